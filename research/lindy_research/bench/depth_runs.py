"""One world for all depth observers: a flown dive (flights.py) in a swell, and its sensors."""

from collections.abc import Iterator
from functools import partial
from math import hypot, pi, sqrt
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from lindy_research.bench.depth_variants import ACCELEROMETER, VariantObserver
from messages.sensors import ImuSample
from messages.units import Vec3
from services.estimation.attitude.attitude_filter import AttitudeSettings
from services.estimation.attitude.attitude_observer import AttitudeObserver
from services.estimation.attitude_axes import AttitudeAxes
from services.estimation.depth.depth_filter import DepthSettings
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.marine.attitude import to_body
from services.marine.vehicle import GRAVITY, SEA_WATER
from services.runtime.config.stack import Stack
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings
from tests.support.flights import (
    FULL_HEAVE,
    HZ,
    LEAST,
    Floats,
    Script,
    Stick,
    TruthLog,
    flown,
)

RATE = HZ  # [1/s] of the observers and of the accelerometer
PRESSURE_RATE = 42.0  # [1/s] with a phase of its own
SECONDS = 90.0  # after arming
DIVES = 5  # different ones
SETTLED = 15.0  # [s] from here on errors count
SWELL, SWELL_FREQUENCY = 0.03, 0.25  # [m/s] rms, [Hz] what the reference knows nothing of
RAMP = 5.0  # [s] over which it comes up
TYPICAL = Stack().section("simulator", Settings)
PER_METRE = SEA_WATER * GRAVITY  # [Pa/m]


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

    def simulated(self) -> Settings:
        """The same for the simulator."""
        std, step = self.std * PER_METRE, self.step * PER_METRE
        return replace(TYPICAL, pressure_std=std, pressure_step=step)


class DepthWorld(NamedTuple):
    """The truth at the steps of the observer, and what is measured of it."""

    t: Floats  # [s]
    depth: Floats  # [m]
    rate: Floats  # [m/s]
    asked: Floats  # [m/s²] acceleration of the reference
    measured: Floats  # [m/s²] accelerometer along down
    axes: list[AttitudeAxes]  # of the accelerometer, by the attitude observer
    stamps: Floats  # [s] when a pressure sample is handed over
    said: Floats  # [m] depth of each pressure sample
    rest: float  # [m] mean depth said at rest, before
    rests: int  # samples in it
    bias: float  # [m/s²] of the accelerometer along down, as learnt at rest


class Estimates(NamedTuple):
    """What an observer makes of a world."""

    depth: Floats  # [m] at the world's times
    rate: Floats  # [m/s]
    surprise: Floats  # [σ] innovation of each pressure sample; of the product's observer


class Score(NamedTuple):
    depth: float  # [mm] rms error
    rate: float  # [mm/s] rms error
    lag: float  # [ms] by which the rate comes late: the shift that explains its error best


def world(sensor: Sensor, seed: int, flight: TruthLog | None = None) -> DepthWorld:
    """A dive with the sensors of that seed, from calibration on. A swell lifts water and vehicle
    alike; the pilot's chain does not answer to it.

    Args:
        flight: None: one of the dives in steps, by the seed.
    """
    flight = flown(steps(seed % DIVES), SECONDS) if flight is None else flight
    phase = float(np.random.default_rng([seed, 42]).uniform(0.0, 2.0 * pi))
    first, n = flight.calibrated, len(flight.depth)
    t = (np.arange(n) - first) / RATE
    lift, rise, push = swell(t, phase)
    depth = flight.depth + lift
    taken = np.arange(t[0] + phase / 500.0, t[-1], 1.0 / PRESSURE_RATE)
    device = Sensors(sensor.simulated(), seed)
    pressures = [device.pressure(0, d).pressure for d in np.interp(taken, t, depth).tolist()]
    said = (np.array(pressures) - TYPICAL.atmosphere) / PER_METRE
    resting = taken + sensor.latency < 0.0
    bias, measured, axes = felt(seed, flight, push)
    return DepthWorld(
        t=t[first:],
        depth=depth[first:],
        rate=(flight.depth_rate + rise)[first:],
        asked=flight.asked[first:],
        measured=measured,
        axes=axes,
        stamps=(taken + sensor.latency)[~resting],
        said=said[~resting],
        rest=float(np.mean(said[resting])),
        rests=int(np.sum(resting)),
        bias=bias,
    )


def swell(t: Floats, phase: float) -> tuple[Floats, Floats, Floats]:
    """[m], [m/s], [m/s²] down, of the water and of whatever floats in it; it comes up after the
    calibration, [s] 0."""
    w, size = 2.0 * pi * SWELL_FREQUENCY, SWELL * sqrt(2.0)
    share, angle = np.clip(t / RAMP, 0.0, 1.0), w * t + phase
    position: Floats = -share * size / w * np.cos(angle)
    rate: Floats = np.gradient(position, t)
    return position, rate, np.gradient(rate, t)


