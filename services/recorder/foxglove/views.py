"""Which views each message of the bus gives: a scene, a log, pictures, and vectors with a name for
each component, `wanted.heave` instead of `wanted[2]`."""

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from messages import cameras, topics
from messages.components import COMPONENTS, QUATERNION
from messages.health import LogLine
from messages.message import Message
from messages.reference import Reference
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.vehicle import Actuation, Truth
from messages.video import Assembler, VideoPart
from services.marine.vehicle import Vehicle
from services.recorder.foxglove import scene
from services.recorder.foxglove.channel import PREFIX, FoxgloveView, NamedSchema, official

# All this is for the eye, so it has fewer messages than the bus has.
POSE_NS = 40_000_000  # [ns] between two poses
PLOT_NS = 40_000_000  # [ns] between two named vectors; the message itself has every sample
THRUST_NS = 100_000_000  # [ns] between two sets of arrows
HULL_NS = 1_000_000_000  # [ns] it never changes, but somebody may begin to watch
Names = Mapping[str, Sequence[str]]  # field of a message → names of its components
VECTORS: dict[AnyTopic, Names] = {
    topic: {
        f: names for f, names in COMPONENTS[topic.message.__name__].items() if names != QUATERNION
    }
    for topic in (topics.IMU, topics.MAGNETOMETER, topics.DVL, topics.WRENCH, topics.TRUTH)
}
THRUST = (topics.THRUSTERS, topics.ACTUATION)  # their `thrust` is in the order of the vehicle file
SEEN = frozenset((VehicleState, Reference, Truth, Actuation, VideoPart, LogLine))
LEVELS = {"info": 2, "warning": 3, "error": 4}  # of `foxglove.Log`


class NamedVectors:
    """The named fields of one topic."""

    def __init__(self, topic: AnyTopic, names: Names) -> None:
        self.key = f"{PREFIX}plot/{topic.key}"
        self.schema = NamedSchema(f"Named{topic.message.__name__}", _schema(names))
        self._names = names

    def of(self, message: Message) -> dict[str, dict[str, float]] | None:
        """The same numbers under their names; None for a message with too many, too few or none."""
        named: dict[str, dict[str, float]] = {}
        for field, names in self._names.items():
            values: Sequence[float] | None = getattr(message, field)
            if values is None or len(values) != len(names):
                return None
            named[field] = dict(zip(names, values, strict=True))
        return named


def named_vectors(thrusters: Sequence[str]) -> dict[str, NamedVectors]:
    """By key of the topic.

    Args:
        thrusters: their names, in the order of the vehicle file.
    """
    vectors = VECTORS | {topic: {"thrust": thrusters} for topic in THRUST}
    return {topic.key: NamedVectors(topic, names) for topic, names in vectors.items()}


class Views:
    """Of one dive."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._named = named_vectors([thruster.name for thruster in vehicle.thruster])
        self._reference: Reference | None = None
        self._truth: Truth | None = None
        self._video = defaultdict[str, Assembler](Assembler)  # by key
        self._due: dict[str, int] = {}  # [ns] UTC, when a view is due again
        self._encode = msgspec.json.Encoder().encode

    def of(
        self, topic: AnyTopic, message: Message, utc_ns: int, key: str = ""
    ) -> list[FoxgloveView]:
        """The views of one message.

        Args:
            topic: its row of the topic table.
            utc_ns: [ns] UTC of its stamp.
            key: of a family's member; default: that of the topic.
        """
        plot = self._plot(topic, message, utc_ns)
        views = [] if plot is None else [plot]
        if type(message) not in SEEN:  # nearly always
            return views
        if isinstance(message, VehicleState):
            if scene.state_is_known(message):
                views += self._drawn(message, utc_ns)
        elif isinstance(message, Reference):
            self._reference = message
        elif isinstance(message, Truth):
            self._truth = message
        elif isinstance(message, Actuation):
            if len(message.thrust) == len(self._vehicle.thruster):
                views += self._thrust(message, utc_ns)
        elif isinstance(message, VideoPart):
            views += self._picture(key or topic.key, message, utc_ns)
        elif isinstance(message, LogLine):
            views.append(self._view("log", "Log", _log(message, utc_ns)))
        return views

    def _plot(self, topic: AnyTopic, message: Message, utc_ns: int) -> FoxgloveView | None:
        named = self._named.get(topic.key)
        if named is None or not self._is_due(topic.key, utc_ns, PLOT_NS):
            return None
        fields = named.of(message)
        if fields is None:
            return None
        return FoxgloveView(named.key, named.schema, self._encode(fields))

    def _drawn(self, state: VehicleState, utc_ns: int) -> list[FoxgloveView]:
        views: list[FoxgloveView] = []
        if self._is_due("pose", utc_ns, POSE_NS):
            frames = scene.transforms(utc_ns, state, self._reference, self._truth)
            pose = scene.pose(scene.place(state), state.attitude)
            stamped = {"timestamp": scene.time(utc_ns), "frame_id": scene.NED, "pose": pose}
            views.append(self._view("transforms", "FrameTransforms", frames))
            views.append(self._view("pose", "PoseInFrame", stamped))
        if self._is_due("hull", utc_ns, HULL_NS):
            known = {scene.REFERENCE: self._reference, scene.TRUTH: self._truth}
            ghosts = [frame for frame, message in known.items() if message is not None]
            hulls = scene.hulls(utc_ns, self._vehicle, ghosts)
            views.append(self._view("hull", "SceneUpdate", hulls))
        return views

    def _thrust(self, actuation: Actuation, utc_ns: int) -> list[FoxgloveView]:
        if not self._is_due("thrust", utc_ns, THRUST_NS):
            return []
        arrows = scene.thrust_arrows(utc_ns, self._vehicle, actuation.thrust)
        return [self._view("thrust", "SceneUpdate", arrows)]

    def _picture(self, key: str, part: VideoPart, utc_ns: int) -> list[FoxgloveView]:
        """The access unit that this part completes."""
        unit = self._video[key].take(part)
        if unit is None:
            return []
        camera = cameras.camera_of(key)
        name = "camera" if camera == cameras.FIRST else f"camera_{camera}"
        stamped = {"timestamp": scene.time(utc_ns), "frame_id": scene.VEHICLE}
        video = {**stamped, "data": unit.data, "format": "h264"}
        return [self._view(name, "CompressedVideo", video)]

    def _is_due(self, name: str, utc_ns: int, period_ns: int) -> bool:
        """Is it as long ago as a period, or did the clock run backwards?"""
        due = self._due.get(name, utc_ns)
        if due - period_ns < utc_ns < due:
            return False
        self._due[name] = utc_ns + period_ns - (utc_ns - due) % period_ns
        return True

    def _view(self, name: str, kind: str, content: dict[str, Any]) -> FoxgloveView:
        return FoxgloveView(PREFIX + name, official(f"foxglove.{kind}"), self._encode(content))


def _log(line: LogLine, utc_ns: int) -> dict[str, Any]:
    return {
        "timestamp": scene.time(utc_ns),
        "level": LEVELS[line.level],
        "message": line.text,
        "name": line.service,
        "file": "",  # the type has these two; nobody needs to know where in the code
        "line": 0,
    }


def _schema(names: Names) -> bytes:
    def vector(components: Sequence[str]) -> dict[str, Any]:
        return {"type": "object", "properties": {name: {"type": "number"} for name in components}}

    properties = {field: vector(components) for field, components in names.items()}
    return json.dumps({"type": "object", "properties": properties}).encode()
