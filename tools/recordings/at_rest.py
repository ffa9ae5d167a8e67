"""A recording of a drone at rest: its sensor samples, and when it really was at rest."""

from collections.abc import Iterator
from itertools import pairwise
from math import inf, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from messages.sensors import ImuSample, MagnetometerSample
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD
from services.runtime.config.errors import LindyError
from tools.recordings.allan import Floats
from tools.recordings.columns import ARRIVAL, Figures, StreamFigures, read_streams
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


def _imu(m: ImuSample) -> Figures:
    return *m.angular_rate, *m.specific_force


def _field(m: MagnetometerSample) -> Figures:
    return tuple(1e6 * component for component in m.field)  # [µT]


SENSORS = (
    StreamFigures(topics.IMU, ("stamp_ns",), ("p", "q", "r", "x", "y", "z"), _imu),
    StreamFigures(topics.MAGNETOMETER, ("stamp_ns",), ("x", "y", "z"), _field),
    StreamFigures(topics.PRESSURE, ("stamp_ns", "pressure")),
)
STATUS = StreamFigures(topics.STATUS, ("stamp_ns", "armed"))


class RestingSamples(NamedTuple):
    t: Floats  # [s] stamps, shape (n,)
    values: Floats  # shape (n, axes)


Span = tuple[float, float]  # [s] from and to


class HeardAtRest(NamedTuple):
    samples: dict[str, RestingSamples]  # of each sensor; those whose stamps rise
    armed: list[Span]  # when the drone was armed, by the clock of the stamps
    first: float = 0.0  # [s] when the first IMU sample arrived, since the recording began


class RestStatistics(NamedTuple):
    """The longest time at rest in a recording."""

    begin: float  # [s] since the recording began
    seconds: float
    samples: dict[str, RestingSamples]


def read(recording: Recording) -> HeardAtRest:
    """The samples of each sensor, and when the drone was armed."""
    streams = read_streams(recording, (*SENSORS, STATUS))
    samples: dict[str, RestingSamples] = {}
    for sensor in SENSORS:
        heard = streams[sensor.topic.key].rising()
        if heard.count >= FEWEST:
            values = np.column_stack([heard[name] for name in (*sensor.fields[1:], *sensor.more)])
            samples[sensor.topic.key] = RestingSamples(heard["stamp_ns"] * 1e-9, values)
    status = streams[STATUS.topic.key]
    times = (status["stamp_ns"] * 1e-9).tolist()
    spans = zip(times, [*times[1:], inf], status["armed"].tolist(), strict=False)
    arrivals, origin = streams[topics.IMU.key][ARRIVAL], recording.origin_ns()
    first = 0.0 if origin is None or not len(arrivals) else (arrivals[0] - origin) / 1e9
    # From an armed status to `CALM` after the next one.
    return HeardAtRest(samples, [(at, end + CALM) for at, end, armed in spans if armed], first)


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
    (begin, end), why = _longest(imu, heard)
    if end - begin < SHORTEST:
        raise LindyError(
            f"{recording} is not at rest: the drone {why}; the longest rest is"
            f" {end - begin:.1f} s, noise needs at least {SHORTEST:.0f} s; {HOW}"
        )
    cut = {
        key: _between(each, imu.t[0] + begin, imu.t[0] + end) for key, each in heard.samples.items()
    }
    rest = RestStatistics(
        heard.first + begin, end - begin, {key: s for key, s in cut.items() if len(s.t) >= FEWEST}
    )
    if topics.PRESSURE.key in rest.samples:
        _check_depth(rest.samples[topics.PRESSURE.key], recording)
    return rest


def _between(samples: RestingSamples, begin: float, end: float) -> RestingSamples:
    inside = (samples.t >= begin) & (samples.t < end)
    return RestingSamples(samples.t[inside], samples.values[inside])


def _longest(imu: RestingSamples, heard: HeardAtRest) -> tuple[Span, str]:
    """The longest span [s] after the first sample without motion, and what ended rest first."""
    spans: list[Span] = []
    why = ""
    since: float | None = None  # [s] None: not at rest
    pose = np.zeros(imu.values.shape[1])  # mean at the beginning of this rest
    begin = 0.0
    for begin, block in _blocks(imu, BLOCK):
        mean = block.mean(axis=0)
        armed = _armed_within(heard.armed, imu.t[0] + begin)
        what = "was armed" if armed is not None else _beyond(np.std(block, axis=0))
        if not what and since is not None:
            what = _beyond(np.abs(mean - pose))
        if not what and since is None:
            since, pose = begin, mean
        if what:
            after = begin if armed is None else max(begin, armed - imu.t[0])
            why = why or f"{what} after {heard.first + after:.1f} s"
            spans += [] if since is None else [(since, begin)]
            since = None
    if since is not None:
        spans.append((since, begin + BLOCK))
    return max(spans, key=lambda span: span[1] - span[0], default=(0.0, 0.0)), why


def _armed_within(armed: list[Span], begin: float) -> float | None:
    """[s] By the clock of the stamps: when a time armed began that reaches into a block."""
    return next((a for a, b in armed if a < begin + BLOCK and begin < b), None)


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
