"""`lindy calibrate noise`: noise of the sensors, from the longest rest in a recording.

The Allan deviation over averages of up to a second tells white noise, that over the longest ones
how much the sensor drifts. Source: IEEE Std 952-1997, annex C: for white noise of density N the
Allan variance over τ is N²/τ.
"""

from collections.abc import Iterator
from itertools import pairwise
from math import inf, log10, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.sensors import ImuSample, MagnetometerSample
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD
from services.runtime.config.errors import LindyError
from tools.recordings.columns import ARRIVAL, Figures, StreamFigures, read_streams
from tools.recordings.recording import Recording, open_recording

Floats = NDArray[np.float64]
LONGEST = 9.0  # parts: averages longer than a ninth of the recording are too uncertain
PER_DECADE = 10


class AllanNoise(NamedTuple):
    """Noise of one axis, in the sensor's unit."""

    density: float  # [unit/√Hz] white noise
    drift: float  # [unit] Allan deviation over the longest average …
    over: float  # [s] … which is this long


def deviation(values: Floats, rate: float) -> tuple[Floats, Floats]:
    """Overlapping Allan deviation of evenly spaced samples.

    Args:
        values: shape (n,), n ≥ 20.
        rate: [1/s]

    Returns:
        Averaging times [s] and the deviation [unit] over each.
    """
    most = max(1, int(len(values) / LONGEST))
    steps = range(int(PER_DECADE * log10(most)) + 1)
    lengths = sorted({round(10.0 ** (k / PER_DECADE)) for k in steps})
    # Without the mean, so that the sum stays small and exact.
    total = np.concatenate(([0.0], np.cumsum(values - np.mean(values))))
    found = [_variance(total, length) for length in lengths]
    return np.array(lengths) / rate, np.sqrt(np.array(found))


def _variance(total: Floats, length: int) -> float:
    """Half the mean square difference of neighbouring means over `length` samples."""
    differences = total[2 * length :] - 2.0 * total[length:-length] + total[: -2 * length]
    return float(np.mean(differences**2)) / (2.0 * length**2)


def noise_of(values: Floats, rate: float) -> AllanNoise:
    """White noise and drift of a sensor at rest.

    Args:
        values: shape (n,), n ≥ 20, any unit.
        rate: [1/s]
    """
    tau, adev = deviation(values, rate)
    known = len(values) / (2.0 * tau * rate)  # inverse of each variance's relative one
    density = float(np.sqrt(np.average(adev**2 * tau, weights=known * (tau <= 1.0))))
    return AllanNoise(density, float(adev[-1]), float(tau[-1]))


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


class NoiseAxis(NamedTuple):
    """One component of a sensor's samples."""

    name: str
    unit: str
    rate: float  # [1/s]
    mean: float
    std: float  # of one sample
    step: float  # smallest difference between two samples that differ; 0: all are the same
    noise: AllanNoise


SECTION = "estimation.depth"


class SettingLine(NamedTuple):
    """A line of the vehicle file."""

    key: str
    value: float | None  # None: nothing to paste, and `why` says so
    why: str


def noise(recording: Path) -> int:
    """Print noise, rate and drift of the sensors of a drone at rest, and the lines to paste into
    the vehicle file. Returns the exit status.

    It uses the longest time in which the drone was neither armed nor moved, at least 20 s: the
    longer, the slower the drift that can be seen.

    Raises:
        LindyError: there is no recording, or no such rest in it.
    """
    rest = resting(read(open_recording(recording)), recording)
    print(as_toml(list(measured(rest.samples)), rest))
    return 0


def measured(heard: dict[str, RestingSamples]) -> Iterator[NoiseAxis]:
    """Noise of every axis of every sensor."""
    names = {
        topics.IMU.key: [(f"gyroscope {axis}", "rad/s") for axis in "xyz"]
        + [(f"accelerometer {axis}", "m/s²") for axis in "xyz"],
        topics.MAGNETOMETER.key: [(f"magnetometer {axis}", "µT") for axis in "xyz"],
        topics.PRESSURE.key: [("pressure", "Pa")],
    }
    for key, samples in heard.items():
        hz = samples.rate
        for column, (name, unit) in enumerate(names[key]):
            values: Floats = samples.values[:, column]
            different: list[float] = sorted(set(values.tolist()))
            mean = float(np.mean(values))
            if len(different) == 1:
                yield NoiseAxis(name, unit, hz, mean, 0.0, 0.0, AllanNoise(0.0, 0.0, 0.0))
                continue
            std, step = float(np.std(values)), min(b - a for a, b in pairwise(different))
            yield NoiseAxis(name, unit, hz, mean, std, step, noise_of(values, hz))


def lines(axes: list[NoiseAxis]) -> Iterator[SettingLine]:
    """What to put into [estimation.depth] of the vehicle file. A sensor whose samples are all the
    same gives no noise."""
    found: list[tuple[str, float, str]] = []
    force = [axis for axis in axes if axis.name.startswith("accelerometer")]
    if (pressure := next((axis for axis in axes if axis.name == "pressure"), None)) is not None:
        # Noise below a step is invisible, and then the rounding is what is left.
        std = max(pressure.std, pressure.step / sqrt(12.0))
        steps = f", in steps of {pressure.step:.3g} Pa" if pressure.step > std / 10.0 else ""
        found.append(("pressure_std", std, f"[Pa] at {pressure.rate:.0f} Hz{steps}"))
    worst = max(force, key=lambda axis: axis.noise.density)
    about = f"[m/s²/√Hz] {worst.name}; under way, tilt adds to it"
    found.append(("acceleration_noise", worst.noise.density, about))
    for key, value, why in found:
        if value > 0.0:
            yield SettingLine(key, float(f"{value:.3g}"), why)
        else:
            yield SettingLine(key, None, "every sample is the same: frozen, or too coarse")


def as_toml(axes: list[NoiseAxis], rest: RestStatistics) -> str:
    """Figures as comments, then the lines to paste."""
    text = [
        f"# Noise at rest; used {rest.seconds:.1f} s at rest, from {rest.begin:.1f} s.",
        "# Each axis: rate, std of a sample, white noise, drift over the longest average.",
        "# Under way thrusters and tilt add to it, and pressure_std belongs to acceleration_noise:",
        "# `lindy review` of a dive tries both on it.",
    ]
    text += [f"# {_figures(axis)}" for axis in axes]
    text += ["", f"[{SECTION}]"]
    for line in lines(axes):
        key = f"# {line.key}:" if line.value is None else f"{line.key} = {line.value:g}  #"
        text.append(f"{key} {line.why}")
    return "\n".join(text)


def _figures(axis: NoiseAxis) -> str:
    unit, found = axis.unit, axis.noise
    return (
        f"{axis.name:<16} {axis.rate:4.0f} Hz  {axis.std:.3g} {unit}  "
        f"{found.density:.3g} {unit}/√Hz  {found.drift:.2g} {unit} over {found.over:.2g} s"
    )
