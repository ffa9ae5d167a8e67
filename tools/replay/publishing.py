"""A recorded message becomes one that can be shown now, and that nothing obeys.

Its stamps are moved by one amount, so that it is as old when it is sent as it was when it was
recorded. Its encoding says that it is a replay: no port of a live dive takes it.
"""

import threading
import time
from collections.abc import Callable

import msgspec

from messages import topics
from messages.health import LogLine
from messages.message import Message
from messages.topic import AnyTopic
from services.runtime.bus.envelope import Bus, Envelope
from services.runtime.bus.qos import QOS_PROFILES
from services.runtime.config.errors import LindyError
from services.runtime.node.clock_offset import mover
from tools.recordings.recording import Raw, Recording

Send = Callable[[Envelope], None]
HEARD_S = 3.0  # [s] in which a hub hands a message on, if it does at all


class Republisher:
    """Sends recorded messages again.

    Attributes:
        sent: so far.
        keys: that were sent.
    """

    def __init__(self, recording: Recording, send: Send) -> None:
        self.sent = 0
        self.keys: set[str] = set()
        self._recording, self._send = recording, send

    def send(self, raw: Raw, due: int) -> None:
        """
        Args:
            due: [ns] when it is to be sent by the clock of this machine.
        """
        message, topic = self._recording.decode(raw), topics.find(raw.key)
        if message is None or topic is None:
            return  # counted by the recording as unreadable
        stamp = due - (raw.log_ns - raw.publish_ns)
        mover(topic.message)(message, message.stamp_ns - stamp)
        self._send(replayed(raw.key, topic, message))
        self.sent += 1
        self.keys.add(raw.key)


def replayed(key: str, topic: AnyTopic, message: Message) -> Envelope:
    """A message marked as one of a replay."""
    payload = msgspec.msgpack.encode(message)
    return Envelope(key, payload, topic.replayed, travelled=QOS_PROFILES[topic.qos])


def require_heard(endpoint: str, bus: Bus, listener: Bus, name: str) -> None:
    """Say on the bus that a replay begins, until somebody else there hears it.

    Args:
        listener: another connection to the hub at `endpoint`.
        name: of the recording.

    Raises:
        LindyError: the hub hands no replay on. That of a vehicle does not: its access control lets
            nothing through but the vehicle's own keys.
    """
    topic, came = topics.LOG.of("replay"), threading.Event()
    listener.hear(topic.key, lambda _: came.set())
    deadline = time.monotonic() + HEARD_S
    while not came.wait(0.05) and time.monotonic() < deadline:  # a subscription takes a moment
        line = LogLine(
            stamp_ns=time.monotonic_ns(), service="replay", level="info", text=f"replay of {name}"
        )
        bus.forward(replayed(topic.key, topic, line))
    if not came.is_set():
        raise LindyError(
            f"the hub at {endpoint} lets no replay through: it is that of a vehicle; leave out "
            f"--connect, or start one of its own with `lindy hub tcp/127.0.0.1:7449`"
        )
