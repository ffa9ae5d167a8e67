"""Input validation of every port: decodes envelopes and admits only messages that are well-formed,
in order and in time.

Pure: `now` is an argument. Every rejected message is counted by reason. A recorded message that is
played again is refused by every gate but that of an onlooker of a replay.
"""

from collections import Counter
from typing import Generic, Protocol

import msgspec

from messages.payload import PayloadDecoder
from messages.topic import M, Topic
from services.runtime.bus.envelope import Envelope
from services.runtime.node.clock_offset import UNKNOWN, ClockOffset, OtherClock
from services.runtime.node.stamps import mover

MEMBERS = 64  # of one family, such as health/*, that one port receives
MOST_LOST = 100_000  # messages between two that arrive: a quarter of an hour without a link
FUTURE_NS = 100_000_000  # [ns] a stamp further ahead than this is wrong, not jitter


class Authority(Protocol):
    """Decides which pilot's commands are admitted, and hears of each that was."""

    def admits(self, epoch: int, now: int) -> bool: ...

    def heard(self, epoch: int, now: int) -> None: ...


class Gate(Generic[M]):
    """Admits the messages of one key. Reasons counted: wrong_type, replayed, malformed,
    from_future, expired, reordered, duplicated, wrong_epoch, unsynchronised (from another machine,
    whose clock is not known yet); and `lost` for gaps in the sequence numbers, which are admitted.

    Ages include the greatest error of the clock offset, so that no message is taken to be fresher
    than it is.

    Events may come from several senders, so their order is not checked: receivers recognise them by
    their id.
    """

    def __init__(
        self,
        topic: Topic[M],
        counts: Counter[str],
        clock_offset: ClockOffset | None = None,
        *,
        onlooker: bool = False,
        replay: bool = False,
    ) -> None:
        """An `onlooker` never acts on commands, so it also gets expired ones; of a `replay` it gets
        recorded messages, and no others. `clock_offset`: of the other machine's clock, where there
        are two machines."""
        self.authority: Authority | None = None  # None: messages of every epoch are admitted
        self._topic = topic
        self._counts = counts
        self._encoding = topic.replayed if replay and onlooker else topic.encoding
        self._decoder = PayloadDecoder(topic)
        self._expires = not onlooker and "ttl_ms" in topic.message.__struct_fields__
        self._clock_offset = (
            clock_offset if clock_offset is not None and clock_offset.concerns(topic) else None
        )
        self._judged = clock_offset is None or clock_offset.judges(topic)
        self._move = mover(topic.message)
        self._last: tuple[int, int] | None = None  # (stamp, seq) of the newest admitted, as sent
        self._clock: OtherClock = UNKNOWN  # of the newest admitted, where there are two machines
        self._sender = 0  # of the newest admitted, where several are told apart

    def bound_ns(self, now: int) -> int:
        """[ns] Greatest error of the age of the newest message admitted."""
        if self._clock_offset is None:
            return 0
        return (self._clock if self.admitted else self._clock_offset.of(None)).bound_ns(now)

    @property
    def admitted(self) -> bool:
        """Was any message admitted yet?"""
        return self._last is not None

    def admit(self, envelope: Envelope, now: int) -> M | None:
        """The message inside, or None with the reason counted."""
        if envelope.encoding != self._encoding:
            is_replayed = envelope.encoding == self._topic.replayed
            return self._refuse("replayed" if is_replayed else "wrong_type", envelope)
        message = self._decoder.decode(envelope.payload)
        if message is None:
            return self._refuse("malformed", envelope)
        if self.authority is not None and not self.authority.admits(epoch_of(message), now):
            return self._refuse("wrong_epoch", envelope)
        sent = (message.stamp_ns, message.seq)  # by the sender's clock
        offset = self._clock_offset
        clock = UNKNOWN if offset is None else offset.of(getattr(message, "epoch", None))
        if (reason := self._untimely(message, clock, now)) is not None:
            return self._refuse(reason, envelope)
        sender = getattr(message, "instance", clock.source)
        if self._topic.hz and sender == self._sender:  # else the stamps may be of two clocks
            reason = self._out_of_order(sent, clock, envelope.key, now)
            if reason is not None:
                return self._refuse(reason, envelope)
        if self.authority is not None:
            self.authority.heard(epoch_of(message), now)
        self._last, self._clock, self._sender = sent, clock, sender
        return message

    def _untimely(self, message: M, clock: OtherClock, now: int) -> str | None:
        """Why a message is not in time, once its stamps are in local time; None: it is."""
        bound = 0
        if self._clock_offset is not None:
            if clock.ahead_ns is None:
                return "unsynchronised" if self._topic.hz else None
            self._move(message, clock.ahead_ns)
            bound = clock.bound_ns(now)
        if self._judged and message.stamp_ns > now + FUTURE_NS + bound:
            return "from_future"
        if self._expires and age_ns(message, now) + bound > ttl_ns(message):
            return "expired"
        return None

    def _out_of_order(
        self, sent: tuple[int, int], clock: OtherClock, key: str, now: int
    ) -> str | None:
        """Order is checked by the sender's clock: the estimated offset of that clock changes, and
        must not make an old message look newer than the one before."""
        if self._last is None or _restarted(clock, self._last[0], now):
            return None
        if sent == self._last:
            return "duplicated"
        if sent[0] < self._last[0]:
            return "reordered"
        missed = sent[1] - self._last[1] - 1
        if missed > MOST_LOST:  # nobody can have sent so many: the sender counts wrongly
            self._counts[f"miscounted:{key}"] += 1
        elif missed > 0:  # negative: the publisher was restarted and counts anew
            self._counts[f"lost:{key}"] += missed
        return None

    def _refuse(self, reason: str, envelope: Envelope) -> None:
        # Anybody can invent members of a family: one never admitted is not counted by its name.
        name = envelope.key if self.admitted else self._topic.key
        self._counts[f"{reason}:{name}"] += 1


