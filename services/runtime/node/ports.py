"""Publishers and subscribers of a service. They do not queue: between two steps only a small ring
is kept, and of a command or a state only the newest is used."""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Generic

import msgspec

from messages.payload import LONGEST
from messages.topic import M, Topic
from services.runtime.bus.envelope import Envelope, Say
from services.runtime.node.gate import Authority, Gate, age_ns, ttl_ns

Now = Callable[[], int]  # [ns] the clock


class Inbox:
    """The ring buffer between the bus (`store`) and the service's thread (`take_all`). The bus is
    one thread for each connection, and for messages from a service of the same process its thread.

    `arrived` notifies the service that there are envelopes: once, however many arrive before the
    service takes them.

    Why this needs no lock: CPython's append to and pop from a deque are atomic, and the operations
    of all threads have one order. `store` appends and then reads `_notified`; `take_all` clears
    `_notified` and then takes. So when `store` finds it set, either the service has yet to clear it
    and will then find the envelope, or another `store` has just set it and is about to notify;
    otherwise `store` notifies the service, perhaps once too often. Every envelope is popped once:
    taken by the service, or counted as overflowed.
    """

    def __init__(self, name: str, depth: int, clock: Now, counts: Counter[str]) -> None:
        self._ring: deque[tuple[int, Envelope]] = deque()
        self._depth = depth
        self._notified = False  # the service knows that there are envelopes
        self._name = name
        self._clock = clock
        self._counts = counts
        self.arrived: Callable[[], None] | None = None
        self.stored = 0

    def store(self, envelope: Envelope) -> None:
        """Keep the envelope with its arrival time; the oldest falls out of a full ring."""
        if len(envelope.payload) > LONGEST:  # a ring of such would fill the memory
            self._counts[f"oversized:{self._name}"] += 1
            return
        ring = self._ring
        ring.append((self._clock(), envelope))
        self.stored += 1
        if len(ring) > self._depth:
            with suppress(IndexError):  # the other thread was here in between
                ring.popleft()
                self._counts[f"overflowed:{self._name}"] += 1
        if self.arrived is not None and not self._notified:
            self._notified = True
            self.arrived()

    def take_all(self) -> Iterator[tuple[int, Envelope]]:
        """(arrival [ns], envelope), oldest first.

        At most one whole ring, however fast they arrive; for the rest `arrived` was called again.
        """
        self._notified = False
        ring, left = self._ring, self._depth
        while ring and left:
            left -= 1
            try:
                oldest = ring.popleft()
            except IndexError:  # the other thread was here in between
                return
            yield oldest


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

    def __init__(self, topic: Topic[M], inbox: Inbox, gate: Gate[M], counts: Counter[str]) -> None:
        self._topic = topic
        self._inbox = inbox
        self._gate = gate
        self._counts = counts
        self._newest: M | None = None
        self._bound_ns = 0  # [ns] greatest error of its age
        self._was_fresh = False
        self._has_ttl = "ttl_ms" in topic.message.__struct_fields__

    def obey(self, authority: Authority) -> None:
        """From now on admit only commands of the epochs that this authority admits."""
        self._gate.authority = authority

    def newest(self, now: int) -> M | None:
        """The newest message ever admitted, however old."""
        for _, envelope in self._inbox.take_all():
            message = self._gate.admit(envelope, now)
            if message is not None:
                self._newest, self._bound_ns = message, self._gate.bound_ns(now)
        return self._newest

    def fresh(self, now: int) -> M | None:
        """The newest message, or None once it is older than its time-to-live or the topic's
        staleness limit. Each change from fresh to stale is counted once."""
        message = self.newest(now)
        if message is None:
            return None
        # A command's age includes the greatest error of the clock offset when its stamp was
        # converted to local time; a later offset does not change that stamp.
        limit = ttl_ns(message) if self._has_ttl else self._topic.stale_after_ns
        bound = self._bound_ns if self._has_ttl else 0
        if limit is None or age_ns(message, now) + bound <= limit:
            self._was_fresh = True
            return message
        if self._was_fresh:
            self._counts[f"stale:{self._topic.key}"] += 1
            self._was_fresh = False
        return None
