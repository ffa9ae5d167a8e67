"""`lindy calibrate noise`: noise of the sensors, from a recording of a drone at rest."""

from collections.abc import Iterator
from itertools import pairwise
from math import sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from tools.calibrate.allan import AllanNoise, Floats
from tools.calibrate.allan import noise as noise_of
from tools.calibrate.at_rest import RestingSamples, RestStatistics, read, resting
from tools.recordings.recording import open_recording


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
                yield NoiseAxis(name, unit, hz, mean, 0.0, 0.0, AllanNoise(0.0, None, None, 0.0))
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
        "# Each axis: rate, std of a sample, white noise, bias instability, random walk;",
        "# <: not seen, and below this.",
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
    slow = f"< {found.drift_below:.2g}" if found.instability is None else f"{found.instability:.2g}"
    walk = "-" if found.walk is None else f"{found.walk:.2g}"
    return (
        f"{axis.name:<16} {axis.rate:4.0f} Hz  {axis.std:.3g} {unit}  "
        f"{found.density:.3g} {unit}/√Hz  {slow} {unit}  {walk} {unit}/√s"
    )
