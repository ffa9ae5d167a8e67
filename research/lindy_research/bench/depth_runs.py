"""One world for all depth observers: a flown dive (flights.py) in a swell, and its sensors."""

from collections.abc import Iterator
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from lindy.api.dives import Stack
from lindy.api.messages import ImuSample, PressureSample
from lindy.api.vehicle import GRAVITY, SEA_WATER, Vehicle, to_body
from lindy_research.bench.thesis_depth import ThesisObserver, Way
from lindy_research.dives import Floats, Stick
from lindy_research.flights import FULL_HEAVE, HZ, LEAST, Script, TruthLog, flown
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, DepthSettings
from services.estimation.settings import Settings as EstimationSettings
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings

RATE = HZ  # [1/s] of the observers and of the accelerometer
PRESSURE_RATE = 42.0  # [1/s] with a phase of its own
SECONDS = 90.0  # after arming
DIVES = 5  # different ones
SETTLED = 15.0  # [s] from here on errors count
SWELL, SWELL_FREQUENCY = 0.03, 0.25  # [m/s] rms, [Hz] what the reference knows nothing of
RAMP = 5.0  # [s] over which it comes up
TYPICAL = Stack().section("simulator", Settings)
VEHICLE = Stack().section("vehicle", Vehicle)
PER_METRE = SEA_WATER * GRAVITY  # [Pa/m]


class Sensor(NamedTuple):
    """A model of a pressure sensor, in metres of water."""

    name: str
    std: float  # [m] Gaussian
    step: float = 0.0  # [m] of quantisation
    latency: float = 0.0  # [s] between the moment of the sample and its stamp

    @property
    def whole_std(self) -> float:
        """[m] With quantisation as uniform noise."""
        return sqrt(self.std**2 + self.step**2 / 12.0)

    def settings(self) -> DepthSettings:
        """What the data sheet says of this sensor, in the vehicle file's words."""
        std = self.whole_std * PER_METRE
        return DepthSettings(pressure_std=std, pressure_latency=self.latency)

    def simulated(self) -> Settings:
        """The same for the simulator."""
        std, step = self.std * PER_METRE, self.step * PER_METRE
        return replace(TYPICAL, pressure_std=std, pressure_step=step)


class DepthWorld(NamedTuple):
    """The truth at the steps of the observer from calibration on, and what is measured of it."""

    flight: TruthLog
    t: Floats  # [s] since calibration
    depth: Floats  # [m]
    rate: Floats  # [m/s]
    asked: Floats  # [m/s²] acceleration of the reference
    imu: list[ImuSample]  # from power-on; stamps are in ns since then
    stamps: Floats  # [s] when each pressure sample is handed over, from power-on; < 0 at rest
    said: Floats  # [m] depth of each

    def ns(self, t: float) -> int:
        """[ns] since power-on."""
        return round((t + (self.flight.calibrated + 1) / RATE) * 1e9)


class Estimates(NamedTuple):
    """What an observer makes of a world."""

    depth: Floats  # [m] at the world's times
    rate: Floats  # [m/s]
    squares: Floats  # [-] normalised innovation squared of the pressure, once settled; Lindy's


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
    return DepthWorld(
        flight=flight,
        t=t[first:],
        depth=depth[first:],
        rate=(flight.depth_rate + rise)[first:],
        asked=flight.asked[first:],
        imu=felt(seed, flight, push),
        stamps=taken + sensor.latency,
        said=(np.array(pressures) - TYPICAL.atmosphere) / PER_METRE,
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


def felt(seed: int, flight: TruthLog, push: Floats) -> list[ImuSample]:
    """
    Args:
        push: [m/s²] acceleration down besides the flight's.
    """
    unit = Sensors(TYPICAL, seed)
    samples: list[ImuSample] = []
    rows = zip(*(part.tolist() for part in flight.motion), push.tolist(), strict=True)
    for k, (q, nu, omega, (x, y, z), down) in enumerate(rows, start=1):
        a, b, c = to_body(q, (0.0, 0.0, down))
        moving = (x + a, y + b, z + c, 0.0, 0.0, 0.0)
        samples.append(unit.imu(round(k * 1e9 / RATE), q, (*nu, *omega), moving))
    return samples


def _pressures(seen: DepthWorld) -> Iterator[list[tuple[int, float]]]:
    """For each row since power-on, the samples since the one before: stamp [ns], depth [m]."""
    stamps, said = [seen.ns(stamp) for stamp in seen.stamps.tolist()], seen.said.tolist()
    heard = 0
    for sample in seen.imu:
        first = heard
        while heard < len(stamps) and stamps[heard] <= sample.stamp_ns:
            heard += 1
        yield list(zip(stamps[first:heard], said[first:heard], strict=True))


def lindy(seen: DepthWorld, settings: DepthSettings) -> Estimates:
    """The whole estimator, from power-on; it knows the air's pressure."""
    air = CalibrationSettings(atmosphere=TYPICAL.atmosphere)
    told = EstimationSettings(depth=settings, calibration=air)
    estimator = Estimator(told, VEHICLE.floating_depth, None, VEHICLE)
    found, squares = np.full((len(seen.imu), 2), np.nan), list[float]()
    for k, (sample, pressures) in enumerate(zip(seen.imu, _pressures(seen), strict=True)):
        now = sample.stamp_ns
        for stamp, depth in pressures:
            said = TYPICAL.atmosphere + depth * PER_METRE
            estimator.pressure(PressureSample(stamp_ns=stamp, pressure=said))
        estimator.actuation(seen.flight.actuation(k, now))
        if (state := estimator.imu(sample, now)) is not None:
            found[k] = state.depth.value, state.depth_rate.value
        for name, source in estimator.aid_sources(now):
            if name == "pressure" and source.innovation is not None and source.variance:
                square = source.innovation**2 + (source.spread or 0.0) ** 2
                settled = now >= seen.ns(SETTLED)
                squares += [square / source.variance] * source.samples if settled else []
    first = seen.flight.calibrated
    return Estimates(found[first:, 0], found[first:, 1], np.array(squares))


def thesis(seen: DepthWorld, way: Way, sensor: Sensor, motion_noise: float) -> Estimates:
    """An observer without accelerometer (thesis_depth.py), told what a data sheet says of the
    sensor, with this process noise [m/s²/√Hz]."""
    observer = ThesisObserver(way, sensor.whole_std, motion_noise, sensor.latency)
    first = seen.flight.calibrated
    depths, rates = list[float](), list[float]()
    heard = list(_pressures(seen))[first:]
    for sample, asked, pressures in zip(seen.imu[first:], seen.asked.tolist(), heard, strict=True):
        for stamp, depth in pressures:
            observer.sample(depth, stamp)
        observer.predict(asked, sample.stamp_ns)
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
