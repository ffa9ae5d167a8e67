"""Jerk as the vehicle feels it, and as its reference asks for it: spectra and their part in a band.

Vertical acceleration and yaw rate are the IMU's, with the tilt taken out as estimation does. A
vehicle that followed its reference exactly would feel the reference's own jerk and no other. Above
`BAND` the accelerometer's own noise counts for more than what the vehicle does: white noise of an
acceleration is noise of its jerk that grows with the frequency.
"""

from math import pi
from typing import NamedTuple

import msgspec
import numpy as np

from messages import topics
from tools.analysis.dive import FIELD, RecordedDive
from tools.recordings.columns import Array

RATE = 100.0  # [1/s] at which all is compared
SEGMENT = 1024  # samples, 10 s; a shorter dive is one segment
BAND = 2.0  # [Hz]
AT_ONCE = 512  # segments that are transformed together
LEAST = 100  # samples; less is no spectrum
MOST = 20_000_000  # samples; more are two days, and most likely a stamp that cannot be
STILL = 1e-9  # a smaller jerk of the reference is none


class Spectrum(NamedTuple):
    frequency: Array  # [Hz], evenly spaced from 0
    density: Array  # unit² / Hz, one-sided

    def rms(self, below: float = np.inf) -> float:
        """Root mean square of what is below a frequency [Hz]."""
        step = self.frequency[1] - self.frequency[0]
        return float(np.sqrt(np.sum(self.density[self.frequency <= below]) * step))


class FeltJerk(msgspec.Struct, frozen=True):
    """Root mean squares below 2 Hz, while armed: [m/s³] of heave, [rad/s³] of yaw."""

    felt: float
    reference: float
    ratio: float | None  # [-] felt over reference; None: the reference did not move


class Smoothness(msgspec.Struct, frozen=True):
    heave: FeltJerk | None  # None: never armed, or too short
    yaw: FeltJerk | None
    starts_per_minute: list[float]  # [1/min] while armed, of each thruster in the file's order
    reversals_per_minute: list[float]  # [1/min] likewise; of turning one way after the other


class AxisSpectra(NamedTuple):
    """Of the jerk of an axis: [(m/s³)²/Hz] or [(rad/s³)²/Hz]."""

    felt: Spectrum
    reference: Spectrum


def smoothness(dive: RecordedDive) -> Smoothness:
    starts, reversals = thruster_changes(dive)
    return Smoothness(
        heave=_felt(axis_spectra(dive, "heave")),
        yaw=_felt(axis_spectra(dive, "yaw")),
        starts_per_minute=starts,
        reversals_per_minute=reversals,
    )


def axis_spectra(dive: RecordedDive, axis: str) -> AxisSpectra | None:
    """Of heave or yaw, from the first armed reference to the last. None: too short."""
    if dive.armed is None or not dive[topics.STATE].count:
        return None
    begin, end = dive.armed
    if not LEAST < (end - begin) / 1e9 * RATE < MOST:
        return None
    at = np.arange(begin, end, 1e9 / RATE)
    reference, state = dive[topics.REFERENCE], dive[topics.STATE]
    wanted = jerk_spectrum(
        np.interp(at, reference["valid_ns"], reference[f"{FIELD[axis]}.acceleration"])
    )
    if axis == "heave":
        felt = np.interp(at, state["sensor_ns"], state["depth_acceleration.value"])
    else:
        felt = np.gradient(np.interp(at, state["sensor_ns"], state["yaw_rate.value"]), 1.0 / RATE)
    return AxisSpectra(jerk_spectrum(felt), wanted)


def thruster_changes(dive: RecordedDive) -> tuple[list[float], list[float]]:
    """[1/min] Starts and reversals of each thruster while armed. A start: from no thrust to some. A
    reversal: some thrust in the other direction than the last."""
    command = dive[topics.THRUSTERS]
    minutes = dive.armed_seconds / 60.0
    if not minutes > 0.0 or not command.count:
        return [], []
    count = int(command["count"].max())
    ahead, astern = (bits(command[name], count) for name in ("ahead", "astern"))
    on = ahead | astern
    starts = [int(np.count_nonzero(on[1:, k] & ~on[:-1, k])) for k in range(count)]
    ways = [ahead[on[:, k], k] for k in range(count)]
    reversals = [int(np.count_nonzero(way[1:] != way[:-1])) for way in ways]
    return [round(n / minutes, 2) for n in starts], [round(n / minutes, 2) for n in reversals]


def bits(numbers: Array, count: int) -> np.ndarray:
    """(n, count) Is bit k of each number set?"""
    whole = numbers.astype(np.int64)
    return np.stack([(whole >> k) & 1 == 1 for k in range(count)], axis=1)


def _felt(spectra: AxisSpectra | None) -> FeltJerk | None:
    if spectra is None:
        return None
    felt, reference = spectra.felt.rms(BAND), spectra.reference.rms(BAND)
    return FeltJerk(felt, reference, felt / reference if reference > STILL else None)


def spectrum(values: Array, rate: float, segment: int = SEGMENT) -> Spectrum:
    """Power spectral density of samples (n,) at `rate` [1/s]: the mean over Hann-windowed segments
    that overlap by half (Welch 1967). What is left over at the end, shorter than half a segment, is
    not used. The mean of each segment is removed."""
    length = min(segment, len(values))
    window = np.sin(pi * np.arange(length) / length) ** 2
    begins = range(0, len(values) - length + 1, max(1, length // 2))
    power = np.zeros(length // 2 + 1)
    for few in (begins[k : k + AT_ONCE] for k in range(0, len(begins), AT_ONCE)):
        pieces = np.stack([values[begin : begin + length] for begin in few])
        pieces = (pieces - pieces.mean(axis=1, keepdims=True)) * window
        power += np.sum(np.abs(np.fft.rfft(pieces, axis=1)) ** 2, axis=0)
    power /= len(begins)
    one_sided = np.full(len(power), 2.0)
    one_sided[0] = 1.0
    if length % 2 == 0:
        one_sided[-1] = 1.0
    density = one_sided * power / (rate * np.sum(window**2))
    return Spectrum(np.arange(len(power)) * rate / length, density)


def jerk_spectrum(acceleration: Array) -> Spectrum:
    """Of an acceleration at `RATE`: (2 π f)² times its own."""
    of = spectrum(acceleration, RATE)
    return Spectrum(of.frequency, of.density * (2.0 * pi * of.frequency) ** 2)
