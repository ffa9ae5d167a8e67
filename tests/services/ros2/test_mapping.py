"""What each message is in ROS 2: frames, units, and that readers of others understand it."""

import io
from collections.abc import Iterable
from dataclasses import fields, is_dataclass, make_dataclass
from math import atan2, isnan, pi, remainder
from typing import Any, cast

import numpy as np
import pycdr2
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs
from PIL import Image
from pycdr2 import types as cdr_types
from rosbags.interfaces import Nodetype

from messages import topics
from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.sensors import ImuSample
from messages.units import Quaternion, Vec3
from messages.video import AccessUnit, VideoPart
from services.camera.core import Order
from services.camera.io.encoder import VideoEncoder
from services.camera.sea import Picture
from services.marine.attitude import from_euler, to_world, wrapped
from services.marine.mounting import ImuMount, Mount, Mounting
from services.piloting.sticks import Sticks
from services.ros2 import mapping
from services.ros2.io.jpeg import JpegOfVideo
from services.ros2.mapping import (
    ROWS,
    STORE,
    UNKNOWN,
    RosMessage,
    RosMessages,
    enu,
    flu,
)
from services.ros2.rmw_zenoh import Attachment

from .examples import EVERY, UTC_NS, known, state

angles = st.floats(-pi, pi)
attitudes = st.builds(from_euler, angles, st.floats(-1.5, 1.5), angles)
metres = st.floats(-100.0, 100.0)
vectors = st.tuples(metres, metres, metres)
shares = st.floats(-1.0, 1.0, width=32)
HOW = Attachment(1, 2, b"p" * 16)


def made(topic: Any, key: str, message: Any) -> dict[str, RosMessage]:
    found = RosMessages("rov", "/rov", None).of(topic, key, message, UTC_NS)
    return {said.topic: said for said in found}


def turned(q: Any, v: Vec3) -> Vec3:
    """By a quaternion of ROS, written out as a matrix."""
    x, y, z, w = q.x, q.y, q.z, q.w
    matrix = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    a, b, c = (float(part) for part in np.array(matrix) @ v)
    return a, b, c


@given(attitudes, vectors)
def test_what_points_somewhere_in_the_body_points_there_in_the_world(
    attitude: Quaternion, v: Vec3
) -> None:
    placed = mapping.transform(mapping.frames_of("rov", Mounting()), state(attitude), UTC_NS)
    rotation = placed.transforms[0].transform.rotation
    assert turned(rotation, flu(v)) == pytest.approx(enu(to_world(attitude, v)), abs=1e-9)


@given(angles, st.floats(-1.0, 1.0))
def test_the_drone_points_by_the_same_north_that_its_place_is_counted_from(
    north: float, off: float
) -> None:
    """The control heading drifts with the gyroscope; a place is by the compass."""
    said = structs.replace(
        state(from_euler(0.1, -0.2, north + off)), heading_navigation=known(wrapped(north))
    )
    frames = mapping.frames_of("rov", Mounting())
    x, y, _ = turned(mapping.odometry(frames, said, UTC_NS).pose.pose.orientation, (1.0, 0.0, 0.0))
    assert remainder(atan2(x, y) - north, 2.0 * pi) == pytest.approx(0.0, abs=1e-9)


@given(attitudes, st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2))
def test_the_velocity_of_the_odometry_rises_as_the_depth_falls(
    attitude: Quaternion, surge: float, sway: float, rate: float
) -> None:
    known = state(
        attitude,
        surge_velocity=Estimate(surge, 0.1),
        sway_velocity=Estimate(sway, 0.1),
        depth_rate=Estimate(rate, 0.1),
    )
    said = made(topics.STATE, "state", known)["/rov/odom"].made
    linear, covariance = said.twist.twist.linear, said.twist.covariance.reshape(6, 6)
    assert (linear.x, linear.y) == pytest.approx((surge, -sway))
    up = turned(said.pose.pose.orientation, (linear.x, linear.y, linear.z))[2]
    if covariance[2, 2] < UNKNOWN:
        assert up == pytest.approx(-rate, abs=1e-9)
    position = said.pose.pose.position
    assert (position.x, position.y, position.z) == (-7.0, 4.0, -2.0)  # east, north, up


