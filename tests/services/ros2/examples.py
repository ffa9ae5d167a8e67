"""A message of every kind that has a place in ROS 2."""

from typing import Any

from messages import topics
from messages.health import Health, LogLine
from messages.message import Estimate, Notice
from messages.pilot import PilotCommand
from messages.sensors import (
    BatterySample,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
)
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.units import Quaternion
from messages.vehicle import Truth, VehicleStatus
from messages.video import VideoPart
from services.marine.attitude import from_euler, to_euler
from tests.support.messages import example

UTC_NS = 1_700_000_000_123_456_789
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)


def known(value: float, std: float = 0.1) -> Estimate:
    return Estimate(value, std)


def state(attitude: Quaternion = LEVEL, **more: Any) -> VehicleState:
    roll, pitch, heading = to_euler(attitude)
    values: dict[str, Any] = {
        "surge_velocity": known(0.3),
        "sway_velocity": known(-0.2),
        "north": known(4.0),
        "east": known(-7.0),
    }
    return example(
        VehicleState, 1, phase="running", depth=known(2.0, 0.05), attitude=attitude,
        depth_rate=more.pop("depth_rate", known(0.1)), roll=known(roll), pitch=known(pitch),
        heading=known(heading, 0.2), yaw_rate=known(0.5), **(values | more),
    )  # fmt: skip


HEALTH = example(
    Health, 1, service="control", lateness_p50_ms=1.0, lateness_p99_ms=2.0,
    counts={"clamped:sticks": 3},
)  # fmt: skip
EVERY: list[tuple[AnyTopic, str, Any]] = [
    (topics.IMU, "sensor/imu", ImuSample(
        stamp_ns=1, specific_force=(0.0, 0.0, -9.81), angular_rate=(0.1, 0.2, 0.3))),
    (topics.MAGNETOMETER, "sensor/magnetometer", MagnetometerSample(
        stamp_ns=1, field=(1.5e-5, 2e-6, 4.9e-5))),
    (topics.PRESSURE, "sensor/pressure", PressureSample(stamp_ns=1, pressure=121_000.0)),
    (topics.DVL, "sensor/dvl", DvlSample(stamp_ns=1, velocity=(0.3, 0.1, -0.1), std=0.01)),
    (topics.BATTERY, "sensor/battery", BatterySample(
        stamp_ns=1, voltage=15.8, current=4.0, used_wh=20.0, capacity_wh=80.0)),
    (topics.STATE, "state", state(from_euler(0.1, -0.2, 2.5))),
    (topics.TRUTH, "simulator/truth", Truth(
        stamp_ns=1, position=(1.0, 2.0, 3.0), attitude=from_euler(0.1, 0.2, -3.0),
        velocity=(0.1, 0.2, 0.3), angular_rate=(0.01, 0.02, 0.03), depth_rate=0.2, roll=0.1,
        pitch=0.2, heading=-3.0, on_floor=False)),
    (topics.PILOT_COMMAND, "pilot/command", PilotCommand(
        stamp_ns=1, surge=0.5, sway=-0.25, heave=1.0, yaw=-1.0, tilt=-1.0)),
    (topics.STATUS, "vehicle/status", VehicleStatus(
        stamp_ns=1, activity="piloted", armed=True, failsafe="leak", conditions=("leak",),
        pilot="ann", reaction="ascend", returns="resume", acting=(Notice("failsafe:leak"),))),
    (topics.HEALTH, "health/control", HEALTH),
    (topics.LOG, "log/control", LogLine(
        stamp_ns=1, service="control", level="warning", text="späte Zeile")),
    (topics.VIDEO, "camera/video", VideoPart(
        stamp_ns=1, picture=1, keyframe=True, width=640, height=480, captured_ns=1, encoded_ns=1,
        budget_kbit=100.0, data=b"\0\0\0\1picture")),
]  # fmt: skip
