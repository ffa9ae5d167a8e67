"""Envelopes from the bus become rows of a recording, or are told as lost.

No input may raise, and no input may make the counters or the list of channels grow without limit:
many invented keys are counted under one shared name.
"""

import hashlib
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from messages import events, topics
from messages.events import Event, Outbox, Row
from messages.message import Message
from messages.payload import MEMBERS, PayloadDecoder
from messages.topic import AnyTopic
from services.recorder.foxglove.channel import NamedSchema, schema_of
from services.recorder.foxglove.views import Views

UNKNOWN = 32  # unknown keys that are counted under their own name
NAME_LENGTH = 80  # characters of an unknown key that are kept in its count
LATEST_NS = 2**63 - 1  # [ns] MCAP tools read times as signed or unsigned 64 bit; this fits both


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [recorder] of a vehicle file: what is recorded beside the messages."""

    foxglove: bool = True  # record what Foxglove shows as well


class RecordedRow(NamedTuple):
    """One message as it is written to the file."""

    key: str
    schema: NamedSchema
    data: bytes  # JSON
    log_ns: int  # [ns] UTC of arrival
    publish_ns: int  # [ns] UTC of the message's own stamp, or of arrival: see `Intake`
    sequence: int  # the publisher's count, modulo 2³²
    is_view: bool = False  # computed from a message of the bus, so nothing is lost without it


class CheckedMessage(NamedTuple):
    """One message that belongs into a recording."""

    topic: AnyTopic  # the row of the topic table; for health/control that of health/*
    message: Message
    log_ns: int  # [ns] UTC of arrival
    publish_ns: int  # [ns] UTC of the message's own stamp, or of arrival: see `Intake`


class Intake:
    """Checks, converts and hashes every envelope of a vehicle.

    Args:
        outbox: is told of what is not recorded.
        wall_offset_ns: [ns] UTC minus the recorder's clock, which is that of arrivals.
        local_ns: converts a stamp [ns] of a topic to the recorder's clock; None where that is not
            known, then the arrival time is used. By default there is one clock.
        views: computes what Foxglove shows; None: only messages are recorded.
    """

    def __init__(
        self,
        outbox: Outbox,
        wall_offset_ns: int = 0,
        local_ns: Callable[[AnyTopic, int], int | None] = lambda _, stamp_ns: stamp_ns,
        views: Views | None = None,
    ) -> None:
        self._outbox, self._views = outbox, views
        self._offset = wall_offset_ns
        self._local_ns = local_ns
        self._topics = {topic.key: topic for topic in topics.ALL}  # and members that are recorded
        self._decoders = {topic.key: PayloadDecoder(topic) for topic in topics.ALL}
        self._members = Counter[str]()  # of each family, that are recorded
        self._unknown: set[str] = set()
        self._hash = hashlib.sha256()
        self._encode = msgspec.json.Encoder().encode

    def rows(self, key: str, checked: CheckedMessage) -> list[RecordedRow]:
        """The row of a message that was checked, and those of its views."""
        topic, message, log_ns, publish_ns = checked
        data, sequence = self._encode(message), message.seq & 0xFFFFFFFF
        row = RecordedRow(key, schema_of(topic.message), data, log_ns, publish_ns, sequence)
        if self._views is None:
            return [row]
        views = self._views.of(topic, message, publish_ns, key)
        if not views:  # nearly always
            return [row]
        of_views = (row._replace(key=k, schema=s, data=d, is_view=True) for k, s, d in views)
        return [row, *of_views]

    def check(
        self,
        key: str,
        encoding: str,
        payload: bytes,
        arrival: int,
        decoded: Message | None = None,
    ) -> CheckedMessage | None:
        """The message, counted into the hash; None: it is not recorded, which is told.

        Args:
            arrival: [ns] by the recorder's clock.
            decoded: the message, where another service of the process has decoded it already.
        """
        found = self._checked(key, encoding, payload, arrival, decoded)
        if isinstance(found, Event):
            self._outbox.tell(found)
            return None
        # Lengths first, so that different fields never give the same bytes.
        self._hash.update(f"{len(key)} {len(payload)} {arrival} {key}".encode() + payload)
        return found

    def _checked(
        self, key: str, encoding: str, payload: bytes, arrival: int, decoded: Message | None
    ) -> CheckedMessage | Event:
        known = self._topics.get(key)
        topic = known or topics.find(key)
        if topic is None:
            return self._unknown_key(key)
        # A rejected member of a family is counted under the family: anybody can invent members.
        name = topic.key if known is None else key
        read = decoded
        if read is None or encoding != topic.encoding:
            read = self._decoders[topic.key].read(key, encoding, payload)
        if isinstance(read, Row):
            return read(name)
        message: Message = read
        stamp_ns = self._local_ns(topic, message.stamp_ns)
        log_ns = arrival + self._offset
        publish_ns = log_ns if stamp_ns is None else stamp_ns + self._offset
        if not (0 <= log_ns <= LATEST_NS and 0 <= publish_ns <= LATEST_NS):
            return events.MALFORMED(name)
        if known is None:
            if self._members[topic.key] >= MEMBERS:
                return events.TOO_MANY_KEYS(name)
            self._members[topic.key] += 1
            self._topics[key] = topic
        return CheckedMessage(topic, message, log_ns, publish_ns)

    def log_hash(self) -> str:
        """SHA-256 over key, payload and arrival of every row so far, in order: two runs with the
        same hash received the same bytes at the same times."""
        return self._hash.hexdigest()

    def _unknown_key(self, key: str) -> Event:
        name = key[:NAME_LENGTH].encode("ascii", "backslashreplace").decode()
        if name not in self._unknown:
            if len(self._unknown) >= UNKNOWN:
                return events.UNKNOWN("others")
            self._unknown.add(name)
        return events.UNKNOWN(name)
