"""The table [simulator.hull]: what is different in the water from what the vehicle file says.

The drone knows the vehicle file only, and flies a vehicle that it does not quite describe, as in
reality. Its thrusters are then without feedback: actuation reports what the file's model expects.
"""

from typing import Annotated

import msgspec
from msgspec.structs import replace

from messages.units import FiniteSetting, Positive
from services.marine.vehicle import Diagonal, Vehicle

ThrustScale = Annotated[float, msgspec.Meta(ge=0.01, le=100.0)]  # [-]


class Hull(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Keys as in [vehicle]; those that are left out are as in the vehicle file."""

    mass: Positive | None = None  # [kg]
    net_buoyancy: FiniteSetting | None = None  # [N]
    added_mass: Diagonal | None = None  # [kg, kg m²]
    linear_damping: Diagonal | None = None  # [N s/m, N m s/rad]
    quadratic_damping: Diagonal | None = None  # [N s²/m², N m s²/rad²]
    time_constant: Positive | None = None  # [s] first-order lag of every thruster
    thrust_scale: ThrustScale = 1.0  # [-] real thrust over that of the vehicle file


def in_the_water(vehicle: Vehicle, hull: Hull | None) -> Vehicle:
    """The vehicle as it really is, but for the scale of its thrust."""
    if hull is None:
        return vehicle
    thrusters = vehicle.thruster
    if (lag := hull.time_constant) is not None:
        thrusters = [replace(thruster, time_constant=lag, lag=None) for thruster in thrusters]
    names = ("mass", "net_buoyancy", "added_mass", "linear_damping", "quadratic_damping")
    given = {name: getattr(hull, name) for name in names if getattr(hull, name) is not None}
    return replace(vehicle, thruster=thrusters, **given)
