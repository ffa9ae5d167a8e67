"""What is wrong with the sensors, beyond noise and biases drawn by the seed: known errors, to see
what estimation makes of them and what `lindy calibrate` finds.

    accelerometer   f' = scale f + offset, axis by axis
    gyroscope       ω' = ω + offset
    magnetometer    m' = S m + offset: soft iron and hard iron
    pressure        p' = p + offset

All in the sensor's own axes. The thrusters shake the IMU: white noise at its rate, as tones above
it appear once they are sampled, in proportion to the mean of |thrust| / limit.
"""

from typing import Annotated

import msgspec

from messages.units import Vec3

Force = Annotated[float, msgspec.Meta(ge=-5.0, le=5.0)]  # [m/s²]
Rate = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # [rad/s]
Iron = Annotated[float, msgspec.Meta(ge=-1e-4, le=1e-4)]  # [T]
Scale = Annotated[float, msgspec.Meta(ge=0.5, le=2.0)]  # [-]
IronPart = Annotated[float, msgspec.Meta(ge=-2.0, le=2.0)]  # [-]
SoftIronRow = tuple[IronPart, IronPart, IronPart]
SoftIron = tuple[SoftIronRow, SoftIronRow, SoftIronRow]
NONE = (0.0, 0.0, 0.0)


class SensorErrors(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [simulator.sensor_errors]."""

    accelerometer_offset: tuple[Force, Force, Force] = NONE  # [m/s²]
    accelerometer_scale: tuple[Scale, Scale, Scale] = (1.0, 1.0, 1.0)  # [-]
    gyro_offset: tuple[Rate, Rate, Rate] = NONE  # [rad/s]
    hard_iron: tuple[Iron, Iron, Iron] = NONE  # [T]
    soft_iron: SoftIron = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # [-]
    pressure_offset: Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)] = 0.0  # [Pa]

    def force(self, f: Vec3) -> Vec3:
        """[m/s²] As the accelerometer reads it."""
        (a, b, c), (x, y, z) = self.accelerometer_scale, self.accelerometer_offset
        return a * f[0] + x, b * f[1] + y, c * f[2] + z

    def rate(self, omega: Vec3) -> Vec3:
        """[rad/s] As the gyroscope reads it."""
        x, y, z = self.gyro_offset
        return omega[0] + x, omega[1] + y, omega[2] + z

    def field(self, m: Vec3) -> Vec3:
        """[T] As the magnetometer reads it."""
        a, b, c = m
        x, y, z = (row[0] * a + row[1] * b + row[2] * c for row in self.soft_iron)
        hx, hy, hz = self.hard_iron
        return x + hx, y + hy, z + hz


class Vibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [simulator.vibration]: of the IMU, with every thruster at its limit."""

    force: Annotated[float, msgspec.Meta(ge=0.0, le=50.0)] = 0.0  # [m/s²] 1σ per axis and sample
    rate: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = 0.0  # [rad/s] 1σ per axis and sample
