"""What depth is told: how the vehicle's axes lie in the world, and how fast it is."""

from typing import NamedTuple

from messages.units import Vec3
from services.vehicle.mounting import cross

MOVING_STD = 0.7  # [m/s] of each horizontal velocity under way, where nothing else is known


class AttitudeAxes(NamedTuple):
    """By the estimated attitude, at one instant. Its yaw is the control heading."""

    forward: Vec3 = (1.0, 0.0, 0.0)  # [-] the body's forward axis along north, east, down
    starboard: Vec3 = (0.0, 1.0, 0.0)  # [-]
    force: tuple[float, float] = (0.0, 0.0)  # [m/s²] specific force along north and east
    levelled: tuple[float, float] = (0.0, 0.0)  # [rad] turn by which it has corrected the attitude
    acceleration: float = 0.0  # [m/s²] along down, by the accelerometer, its bias included
    tilt_std: float = 0.0  # [rad] of the attitude, as far as its own filter knows
    noise: float = 0.0  # [m²/s³] spectral density of the accelerometer's vibration now
    # [m/s] velocity along north and east to be expected, and the error of each: mostly slow.
    velocity: tuple[float, float] = (0.0, 0.0)
    velocity_std: float = MOVING_STD

    @property
    def down(self) -> Vec3:
        """[-] The body's down axis along north, east, down."""
        return cross(self.forward, self.starboard)


LEVEL = AttitudeAxes()
