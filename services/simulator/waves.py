"""Waves: one regular wave of small height in deep water (Airy's theory).

Surface elevation, dynamic pressure and the motion of the water (Faltinsen 1990, *Sea Loads on Ships
and Offshore Structures*, table 2.1, deep water; k = ω² / g). Deep is more than half a wavelength,
12 m for a wave of 4 s; where the water is shallower, less of a real wave is lost with depth.
"""

from math import cos, exp, pi, sin
from typing import Annotated, NamedTuple

import msgspec

from messages.units import Vec3
from services.marine.vehicle import GRAVITY

STEEPEST = 0.142  # [-] height over length; a steeper wave breaks (Michell 1893)


class Waves(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [simulator.waves].

    Raises:
        ValueError: so steep that it would break.
    """

    height: Annotated[float, msgspec.Meta(gt=0.0, le=20.0)]  # [m] from trough to crest
    period: Annotated[float, msgspec.Meta(ge=0.5, le=30.0)]  # [s]
    heading: Annotated[float, msgspec.Meta(ge=-6.3, le=6.3)] = 0.0  # [rad] where it runs to
    moves_hull: bool = True  # the water carries the hull along; false: held against it
    begins: Annotated[float, msgspec.Meta(ge=0.0, le=1e5)] = 0.0  # [s] calm before, as to calibrate

    def __post_init__(self) -> None:
        most = STEEPEST * 2.0 * pi / wave_number(self.period)
        if self.height > most:
            raise ValueError(
                f"height: a wave of {self.period:g} s breaks beyond {most:.2f} m, found "
                f"{self.height:g} m"
            )


class WaveMotion(NamedTuple):
    """The wave's own motion at one place."""

    rise: float  # [m] of the surfaces of equal pressure; at depth 0 of the water's surface
    velocity: Vec3  # [m/s] NED
    acceleration: Vec3  # [m/s²] NED


def wave_number(period: float) -> float:
    """[1/m] k = ω² / g of a wave of this period [s] in deep water."""
    return (2.0 * pi / period) ** 2 / GRAVITY


def water_at(waves: Waves, seconds: float, position: Vec3) -> WaveMotion:
    """The wave `seconds` after the start at a position [m] NED; in the air as at the surface."""
    after = seconds - waves.begins
    omega, k = 2.0 * pi / waves.period, wave_number(waves.period)
    x, y, depth = position
    north, east = cos(waves.heading), sin(waves.heading)
    phase = omega * after - k * (north * x + east * y)
    grown = max(0.0, min(1.0, after / waves.period))  # [-] over the first period
    size = 0.5 * grown * waves.height * exp(-k * max(0.0, depth))  # [m] radius of the orbit
    s, c = size * sin(phase), size * cos(phase)
    along, down = omega * s, -omega * c  # velocity
    forward, sinking = omega * omega * c, omega * omega * s  # acceleration
    return WaveMotion(
        s, (along * north, along * east, down), (forward * north, forward * east, sinking)
    )
