"""Density of water against the published check values of EOS-80, and its names."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from services.marine.vehicle import SEA_WATER
from services.marine.water import Density, density, density_of

decode: Callable[..., Any] = msgspec.toml.decode


# UNESCO technical papers in marine science 36 (1981), at atmospheric pressure.
@pytest.mark.parametrize(
    ("temperature", "salinity", "expected"),
    [(5.0, 0.0, 999.96675), (25.0, 0.0, 997.04796), (5.0, 35.0, 1027.67547),
     (25.0, 35.0, 1023.34306)],
)  # fmt: skip
def test_density_is_that_of_the_published_check_values(
    temperature: float, salinity: float, expected: float
):
    assert density(temperature, salinity) == pytest.approx(expected, abs=1e-5)


def test_fresh_water_is_heaviest_at_four_degrees():
    tenths = [temperature / 10.0 for temperature in range(100)]
    assert max(tenths, key=lambda t: density(t, 0.0)) == pytest.approx(4.0, abs=0.05)


def test_salt_makes_water_heavier():
    weights = [density(10.0, salinity) for salinity in (0.0, 7.0, 20.0, 35.0, 42.0)]
    assert weights == sorted(weights)


class Place(msgspec.Struct):
    water_density: Density


@pytest.mark.parametrize(
    ("text", "expected"),
    [("1010.0", 1010.0), ('"fresh"', 1000.0), ('"sea"', SEA_WATER),
     ("{ temperature = 5.0, salinity = 35.0 }", density(5.0, 35.0))],
)  # fmt: skip
def test_a_vehicle_file_may_say_it_in_each_way(text: str, expected: float):
    place = decode(f"water_density = {text}", type=Place)
    assert density_of(place.water_density) == expected


@pytest.mark.parametrize(
    "text", ["500.0", "nan", '"salty"', "{ temperature = 5.0 }",
             "{ temperature = 50.0, salinity = 35.0 }", "{ temperature = 5.0, salinity = -1.0 }"],
)  # fmt: skip
def test_what_is_no_water_is_refused(text: str):
    with pytest.raises(msgspec.ValidationError):
        decode(f"water_density = {text}", type=Place)
