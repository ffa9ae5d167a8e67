"""Recorded messages as envelopes of a bus."""

import msgspec

from messages import topics
from messages.identity import SideIdentity
from messages.message import Message
from services.runtime.bus.envelope import Envelope
from services.runtime.config.identity import identity_of
from services.runtime.config.stack import Stack
from tools.recordings.recording import Raw
from tools.replay.source import ReplaySource

OURS = ("version", "commit", "messages", "vehicle_hash")  # what an identity says of the code


class Encoder:
    """JSON as recorded → msgpack as sent. What today's messages do not admit is counted by the
    recording as unreadable.

    A side that had the same Lindy as the drone in the recording has today's in the replay: else
    today's code would take it for another one, and refuse to arm.
    """

    def __init__(self, source: ReplaySource, stack: Stack) -> None:
        self._recording = source.recording
        self._encode = msgspec.msgpack.Encoder().encode
        self._then = source.identity
        self._today = identity_of(stack, "drone", 0)

    def envelope(self, raw: Raw) -> Envelope | None:
        """None: this version of Lindy cannot read it."""
        message = self._recording.decode(raw)
        topic = topics.find(raw.key)
        if message is None or topic is None:
            return None
        if isinstance(message, SideIdentity):
            message = self._as_today(message)
        return Envelope(raw.key, self._encode(message), topic.encoding)

    def _as_today(self, said: SideIdentity) -> Message:
        then, today = self._then, self._today
        if then is None:
            return said
        same = {n: getattr(today, n) for n in OURS if getattr(said, n) == getattr(then, n)}
        return msgspec.structs.replace(said, **same)
