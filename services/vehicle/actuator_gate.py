"""The last check of thruster commands before the thrusters: validity and time-to-live.

Pure: a command and `now` go in, the permitted thrust comes out. A refused command does not change
the one in force, which ends with its time-to-live.

A disarm by the pilot, obeyed by every stage itself: a stage above it that hangs cannot keep the
thrusters turning, and one that wakes again cannot start them.
The latch is used by control (the stage above: `reference`) and by every vehicle side, through its
`ActuatorGate` (the stage above: `control`).

Its law: an arming is named by the stamp of the pilot's request for it, `armed_ns`. A stage is armed
only by an arming that is later than the newest disarm obeyed. So no old message arms again,
whenever it arrives, and no old disarm ends a later arming.

1. A disarm is obeyed if it carries the epoch of the newest message of the stage above.
2. Its instant is its stamp when it was first heard; a repetition, with the same id, changes
   nothing.
3. Messages without `armed_ns` come from a sender that does not say it: after a disarm they arm
   again once one of them, stamped after the disarm was heard, was disarmed.
"""

from collections.abc import Sequence
from math import isfinite

from messages import events, topics
from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.pilot import PilotRequest
from messages.units import Ns
from services.marine.vehicle import Thruster, limited

REQUESTS = topics.PILOT_REQUEST.key  # named in what is counted
KNOWN = 64  # newest disarms that are recognised when they are repeated


class DisarmLatch:
    """The newest disarm obeyed, and what it forbids."""

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self.request: PilotRequest | None = None  # the newest disarm obeyed, as first heard
        self.heard_ns: Ns | None = None  # [ns] when
        self.epoch: int | None = None  # of the newest message of the stage above
        self._armed_ns: Ns | None = None  # of the newest message of the stage above
        self._instant: Ns | None = None  # [ns] of `request`
        self._seen_disarmed = False  # the stage above, since then
        self._known: dict[str, bool] = {}  # id of a disarm: was it obeyed? The oldest first

    def see(self, epoch: int, stamp_ns: Ns, armed_ns: Ns | None, *, armed: bool) -> bool:
        """A message of the stage above, in the order of their stamps. May it arm?"""
        self.epoch, self._armed_ns = epoch, armed_ns if armed else None
        if not armed and self.heard_ns is not None and stamp_ns > self.heard_ns:
            self._seen_disarmed = True
        return armed and not self.forbids(armed_ns)

    def forbids(self, armed_ns: Ns | None) -> bool:
        """Does the newest disarm forbid this arming?"""
        if self._instant is None:
            return False
        return not self._seen_disarmed if armed_ns is None else armed_ns <= self._instant

    def hear(self, request: PilotRequest, now: Ns) -> None:
        """A request of a pilot."""
        if request.kind != "disarm" or request.id in self._known:
            return
        if self.epoch is None or request.epoch != self.epoch:
            self._outbox.tell(events.WRONG_EPOCH(REQUESTS))
            return  # not kept: perhaps its epoch is about to begin
        instant = min(request.stamp_ns, now)
        late = self._armed_ns is not None and instant < self._armed_ns
        self._keep(request.id, obeyed=not late)
        if late:
            self._outbox.tell(events.OVERTAKEN(REQUESTS))
        elif self._instant is None or instant >= self._instant:
            self.request, self.heard_ns, self._instant = request, now, instant
            self._seen_disarmed = False

    def obeyed(self, request: PilotRequest) -> bool:
        """Was this request, or an earlier one with its id, a disarm that was obeyed?"""
        return self._known.get(request.id, False)

    def _keep(self, name: str, *, obeyed: bool) -> None:
        self._known[name] = obeyed
        if len(self._known) > KNOWN:
            del self._known[next(iter(self._known))]


