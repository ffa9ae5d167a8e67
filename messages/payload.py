"""Decoding what came over the network: any bytes give a message or a reason, and never an
exception."""

from typing import Generic

import msgspec

from messages import events
from messages.events import Row
from messages.topic import M, Topic

# What msgspec raises for bytes of any kind; ValueError: text that is not UTF-8.
UNDECODABLE = (msgspec.MsgspecError, ValueError, RecursionError)
LONGEST = 1_000_000  # [bytes] a longer payload is not even kept
MEMBERS = 64  # of one family, such as health/*, that one receiver takes: anybody can invent some


class PayloadDecoder(Generic[M]):
    """Decodes the payloads of one topic."""

    def __init__(self, topic: Topic[M], *, replayed: bool = False) -> None:
        """`replayed`: of a recording that is played again, and no others. They have another
        `encoding`."""
        self.encoding = topic.replayed if replayed else topic.encoding
        self._replayed = topic.replayed
        self._decode = msgspec.msgpack.Decoder(topic.message).decode
        # The access control knows keys: who may say health/camera must not speak as control.
        self._names_itself = topic.is_family and "service" in topic.message.__struct_fields__
        self._before_name = len(topic.key) - 1

    def read(self, key: str, encoding: str, payload: bytes) -> M | Row:
        """The message, or why it is not used: it is of another type or replayed, malformed, of
        another service than that of its key, or a value is outside its limits."""
        if encoding != self.encoding:
            return events.REPLAYED if encoding == self._replayed else events.WRONG_TYPE
        try:
            message = self._decode(payload)
        except UNDECODABLE:
            return events.MALFORMED
        if self._names_itself and getattr(message, "service", "") != key[self._before_name :]:
            return events.MISNAMED
        return message
