"""The two layouts that the control tests fly: four thrusters and eight."""

import pytest

from messages.units import Vec3
from services.marine.vehicle import Thruster, Vehicle
from services.runtime.config.stack import Stack

SLANT = 0.5**0.5


def thruster(name: str, position: Vec3, direction: Vec3) -> Thruster:
    return Thruster(
        name=name,
        position=position,
        direction=direction,
        max_thrust=30.4,
        max_reverse=24.0,
        dead_band=0.5,
        time_constant=0.07,
    )


@pytest.fixture(scope="session")
def pioneer() -> Vehicle:
    return Stack().section("vehicle", Vehicle)


@pytest.fixture(scope="session")
def heavy() -> Vehicle:
    """A BlueROV2 Heavy after von Benzon et al. 2022 (doi 10.3390/jmse10121898): four vectored
    and four vertical thrusters. Reverse limit and dead-band are assumed."""
    corners = (("front_left", 1, -1), ("front_right", 1, 1))
    corners += (("rear_left", -1, -1), ("rear_right", -1, 1))
    flat = [
        thruster(f"flat_{name}", (0.156 * x, 0.111 * y, 0.085), (SLANT, -x * y * SLANT, 0.0))
        for name, x, y in corners
    ]
    vertical = [
        thruster(f"vertical_{name}", (0.12 * x, 0.218 * y, 0.0), (0.0, 0.0, 1.0))
        for name, x, y in corners
    ]
    return Vehicle(
        name="BlueROV2 Heavy",
        mass=13.5,
        net_buoyancy=2.0,
        inertia=(0.26, 0.23, 0.37),
        added_mass=(6.36, 7.12, 18.68, 0.189, 0.135, 0.222),
        linear_damping=(13.7, 0.0, 33.0, 0.0, 0.8, 0.0),
        quadratic_damping=(141.0, 217.0, 190.0, 1.19, 0.47, 1.5),
        metacentric_height=0.01,
        size=(0.457, 0.575, 0.254),
        thruster=[*flat, *vertical],
    )
