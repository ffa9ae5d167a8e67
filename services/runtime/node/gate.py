"""Input validation of every port: decodes envelopes and admits only messages that are well-formed,
in order and in time.

Pure: `now` is an argument. Every rejected message is counted by reason. A recorded message that is
played again is refused by every gate but that of an onlooker of a replay.
"""

from typing import Any, Generic, Protocol

from messages import events
from messages.events import Outbox, Row
from messages.payload import MEMBERS, PayloadDecoder
from messages.topic import M, Topic
from services.runtime.bus.envelope import Envelope
from services.runtime.node.clock_offset import UNKNOWN, ClockOffset, mover

MOST_LOST = 100_000  # messages between two that arrive: a quarter of an hour without a link
FUTURE_NS = 100_000_000  # [ns] a stamp further ahead than this is wrong, not jitter


class Authority(Protocol):
    """Decides which pilot's commands are admitted, and hears of each that was."""

    def admits(self, epoch: int, now: int) -> bool: ...

    def heard(self, epoch: int, now: int) -> None: ...


class Gate(Generic[M]):
    """Admits the messages of one key. Reasons counted: wrong_type, replayed, malformed,
    misnamed, from_future, expired, reordered, duplicated, wrong_epoch, unsynchronised (from another
    machine, whose clock is not known yet); and `lost` for gaps in the sequence numbers, which are
    admitted.

    Ages include the greatest error of the clock offset, so that no message is taken to be fresher
    than it is.

    Events may come from several senders, so their order is not checked: receivers recognise them by
    their id.
    """

    def __init__(
        self,
        topic: Topic[M],
        outbox: Outbox,
        clock_offset: ClockOffset | None = None,
        *,
        onlooker: bool = False,
        replay: bool = False,
    ) -> None:
        """An `onlooker` never acts on commands, so it also gets expired ones; of a `replay` it gets
        recorded messages, and no others. `clock_offset`: of the other machine's clock, where there
        are two machines."""
        self.authority: Authority | None = None  # None: messages of every epoch are admitted
        self.bound_ns = 0  # [ns] greatest error of the age of the newest admitted, when it was
        self._topic = topic
        self._outbox = outbox
        decoder = PayloadDecoder(topic, replayed=replay and onlooker)
        self._read, self._encoding = decoder.read, decoder.encoding
        fields = topic.message.__struct_fields__
        self._expires = not onlooker and "ttl_ms" in fields
        self._has_epoch, self._has_instance = "epoch" in fields, "instance" in fields
        self._in_order = topic.hz > 0.0
        self._clock_offset = (
            clock_offset if clock_offset is not None and clock_offset.concerns(topic) else None
        )
        self._judged = clock_offset is None or clock_offset.judges(topic)
        self._move = mover(topic.message)
        self._last: tuple[int, int] | None = None  # (stamp, seq) of the newest admitted, as sent
        self._sender = 0  # of the newest admitted, where several are told apart

    @property
    def admitted(self) -> bool:
        """Was any message admitted yet?"""
        return self._last is not None

    def admit(self, envelope: Envelope, now: int) -> M | None:  # noqa: C901 - one check after another
        """The message inside, or None with the reason counted."""
        message: Any = envelope.message
        if message is None or envelope.encoding != self._encoding or self._clock_offset is not None:
            message = self._read(envelope.key, envelope.encoding, envelope.payload)
            if isinstance(message, Row):
                return self._refuse(message, envelope)
            if self._clock_offset is None:  # else its stamps become those of this receiver's clock
                envelope.message = message

        # Of the pilot in control?
        epoch: Any = message.epoch if self._has_epoch else None
        if self.authority is not None and not self.authority.admits(epoch, now):
            return self._refuse(events.WRONG_EPOCH, envelope)

        # In time, once its stamps are in local time?
        sent = (message.stamp_ns, message.seq)  # by the sender's clock
        clock, bound, is_local = UNKNOWN, 0, True
        if self._clock_offset is not None:
            clock = self._clock_offset.of(epoch)
            if clock.ahead_ns is not None:
                self._move(message, clock.ahead_ns)
                bound = clock.bound_ns(now)
            elif self._in_order:
                return self._refuse(events.UNSYNCHRONISED, envelope)
            else:
                is_local = False
        if is_local and self._judged and message.stamp_ns > now + FUTURE_NS + bound:
            return self._refuse(events.FROM_FUTURE, envelope)
        if is_local and self._expires:
            ttl_ns: float = message.ttl_ms * 1e6
            if now - message.stamp_ns + bound > ttl_ns:
                return self._refuse(events.EXPIRED, envelope)

        # In order? By the sender's clock: the estimated offset of that clock changes, and must not
        # make an old message look newer than the one before.
        sender, last = message.instance if self._has_instance else clock.source, self._last
        if self._in_order and last is not None and sender == self._sender:  # else of two clocks
            # Was the last one sent before the other machine's clock restarted, as by a power cut?
            ahead = clock.ahead_ns
            if ahead is None or last[0] - ahead <= now + FUTURE_NS + bound:
                if sent == last:
                    return self._refuse(events.DUPLICATED, envelope)
                if sent[0] < last[0]:
                    return self._refuse(events.REORDERED, envelope)
                missed = sent[1] - last[1] - 1
                if missed > MOST_LOST:  # nobody can have sent so many: the sender counts wrongly
                    self._outbox.tell(events.MISCOUNTED(envelope.key))
                elif missed > 0:  # negative: the publisher was restarted and counts anew
                    self._outbox.tell(events.LOST(envelope.key), missed)

        if self.authority is not None:
            self.authority.heard(epoch, now)
        self._last, self._sender, self.bound_ns = sent, sender, bound
        return message

    def _refuse(self, reason: Row, envelope: Envelope) -> None:
        # Anybody can invent members of a family: one never admitted is not counted by its name.
        name = envelope.key if self.admitted else self._topic.key
        self._outbox.tell(reason(name))


class Gates(Generic[M]):
    """One gate for each member of a family, or one gate for a topic. Members beyond the first
    `MEMBERS`, and keys that no member may have, are counted under the family's name:
    too_many_keys, unknown_key."""

    def __init__(
        self,
        topic: Topic[M],
        outbox: Outbox,
        clock_offset: ClockOffset | None = None,
        *,
        onlooker: bool = False,
        replay: bool = False,
    ) -> None:
        """Arguments as of a `Gate`."""
        self._topic = topic
        self._outbox = outbox
        self._new = lambda: Gate(topic, outbox, clock_offset, onlooker=onlooker, replay=replay)
        self._next = self._new()  # for a member of which nothing was admitted yet
        self._gates: dict[str, Gate[M]] = {}  # by key

    def admit(self, envelope: Envelope, now: int) -> M | None:
        """The message inside, or None with the reason counted."""
        gate = self._gates.get(envelope.key)
        return self._first(envelope, now) if gate is None else gate.admit(envelope, now)

    def _first(self, envelope: Envelope, now: int) -> M | None:
        """Perhaps the first message of a member: only an admitted message makes a new gate."""
        if not self._topic.covers(envelope.key):
            self._outbox.tell(events.UNKNOWN_KEY(self._topic.key))
            return None
        if len(self._gates) >= MEMBERS:
            self._outbox.tell(events.TOO_MANY_KEYS(self._topic.key))
            return None
        message = self._next.admit(envelope, now)
        if message is not None:
            self._gates[envelope.key], self._next = self._next, self._new()
        return message
