"""Decoding what came over the network: any bytes give a message or None, and never an exception."""

from typing import Generic

import msgspec

from messages.topic import M, Topic

LONGEST = 1_000_000  # [bytes] a longer payload is not even kept


class PayloadDecoder(Generic[M]):
    """Decodes the payloads of one topic."""

    def __init__(self, topic: Topic[M]) -> None:
        self._decode = msgspec.msgpack.Decoder(topic.message).decode

    def decode(self, payload: bytes) -> M | None:
        """The message, or None: it is malformed, or a value is outside its limits."""
        try:
            return self._decode(payload)
        except (msgspec.MsgspecError, ValueError, RecursionError):  # ValueError: text not in UTF-8
            return None