THRUSTERS = topics.THRUSTERS.key  # named in what is counted
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

    def __init__(self, thrusters: Sequence[Thruster], outbox: Outbox) -> None:
        """
        Args:
            thrusters: of the vehicle file, in its order.
            outbox: of the driver's node.
        """
        self.command: ThrusterCommand | None = None  # newest accepted, as received
        self.obeyed_ns: int | None = None  # [ns] when it was accepted
        self.ends_ns: int | None = None  # [ns] last instant it holds; None: none in force
        self._outbox = outbox
        self._thrusters = tuple(thrusters)
        self._zeros = (0.0,) * len(self._thrusters)
        self._thrust = self._zeros  # [N] within the limits
        self._armed = False  # by the newest accepted, and not disarmed since
        self._gripper = 0.0  # [-] of the newest accepted
        self._latch = DisarmLatch(outbox)

    def obey(self, command: ThrusterCommand, now: int) -> None:  # noqa: C901 - check by check
        """Take in a command at `now` [ns]."""
        self.lapse(now)

        # Well-formed, of this vehicle's length, in time, in order, of the epoch in force?
        newest, reason = self.command, None
        in_force = self.obeyed_ns is not None and now <= self.obeyed_ns + LATCH_NS
        finite = all(map(isfinite, command.thrust)) and -1.0 <= command.gripper <= 1.0
        if not finite or not 0.0 <= command.ttl_ms <= LONGEST_MS:
            reason = events.MALFORMED
        elif len(command.thrust) != len(self._thrusters):
            reason = events.WRONG_LENGTH
        elif command.stamp_ns > now + FUTURE_NS:
            reason = events.FROM_FUTURE
        elif now > command.stamp_ns + round(command.ttl_ms * 1e6):
            reason = events.EXPIRED
        elif newest is not None and command.stamp_ns < newest.stamp_ns:
            reason = events.REORDERED
        elif newest is not None and in_force and command.epoch < newest.epoch:
            reason = events.WRONG_EPOCH
        if reason is not None:
            self._outbox.tell(reason(THRUSTERS))
            return

        # It is in force from now on, with zero thrust unless it may arm.
        self.command, self.obeyed_ns = command, now
        self.ends_ns = min(command.stamp_ns, now) + round(command.ttl_ms * 1e6)
        self._thrust, self._gripper = self._zeros, command.gripper
        self._armed = self._latch.see(
            command.epoch, command.stamp_ns, command.armed_ns, armed=command.armed
        )
        if not self._armed:
            if any(command.thrust):
                self._outbox.tell(events.DISARMED(THRUSTERS))
            return

        # Within the limits.
        thrust = list[float]()
        for thruster, newtons in zip(self._thrusters, command.thrust, strict=True):
            permitted = limited(thruster, newtons)
            thrust.append(permitted)
            if permitted != newtons:
                self._outbox.tell(events.SATURATED(thruster.name))
        self._thrust = tuple(thrust)

    def hear(self, request: PilotRequest, now: int) -> None:
        """Take in a request of a pilot at `now` [ns]: a disarm stops the thrusters whatever becomes
        of the services above."""
        self._latch.hear(request, now)
        if self.command is not None and self._latch.forbids(self.command.armed_ns):
            self._thrust, self._armed = self._zeros, False

    def lapse(self, now: int) -> None:
        """End a command whose time-to-live has passed at `now` [ns]; counted once per command."""
        if self.ends_ns is not None and now > self.ends_ns:
            self.ends_ns, self._thrust = None, self._zeros
            self._outbox.tell(events.STALE(THRUSTERS))

    def output(self, now: int) -> tuple[float, ...]:
        """[N] Permitted thrust per thruster at `now` [ns]."""
        return self._thrust if self.ends_ns is not None and now <= self.ends_ns else self._zeros

    def gripper(self, now: int) -> float:
        """[-] Permitted motion of the gripper at `now` [ns], + opens: none unless armed, and none
        once the command has ended."""
        return self._gripper if self.armed(now) else 0.0

    def armed(self, now: int) -> bool:
        """Whether the thrusters may turn at `now` [ns]."""
        return self._armed and self.ends_ns is not None and now <= self.ends_ns
