"""What the horizontal observer takes from attitude and depth, and the change to north."""

from math import cos, sin
from typing import NamedTuple

from messages.units import Quaternion, Vec3
from services.estimation.attitude.heading import horizontal
from services.estimation.horizontal.horizontal_filter import Pair


class VehicleMotion(NamedTuple):
    """Estimates of the other filters at one instant."""

    attitude: Quaternion  # q_NB, yaw is the control heading
    offset: float | None  # [rad] north heading minus control heading; None: unknown
    heading_std: float  # [rad] of the heading from north
    specific_force: Vec3 | None  # [m/s²] FRD; None: IMU silent
    yaw_rate: float = 0.0  # [rad/s]
    depth_rate: float = 0.0  # [m/s]
    depth_rate_std: float = 0.0  # [m/s]


def to_north(attitude: Quaternion, offset: float, v: Vec3) -> Pair:
    """North and east components of a body vector, for an attitude whose yaw is the control heading;
    `offset` [rad]: north heading minus control heading."""
    n, e = horizontal(attitude, v)
    c, s = cos(offset), sin(offset)
    return n * c - e * s, n * s + e * c


def from_north(attitude: Quaternion, offset: float) -> Quaternion:
    """The same attitude with its yaw counted from north."""
    w, x, y, z = attitude
    c, s = cos(offset / 2.0), sin(offset / 2.0)
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w
