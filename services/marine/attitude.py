"""Unit quaternions q_NB as (w, x, y, z), scalar first: the body's (FRD) attitude in NED.

Plain floats instead of arrays: at three or four numbers NumPy costs ten times the arithmetic.
Source of all: Fossen 2011, §2.2.
"""

from collections.abc import Sequence
from math import asin, atan2, cos, hypot, pi, remainder, sin, sqrt, tau

from messages.state import VehicleState
from messages.units import Quaternion, Vec3

LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
LEAST_UPRIGHT = 0.5  # [-] of the body's down axis that is vertical: at most 60 deg of tilt


def from_euler(roll: float, pitch: float, heading: float) -> Quaternion:
    """Roll, pitch and heading [rad], turned about z, then y, then x (Fossen 2011, §2.2.1)."""
    cr, sr = cos(roll / 2), sin(roll / 2)
    cp, sp = cos(pitch / 2), sin(pitch / 2)
    ch, sh = cos(heading / 2), sin(heading / 2)
    return (
        cr * cp * ch + sr * sp * sh,
        sr * cp * ch - cr * sp * sh,
        cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    )


def to_euler(q_NB: Quaternion) -> Vec3:
    """Roll, pitch and heading [rad]. At ±90° of pitch roll and heading are not defined apart."""
    w, x, y, z = q_NB
    roll = atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = asin(max(-1.0, min(1.0, 2 * (w * y - x * z))))  # rounding may pass 1 by 1e-16
    return roll, pitch, heading_of(q_NB)


def heading_of(q_NB: Quaternion) -> float:
    """[rad] −π … π, not defined at ±90° of pitch."""
    w, x, y, z = q_NB
    return atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def normalised(q_NB: Quaternion) -> Quaternion:
    """The same attitude with length 1; integration changes the length by rounding."""
    w, x, y, z = q_NB
    length = sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length


def to_world(q_NB: Quaternion, v_B: Vec3) -> Vec3:
    """v_N = R_NB v_B (Fossen 2011, §2.2.2, written as v + 2 ε × (ε × v + w v))."""
    w, x, y, z = q_NB
    a, b, c = v_B
    s = y * c - z * b + w * a
    t = z * a - x * c + w * b
    u = x * b - y * a + w * c
    return a + 2 * (y * u - z * t), b + 2 * (z * s - x * u), c + 2 * (x * t - y * s)


def to_body(q_NB: Quaternion, v_N: Vec3) -> Vec3:
    """v_B = R_BN v_N, the inverse of `to_world`."""
    w, x, y, z = q_NB
    return to_world((w, -x, -y, -z), v_N)


def down_in_body(q_NB: Quaternion) -> Vec3:
    """The world's down axis in body axes: the last row of R_NB. (0, 0, 1) when level."""
    w, x, y, z = q_NB
    return 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


def level_velocity(state: VehicleState) -> tuple[float, float] | None:
    """[m/s] The horizontal velocity over the ground: ahead, as the heading points, and to
    starboard of it. None where surge or sway is not valid, or the vehicle tilts by over 60°.

    With a, b, c the down axis in the body, sin θ = -a, h = cos θ, sin φ = b / h and cos φ = c / h:
    surge and sway are the first two parts of R_BN v_N (Fossen 2011, §2.2.1), solved for ahead and
    starboard. A depth rate that is not valid counts as zero.
    """
    surge, sway, rate = state.surge_velocity, state.sway_velocity, state.depth_rate
    if surge is None or sway is None or not (surge.valid and sway.valid):
        return None
    a, b, c = down_in_body(state.attitude)
    if c < LEAST_UPRIGHT:
        return None
    down, h = rate.value if rate.valid else 0.0, hypot(b, c)
    ahead = (surge.value - a * down) / h
    return ahead, (h * (sway.value - b * down) + a * b * ahead) / c


def north_offset(state: VehicleState) -> float:
    """[rad] North heading minus control heading; 0 without a compass, where estimation counts the
    control heading from north too."""
    if state.heading_navigation is None:
        return 0.0
    return wrapped(state.heading_navigation.value - state.heading.value)


def from_north(state: VehicleState) -> Quaternion:
    """q_NB whose heading is counted from north, as the position is."""
    return yawed(state.attitude, north_offset(state))


def yawed(q_NB: Quaternion, angle: float) -> Quaternion:
    """Turned by `angle` [rad] about the world's down."""
    c, s = cos(angle / 2.0), sin(angle / 2.0)
    w, x, y, z = q_NB
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def turned(vector: tuple[float, float], angle: float) -> tuple[float, float]:
    """A horizontal vector rotated clockwise seen from above: body to NED by the heading [rad]."""
    x, y = vector
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


def plus(a: Vec3, b: Sequence[float]) -> Vec3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec3, b: Vec3) -> Vec3:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def attitude_rate(q_NB: Quaternion, rate_B: Vec3) -> Quaternion:
    """dq/dt [1/s] for a body angular rate [rad/s]: half of q ⊗ ω (Fossen 2011, §2.2.2)."""
    w, x, y, z = q_NB
    p, q, r = rate_B
    return (
        -0.5 * (x * p + y * q + z * r),
        0.5 * (w * p + y * r - z * q),
        0.5 * (w * q + z * p - x * r),
        0.5 * (w * r + x * q - y * p),
    )


def tilt(q_NB: Quaternion) -> float:
    """[rad] Angle between the body's and the world's down axis, 0 … π."""
    a, b, c = down_in_body(q_NB)
    return atan2(hypot(a, b), c)


def whole_turns(heading: float) -> int:
    """In an accumulated heading [rad], + clockwise: the drone's since its start, the tether's."""
    return round(heading / tau)


def wrapped(angle: float) -> float:
    """The same direction in (−π, π] [rad]."""
    turned = remainder(angle, tau)
    return pi if turned == -pi else turned
