"""One world for all depth observers: a dive of minimum-jerk steps in a swell, and its sensors."""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from services.estimation.depth_filter import DepthSettings
from services.estimation.depth_observer import Atmosphere, DepthObserver
from services.estimation.depth_ways import WAYS
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER
from services.reference.minimum_jerk import Limits, Ramp

RATE = 100.0  # [1/s] of the observers and of the accelerometer
PRESSURE_RATE = 42.0  # [1/s] with a phase of its own
SECONDS = 90.0
SETTLED = 15.0  # [s] from here on errors count
START = 20.0  # [m] deep enough never to come up
SPEED, JERK = 0.5, 1.0  # [m/s] either way, [m/s³]
SWELL, SWELL_FREQUENCY = 0.03, 0.25  # [m/s] rms, [Hz] what the reference knows nothing of
ACCELEROMETER_STD = 0.03  # [m/s²] white, of one sample
BIAS, BIAS_WALK = 0.15, 0.001  # [m/s²] at the beginning, [m/s²/√s]
PER_METRE = SEA_WATER * GRAVITY  # [Pa/m]
Floats = NDArray[np.float64]
Stick = list[tuple[float, float]]


class Sensor(NamedTuple):
    """A model of a pressure sensor, in metres of water."""

    name: str
    std: float  # [m] Gaussian
    step: float = 0.0  # [m] of quantisation
    latency: float = 0.0  # [s] between the moment of the sample and its stamp

    def settings(self, **others: float) -> DepthSettings:
        """What the data sheet says of this sensor, in the vehicle file's words."""
        std = sqrt(self.std**2 + self.step**2 / 12.0)  # quantisation as uniform noise
        told = DepthSettings(pressure_std=std * PER_METRE, pressure_latency=self.latency)
        return replace(told, **others)


class World(NamedTuple):
    """The truth at the steps of the observer, and what is measured of it."""

    t: Floats  # [s]
    depth: Floats  # [m]
    rate: Floats  # [m/s]
    asked: Floats  # [m/s²] acceleration of the reference
    measured: Floats  # [m/s²] accelerometer along down
    stamps: Floats  # [s] when a pressure sample is handed over
    said: Floats  # [m] depth of each pressure sample


class Estimates(NamedTuple):
    """What an observer makes of a world."""

    depth: Floats  # [m] at the world's times
    rate: Floats  # [m/s]
    surprise: Floats  # [σ] innovation of each pressure sample


class Score(NamedTuple):
    depth: float  # [mm] rms error
    rate: float  # [mm/s] rms error
    lag: float  # [ms] by which the rate comes late: the shift that explains its error best


def world(sensor: Sensor, seed: int, stick: Stick | None = None) -> World:
    """Ninety seconds of `sensor` and accelerometer; everything random comes from the seed.

    Args:
        stick: from when [s] on which rate [m/s] is asked for; None: steps at random.
    """
    rng = np.random.default_rng([seed, 42])
    stick = _stick(rng) if stick is None else stick
    phase = float(rng.uniform(0.0, 2.0 * pi))
    t = np.arange(1.0, SECONDS * RATE + 1.0) / RATE
    depth, rate, asked, acceleration = _motion(stick, phase, t)
    taken = np.arange(rng.uniform(0.0, 1.0), SECONDS * PRESSURE_RATE) / PRESSURE_RATE
    said = _motion(stick, phase, taken)[0] + sensor.std * rng.standard_normal(len(taken))
    if sensor.step > 0.0:
        said = np.round(said / sensor.step) * sensor.step
    bias = BIAS + BIAS_WALK / sqrt(RATE) * np.cumsum(rng.standard_normal(len(t)))
    measured = acceleration + bias + ACCELEROMETER_STD * rng.standard_normal(len(t))
    return World(t, depth, rate, asked, measured, taken + sensor.latency, said)


def _stick(rng: np.random.Generator) -> Stick:
    """When [s] the stick goes where [m/s]: up, down or to rest, every 10 to 20 s."""
    whens = np.cumsum(rng.uniform(10.0, 20.0, 9)).tolist()
    steps = rng.choice([-SPEED, 0.0, SPEED], len(whens)).tolist()
    return [(when, step) for when, step in zip(whens, steps, strict=True) if when < SECONDS]


def _motion(stick: Stick, phase: float, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Depth, its rate, the acceleration asked for and the whole acceleration at the times `t`."""
    ramp, moves = Ramp(Limits(JERK), START), list(stick)
    rows = np.empty((len(t), 3))
    for row, moment in enumerate(t.tolist()):
        while moves and moves[0][0] <= moment:
            when, target = moves.pop(0)
            ramp.aim(target, when)
        rows[row] = ramp.at(moment)[:3]
    position, velocity, asked = rows.T
    w, size = 2.0 * pi * SWELL_FREQUENCY, SWELL * sqrt(2.0)
    angle = w * t + phase
    return (
        position - size / w * np.cos(angle),
        velocity + size * np.sin(angle),
        asked,
        asked + size * w * np.cos(angle),
    )


def observe(seen: World, way: str, settings: DepthSettings) -> Estimates:
    """Run one of the observers of `depth_ways.py` through a world."""
    observer = DepthObserver(settings, Atmosphere(ATMOSPHERE, 1.0), SEA_WATER, 0.0, WAYS[way])
    inputs = (seen.asked if way == "reference" else seen.measured).tolist()
    stamps = [round(stamp * 1e9) for stamp in seen.stamps.tolist()]
    pressures = (ATMOSPHERE + seen.said * PER_METRE).tolist()
    depths, rates, surprises = [0.0] * len(inputs), [0.0] * len(inputs), [0.0] * len(stamps)
    heard = 0
    for k, acceleration in enumerate(inputs):
        now = round((k + 1) * 1e9 / RATE)
        while heard < len(stamps) and stamps[heard] <= now:
            observer.pressure(pressures[heard], stamps[heard])
            surprises[heard] = observer.surprise
            heard += 1
        observer.predict(acceleration, now)
        depth, rate, _ = observer.estimates(now)
        depths[k], rates[k] = depth.value, rate.value
    return Estimates(np.array(depths), np.array(rates), np.array(surprises[:heard]))


def score(seen: World, found: Estimates) -> Score:
    """How far the estimates are from the truth, once settled."""
    late = seen.t >= SETTLED
    depth = _rms((found.depth - seen.depth)[late])
    rate = _rms((found.rate - seen.rate)[late])
    return Score(1e3 * depth, 1e3 * rate, _lag(seen.rate[late], found.rate[late]))


def _lag(truth: Floats, estimate: Floats) -> float:
    """[ms] Shift of the truth that is nearest to the estimate, in steps of 10 ms up to 0.8 s."""
    most = round(0.8 * RATE)
    errors = [
        _rms(estimate[most:] - truth[most - shift : len(truth) - shift])
        for shift in range(most + 1)
    ]
    return float(np.argmin(errors)) * 1e3 / RATE


def _rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(errors * errors)))
