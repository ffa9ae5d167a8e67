"""Publishers, subscribers and timers of a service. Its ports do not queue: between two steps only a
small ring is kept, and of a command or a state only the newest is used."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic

import msgspec

from messages import events
from messages.events import Outbox
from messages.payload import LONGEST
from messages.topic import M, Topic
from services.runtime.bus.envelope import Envelope, Say
from services.runtime.node.gate import Authority, Gate

Now = Callable[[], int]  # [ns] the clock
MISSABLE = 10  # periods of delay after which a tick gives up catching up


class Inbox:
    """The ring buffer between the bus (`store`) and the service's thread (`take_all`). The bus is
    one thread for each connection, and for messages from a service of the same process its thread.

    `arrived` notifies the service that there are envelopes: once, however many arrive before the
    service takes them.

    The lock is held for an append or a copy, never while anything else is called. Without it, the
    service could take the oldest between `store`'s look at a full ring and its pop, which then hit
    the newest.
    """

    def __init__(self, name: str, depth: int, clock: Now, outbox: Outbox) -> None:
        self._ring: deque[tuple[int, Envelope]] = deque()
        self._lock = threading.Lock()
        self._depth = depth
        self._notified = False  # the service knows that there are envelopes
        self._name = name
        self._clock = clock
        self._outbox = outbox
        self.arrived: Callable[[], None] | None = None
        self.stored = 0

    def store(self, envelope: Envelope) -> None:
        """Keep the envelope with its arrival time; the oldest falls out of a full ring."""
        if len(envelope.payload) > LONGEST:  # a ring of such would fill the memory
            self._outbox.tell(events.OVERSIZED(self._name))
            return
        arrival = (self._clock(), envelope)
        with self._lock:
            self._ring.append(arrival)
            self.stored += 1
            overflowed = len(self._ring) > self._depth
            if overflowed:
                self._ring.popleft()
            arrived = None if self._notified else self.arrived
            self._notified |= arrived is not None
        if overflowed:
            self._outbox.tell(events.OVERFLOWED(self._name))
        if arrived is not None:
            arrived()

    def take_all(self) -> list[tuple[int, Envelope]]:
        """(arrival [ns], envelope) of all that are here, oldest first."""
        with self._lock:
            self._notified = False
            taken = list(self._ring)
            self._ring.clear()
        return taken


class Publisher(Generic[M]):
    """Publishes one topic. `put` numbers the message, encodes it and never blocks."""

    def __init__(self, topic: Topic[M], says: list[Say]) -> None:
        self.topic = topic
        self.sent = 0
        self._says = says
        self._encode = msgspec.msgpack.Encoder().encode

    def put(self, message: M) -> None:
        # The only place that may write to a frozen message: nobody else has it yet.
        msgspec.structs.force_setattr(message, "seq", self.sent)
        self.sent += 1
        payload = self._encode(message)
        for say in self._says:
            say(payload)


class Latest(Generic[M]):
    """The newest message of a topic, for as long as it is fresh."""

    def __init__(self, topic: Topic[M], inbox: Inbox, gate: Gate[M], outbox: Outbox) -> None:
        self._topic = topic
        self._inbox = inbox
        self._gate = gate
        self._outbox = outbox
        self._newest: M | None = None
        self._was_fresh = False
        self._stale_after_ns = topic.stale_after_ns
        self._has_ttl = "ttl_ms" in topic.message.__struct_fields__

    def obey(self, authority: Authority) -> None:
        """From now on admit only commands of the epochs that this authority admits."""
        self._gate.authority = authority

    def newest(self, now: int) -> M | None:
        """The newest message ever admitted, however old."""
        for _, envelope in self._inbox.take_all():
            message = self._gate.admit(envelope, now)
            if message is not None:
                self._newest = message
        return self._newest

    def fresh(self, now: int) -> M | None:
        """The newest message, or None once it is older than its time-to-live or the topic's
        staleness limit. Each change from fresh to stale is counted once."""
        message = self.newest(now)
        if message is None:
            return None
        limit, age = self._stale_after_ns, now - message.stamp_ns
        if self._has_ttl:
            # A command's age includes the greatest error of the clock offset when its stamp was
            # converted to local time; a later offset does not change that stamp.
            limit, age = message.ttl_ms * 1e6, age + self._gate.bound_ns  # type: ignore[attr-defined]
        if limit is None or age <= limit:
            self._was_fresh = True
            return message
        if self._was_fresh:
            self._outbox.tell(events.STALE(self._topic.key))
            self._was_fresh = False
        return None


class Tick:
    """A fixed rate on absolute deadlines: one late tick does not shift the next."""

    def __init__(self, hz: float, start: int, handler: Callable[[int], None]) -> None:
        self._period = round(1e9 / hz)
        self._handler = handler
        self.due: int | None = None  # [ns]
        self.start(start)

    def start(self, now: int) -> None:
        """Ring for the first time one period after `now` [ns]."""
        self.due = now + self._period

    def shift(self, by: int) -> None:
        """Ring `by` [ns] later from the next time on; negative: sooner."""
        if self.due is not None:
            self.due += by

    def ring(self, now: int) -> int:
        """Call the handler; returns how many ticks were missed. After a long stall these are
        skipped, instead of being run in a burst."""
        assert self.due is not None
        missed = (now - self.due) // self._period
        if missed > MISSABLE:
            self.due += missed * self._period
        else:
            missed = 0
        self.due += self._period
        self._handler(now)
        return missed


class Alarm:
    """A one-shot timer: rings once each time it is set."""

    def __init__(self, handler: Callable[[int], None]) -> None:
        self._handler = handler
        self.due: int | None = None  # [ns]

    def set(self, at: int | None) -> None:
        """Ring at `at` [ns], replacing any earlier setting; None: do not ring."""
        self.due = at

    def ring(self, now: int) -> int:
        self.due = None
        self._handler(now)
        return 0
