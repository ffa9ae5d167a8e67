"""The table [simulator.hull]: what is different in the water from what the vehicle file says.

The drone knows the vehicle file only, and flies a vehicle that it does not quite describe, as in
reality. Its thrusters are then without feedback: actuation reports what the file's model expects.
"""

from typing import Annotated

import msgspec
from msgspec.structs import replace

from messages.units import FiniteSetting, Positive, Quaternion, Vec6
from services.marine.attitude import down_in_body
from services.marine.vehicle import GRAVITY, Diagonal, Vehicle

ThrustScale = Annotated[float, msgspec.Meta(ge=0.01, le=100.0)]  # [-]
Shift = Annotated[float, msgspec.Meta(ge=-0.5, le=0.5)]  # [m]
NOWHERE = (0.0, 0.0, 0.0)


class Hull(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Keys as in [vehicle]; those that are left out are as in the vehicle file."""

    mass: Positive | None = None  # [kg]
    net_buoyancy: FiniteSetting | None = None  # [N]
    inertia: tuple[Positive, Positive, Positive] | None = None  # [kg m²]
    added_mass: Diagonal | None = None  # [kg, kg m²]
    linear_damping: Diagonal | None = None  # [N s/m, N m s/rad]
    quadratic_damping: Diagonal | None = None  # [N s²/m², N m s²/rad²]
    time_constant: Positive | None = None  # [s] first-order lag of every thruster
    thrust_scale: ThrustScale = 1.0  # [-] real thrust over that of the vehicle file
    # [m] FRD, of the centre of gravity from where the vehicle file has it.
    gravity_shift: tuple[Shift, Shift, Shift] = NOWHERE


def in_the_water(vehicle: Vehicle, hull: Hull | None) -> Vehicle:
    """The vehicle as it really is, but for the scale of its thrust."""
    if hull is None:
        return vehicle
    thrusters = vehicle.thruster
    if (lag := hull.time_constant) is not None:
        thrusters = [replace(thruster, time_constant=lag, lag=None) for thruster in thrusters]
    names = (
        "mass", "net_buoyancy", "inertia", "added_mass", "linear_damping", "quadratic_damping",
    )  # fmt: skip
    given = {name: getattr(hull, name) for name in names if getattr(hull, name) is not None}
    return replace(vehicle, thruster=thrusters, **given)


def lean(vehicle: Vehicle, hull: Hull, q_NB: Quaternion) -> Vec6:
    """[N, N m] The moment of a weight that acts elsewhere than in the vehicle file: r_g of Fossen
    2011, eq. 4.6. The inertia stays about the file's centre of gravity, because a shift of
    centimetres changes it little."""
    x, y, z = (vehicle.mass * GRAVITY * shift for shift in hull.gravity_shift)
    a, b, c = down_in_body(q_NB)
    return 0.0, 0.0, 0.0, y * c - z * b, z * a - x * c, x * b - y * a
