"""Messages in, batches out: nothing is thinned but the path and the scene.

A message costs one append when it comes. Half a second of them become columns at once, because
writing a thousand samples costs little more than writing one.
"""

import re
from collections import defaultdict

from messages.control import ThrusterCommand
from messages.message import Message
from messages.topic import AnyTopic
from messages.vehicle import Actuation
from services.marine.vehicle import Vehicle
from services.visualizer.batch import Batch, Columns, Frame
from services.visualizer.curves import Curve, curves
from services.visualizer.scene import Scene
from services.visualizer.status import NOTED, Status

WITH_THRUST = (Actuation, ThrusterCommand)
OLDEST_NS = 60_000_000_000  # [ns] a stamp further back than this is wrong, not late


class Collector:
    """All that was heard since the last batch."""

    def __init__(self, vehicle: Vehicle, start: int | None = None) -> None:
        self.start = start  # [ns] when the dive began: the first message's arrival
        self.newest = 0  # [ns] arrival of the last message
        self._thrusters = len(vehicle.thruster)
        self._curves: dict[str, list[Curve]] = defaultdict(list)
        for curve in curves(vehicle):
            self._curves[curve.topic.key].append(curve)
        self._heard: dict[str, list[Message]] = defaultdict(list)  # by key
        self._topics: dict[str, AnyTopic] = {}  # by key
        self._scene = Scene(vehicle)
        self._frames: list[Frame] = []
        self._status = Status()

    def hear(self, topic: AnyTopic, key: str, message: Message, now: int) -> str | None:
        """Keep a message that arrived at `now` [ns]. Returns why not, or None."""
        if now - message.stamp_ns > OLDEST_NS:
            return "too_old"
        if isinstance(message, WITH_THRUST) and len(message.thrust) != self._thrusters:
            return "wrong_length"
        if self.start is None:
            self.start = now
        self.newest = now
        self._heard[key].append(message)
        self._topics[key] = topic
        self._scene.hear(message)
        return None

    def newest_sample(self) -> int | None:
        """[ns] Sensor sample behind the newest state heard."""
        return self._scene.newest_sample()

    def frame(self) -> Frame | None:
        """The scene, when it has moved since the last frame."""
        return None if self.start is None else self._scene.frame(self.start)

    def keep_frame(self) -> None:
        """Have the scene as it is now in the next batch."""
        if (frame := self.frame()) is not None:
            self._frames.append(frame)

    def drain(self, now: int) -> Batch:
        """Everything since the last call."""
        heard, self._heard = self._heard, defaultdict(list)
        frames, self._frames = self._frames, []
        start = now if self.start is None else self.start
        batch = Batch(
            frames=frames,
            trail=self._scene.take_trail(),
            trail_time=now - start,
            floor=self._scene.take_floor(),
        )
        for key, messages in heard.items():
            topic = self._topics[key]
            times = [message.stamp_ns - start for message in messages]
            for curve in self._curves[topic.key]:
                columns = _columns(curve, key, messages, times)
                if columns.rows:
                    batch.columns.append(columns)
            # Of streams that give rise to no notes, the status page wants the newest alone.
            telling = messages if topic.message in NOTED else messages[-1:]
            for message in telling:
                batch.notes.extend(self._status.hear(key, message, message.stamp_ns - start))
        page = self._status.page(now - start)
        if page is not None:
            batch.notes.append(page)
        return batch


def _columns(curve: Curve, key: str, messages: list[Message], times: list[int]) -> Columns:
    """What one curve draws of these messages; nothing of those that do not know its value."""
    read = curve.read
    rows = [row for message in messages if (row := read(message)) is not None]
    if len(rows) < len(times):
        times = [t for t, message in zip(times, messages, strict=True) if read(message) is not None]
    path = curve.path
    if curve.topic.is_family:
        path += "/" + re.sub(r"[^a-z0-9_]", "_", key.rpartition("/")[2])
    return Columns(path, times, rows)
