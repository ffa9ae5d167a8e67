"""Vehicle files, and the physics of a rigid body under water that estimation, control and simulator
share. NED and FRD, SI units."""

from services.control.allocation import Allocated, Allocation, AllocationSettings
from services.marine.attitude import from_euler, to_body, to_euler, to_world, wrapped
from services.marine.hydrodynamics import coriolis, damping, system_inertia
from services.marine.vehicle import (
    ATMOSPHERE,
    GRAVITY,
    SEA_WATER,
    Thruster,
    Vehicle,
    total_wrench,
    wrench_per_newton,
)
from services.vehicle.actuation import share_of_voltage

__all__ = [
    "ATMOSPHERE",
    "GRAVITY",
    "SEA_WATER",
    "Allocated",
    "Allocation",
    "AllocationSettings",
    "Thruster",
    "Vehicle",
    "coriolis",
    "damping",
    "from_euler",
    "share_of_voltage",
    "system_inertia",
    "to_body",
    "to_euler",
    "to_world",
    "total_wrench",
    "wrapped",
    "wrench_per_newton",
]
