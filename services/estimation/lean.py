"""What is said to depth: how the accelerometer lies in the world, and how fast the vehicle is."""

from typing import NamedTuple

from messages.units import Vec3

MOVING_STD = 0.7  # [m/s] of each horizontal velocity under way, where nothing else is known


class Lean(NamedTuple):
    """By the estimated attitude, at one instant. Its yaw is the control heading."""

    forward: Vec3 = (1.0, 0.0, 0.0)  # [-] the body's forward axis along north, east, down
    starboard: Vec3 = (0.0, 1.0, 0.0)  # [-]
    force: tuple[float, float] = (0.0, 0.0)  # [m/s²] specific force along north and east
    levelled: tuple[float, float] = (0.0, 0.0)  # [rad] turn by which it has corrected the attitude
    tilt_std: float = 0.0  # [rad] of the attitude, as far as its own filter knows
    # [m/s] velocity along north and east to be expected, and the error of each: mostly slow.
    velocity: tuple[float, float] = (0.0, 0.0)
    velocity_std: float = MOVING_STD


LEVEL = Lean()
