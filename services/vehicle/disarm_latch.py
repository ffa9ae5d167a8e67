"""A disarm by the pilot, obeyed by every stage itself: a stage above it that hangs cannot keep the
thrusters turning, and one that wakes again cannot start them.

Pure. Used by control (the stage above: `reference`) and by every vehicle side, through its
`ActuatorGate` (the stage above: `control`).

The law: an arming is named by the stamp of the pilot's request for it, `armed_ns`. A stage is armed
only by an arming that is later than the newest disarm obeyed. So no old message arms again,
whenever it arrives, and no old disarm ends a later arming.

1. A disarm is obeyed if it carries the epoch of the newest message of the stage above.
2. Its instant is its stamp when it was first heard; a repetition, with the same id, changes
   nothing.
3. Messages without `armed_ns` come from a sender that does not say it: after a disarm they arm
   again once one of them, stamped after the disarm was heard, was disarmed.
"""

from messages import events, topics
from messages.events import Outbox
from messages.pilot import PilotRequest
from messages.units import Ns

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