def test_what_is_not_known_is_said_by_its_covariance_and_not_by_its_value() -> None:
    blind = state(surge_velocity=None, sway_velocity=None, north=None, east=None)
    said = made(topics.STATE, "state", blind)["/rov/odom"].made
    pose = said.pose.covariance.reshape(6, 6).diagonal()
    twist = said.twist.covariance.reshape(6, 6).diagonal()
    assert list(pose[:2]) == [UNKNOWN, UNKNOWN]
    assert pose[2] == pytest.approx(0.05**2)
    assert list(twist[[0, 1, 3, 4]]) == [UNKNOWN] * 4
    assert twist[5] == pytest.approx(0.1**2)


@pytest.mark.parametrize(
    "unknown", [{"phase": "calibrating"}, {"depth": Estimate(0.0, 1.0, valid=False)}]
)
def test_a_drone_that_does_not_know_its_depth_is_nowhere(unknown: dict[str, Any]) -> None:
    assert not made(topics.STATE, "state", structs.replace(state(), **unknown))


def test_a_resting_imu_measures_gravity_upwards_whichever_way_it_is_mounted() -> None:
    upside_down = ImuMount(rotation=((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0)))
    for mounting, force in ((Mounting(), -9.81), (Mounting(imu=upside_down), 9.81)):
        sample = ImuSample(stamp_ns=1, specific_force=(0.0, 0.0, force), angular_rate=(0, 0, 0.0))
        said = mapping.imu(mapping.frames_of("rov", mounting), sample, UTC_NS)
        assert said.linear_acceleration.z == pytest.approx(9.81)
        assert said.orientation_covariance[0] == -1.0
        assert (said.header.stamp.sec, said.header.stamp.nanosec) == (1_700_000_000, 123_456_789)


def test_current_out_of_the_battery_is_negative_and_what_is_not_measured_no_number() -> None:
    said = made(*EVERY[4])["/rov/battery"].made
    assert (said.voltage, said.current, said.percentage) == (15.8, -4.0, 0.75)
    assert isnan(said.charge)
    assert isnan(said.temperature)


def test_a_failsafe_is_an_error_and_a_late_service_a_warning() -> None:
    failed = made(*EVERY[8])["/diagnostics"].made.status[0]
    assert (failed.level, failed.message) == (
        mapping.ERROR,
        "water in the enclosure; the drone rises slowly; press resume to continue",
    )
    topic, key, health = EVERY[9]
    assert made(topic, key, health)["/diagnostics"].made.status[0].level == mapping.OK
    late = made(topic, key, structs.replace(health, lateness_p99_ms=90.0))[
        "/diagnostics"
    ].made.status[0]
    assert (late.level, late.name) == (mapping.WARN, "rov: control")
    assert "clamped:sticks: a value was limited (sticks)" in [pair.key for pair in late.values]


@given(st.tuples(shares, shares, shares, shares, st.sampled_from([-1.0, 0.0, 1.0])))
def test_sticks_that_went_out_come_back_the_same(five: tuple[float, ...]) -> None:
    sticks = Sticks(*five)
    said = {k: v for k, v in sticks._asdict().items() if k != "gripper"}
    command = PilotCommand(stamp_ns=1, **said)
    sent = made(topics.PILOT_COMMAND, "pilot/command", command)["/rov/sticks"]
    heard, clipped = mapping.heard_of(sent.cdr(), HOW)
    assert heard.sticks == sticks
    assert (heard.sender, heard.sent_ns, clipped) == (HOW.publisher, HOW.utc_ns, False)


def test_sticks_that_pycdr2_wrote_are_understood() -> None:
    header = {"stamp": struct_of("builtin_interfaces/msg/Time")(1, 2), "frame_id": "joy"}
    said = struct_of(mapping.JOY)(
        header=struct_of("std_msgs/msg/Header")(**header),
        axes=[0.5, -1.0, 0.25, 1.0],
        buttons=[0, 0, 0, 0, 0, 0, 1],
    )
    heard, _ = mapping.heard_of(said.serialize(), HOW)
    assert heard.sticks == Sticks(surge=1.0, sway=-0.25, heave=1.0, yaw=-0.5)
    assert heard.buttons == {"arm"}


