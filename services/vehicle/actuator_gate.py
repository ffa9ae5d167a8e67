"""The last check of thruster commands before the thrusters: validity and time-to-live.

Pure: a command and `now` go in, the permitted thrust comes out. A refused command does not change
the one in force, which ends with its time-to-live.
"""

from collections.abc import Sequence
from math import isfinite

from messages.control import ThrusterCommand
from messages.pilot import PilotRequest
from services.marine.thrusters import limited
from services.marine.vehicle import Thruster
from services.vehicle.disarm_latch import DisarmLatch

THRUSTERS = "control/thrusters"  # named in what is counted
LONGEST_MS = 1000.0  # [ms] longest time-to-live allowed
LATCH_NS = 1_000_000_000  # [ns] commands of an older epoch than the newest have expired by then
FUTURE_NS = 100_000_000  # [ns] a stamp further ahead than this is an error, not jitter


class ActuatorGate:
    """A command takes effect if it is well-formed, of this vehicle's length, in time, in order, and
    of the epoch in force or a newer one; an older epoch takes effect again once the newer one has
    been silent for `LATCH_NS`, so that no number locks control out for good. It is limited to the
    thrusters' limits, is zero unless armed, and ends exactly with its time-to-live. A disarm by the
    pilot ends it at once, and no command of that arming takes effect again (`DisarmLatch`).

    Everything refused or changed is counted by reason: malformed, wrong_length, from_future,
    expired, reordered, wrong_epoch, disarmed (with thrust not zero), saturated:<name>, and stale
    when a command ended without a successor.
    """

    def __init__(self, thrusters: Sequence[Thruster]) -> None:
        """
        Args:
            thrusters: of the vehicle file, in its order.
        """
        self.command: ThrusterCommand | None = None  # newest accepted, as received
        self.obeyed_ns: int | None = None  # [ns] when it was accepted
        self.ends_ns: int | None = None  # [ns] last instant it holds; None: none in force
        self._thrusters = tuple(thrusters)
        self._zeros = (0.0,) * len(self._thrusters)
        self._thrust = self._zeros  # [N] within the limits
        self._armed = False  # by the newest accepted, and not disarmed since
        self._latch = DisarmLatch()

    def obey(self, command: ThrusterCommand, now: int) -> list[str]:
        """Take in a command at `now` [ns]. Returns the names to count."""
        counted = self.lapse(now)
        if (reason := self._refusal(command, now)) is not None:
            return [*counted, f"{reason}:{THRUSTERS}"]
        self.command, self.obeyed_ns = command, now
        self.ends_ns = min(command.stamp_ns, now) + round(command.ttl_ms * 1e6)
        self._thrust = self._zeros
        self._armed = self._latch.see(
            command.epoch, command.stamp_ns, command.armed_ns, armed=command.armed
        )
        if not self._armed:
            return [*counted, f"disarmed:{THRUSTERS}"] if any(command.thrust) else counted
        pairs = list(zip(self._thrusters, command.thrust, strict=True))
        self._thrust = tuple([limited(thruster, newtons) for thruster, newtons in pairs])
        return counted + [
            f"saturated:{t.name}" for t, newtons in pairs if limited(t, newtons) != newtons
        ]

    def hear(self, request: PilotRequest, now: int) -> list[str]:
        """Take in a request of a pilot at `now` [ns]: a disarm stops the thrusters whatever becomes
        of the services above. Returns the names to count."""
        counted = self._latch.hear(request, now)
        if self.command is not None and self._latch.forbids(self.command.armed_ns):
            self._thrust, self._armed = self._zeros, False
        return counted

    def lapse(self, now: int) -> list[str]:
        """End a command whose time-to-live has passed at `now` [ns]. Returns the names to count,
        once per command."""
        if self.ends_ns is None or now <= self.ends_ns:
            return []
        self.ends_ns, self._thrust = None, self._zeros
        return [f"stale:{THRUSTERS}"]

    def output(self, now: int) -> tuple[float, ...]:
        """[N] Permitted thrust per thruster at `now` [ns]."""
        return self._thrust if self._holds(now) else self._zeros

    def armed(self, now: int) -> bool:
        """Whether the thrusters may turn at `now` [ns]."""
        return self._holds(now) and self._armed

    def _holds(self, now: int) -> bool:
        return self.ends_ns is not None and now <= self.ends_ns

    def _refusal(self, command: ThrusterCommand, now: int) -> str | None:
        """Why a command is refused; None when it is accepted."""
        if not all(map(isfinite, command.thrust)) or not 0.0 <= command.ttl_ms <= LONGEST_MS:
            return "malformed"
        if len(command.thrust) != len(self._thrusters):
            return "wrong_length"
        if command.stamp_ns > now + FUTURE_NS:
            return "from_future"
        if now > command.stamp_ns + round(command.ttl_ms * 1e6):
            return "expired"
        if self.command is not None and command.stamp_ns < self.command.stamp_ns:
            return "reordered"
        return "wrong_epoch" if self._supersedes(command, now) else None

    def _supersedes(self, command: ThrusterCommand, now: int) -> bool:
        """Is the epoch in force newer than that of this command?"""
        if self.command is None or self.obeyed_ns is None or now > self.obeyed_ns + LATCH_NS:
            return False
        return command.epoch < self.command.epoch
