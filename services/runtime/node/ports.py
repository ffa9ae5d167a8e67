"""What a service says and hears. Ports cannot queue: between two steps only a small ring is kept,
and of a command or a state only the newest survives."""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from typing import Generic

import msgspec

from messages.topic import M, Topic
from services.runtime.bus.envelope import Envelope, Say
from services.runtime.node.gate import Authority, Gate, age_ns, ttl_ns

Now = Callable[[], int]  # [ns] the clock


class Inbox:
    """The ring between the bus's thread (`store`) and the service's thread (`take_all`).

    `arrived` is called when something is in the ring that the service has not been told of: once,
    however much comes before the service takes it.

    Why this needs no lock, with one thread on each side: CPython appends to and pops from a deque
    in one step that no other thread can see half done, and the steps of both threads have one
    order. `store` appends and then reads `_told`; `take_all` clears `_told` and then takes. So
    when `store` finds it set, the service is still to clear it and will then find the envelope;
    otherwise `store` tells the service. And every envelope is popped by one side only: taken by the
    service, or counted as overflowed by the bus's thread.
    """

    def __init__(self, name: str, depth: int, clock: Now, counts: Counter[str]) -> None:
        self._ring: deque[tuple[int, Envelope]] = deque()
        self._depth = depth
        self._told = False  # the service knows that something is here
        self._name = name
        self._clock = clock
        self._counts = counts
        self.arrived: Callable[[], None] | None = None
        self.stored = 0

    def store(self, envelope: Envelope) -> None:
        """Keep the envelope with its arrival time; the oldest falls out of a full ring."""
        self._ring.append((self._clock(), envelope))
        self.stored += 1
        if len(self._ring) > self._depth and self._pop() is not None:
            self._counts[f"overflowed:{self._name}"] += 1
        if self.arrived is not None and not self._told:
            self._told = True
            self.arrived()

    def take_all(self) -> Iterator[tuple[int, Envelope]]:
        """(arrival [ns], envelope), oldest first.

        Bounded, however fast they come: of what is left after a whole ring, `arrived` has told.
        """
        self._told = False
        for _ in range(self._depth):
            oldest = self._pop()
            if oldest is None:
                return
            yield oldest

    def _pop(self) -> tuple[int, Envelope] | None:
        try:
            return self._ring.popleft()
        except IndexError:  # the other thread was here in between
            return None


class Publisher(Generic[M]):
    """Says one topic. `put` numbers the message, encodes it and never blocks."""

    def __init__(self, topic: Topic[M], says: list[Say]) -> None:
        self.topic = topic
        self.sent = 0
        self._says = says
        self._encode = msgspec.msgpack.Encoder().encode

    def put(self, message: M) -> None:
        # The one place that may write to a frozen message: it is not yet anybody's.
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
        self._bound_ns = 0  # [ns] what its age may be off by
        self._was_fresh = False
        self._has_ttl = "ttl_ms" in topic.message.__struct_fields__

    def authority(self, epoch: int) -> Authority:
        """From now on only commands of this authority epoch, and of those granted after it."""
        if self._gate.authority is None:
            self._gate.authority = Authority(epoch, epoch)
        return self._gate.authority

    def newest(self, now: int) -> M | None:
        """The newest message ever admitted, however old."""
        for _, envelope in self._inbox.take_all():
            message = self._gate.admit(envelope, now)
            if message is not None:
                self._newest, self._bound_ns = message, self._gate.bound_ns(now)
        return self._newest

    def fresh(self, now: int) -> M | None:
        """The newest message, or None once it is older than its time-to-live or the topic's
        staleness limit. Each passage from fresh to stale is counted once."""
        message = self.newest(now)
        if message is None:
            return None
        # A command's life is counted by the worst case of the clocks, as they were known when its
        # stamp was turned into local time; what is learnt later does not move that stamp.
        limit = ttl_ns(message) if self._has_ttl else self._topic.stale_after_ns
        bound = self._bound_ns if self._has_ttl else 0
        if limit is None or age_ns(message, now) + bound <= limit:
            self._was_fresh = True
            return message
        if self._was_fresh:
            self._counts[f"stale:{self._topic.key}"] += 1
            self._was_fresh = False
        return None
