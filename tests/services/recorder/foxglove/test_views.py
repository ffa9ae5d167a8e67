"""What Foxglove draws is where the drone is, and every view is what its schema promises."""

import json
from collections import Counter
from math import cos, hypot, pi, sin
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.control import ThrusterCommand, Wrench
from messages.health import LogLine
from messages.message import Message
from messages.reference import Motion
from messages.sensors import DvlSample, ImuSample, MagnetometerSample
from messages.topic import AnyTopic
from messages.units import Quaternion, Vec3
from services.marine.vehicle import Vehicle
from services.recorder.foxglove.channel import OFFICIAL, PREFIX, FoxgloveView, foxglove_schema
from services.recorder.foxglove.scene import NED_IN_WORLD, along
from services.recorder.foxglove.views import THRUST, VECTORS, Views
from services.runtime.config.stack import Stack
from tests.support import said
from tests.support.messages import example

SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND
VEHICLE = Stack().section("vehicle", Vehicle)
THRUSTERS = [thruster.name for thruster in VEHICLE.thruster]
part = st.floats(min_value=-1.0, max_value=1.0)
vectors = st.tuples(part, part, part).filter(lambda v: hypot(*v) > 0.01)
metres = st.floats(min_value=-100.0, max_value=100.0)
places = st.tuples(metres, metres, metres)


@st.composite
def attitudes(draw: st.DrawFn) -> Quaternion:
    x, y, z = draw(vectors)
    length, half = hypot(x, y, z), draw(st.floats(min_value=-pi, max_value=pi)) / 2
    s = sin(half) / length
    return (cos(half), s * x, s * y, s * z)


def turned(q: Quaternion, v: Vec3) -> Vec3:
    """v + 2 w (u × v) + 2 u × (u × v) with q = (w, u)."""

    u = np.array(q[1:])
    once = np.cross(u, v)
    x, y, z = np.array(v) + 2 * (q[0] * once + np.cross(u, once))
    return float(x), float(y), float(z)


def everything(now: int) -> list[tuple[AnyTopic, Message]]:
    six, newton = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), tuple(10.0 * n for n in range(len(THRUSTERS)))
    wrench = example(Wrench, now, wanted=six, achieved=six)
    return [
        (topics.REFERENCE, said.reference(now)),
        (topics.TRUTH, said.truth(now)),
        (topics.STATE, said.state(now, depth=1.0)),
        (topics.IMU, ImuSample(stamp_ns=now, specific_force=(1, 2, 3), angular_rate=(4, 5, 6))),
        (topics.MAGNETOMETER, MagnetometerSample(stamp_ns=now, field=(1, 2, 3))),
        (topics.DVL, DvlSample(stamp_ns=now, velocity=(1, 2, 3), std=0.1)),
        (topics.WRENCH, wrench),
        (
            topics.THRUSTERS,
            ThrusterCommand(stamp_ns=now, sensor_ns=now, pilot_ns=now, thrust=newton),
        ),
        (topics.ACTUATION, said.actuation(now, thrust=newton)),
        (topics.LOG, LogLine(stamp_ns=now, service="control", level="warning", text="words")),
    ]


def views_of(topic: AnyTopic, message: Message) -> list[FoxgloveView]:
    return Views(VEHICLE).of(topic, message, START)


def views_of_all(now: int = START) -> dict[str, FoxgloveView]:
    views = Views(VEHICLE)
    return {v.key: v for topic, message in everything(now) for v in views.of(topic, message, now)}


def fits(schema: dict[str, Any], value: Any) -> bool:
    if "oneOf" in schema:
        return value in [alternative["const"] for alternative in schema["oneOf"]]
    if schema["type"] == "object":
        inner = schema["properties"]
        return set(schema.get("required", ())) <= set(value) <= set(inner) and all(
            fits(inner[name], part) for name, part in value.items()
        )
    if schema["type"] == "array":
        return all(fits(schema["items"], part) for part in value)
    kinds = {"number": (int, float), "integer": (int,), "string": (str,), "boolean": (bool,)}
    return isinstance(value, kinds[schema["type"]])


def test_every_view_has_all_that_its_schema_promises_and_nothing_else():
    views = views_of_all()
    plots = {f"{PREFIX}plot/{topic.key}" for topic in (*VECTORS, *THRUST)}
    drawn = {f"{PREFIX}{name}" for name in ("transforms", "pose", "hull", "thrust", "log")}
    assert set(views) == plots | drawn
    for view in views.values():
        assert topics.find(view.key) is None
        assert fits(json.loads(view.schema.data), json.loads(view.data)), view.key
    official = {view.schema.name for view in views.values() if view.schema.name in OFFICIAL}
    assert official == set(OFFICIAL) - {"foxglove.CompressedVideo"}  # needs a whole picture


