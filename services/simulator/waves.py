"""Waves: a sum of regular waves of small height in deep water (Airy's theory), so a sea state.

Each line of the spectrum: surface elevation, dynamic pressure and motion of the water (Faltinsen
1990, *Sea Loads on Ships and Offshore Structures*, table 2.1, deep water; k = ω² / g). Deep is more
than half a wavelength, 12 m for a wave of 4 s; where the water is shallower, less of a real wave is
lost with depth.

The spectrum is JONSWAP's (Hasselmann et al. 1973; Faltinsen 1990, §2.2):

    S(ω) ∝ ω⁻⁵ exp(−5/4 (ω/ω_p)⁻⁴) γ^exp(−(ω/ω_p − 1)² / 2σ²),   σ = 0.07 below ω_p, else 0.09

scaled so that the surface has the standard deviation of a quarter of the significant height. One
line alone is a regular wave, whose significant height is its height from trough to crest.
"""

from math import cos, exp, log, pi, sin, sqrt
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from messages.units import Vec3
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY
from services.simulator.streams import WAVES

# [-] significant height over the length of a wave of the peak's period: a sea does not get steeper
# (DNV-RP-C205, §3.5.4, up to 8 s); a regular wave breaks (Michell 1893).
STEEPEST, STEEPEST_REGULAR = 1.0 / 15.0, 0.142
LEAST_RATE, MOST_RATE = 0.6, 3.0  # [-] of the peak's: 98 % of the spectrum lies between them


class Waves(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [simulator.waves].

    Raises:
        ValueError: so steep that it would break.
    """

    height: Annotated[float, msgspec.Meta(gt=0.0, le=20.0)]  # [m] significant, trough to crest
    period: Annotated[float, msgspec.Meta(ge=0.5, le=30.0)]  # [s] of the spectrum's peak
    lines: Annotated[int, msgspec.Meta(ge=1, le=200)] = 40  # of the spectrum; 1: a regular wave
    peak: Annotated[float, msgspec.Meta(ge=1.0, le=7.0)] = 3.3  # [-] γ; 1: a fully developed sea
    heading: Annotated[float, msgspec.Meta(ge=-6.3, le=6.3)] = 0.0  # [rad] where they run to
    spread: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.0  # [rad] 1σ of the lines' headings
    begins: Annotated[float, msgspec.Meta(ge=0.0, le=1e5)] = 0.0  # [s] calm before, as to calibrate

    def __post_init__(self) -> None:
        steepest = STEEPEST_REGULAR if self.lines == 1 else STEEPEST
        most = steepest * 2.0 * pi / wave_number(2.0 * pi / self.period)
        if self.height > most:
            raise ValueError(
                f"height: waves of {self.period:g} s break beyond {most:.2f} m, found "
                f"{self.height:g} m"
            )


class WaveMotion(NamedTuple):
    """The water's own motion in the waves at one place."""

    rise: float  # [m] of the surfaces of equal pressure; at depth 0 of the water's surface
    velocity: Vec3  # [m/s] NED
    acceleration: Vec3  # [m/s²] NED


class WaveLine(NamedTuple):
    """A regular wave: one line of a spectrum."""

    omega: float  # [rad/s]
    wave_number: float  # [1/m]
    amplitude: float  # [m] of the surface
    phase: float  # [rad] when they begin, at the origin
    north: float  # [-] of the direction it runs to
    east: float  # [-]


def wave_number(omega: float) -> float:
    """[1/m] k = ω² / g in deep water."""
    return omega * omega / GRAVITY


def jonswap(ratio: float, peak: float) -> float:
    """[-] The spectral density at a multiple of the peak's rate, but for a constant factor."""
    width = 0.07 if ratio <= 1.0 else 0.09
    off = (ratio - 1.0) / width
    fourth = ratio * ratio * ratio * ratio
    return exp(log(peak) * exp(-0.5 * off * off) - 1.25 / fourth) / (fourth * ratio)


def lines_of(waves: Waves, seed: int) -> list[WaveLine]:
    """The lines of a sea state; the same seed [-], 0 or more, gives the same sea.

    Each has the energy of a band of its own, at a rate drawn within it, because lines at equal
    distances would repeat the same waves again and again.
    """
    peak_rate = 2.0 * pi / waves.period
    if waves.lines == 1:
        north, east = cos(waves.heading), sin(waves.heading)
        return [WaveLine(peak_rate, wave_number(peak_rate), waves.height / 2.0, 0.0, north, east)]
    rng = np.random.default_rng([seed, WAVES])
    places, phases = rng.random((2, waves.lines)).tolist()
    turned = rng.standard_normal(waves.lines).tolist()
    band = (MOST_RATE - LEAST_RATE) / waves.lines
    ratios = [LEAST_RATE + (n + place) * band for n, place in enumerate(places)]
    energies = [jonswap(ratio, waves.peak) for ratio in ratios]
    scale = (waves.height / 4.0) ** 2 / plain_sum(energies)
    lines = list[WaveLine]()
    for ratio, energy, phase, off in zip(ratios, energies, phases, turned, strict=True):
        omega, heading = ratio * peak_rate, waves.heading + waves.spread * off
        amplitude = sqrt(2.0 * scale * energy)
        lines.append(
            WaveLine(
                omega, wave_number(omega), amplitude, 2.0 * pi * phase, cos(heading), sin(heading)
            )
        )
    return lines


class Sea:
    """The waves of one seed."""

    def __init__(self, waves: Waves, seed: int) -> None:
        """`seed`: [-] 0 or more."""
        self.lines = lines_of(waves, seed)
        self._begins, self._period = waves.begins, waves.period

    def at(self, seconds: float, position: Vec3) -> WaveMotion:
        """`seconds` after the start at a position [m] NED; in the air as at the surface."""
        after = seconds - self._begins
        grown = max(0.0, min(1.0, after / self._period))  # [-] over the first period
        x, y, depth = position
        depth = max(0.0, depth)
        rise = v_north = v_east = v_down = a_north = a_east = a_down = 0.0
        if grown == 0.0:
            return WaveMotion(rise, (v_north, v_east, v_down), (a_north, a_east, a_down))
        for omega, k, amplitude, phase, north, east in self.lines:
            angle = omega * after - k * (north * x + east * y) + phase
            size = grown * amplitude * exp(-k * depth)  # [m] radius of the orbit
            s, c = size * sin(angle), size * cos(angle)
            along, forward = omega * s, omega * omega * c  # velocity and acceleration
            rise += s
            v_north += along * north
            v_east += along * east
            v_down -= omega * c
            a_north += forward * north
            a_east += forward * east
            a_down += omega * omega * s
        return WaveMotion(rise, (v_north, v_east, v_down), (a_north, a_east, a_down))
