"""Messages in, batches out. Curves have at most some 40 points a second, more than a screen shows
of a dive; that halves the file. The recording has every message.

A message costs one append when it arrives. All of some seconds become columns at once,
because writing a thousand samples costs little more than writing one.
"""

from collections import defaultdict
from math import nan

from messages import events, topics
from messages.cameras import FIRST, camera_of
from messages.control import ThrusterCommand
from messages.events import Row
from messages.link import ClockPong
from messages.message import Message
from messages.topic import AnyTopic, Direction
from messages.vehicle import Actuation
from messages.video import Assembler, VideoPart
from services.marine.vehicle import Vehicle
from services.visualizer.batch import Batch, CurveColumns, Frame, VideoSample
from services.visualizer.curves import Curve, CurveRow, curves
from services.visualizer.scene import Scene
from services.visualizer.status import NOTED, Status, part_of_path

WITH_THRUST = (Actuation, ThrusterCommand)
SPACING_NS = 22_000_000  # [ns] between two points of a fast curve: of 100 Hz every third is drawn
OLDEST_NS = 60_000_000_000  # [ns] a stamp further back than this is wrong, not late

# Topics whose stamps may be of another machine's clock and are not converted: those published on
# either side, the answer to a ping, and events, which are admitted before the clock offset is
# known. They are shown at the time of their arrival.
BY_ARRIVAL = frozenset(
    topic.key
    for topic in topics.ALL
    if topic.hz == 0 or topic.way is Direction.BOTH or topic.message is ClockPong
)
# Topics of which not every sample becomes a point.
FAST = frozenset(
    topic.key for topic in topics.ALL if topic.hz * SPACING_NS > 1e9 and topic.key not in BY_ARRIVAL
)


class Collector:
    """Collects messages between two batches."""

    def __init__(self, vehicle: Vehicle, start: int | None = None) -> None:
        self.start = start  # [ns] when the dive began: the first message's arrival
        self.newest = 0  # [ns] arrival of the last message
        self._thrusters = len(vehicle.thruster)
        self._curves: dict[str, list[Curve]] = defaultdict(list)
        for curve in curves(vehicle):
            self._curves[curve.topic.key].append(curve)
        self._heard: dict[str, list[Message]] = defaultdict(list)  # by key
        self._arrivals: dict[str, list[int]] = defaultdict(list)  # [ns] by key, of BY_ARRIVAL
        self._topics: dict[str, AnyTopic] = {}  # by key
        self._drawn_ns: dict[str, int] = {}  # [ns] time of the newest point by key
        self._widths: dict[str, int] = {}  # of the last row by path; 0: not known at the time
        self._scene = Scene(vehicle)
        self._frames: list[Frame] = []
        self._assemblers = defaultdict[str, Assembler](Assembler)  # by camera
        self._video: list[VideoSample] = []
        self._status = Status()

    def hear(self, topic: AnyTopic, key: str, message: Message, now: int) -> Row | None:
        """Keep a message that arrived at `now` [ns]. Returns why it is rejected, or None."""
        by_arrival = topic.key in BY_ARRIVAL
        if not by_arrival and now - message.stamp_ns > OLDEST_NS:
            return events.TOO_OLD
        if isinstance(message, WITH_THRUST) and len(message.thrust) != self._thrusters:
            return events.WRONG_LENGTH
        if self.start is None:
            self.start = now
        self.newest = now
        if isinstance(message, VideoPart):
            self._film(key, message, self.start)
            return None
        self._scene.hear(message)
        self._heard[key].append(message)
        if by_arrival:
            self._arrivals[key].append(now)
        self._topics[key] = topic
        return None

    def _film(self, key: str, part: VideoPart, start: int) -> None:
        """Keep the picture that this part completes, at the time of its light."""
        camera = camera_of(key) or FIRST
        if (unit := self._assemblers[camera].take(part)) is not None:
            self._video.append(VideoSample(part.stamp_ns - start, unit.data, camera))

    def newest_sample(self) -> int | None:
        """[ns] Sensor sample of the newest state."""
        return self._scene.newest_sample()

    def frame(self) -> Frame | None:
        """The scene, when it has moved since the last frame."""
        return None if self.start is None else self._scene.frame(self.start)

    def keep_frame(self) -> None:
        """Add the present scene to the next batch."""
        if (frame := self.frame()) is not None:
            self._frames.append(frame)

    def drain(self, now: int) -> Batch:
        """Everything since the last call."""
        heard, self._heard = self._heard, defaultdict(list)
        arrivals, self._arrivals = self._arrivals, defaultdict(list)
        frames, self._frames = self._frames, []
        video, self._video = self._video, []
        start = now if self.start is None else self.start
        batch = Batch(
            frames=frames,
            video=video,
            trail=self._scene.take_trail(),
            trail_time=now - start,
            floor=self._scene.take_floor(),
        )
        for key, messages in heard.items():
            topic = self._topics[key]
            stamps = arrivals.get(key) or [message.stamp_ns for message in messages]
            times = [stamp - start for stamp in stamps]
            points = self._points(key, messages, times) if topic.key in FAST else (messages, times)
            for curve in self._curves[topic.key]:
                columns = self._columns(curve, key, *points)
                if columns.rows:
                    batch.columns.append(columns)
            # Of topics that make no notes, the status page needs only the newest message.
            first = 0 if topic.message in NOTED else -1
            for message, time in zip(messages[first:], times[first:], strict=True):
                batch.notes.extend(self._status.hear(key, message, time, start))
        batch.notes.extend(self._status.page(now - start, start))
        return batch

    def _points(
        self, key: str, messages: list[Message], times: list[int]
    ) -> tuple[list[Message], list[int]]:
        """Those that become points of the curves: none too soon after another."""
        drawn = list[int]()
        for index, time in enumerate(times):
            last = self._drawn_ns.get(key)
            if last is None or not last <= time < last + SPACING_NS:
                self._drawn_ns[key] = time
                drawn.append(index)
        return [messages[index] for index in drawn], [times[index] for index in drawn]

    def _columns(
        self, curve: Curve, key: str, messages: list[Message], times: list[int]
    ) -> CurveColumns:
        """The samples of one curve in these messages."""
        path = curve.path
        if curve.topic.is_family:
            path += "/" + part_of_path(key.rpartition("/")[2])
        if not messages:
            return CurveColumns(path, [], [])
        rows = [curve.read(message) for message in messages]
        known = [row for row in rows if row is not None]
        if curve.in_parts:
            at = [time for time, row in zip(times, rows, strict=True) if row is not None]
            return CurveColumns(path, at, known)
        width = self._widths.get(path, 0)
        if len(known) < len(rows):
            times, known = _broken(times, rows, width)
        self._widths[path] = 0 if rows[-1] is None else len(rows[-1])
        return CurveColumns(path, times, known)


def _broken(
    times: list[int], rows: list[CurveRow | None], width: int
) -> tuple[list[int], list[CurveRow]]:
    """The known rows, and one row of NaN where a value becomes unknown, so that the line ends there
    instead of being connected to the next known value. `width` is of the previous row."""
    kept_times: list[int] = []
    kept: list[CurveRow] = []
    for time, row in zip(times, rows, strict=True):
        if row is None and width == 0:
            continue
        kept_times.append(time)
        kept.append((nan,) * width if row is None else row)
        width = 0 if row is None else len(row)
    return kept_times, kept
