"""What is wrong with the sensors, beyond noise and biases drawn by the seed: known errors, to see
what estimation makes of them and what `lindy calibrate` finds.

    accelerometer   f' = scale f + offset, axis by axis
    gyroscope       ω' = ω + offset
    magnetometer    m' = S m + offset: soft iron and hard iron
    pressure        p' = p + offset

All in the sensor's own axes.
"""

from typing import Annotated

import msgspec

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
