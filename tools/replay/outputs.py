"""What services publish during a replay, in the form in which it is compared."""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence

import msgspec

from messages import topics
from messages.events import Row
from messages.message import Message
from messages.payload import UNDECODABLE, PayloadDecoder
from services.runtime.bus.envelope import Bus, Envelope
from tools.recordings.recording import Raw
from tools.replay.differences import Told


class Head(msgspec.Struct):
    """What every message has."""

    stamp_ns: int
    seq: int = 0
    sensor_ns: int | None = None


HEAD = msgspec.json.Decoder(Head)


class Outputs:
    """What the services of a replay publish, on buses which others use as well."""

    def __init__(self, ports: Sequence[Bus], is_own: Callable[[str], bool]) -> None:
        """
        Args:
            is_own: does one of these services publish this key?
        """
        self._is_own = is_own
        self._by_key: dict[str, list[Told]] = defaultdict(list)
        self._decoders: dict[str, PayloadDecoder[Message]] = {}
        self._encode = msgspec.json.Encoder().encode
        for port in ports:
            port.hear("**", self._store)

    @property
    def keys(self) -> list[str]:
        return list(self._by_key)

    def of(self, key: str) -> list[Told]:
        """In the order in which they were published."""
        return self._by_key[key]

    def has(self, told: Told) -> bool:
        """Was today's message for this sensor sample published?"""
        newest = self._by_key[told.key]
        return bool(newest) and newest[-1].sensor_ns == told.sensor_ns

    def _store(self, envelope: Envelope) -> None:
        if not self._is_own(envelope.key):
            return
        decoder = self._decoders.get(envelope.key)
        if decoder is None:
            topic = topics.find(envelope.key)
            assert topic is not None  # nodes publish rows of the topic table only
            decoder = self._decoders[envelope.key] = PayloadDecoder(topic)
        message = decoder.read(envelope.key, envelope.encoding, envelope.payload)
        if isinstance(message, Row):  # damaged on the link
            return
        sample = getattr(message, "sensor_ns", None)
        data = self._encode(message)
        told = Told(envelope.key, message.seq, message.stamp_ns, data, sample)
        self._by_key[envelope.key].append(told)


def told_of(raw: Raw, utc_offset_ns: int, unreadable: Counter[str]) -> Told | None:
    """A recorded message; its stamp by the clock on board. None: it is none, which is counted."""
    try:
        head = HEAD.decode(raw.data)
    except UNDECODABLE:
        unreadable[raw.key] += 1
        return None
    return Told(raw.key, head.seq, raw.publish_ns - utc_offset_ns, raw.data, head.sensor_ns)
