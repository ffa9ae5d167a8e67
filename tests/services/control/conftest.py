"""The two layouts that the control tests fly: four thrusters and eight."""

import pytest
from msgspec.structs import replace

from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack


@pytest.fixture(scope="session")
def pioneer() -> Vehicle:
    return Stack().section("vehicle", Vehicle)


@pytest.fixture(scope="session")
def heavy() -> Vehicle:
    """Four vectored and four vertical thrusters, weaker astern than ahead."""
    found = Stack(vehicle="bluerov2_heavy").section("vehicle", Vehicle)
    limits = {"max_reverse": 24.0, "dead_band": 0.5, "curve": "linear"}
    return replace(found, thruster=[replace(each, **limits) for each in found.thruster])
