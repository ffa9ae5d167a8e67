"""Recorded messages as envelopes of a bus."""

import msgspec

from messages import topics
from services.runtime.bus.envelope import Envelope
from tools.recordings.recording import Raw, Recording


class Encoder:
    """JSON as recorded → msgpack as sent. What today's messages do not admit is counted by the
    recording as unreadable."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._encode = msgspec.msgpack.Encoder().encode

    def envelope(self, raw: Raw) -> Envelope | None:
        """None: this version of Lindy cannot read it."""
        message = self._recording.decode(raw)
        topic = topics.find(raw.key)
        if message is None or topic is None:
            return None
        return Envelope(raw.key, self._encode(message), topic.encoding)
