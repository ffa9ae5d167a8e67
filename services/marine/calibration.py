"""What the sensors read wrongly, as measured: the table [vehicle.calibration].

    accelerometer   f = scale (f' - bias), axis by axis
    gyroscope       ω = ω' - bias
    magnetometer    m = S (m' - bias): hard iron and soft iron
    pressure        p = p' - offset
    DVL             v = scale v'

A compass points to magnetic north, positions and maps are by true north: with `declination` the
field is turned about the vertical, and every north of the drone is the true one.

All in the sensor's own axes, before its mounting. `lindy calibrate` finds the numbers. A vehicle
without this table has sensors that are right but for what each dive's own calibration finds.
"""

from math import pi
from typing import Annotated

import msgspec

from messages.units import Vec3

ForceBias = Annotated[float, msgspec.Meta(ge=-5.0, le=5.0)]  # [m/s²]
RateBias = Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)]  # [rad/s]
FieldBias = Annotated[float, msgspec.Meta(ge=-5e-4, le=5e-4)]  # [T]
ScaleFactor = Annotated[float, msgspec.Meta(ge=0.5, le=2.0)]  # [-]
IronShare = Annotated[float, msgspec.Meta(ge=-3.0, le=3.0)]  # [-]
IronRow = tuple[IronShare, IronShare, IronShare]
IronMatrix = tuple[IronRow, IronRow, IronRow]
NO_BIAS = (0.0, 0.0, 0.0)
NO_SCALE = (1.0, 1.0, 1.0)
NO_IRON: IronMatrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class SensorCalibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Corrections of raw samples, applied in services/vehicle/mounting.py."""

    accelerometer_bias: tuple[ForceBias, ForceBias, ForceBias] = NO_BIAS  # [m/s²]
    accelerometer_scale: tuple[ScaleFactor, ScaleFactor, ScaleFactor] = NO_SCALE  # [-]
    gyro_bias: tuple[RateBias, RateBias, RateBias] = NO_BIAS  # [rad/s]
    magnetometer_bias: tuple[FieldBias, FieldBias, FieldBias] = NO_BIAS  # [T]
    magnetometer_matrix: IronMatrix = NO_IRON  # [-] S
    # [rad] of magnetic north from true north where the drone dives, + to the east; 0: headings are
    # by magnetic north, and a place by the map is missed by this angle.
    declination: Annotated[float, msgspec.Meta(ge=-pi, le=pi)] = 0.0
    pressure_offset: Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)] = 0.0  # [Pa]
    dvl_scale: ScaleFactor = 1.0  # [-]

    def field(self, measured: Vec3) -> Vec3:
        """[T] Of a raw one [T]."""
        (a, b, c), (x, y, z) = measured, self.magnetometer_bias
        a, b, c = a - x, b - y, c - z
        u, v, w = (row[0] * a + row[1] * b + row[2] * c for row in self.magnetometer_matrix)
        return u, v, w
