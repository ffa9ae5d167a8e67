"""Position and orientation of the sensors: the tables [vehicle.mounting…].

A sensor without a table is at the vehicle's origin, along its axes. The transformation of samples
is in services/vehicle/mounting.py.

What the sensors read wrongly, as measured: the table [vehicle.calibration].

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

from math import isclose, pi
from typing import Annotated

import msgspec

from messages.units import Vec3
from services.marine.attitude import cross, dot

Component = Annotated[float, msgspec.Meta(ge=-1.01, le=1.01)]  # [-] of a direction
Metres = Annotated[float, msgspec.Meta(ge=-100.0, le=100.0)]  # [m] no vehicle is larger
RotationRow = tuple[Component, Component, Component]
Rotation = tuple[RotationRow, RotationRow, RotationRow]  # R_BS, see Mount
Arm = tuple[Metres, Metres, Metres]

ALONG: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ORIGIN: Arm = (0.0, 0.0, 0.0)
TOLERANCE = 1e-3  # [-] of lengths, angles and the determinant; files have three digits


class Turned(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Orientation of a sensor.

    Raises:
        ValueError: the matrix is no rotation.
    """

    # [-] R_BS, from the sensor's axes to the body's: v_B = R_BS v_S. Its columns are the sensor's
    # axes in body coordinates (forward, starboard, down).
    rotation: Rotation = ALONG

    def __post_init__(self) -> None:
        a, b, c = self.rotation
        unit = all(isclose(dot(row, row), 1.0, abs_tol=TOLERANCE) for row in (a, b, c))
        square = all(abs(dot(p, q)) <= TOLERANCE for p, q in ((a, b), (b, c), (c, a)))
        determinant = dot(a, cross(b, c))
        if not unit or not square or abs(determinant - 1.0) > 2 * TOLERANCE:
            raise ValueError(
                f"rotation is no rotation: its rows must have length 1 and be at right angles, to "
                f"within {TOLERANCE:g}, and its determinant must be +1, found {determinant:.3f}"
            )


class Placed(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Position of a sensor."""

    position: Arm = ORIGIN  # [m] FRD, from the vehicle's origin


class Mount(Turned, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Position and orientation of a sensor."""

    position: Arm = ORIGIN  # [m] FRD, from the vehicle's origin


class ImuMount(Mount, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Position and orientation of the IMU."""

    # [m] 1σ of that position: in a turn, an IMU elsewhere feels another acceleration. The default
    # was tuned on real dives whose files name none, range 0.01 … 0.04.
    position_std: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.02


class Mounting(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All sensors. The magnetic field is uniform within the vehicle; pressure, an acoustic fix and
    an altitude, which is vertical, have no axes."""

    imu: ImuMount = ImuMount()
    magnetometer: Turned = Turned()
    pressure: Placed = Placed()  # must be under water when the vehicle floats
    dvl: Mount = Mount()
    usbl: Placed = Placed()
    altimeter: Placed = Placed()


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
