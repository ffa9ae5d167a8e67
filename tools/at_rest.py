"""A recording of a drone that lies still: its sensor samples, and whether it really did."""

from collections.abc import Iterator
from itertools import pairwise
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from messages.message import Message
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from services.estimation.calibration import CalibrationSettings
from services.runtime.errors import LindyError
from tools.allan import Floats
from tools.recording import Recording

SHORTEST = 20.0  # [s]
FEWEST = 100  # samples of a sensor that is to be judged
BLOCK = 0.5  # [s] over which a drone at rest is judged
SINKING = 500.0  # [Pa] 5 cm: more between the seconds of a recording is not rest
STILL = CalibrationSettings()
KEYS = (topics.IMU.key, topics.MAGNETOMETER.key, topics.PRESSURE.key)


class Samples(NamedTuple):
    t: Floats  # [s] stamps, shape (n,)
    values: Floats  # shape (n, axes)


def read(recording: Recording) -> dict[str, Samples]:
    """The samples of each sensor; those whose stamp does not rise are left out."""
    rows: dict[str, list[tuple[float, ...]]] = {key: [] for key in KEYS}
    newest: dict[str, int] = {}
    for raw in recording.raw():
        if raw.key not in rows or (sample := recording.decode(raw)) is None:
            continue
        if raw.key not in newest or sample.stamp_ns > newest[raw.key]:
            newest[raw.key] = sample.stamp_ns
            rows[raw.key].append((sample.stamp_ns * 1e-9, *_numbers(sample)))
    arrays = {key: np.array(found) for key, found in rows.items() if len(found) >= FEWEST}
    return {key: Samples(found[:, 0], found[:, 1:]) for key, found in arrays.items()}


def _numbers(sample: Message) -> tuple[float, ...]:
    match sample:
        case ImuSample():
            return *sample.angular_rate, *sample.specific_force
        case MagnetometerSample():
            return tuple(1e6 * component for component in sample.field)  # [µT]
        case PressureSample():
            return (sample.pressure,)
        case _:
            return ()


def check(heard: dict[str, Samples], recording: Path) -> None:
    """
    Raises:
        LindyError: nothing to judge, too short, or the drone moved.
    """
    if topics.IMU.key not in heard:
        raise LindyError(
            f"{recording} holds fewer than {FEWEST} IMU samples: without them nobody can tell"
            " whether the drone was at rest"
        )
    imu = heard[topics.IMU.key]
    seconds = imu.t[-1] - imu.t[0]
    if seconds < SHORTEST:
        raise LindyError(
            f"{recording} is too short: {seconds:.1f} s of IMU samples, noise needs at least"
            f" {SHORTEST:.0f} s at rest"
        )
    for what, values, limit in (
        ("turns", imu.values[:, :3], STILL.rate_std),
        ("is pushed", imu.values[:, 3:], STILL.force_std),
    ):
        if (moved := _restless(Samples(imu.t, values), limit)) is not None:
            raise LindyError(f"{recording} is not at rest: the drone {what} after {moved:.1f} s")
    if topics.PRESSURE.key in heard:
        _check_depth(heard[topics.PRESSURE.key], recording)


def _restless(samples: Samples, limit: float) -> float | None:
    """[s] After the first sample: where spread, or change of mean, is that of motion."""
    first = None
    for begin, block in _blocks(samples, BLOCK):
        mean = block.mean(axis=0)
        first = mean if first is None else first
        if np.any(np.std(block, axis=0) > limit) or np.any(np.abs(mean - first) > limit):
            return begin
    return None


def _check_depth(samples: Samples, recording: Path) -> None:
    means = [float(block.mean()) for _, block in _blocks(samples, 1.0)]
    steps: Floats = np.diff(samples.values[:, 0])
    single = float(np.std(steps)) / sqrt(2.0)  # slow motion left out
    change = max(means) - min(means)
    if change > SINKING + 6.0 * single / sqrt(rate(samples)):
        raise LindyError(
            f"{recording} is not at rest: the pressure wanders by {change:.0f} Pa between its"
            " seconds"
        )


def _blocks(samples: Samples, seconds: float) -> Iterator[tuple[float, Floats]]:
    """Begin [s] and values of each whole block."""
    t = samples.t - samples.t[0]
    edges = np.searchsorted(t, np.arange(0.0, t[-1], seconds)).tolist()
    for begin, end in pairwise(edges):
        if end > begin:
            yield float(t[begin]), samples.values[begin:end]


def rate(samples: Samples) -> float:
    """[1/s]"""
    periods: Floats = np.diff(samples.t)
    return float(1.0 / np.median(periods))