@given(st.binary(max_size=200), st.integers(0, 80))
def test_any_bytes_are_sticks_or_a_value_error(data: bytes, at: int) -> None:
    """Also a Joy with a few wrong bytes."""
    good = made(*EVERY[7])["/rov/sticks"].cdr()
    for said in (data, good[:at] + data[:8] + good[at + 8 :]):
        try:
            heard, _ = mapping.heard_of(said, HOW)
        except ValueError:
            continue
        assert all(-1.0 <= stick <= 1.0 for stick in heard.sticks)


def test_what_has_no_room_in_its_field_is_a_value_error() -> None:
    topic, key, sample = EVERY[4]
    with pytest.raises(ValueError, match="/rov/battery"):
        made(topic, key, structs.replace(sample, voltage=1e99))["/rov/battery"].cdr()
    for utc_ns in (-(2**62), 2**62):
        (said,) = RosMessages("rov", "/rov", None).of(topic, key, sample, utc_ns)
        with pytest.raises(ValueError, match="/rov/battery"):
            said.cdr()


def test_a_picture_is_there_once_all_of_its_parts_are() -> None:
    topic, key, part = EVERY[11]
    messages = RosMessages("rov", "/rov", None)
    first, second = (
        structs.replace(part, parts=2),
        structs.replace(part, parts=2, part=1, data=b"more"),
    )
    assert not list(messages.of(topic, key, first, UTC_NS))
    (said,) = messages.of(topic, key, second, UTC_NS)
    assert (said.topic, said.made.format) == ("/rov/camera/h264", "h264")
    assert bytes(said.made.data) == b"\0\0\0\1picturemore"
    down = structs.replace(part, data=b"x")
    (said,) = messages.of(topics.FURTHER_VIDEO, "camera/video/down", down, UTC_NS)
    assert said.topic == "/rov/camera_down/h264"


def film(pictures: int) -> list[VideoPart]:
    """Pictures that become brighter from each to the next, the first of them a keyframe."""
    encoder, parts = VideoEncoder(320, 180), list[VideoPart]()
    for number in range(pictures):
        grey = np.full((180, 320), 20 + 8 * number, np.uint8)
        blue = np.full((90, 160), 128, np.uint8)
        stamp_ns = number * 40_000_000
        data = encoder.encode(Picture(grey, blue, blue), stamp_ns, Order(2000.0, 25.0, number == 0))
        _, _, part = EVERY[11]
        about = {"picture": number, "keyframe": number == 0, "stamp_ns": stamp_ns}
        sizes = {"width": 320, "height": 180, "encoded_ns": number + 1}
        parts.append(structs.replace(part, data=data, **about, **sizes))
    return parts


def shown(messages: RosMessages, part: VideoPart, wanted: bool = True) -> float | None:
    """Brightness of the picture that a viewer of ROS shows; None: there is none."""
    said = list(messages.of(topics.VIDEO, "camera/video", part, UTC_NS, lambda name: (
        wanted and name == "/rov/camera/compressed")))  # fmt: skip
    if not said:
        return None
    (picture,) = said
    assert (picture.kind, picture.made.format) == ("sensor_msgs/msg/CompressedImage", "jpeg")
    with Image.open(io.BytesIO(bytes(picture.made.data))) as opened:
        assert (opened.format, opened.size) == ("JPEG", (320, 180))
        return float(np.asarray(opened.convert("L")).mean())


def test_each_picture_is_a_jpeg_too_and_pictures_follow_on_each_other() -> None:
    messages = RosMessages("rov", "/rov", None, JpegOfVideo)
    seen = [shown(messages, part) for part in film(8)]
    assert None not in seen
    assert seen == sorted(seen, key=lambda each: each or 0.0)
    assert cast(float, seen[-1]) - cast(float, seen[0]) > 50.0


def test_who_hears_the_jpeg_later_sees_nothing_before_the_next_keyframe() -> None:
    messages = RosMessages("rov", "/rov", None, JpegOfVideo)
    one, two = film(3), film(3)
    assert [shown(messages, part, wanted=False) for part in one[:2]] == [None, None]
    assert shown(messages, one[2]) is None
    later = [structs.replace(part, encoded_ns=part.encoded_ns + 10) for part in two]
    assert None not in [shown(messages, part) for part in later]


