"""The door of every port: opens envelopes and lets in only what is whole, in order and in time.

Pure: `now` is an argument. Everything turned away is counted by reason.
"""

from collections import Counter
from typing import Generic

import msgspec

from messages.topic import M, Topic
from services.runtime.bus import Envelope

FUTURE_NS = 100_000_000  # [ns] a stamp further ahead than this is a lie, not jitter


class Gate(Generic[M]):
    """Admits the messages of one key. Reasons counted: wrong_type, malformed, from_future,
    expired, reordered, duplicated; and `lost` for gaps in the sequence, which are let through.

    Events may come from several senders, so they are not put in order: whoever acts on one knows
    it by its id.
    """

    def __init__(self, topic: Topic[M], counts: Counter[str], *, onlooker: bool = False) -> None:
        """An `onlooker` never acts on a command, so it is also shown those that are too old to."""
        self._topic = topic
        self._counts = counts
        self._encoding = topic.encoding
        self._decoder = msgspec.msgpack.Decoder(topic.message)
        self._expires = not onlooker and "ttl_ms" in topic.message.__struct_fields__
        self._last: tuple[int, int] | None = None  # (stamp_ns, seq) of the newest admitted

    @property
    def admitted(self) -> bool:
        """Has anything ever come through?"""
        return self._last is not None

    def admit(self, envelope: Envelope, now: int) -> M | None:
        """The message inside, or None with the reason counted."""
        if envelope.encoding != self._encoding:
            return self._refuse("wrong_type", envelope)
        try:
            message = self._decoder.decode(envelope.payload)
        except (msgspec.DecodeError, msgspec.ValidationError, RecursionError):
            return self._refuse("malformed", envelope)
        if message.stamp_ns > now + FUTURE_NS:
            return self._refuse("from_future", envelope)
        if self._expires and age_ns(message, now) > ttl_ns(message):
            return self._refuse("expired", envelope)
        return self._in_order(message, envelope) if self._topic.hz else self._event(message)

    def _event(self, message: M) -> M:
        self._last = (message.stamp_ns, message.seq)
        return message

    def _in_order(self, message: M, envelope: Envelope) -> M | None:
        here = (message.stamp_ns, message.seq)
        if self._last is not None:
            if here == self._last:
                return self._refuse("duplicated", envelope)
            if message.stamp_ns < self._last[0]:
                return self._refuse("reordered", envelope)
            missed = message.seq - self._last[1] - 1
            if missed > 0:  # negative: the publisher was restarted and counts anew
                self._counts[f"lost:{envelope.key}"] += missed
        self._last = here
        return message

    def _refuse(self, reason: str, envelope: Envelope) -> None:
        self._counts[f"{reason}:{envelope.key}"] += 1


def age_ns(message: msgspec.Struct, now: int) -> int:
    return now - message.stamp_ns  # type: ignore[attr-defined]


def ttl_ns(message: msgspec.Struct) -> float:
    return message.ttl_ms * 1e6  # type: ignore[attr-defined]