def steps(number: int) -> Script:
    """Down first; then up, down or rest at full stick for 10 to 20 s each, at random."""
    rng = np.random.default_rng([number, 7])
    rows: list[tuple[float, Stick]] = [(2.0, (0.0, 0.0, 1.0, 0.0))]
    t, depth = 8.0, 3.0
    while t < SECONDS:
        wait, heave = float(rng.uniform(10.0, 20.0)), float(rng.choice([-1.0, 0.0, 1.0]))
        if depth + FULL_HEAVE * heave * wait < LEAST:
            heave = 1.0
        rows.append((t, (0.0, 0.0, heave, 0.0)))
        t, depth = t + wait, depth + FULL_HEAVE * heave * wait
    return tuple(rows)


def felt(seed: int, flight: TruthLog, push: Floats) -> tuple[float, Floats, list[AttitudeAxes]]:
    """The accelerometer's bias along down as calibration learns it [m/s²], and from then on what
    the service's attitude observer makes of IMU samples: the acceleration along down [m/s²], and
    how the accelerometer lies in the world.

    Args:
        push: [m/s²] acceleration down besides the flight's.
    """
    unit, first = Sensors(TYPICAL, seed), flight.calibrated
    samples: list[ImuSample] = []
    rows = zip(*(part.tolist() for part in flight.motion), push.tolist(), strict=True)
    for q, nu, omega, (x, y, z), down in rows:
        a, b, c = to_body(q, (0.0, 0.0, down))
        samples.append(unit.imu(0, q, (*nu, *omega), (x + a, y + b, z + c, 0.0, 0.0, 0.0)))
    force = _mean([sample.specific_force for sample in samples[:first]])
    rate = _mean([sample.angular_rate for sample in samples[:first]])
    observer = AttitudeObserver(AttitudeSettings(), rate, 0.0, 0.0)
    observer.start(force)
    axes: list[AttitudeAxes] = []
    for sample in samples[first:]:
        observer.step(sample.angular_rate, sample.specific_force, 1.0 / RATE)
        axes.append(observer.axes(sample.specific_force))
    return GRAVITY - hypot(*force), np.array([each.acceleration for each in axes]), axes


def _mean(values: list[Vec3]) -> Vec3:
    x, y, z = np.mean(np.array(values), axis=0).tolist()
    return x, y, z


def observe(seen: DepthWorld, way: str, settings: DepthSettings) -> Estimates:
    """Run the product's observer or one of `depth_variants.py` through a world."""
    run = _accelerometer if way == ACCELEROMETER else partial(_variant, way)
    return run(seen, settings)


def _steps(seen: DepthWorld) -> Iterator[tuple[int, int, list[tuple[float, int]]]]:
    """Number and time [ns] of each step, and the samples [m], [ns] since the one before."""
    stamps, said = [round(stamp * 1e9) for stamp in seen.stamps.tolist()], seen.said.tolist()
    heard = 0
    for k in range(len(seen.t)):
        now, first = round(k * 1e9 / RATE), heard
        while heard < len(stamps) and stamps[heard] <= now:
            heard += 1
        yield k, now, list(zip(said[first:heard], stamps[first:heard], strict=True))


def _accelerometer(seen: DepthWorld, settings: DepthSettings) -> Estimates:
    observer = DepthObserver(settings, Atmosphere(TYPICAL.atmosphere, 1.0), SEA_WATER, 0.0)
    depths, rates, surprises = list[float](), list[float](), list[float]()
    measured = seen.measured.tolist()
    for k, now, samples in _steps(seen):
        for depth, stamp in samples:
            observer.pressure(TYPICAL.atmosphere + depth * PER_METRE, stamp)
            surprises.append(_surprise(observer))
        observer.predict(measured[k], now, seen.axes[k])
        depth, rate, _ = observer.estimates(now)
        depths.append(depth.value)
        rates.append(rate.value)
    return Estimates(np.array(depths), np.array(rates), np.array(surprises))


def _surprise(observer: DepthObserver) -> float:
    """[σ] Newest innovation; 0 for a sample that started the filter."""
    source = observer.aiding.message()
    if source is None or source.innovation is None or not source.variance:
        return 0.0
    return source.innovation / sqrt(source.variance)


def _variant(way: str, seen: DepthWorld, settings: DepthSettings) -> Estimates:
    observer = VariantObserver(settings, PER_METRE, way)
    depths, rates = list[float](), list[float]()
    asked = seen.asked.tolist()
    for k, now, samples in _steps(seen):
        for depth, stamp in samples:
            observer.sample(depth, stamp)
        observer.predict(asked[k], now)
        depths.append(observer.depth)
        rates.append(observer.rate)
    return Estimates(np.array(depths), np.array(rates), np.zeros(0))


def score(seen: DepthWorld, found: Estimates) -> Score:
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