@given(place=places, q=attitudes(), depth=metres, heading=st.floats(min_value=-50, max_value=50))
def test_frames_are_east_north_and_up(place: Vec3, q: Quaternion, depth: float, heading: float):
    views = Views(VEHICLE)
    wanted = [Motion(value, 0.0, 0.0, 0.0) for value in (depth, heading)]
    views.of(topics.REFERENCE, said.reference(START, depth=wanted[0], heading=wanted[1]), START)
    north, east, down = place
    state = said.state(START, attitude=q, north=north, east=east, depth=down)
    drawn_now = views.of(topics.STATE, state, START)
    drawn = {view.key: json.loads(view.data) for view in drawn_now}
    frames = {f["child_frame_id"]: f for f in drawn[f"{PREFIX}transforms"]["transforms"]}
    assert set(frames) == {"ned", "vehicle", "reference"}

    def to_world(frame: str, point: Vec3) -> Vec3:
        while frame != "world":
            here = frames[frame]
            r, t = here["rotation"], here["translation"]
            x, y, z = turned((r["w"], r["x"], r["y"], r["z"]), point)
            point, frame = (x + t["x"], y + t["y"], z + t["z"]), here["parent_frame_id"]
        return point

    ahead = turned(q, (1.0, 0.0, 0.0))
    assert to_world("vehicle", (0.0, 0.0, 0.0)) == pytest.approx((east, north, -down), abs=1e-9)
    assert to_world("vehicle", (1.0, 0.0, 0.0)) == pytest.approx(
        (east + ahead[1], north + ahead[0], -down - ahead[2]), abs=1e-9
    )
    wish = (east + sin(heading), north + cos(heading), -depth)
    assert to_world("reference", (1.0, 0.0, 0.0)) == pytest.approx(wish, abs=1e-9)
    pose = drawn[f"{PREFIX}pose"]
    assert pose["frame_id"] == "ned"
    assert pose["pose"]["position"] == {"x": north, "y": east, "z": down}
    assert turned(NED_IN_WORLD, (0.0, 0.0, 1.0)) == pytest.approx((0.0, 0.0, -1.0))


@given(direction=vectors)
def test_an_arrow_points_where_its_thruster_pushes(direction: Vec3):
    length = hypot(*direction)
    unit = tuple(p / length for p in direction)
    assert turned(along(direction), (1.0, 0.0, 0.0)) == pytest.approx(unit, abs=1e-4)


def test_arrows_are_those_of_the_thrusters_that_push():
    thrust = [0.0] * len(THRUSTERS)
    thrust[1] = -10.0
    (arrows,) = [
        json.loads(view.data)
        for view in views_of(topics.ACTUATION, said.actuation(START, thrust=tuple(thrust)))
        if view.key == f"{PREFIX}thrust"
    ]
    (arrow,) = arrows["entities"][0]["arrows"]
    assert arrow["shaft_length"] == pytest.approx(0.4)
    x, y, z = VEHICLE.thruster[1].position
    assert arrow["pose"]["position"] == {"x": x, "y": y, "z": z}
    o = arrow["pose"]["orientation"]
    back = turned((o["w"], o["x"], o["y"], o["z"]), (1.0, 0.0, 0.0))
    assert back == pytest.approx((-1.0, 0.0, 0.0))


def test_a_plot_has_the_same_numbers_under_names():
    views = views_of_all()
    wrench = json.loads(views[f"{PREFIX}plot/control/wrench"].data)
    names = ("surge", "sway", "heave", "roll", "pitch", "yaw")
    assert wrench["wanted"] == dict(zip(names, range(1, 7), strict=True))
    command = json.loads(views[f"{PREFIX}plot/control/thrusters"].data)
    assert command["thrust"] == {name: 10.0 * n for n, name in enumerate(THRUSTERS)}
    imu = json.loads(views[f"{PREFIX}plot/sensor/imu"].data)
    assert imu["angular_rate"] == {"x": 4, "y": 5, "z": 6}


@pytest.mark.parametrize("count", [0, 1, len(THRUSTERS) + 1, 32])
def test_a_message_with_other_thrusters_gives_no_view(count: int):
    assert views_of(topics.ACTUATION, said.actuation(START, thrust=(1.0,) * count)) == []


def test_nothing_is_drawn_before_the_depth_is_known():
    calibrating = said.state(START, phase="calibrating")
    unknown = said.state(START, invalid=("depth",))
    views = Views(VEHICLE)
    for message in (calibrating, unknown):
        assert views.of(topics.STATE, message, START) == []
    assert views.of(topics.STATE, said.state(START), START)


@pytest.mark.parametrize("jump", [-3600 * SECOND, 3600 * SECOND])
def test_the_scene_goes_on_at_its_rate_whatever_the_clock_does(jump: int):
    views, count = Views(VEHICLE), Counter[str]()
    for n in range(400):
        now = START + n * SECOND // 100 + (jump if n >= 200 else 0)
        imu = ImuSample(stamp_ns=now, specific_force=(1, 2, 3), angular_rate=(4, 5, 6))
        given = [*views.of(topics.STATE, said.state(now), now), *views.of(topics.IMU, imu, now)]
        count.update(view.key.removeprefix(PREFIX) for view in given)
    assert 99 <= count["plot/sensor/imu"] <= 101
    assert count["transforms"] == count["pose"]
    assert 99 <= count["pose"] <= 101
    assert 4 <= count["hull"] <= 6


# What Foxglove's parser demands of a schema holds for every message type.


KINDS = sorted({topic.message for topic in topics.ALL}, key=lambda kind: kind.__name__)
REFUSED = {"$ref", "$defs", "anyOf", "oneOf", "enum", "prefixItems"}
TYPES = {"object", "array", "string", "number", "integer", "boolean"}


def schema_of(kind: type[Message]) -> dict[str, Any]:
    return json.loads(foxglove_schema(kind))


def parts_of(schema: dict[str, Any]) -> list[dict[str, Any]]:
    inner = [*schema.get("properties", {}).values()]
    inner += [schema[name] for name in ("items", "additionalProperties") if name in schema]
    return [schema, *(part for child in inner for part in parts_of(child))]


def test_every_part_has_a_plain_type_and_nothing_the_parser_refuses():
    for kind in KINDS:
        schema = schema_of(kind)
        assert schema["type"] == "object"
        assert set(schema["properties"]) == {f.encode_name for f in msgspec.structs.fields(kind)}
        for part in parts_of(schema):
            assert part["type"] in TYPES
            assert part["type"] != "object" or "properties" in part
            assert part["type"] != "array" or part["items"]["type"] != "array"
            assert not REFUSED & set(part)
