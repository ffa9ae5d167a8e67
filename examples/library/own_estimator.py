"""An estimator of one's own: a complementary filter for the attitude, an alpha-beta filter for the
depth. Rest at the surface is needed for the first seconds; heading counts from there."""

from dataclasses import dataclass, field
from math import atan2, cos, hypot, sin, tan

import msgspec

from lindy.api.messages import Estimate, ImuSample, PressureSample, VehicleState, topics
from lindy.api.service import Node, Stack
from lindy.api.vehicle import GRAVITY, SEA_WATER, Vehicle, from_euler, to_world


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    tilt: float = 0.5  # [1/s] how fast gravity corrects roll and pitch
    alpha: float = 0.15  # [-] of a pressure sample, for the depth
    beta: float = 0.15  # [1/s] for its rate


@dataclass(slots=True)
class Observer:
    rest: int  # IMU samples of rest still to go
    floating: float  # [m] depth of the origin, afloat
    s: Settings
    bias: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [rad/s]
    air: float = 0.0  # [Pa] at the surface
    angles: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [rad]
    depth: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [m, m/s, m/s²]
    before_ns: int = 0

    def pressure(self, sample: PressureSample, _: int) -> None:
        down = SEA_WATER * GRAVITY
        if self.rest > 0:
            self.air, self.depth[0] = sample.pressure - down * self.floating, self.floating
        gap = (sample.pressure - self.air) / down - self.depth[0]
        self.depth[0] += self.s.alpha * gap
        self.depth[1] += self.s.beta * gap

    def imu(self, sample: ImuSample) -> VehicleState:
        dt = min(0.1, (sample.stamp_ns - self.before_ns) * 1e-9)
        self.before_ns, (fx, fy, fz) = sample.stamp_ns, sample.specific_force
        p, q, r = (w - b for w, b in zip(sample.angular_rate, self.bias, strict=True))
        if self.rest > 0:
            self.rest -= 1
            self.bias = [b + w / 100 for b, w in zip(self.bias, (p, q, r), strict=True)]
        roll, pitch, yaw = self.angles
        level = atan2(-fy, -fz), atan2(fx, hypot(fy, fz))  # where gravity says that down is
        turn = q * sin(roll) + r * cos(roll)
        self.angles = [
            roll + dt * (p + tan(pitch) * turn + self.s.tilt * (level[0] - roll)),
            pitch + dt * (q * cos(roll) - r * sin(roll) + self.s.tilt * (level[1] - pitch)),
            yaw + dt * turn / cos(pitch),
        ]
        attitude = from_euler(*self.angles)
        x, v, _ = self.depth
        a = to_world(attitude, sample.specific_force)[2] + GRAVITY
        self.depth = [x + dt * v, v + dt * a, a] if self.rest <= 0 else [x, 0.0, 0.0]
        depth, rate, felt = (Estimate(value, 0.02, valid=True) for value in self.depth)
        roll, pitch, heading = (Estimate(value, 0.02, valid=True) for value in self.angles)
        return VehicleState(
            stamp_ns=sample.stamp_ns, sensor_ns=sample.stamp_ns,
            phase="calibrating" if self.rest > 0 else "running",
            depth=depth, depth_rate=rate, depth_acceleration=felt, attitude=attitude, roll=roll,
            pitch=pitch, heading=heading, heading_navigation=None,
            yaw_rate=Estimate(r, 0.01, valid=True),
        )  # fmt: skip


def wire(node: Node, stack: Stack) -> None:
    floating = stack.section("vehicle", Vehicle).floating_depth
    observer = Observer(300, floating, stack.section(node.name, Settings))
    states = node.publisher(topics.STATE)

    def on_imu(sample: ImuSample | None, _: int) -> None:
        if sample is not None:  # None: it is silent, which the failsafes see
            states.put(observer.imu(sample))

    node.each(topics.PRESSURE, observer.pressure)
    node.trigger(topics.IMU, on_imu, 0.05)
