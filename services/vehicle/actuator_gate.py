"""Which thruster commands act, and for how long: the last door before the thrusters.

Pure: a command and `now` go in, the thrust that may be applied comes out. What is not obeyed leaves
the command in force as it is, which ends by itself.
"""

from collections.abc import Sequence
from math import isfinite

from messages.control import ThrusterCommand
from services.marine.thrusters import limited
from services.marine.vehicle import Thruster

THRUSTERS = "control/thrusters"  # named in what is counted
LONGEST_MS = 1000.0  # [ms] nobody may claim a longer life
FUTURE_NS = 100_000_000  # [ns] a stamp further ahead than this is a lie, not jitter


class ActuatorGate:
    """A command acts if it is whole, of this vehicle's length, in time, in order and of the epoch
    in force or a newer one. It is held to the thrusters' limits, is zero unless armed, and ends at
    the very instant its life does.

    Everything refused or changed is counted by reason: malformed, wrong_length, from_future,
    expired, reordered, wrong_epoch, disarmed (thrust was asked for all the same), saturated:<name>,
    and stale when a command ended without a next one.
    """

    def __init__(self, thrusters: Sequence[Thruster]) -> None:
        """
        Args:
            thrusters: of the vehicle file, in its order.
        """
        self.command: ThrusterCommand | None = None  # the newest that was obeyed, as it was said
        self.obeyed_ns: int | None = None  # [ns] when that was
        self.ends_ns: int | None = None  # [ns] last instant it holds; None: nothing to obey
        self._thrusters = tuple(thrusters)
        self._zeros = (0.0,) * len(self._thrusters)
        self._thrust = self._zeros  # [N] within the limits
        self._epoch = 0  # newest authority epoch that was obeyed

    def obey(self, command: ThrusterCommand, now: int) -> list[str]:
        """A command has come at `now` [ns]. Returns the names of what is to be counted."""
        counted = self.lapse(now)
        if (reason := self._refusal(command, now)) is not None:
            return [*counted, f"{reason}:{THRUSTERS}"]
        self.command, self.obeyed_ns, self._epoch = command, now, command.epoch
        self.ends_ns = min(command.stamp_ns, now) + round(command.ttl_ms * 1e6)
        self._thrust = self._zeros
        if not command.armed:
            return [*counted, f"disarmed:{THRUSTERS}"] if any(command.thrust) else counted
        pairs = list(zip(self._thrusters, command.thrust, strict=True))
        self._thrust = tuple([limited(thruster, newtons) for thruster, newtons in pairs])
        return counted + [
            f"saturated:{t.name}" for t, newtons in pairs if limited(t, newtons) != newtons
        ]

    def lapse(self, now: int) -> list[str]:
        """Time has passed. Returns the names of what is to be counted: once, when a command's life
        has ended."""
        if self.ends_ns is None or now <= self.ends_ns:
            return []
        self.ends_ns, self._thrust = None, self._zeros
        return [f"stale:{THRUSTERS}"]

    def output(self, now: int) -> tuple[float, ...]:
        """[N] Per thruster, what may be applied at `now` [ns]."""
        return self._thrust if self._holds(now) else self._zeros

    def armed(self, now: int) -> bool:
        """May the thrusters turn at `now` [ns]?"""
        return self._holds(now) and self.command is not None and self.command.armed

    def _holds(self, now: int) -> bool:
        return self.ends_ns is not None and now <= self.ends_ns

    def _refusal(self, command: ThrusterCommand, now: int) -> str | None:
        """Why a command cannot be obeyed; None when it can."""
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
        return "wrong_epoch" if command.epoch < self._epoch else None
