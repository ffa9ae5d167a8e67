"""Density of water."""

from math import sqrt
from typing import Annotated, Literal

import msgspec

from services.marine.vehicle import SEA_WATER

FRESH_WATER = 1000.0  # [kg/m³]


class Water(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Temperature and salinity; the limits are those of the formula."""

    temperature: Annotated[float, msgspec.Meta(ge=-2.0, le=40.0)]  # [°C]
    salinity: Annotated[float, msgspec.Meta(ge=0.0, le=42.0)]  # [-] practical; the ocean's is 35


# Setting in a vehicle file: [kg/m³], a name, or { temperature = 8.0, salinity = 20.0 }.
Density = Annotated[float, msgspec.Meta(ge=900.0, le=1300.0)] | Literal["fresh", "sea"] | Water


def density_of(water: Density) -> float:
    """[kg/m³]"""
    if isinstance(water, Water):
        return density(water.temperature, water.salinity)
    if water == "fresh":
        return FRESH_WATER
    return SEA_WATER if water == "sea" else water


def density(temperature: float, salinity: float) -> float:
    """[kg/m³] At atmospheric pressure, by the international equation of state EOS-80.

    Compression, 0.05 % per hundred metres of depth, is neglected.

    Source: Fofonoff and Millard 1983, UNESCO technical papers in marine science 44, after
    Millero and Poisson 1981. Within 0.004 kg/m³ for 0 to 40 °C and 0 to 42 of salinity.

    Args:
        temperature: [°C]
        salinity: [-] practical salinity, 0 or more.
    """
    t, s = temperature, salinity
    pure = 999.842594 + t * (
        6.793952e-2 + t * (-9.095290e-3 + t * (1.001685e-4 + t * (-1.120083e-6 + t * 6.536332e-9)))
    )
    a = 8.24493e-1 + t * (-4.0899e-3 + t * (7.6438e-5 + t * (-8.2467e-7 + t * 5.3875e-9)))
    b = -5.72466e-3 + t * (1.0227e-4 - t * 1.6546e-6)
    return pure + s * (a + b * sqrt(s) + s * 4.8314e-4)
