"""A recording of a drone at rest: its sensor samples, and when it really was at rest."""

from collections.abc import Iterator
from itertools import pairwise
from math import inf, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from messages.message import Message
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.vehicle import VehicleStatus
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD
from services.runtime.config.errors import LindyError
from tools.recordings.allan import Floats
from tools.recordings.recording import Recording

SHORTEST = 20.0  # [s]
FEWEST = 100  # samples that a sensor must have
BLOCK = 0.5  # [s] over which rest is checked
SINKING = 500.0  # [Pa] 5 cm: a larger change between seconds is not rest
CALM = 5.0  # [s] after disarming, for the drone and the water to come to rest
HOW = (
    "to make such a recording, let nobody arm the drone: `lindy up drone --out dives/on_the_bench`"
    " without a topside, and Ctrl-C after a minute or longer"
)
KEYS = (topics.IMU.key, topics.MAGNETOMETER.key, topics.PRESSURE.key)


class RestingSamples(NamedTuple):
    t: Floats  # [s] stamps, shape (n,)
    values: Floats  # shape (n, axes)


Span = tuple[float, float]  # [s] from and to


class HeardAtRest(NamedTuple):
    samples: dict[
        str, RestingSamples
    ]  # of each sensor; those whose stamp does not rise are left out
    armed: list[Span]  # when the drone was armed, by the clock of the stamps


class RestStatistics(NamedTuple):
    """The longest time at rest in a recording."""

    begin: float  # [s] after the recording's first IMU sample
    seconds: float
    samples: dict[str, RestingSamples]


def read(recording: Recording) -> HeardAtRest:
    """The samples of each sensor, and when the drone was armed."""
    rows: dict[str, list[tuple[float, ...]]] = {key: [] for key in KEYS}
    newest: dict[str, int] = {}
    statuses: list[tuple[float, bool]] = []  # [s] and whether it was armed
    for raw in recording.raw(lambda key: key in rows or key == topics.STATUS.key):
        if (message := recording.decode(raw)) is None:
            continue
        if isinstance(message, VehicleStatus):
            statuses.append((message.stamp_ns * 1e-9, message.armed))
        elif raw.key not in newest or message.stamp_ns > newest[raw.key]:
            newest[raw.key] = message.stamp_ns
            rows[raw.key].append((message.stamp_ns * 1e-9, *_numbers(message)))
    arrays = {key: np.array(found) for key, found in rows.items() if len(found) >= FEWEST}
    samples = {key: RestingSamples(found[:, 0], found[:, 1:]) for key, found in arrays.items()}
    return HeardAtRest(samples, _armed(statuses))


def _armed(statuses: list[tuple[float, bool]]) -> list[Span]:
    """Spans from an armed status to `CALM` after the next status."""
    ends = [at for at, _ in statuses[1:]] + [inf]
    return [(at, end + CALM) for (at, armed), end in zip(statuses, ends, strict=False) if armed]


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


def resting(heard: HeardAtRest, recording: Path) -> RestStatistics:
    """The samples in the longest time at rest.

    Raises:
        LindyError: too few samples, too short, or the drone was never long enough at rest.
    """
    if topics.IMU.key not in heard.samples:
        raise LindyError(
            f"{recording} holds fewer than {FEWEST} IMU samples, which are needed to find out"
            " whether the drone was at rest"
        )
    imu = heard.samples[topics.IMU.key]
    if (seconds := imu.t[-1] - imu.t[0]) < SHORTEST:
        raise LindyError(
            f"{recording} is too short: {seconds:.1f} s of IMU samples, noise needs at least"
            f" {SHORTEST:.0f} s at rest; {HOW}"
        )
    (begin, end), why = _longest(imu, heard.armed)
    if end - begin < SHORTEST:
        raise LindyError(
            f"{recording} is not at rest: the drone {why}; the longest rest is"
            f" {end - begin:.1f} s, noise needs at least {SHORTEST:.0f} s; {HOW}"
        )
    cut = {
        key: _between(each, imu.t[0] + begin, imu.t[0] + end) for key, each in heard.samples.items()
    }
    rest = RestStatistics(
        begin, end - begin, {key: s for key, s in cut.items() if len(s.t) >= FEWEST}
    )
    if topics.PRESSURE.key in rest.samples:
        _check_depth(rest.samples[topics.PRESSURE.key], recording)
    return rest


def _between(samples: RestingSamples, begin: float, end: float) -> RestingSamples:
    inside = (samples.t >= begin) & (samples.t < end)
    return RestingSamples(samples.t[inside], samples.values[inside])


def _longest(imu: RestingSamples, armed: list[Span]) -> tuple[Span, str]:
    """The longest span [s] after the first sample without motion, and what ended rest first."""
    spans: list[Span] = []
    why = ""
    since: float | None = None  # [s] None: not at rest
    pose = np.zeros(imu.values.shape[1])  # mean at the beginning of this rest
    begin = 0.0
    for begin, block in _blocks(imu, BLOCK):
        mean = block.mean(axis=0)
        what = _armed_within(armed, imu.t[0] + begin) or _beyond(np.std(block, axis=0))
        if not what and since is not None:
            what = _beyond(np.abs(mean - pose))
        if not what and since is None:
            since, pose = begin, mean
        if what:
            why = why or f"{what} after {begin:.1f} s"
            spans += [] if since is None else [(since, begin)]
            since = None
    if since is not None:
        spans.append((since, begin + BLOCK))
    return max(spans, key=lambda span: span[1] - span[0], default=(0.0, 0.0)), why


def _armed_within(armed: list[Span], begin: float) -> str:
    return "was armed" if any(a < begin + BLOCK and begin < b for a, b in armed) else ""


def _beyond(spread: Floats) -> str:
    """The motion in six numbers [rad/s, m/s²], in words; empty for a drone at rest."""
    if np.any(spread[:3] > MOST_RATE_STD):
        return "turns"
    return "is pushed" if np.any(spread[3:] > MOST_FORCE_STD) else ""


def _check_depth(samples: RestingSamples, recording: Path) -> None:
    means = [float(block.mean()) for _, block in _blocks(samples, 1.0)]
    steps: Floats = np.diff(samples.values[:, 0])
    single = float(np.std(steps)) / sqrt(2.0)  # slow motion left out
    change = max(means) - min(means)
    if change > SINKING + 6.0 * single / sqrt(rate(samples)):
        raise LindyError(
            f"{recording} is not at rest: the pressure wanders by {change:.0f} Pa between its"
            " seconds"
        )


def _blocks(samples: RestingSamples, seconds: float) -> Iterator[tuple[float, Floats]]:
    """Begin [s] and values of each whole block."""
    t = samples.t - samples.t[0]
    edges = np.searchsorted(t, np.arange(0.0, t[-1], seconds)).tolist()
    for begin, end in pairwise(edges):
        if end > begin:
            yield float(t[begin]), samples.values[begin:end]


def rate(samples: RestingSamples) -> float:
    """[1/s]"""
    periods: Floats = np.diff(samples.t)
    return float(1.0 / np.median(periods))
