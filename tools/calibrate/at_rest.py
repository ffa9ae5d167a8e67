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
from tools.calibrate.allan import Floats
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
MOST_STD = np.array([MOST_RATE_STD] * 3 + [MOST_FORCE_STD] * 3)  # [rad/s, m/s²]
Span = tuple[float, float]  # [s] from and to


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

    @property
    def rate(self) -> float:
        """[1/s]"""
        return float(1.0 / np.median(np.diff(self.t)))

    def blocks(self, seconds: float) -> Iterator[tuple[float, Floats]]:
        """Begin [s] and values of each whole block."""
        t = self.t - self.t[0]
        edges = np.searchsorted(t, np.arange(0.0, t[-1], seconds)).tolist()
        for begin, end in pairwise(edges):
            if end > begin:
                yield float(t[begin]), self.values[begin:end]


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
    samples: dict[str, RestingSamples] = {}
    for key, each in heard.samples.items():
        inside = (each.t >= imu.t[0] + begin) & (each.t < imu.t[0] + end)
        if np.count_nonzero(inside) >= FEWEST:
            samples[key] = RestingSamples(each.t[inside], each.values[inside])
    if topics.PRESSURE.key in samples:
        _check_depth(samples[topics.PRESSURE.key], recording)
    return RestStatistics(heard.first + begin, end - begin, samples)


def _longest(imu: RestingSamples, heard: HeardAtRest) -> tuple[Span, str]:
    """The longest span [s] after the first sample without motion, and what ended rest first."""
    spans: list[Span] = []
    why, pose = "", np.zeros(6)  # mean of the first block of this rest
    since: float | None = None  # [s] None: not at rest
    begin = 0.0
    for begin, block in imu.blocks(BLOCK):
        at, mean = imu.t[0] + begin, block.mean(axis=0)
        armed = next((a for a, b in heard.armed if a < at + BLOCK and at < b), None)
        pose = mean if since is None else pose
        beyond = (np.std(block, axis=0) > MOST_STD) | (np.abs(mean - pose) > MOST_STD)
        if armed is None and not beyond.any():
            since = begin if since is None else since
            continue
        what, after = "turns" if beyond[:3].any() else "is pushed", begin
        if armed is not None:
            what, after = "was armed", max(begin, armed - imu.t[0])
        why = why or f"{what} after {heard.first + after:.1f} s"
        spans += [] if since is None else [(since, begin)]
        since = None
    if since is not None:
        spans.append((since, begin + BLOCK))
    return max(spans, key=lambda span: span[1] - span[0], default=(0.0, 0.0)), why


def _check_depth(samples: RestingSamples, recording: Path) -> None:
    means = [float(block.mean()) for _, block in samples.blocks(1.0)]
    steps: Floats = np.diff(samples.values[:, 0])
    single = float(np.std(steps)) / sqrt(2.0)  # slow motion left out
    change = max(means) - min(means)
    if change > SINKING + 6.0 * single / sqrt(samples.rate):
        raise LindyError(
            f"{recording} is not at rest: the pressure wanders by {change:.0f} Pa between its"
            " seconds"
        )