@given(st.binary(max_size=300), st.booleans())
def test_garbage_is_no_jpeg(data: bytes, keyframe: bool) -> None:
    part = structs.replace(EVERY[11][2], data=data, keyframe=keyframe)
    assert JpegOfVideo().take(AccessUnit(part, data)) is None


@given(vectors, vectors)
def test_a_sensors_frame_is_where_it_sits_and_its_samples_are_in_it(r: Vec3, s: Vec3) -> None:
    mounting = Mounting(imu=ImuMount(position=r), dvl=Mount(position=s))
    messages = RosMessages("rov", "/rov", mounting)
    said = messages.static(UTC_NS)
    assert said is not None
    assert said.topic == "/tf_static"
    placed = {each.child_frame_id: each.transform for each in said.made.transforms}
    for name, place in (("rov/imu", r), ("rov/dvl", s)):
        at, turn = placed[name].translation, placed[name].rotation
        assert (at.x, at.y, at.z) == pytest.approx(flu(place))
        assert (turn.w, turn.x, turn.y, turn.z) == (1.0, 0.0, 0.0, 0.0)
    for number in (0, 2, 3):  # IMU, pressure, DVL
        (sample,) = messages.of(*EVERY[number], UTC_NS)
        assert sample.made.header.frame_id in placed
        (unplaced,) = RosMessages("rov", "/rov", None).of(*EVERY[number], UTC_NS)
        assert unplaced.made.header.frame_id == "rov/base_link"
    assert RosMessages("rov", "/rov", None).static(UTC_NS) is None


def test_every_row_of_the_table_is_tried_here() -> None:
    tried = {said.topic for example in EVERY for said in made(*example).values()}
    offered = {topic.name for topic in RosMessages("rov", "/rov", None).offered(["front"])}
    assert tried == offered
    assert {row.of for row in ROWS} | {topics.VIDEO} == {topic for topic, _, _ in EVERY}


@pytest.mark.parametrize("example", EVERY, ids=lambda example: example[1])
def test_rosbags_and_pycdr2_read_every_message_as_it_was(example: tuple[Any, str, Any]) -> None:
    for said in made(*example).values():
        data = said.cdr()
        again: Any = STORE.deserialize_cdr(data, said.kind)
        assert plain(again) == pytest.approx(plain(said.made), nan_ok=True)
        others: Any = struct_of(said.kind).deserialize(data)
        assert plain(others) == pytest.approx(plain(said.made), nan_ok=True)


# Types of pycdr2, from the definitions of ROS.

SIMPLE: dict[str, Any] = {
    "bool": bool, "string": str, "byte": cdr_types.uint8, "float32": cdr_types.float32,
    "float64": cdr_types.float64, "uint8": cdr_types.uint8, "int32": cdr_types.int32,
    "uint32": cdr_types.uint32,
}  # fmt: skip


def struct_of(kind: str, known: dict[str, Any] = {}) -> Any:  # noqa: B006 - each type once
    if kind not in known:
        within = [(name, type_of(field)) for name, field in STORE.fielddefs[kind][1]]
        known[kind] = make_dataclass(kind.replace("/", "_"), within, bases=(pycdr2.IdlStruct,))
    return known[kind]


def type_of(field: Any) -> Any:
    what, of = field
    match what:
        case Nodetype.BASE:
            return SIMPLE[of[0]]
        case Nodetype.NAME:
            return struct_of(of)
        case Nodetype.ARRAY:
            return cdr_types.array[type_of(of[0]), of[1]]
        case _:
            return cdr_types.sequence[type_of(of[0])]


def plain(message: Any) -> dict[str, Any]:
    """Every value by its place."""
    found: dict[str, Any] = {}

    def walk(where: str, value: Any) -> None:
        if isinstance(value, np.ndarray | list | tuple | bytes):
            parts = list(cast(Iterable[Any], value))
            found[where] = len(parts)
            for number, each in enumerate(parts):
                walk(f"{where}.{number}", each)
        elif is_dataclass(value):
            for each in fields(value):
                if each.name[0].islower():  # the others are constants of rosbags
                    walk(f"{where}.{each.name}", getattr(value, each.name))
        else:
            found[where] = value if isinstance(value, str) else float(value)

    walk("", message)
    return found
