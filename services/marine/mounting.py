"""Position and orientation of the sensors: the tables [vehicle.mounting…].

A sensor without a table is at the vehicle's origin, along its axes. The transformation of samples
is in services/vehicle/mounting.py.
"""

from math import isclose
from typing import Annotated

import msgspec

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