class Gates(Generic[M]):
    """One gate for each member of a family, or one gate for a topic. Members beyond the first
    `MEMBERS`, and keys that no member may have, are counted under the family's name:
    too_many_keys, unknown_key."""

    def __init__(
        self,
        topic: Topic[M],
        counts: Counter[str],
        clock_offset: ClockOffset | None = None,
        *,
        onlooker: bool = False,
        replay: bool = False,
    ) -> None:
        """Arguments as of a `Gate`."""
        self._topic = topic
        self._counts = counts
        self._new = lambda: Gate(topic, counts, clock_offset, onlooker=onlooker, replay=replay)
        self._next = self._new()  # for a member of which nothing was admitted yet
        self._gates: dict[str, Gate[M]] = {}  # by key

    def admit(self, envelope: Envelope, now: int) -> M | None:
        """The message inside, or None with the reason counted."""
        gate = self._gates.get(envelope.key)
        return self._first(envelope, now) if gate is None else gate.admit(envelope, now)

    def _first(self, envelope: Envelope, now: int) -> M | None:
        """Perhaps the first message of a member: only an admitted message makes a new gate."""
        if not self._topic.covers(envelope.key):
            self._counts[f"unknown_key:{self._topic.key}"] += 1
            return None
        if len(self._gates) >= MEMBERS:
            self._counts[f"too_many_keys:{self._topic.key}"] += 1
            return None
        message = self._next.admit(envelope, now)
        if message is not None:
            self._gates[envelope.key], self._next = self._next, self._new()
        return message


def _restarted(clock: OtherClock, sent_ns: int, now: int) -> bool:
    """Was this sent before the other machine's clock restarted, as after a power cut?"""
    if clock.ahead_ns is None:
        return False
    return sent_ns - clock.ahead_ns > now + FUTURE_NS + clock.bound_ns(now)


def epoch_of(message: msgspec.Struct) -> int:
    return message.epoch  # type: ignore[attr-defined]


def age_ns(message: msgspec.Struct, now: int) -> int:
    return now - message.stamp_ns  # type: ignore[attr-defined]


def ttl_ns(message: msgspec.Struct) -> float:
    return message.ttl_ms * 1e6  # type: ignore[attr-defined]
