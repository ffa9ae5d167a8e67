"""What a service says and hears. Ports cannot queue: between two steps only a small ring is kept,
and of a command or a state only the newest survives."""

from collections import Counter, deque
from collections.abc import Callable, Iterator
from typing import Generic

import msgspec

from messages.topic import M, Topic
from services.runtime.bus import Envelope, Say
from services.runtime.gate import Authority, Gate, age_ns, ttl_ns

Now = Callable[[], int]  # [ns] the clock


class Inbox:
    """The ring between the bus's thread (`store`) and the service's thread (`take`).

    `arrived` is called once for each envelope that made the ring longer.
    """

    def __init__(self, name: str, depth: int, clock: Now, counts: Counter[str]) -> None:
        self._ring: deque[tuple[int, Envelope]] = deque(maxlen=depth)
        self._name = name
        self._clock = clock
        self._counts = counts
        self.arrived: Callable[[], None] | None = None
        self.stored = 0

    def store(self, envelope: Envelope) -> None:
        """Keep the envelope with its arrival time; the oldest falls out of a full ring."""
        full = len(self._ring) == self._ring.maxlen
        self._ring.append((self._clock(), envelope))
        self.stored += 1
        if full:
            self._counts[f"overflowed:{self._name}"] += 1
        elif self.arrived is not None:
            self.arrived()

    def take_all(self) -> Iterator[tuple[int, Envelope]]:
        """(arrival [ns], envelope), oldest first.

        Bounded, however fast they come; twice the ring, because a full ring may be refilled
        without a call of `arrived` while it is emptied.
        """
        ring = self._ring
        for _ in range(2 * (ring.maxlen or 0)):
            if not ring:
                return
            yield ring.popleft()


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
