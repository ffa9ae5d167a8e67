"""What the filters make of a flown dive (flights.py) with a typical MEMS unit: samples from the
simulator's sensors, a new unit for each seed, and the errors of each heading."""

from dataclasses import dataclass
from math import pi

import numpy as np
from msgspec.structs import replace

from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.units import Quaternion, Vec3
from services.estimation.core import Estimator
from services.estimation.settings import Settings as EstimationSettings
from services.marine.attitude import from_euler, to_body
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings
from tests.support import marg
from tests.support.flights import DT, Floats, TruthLog, busy, flown
from tests.support.flights import HZ as HZ

PLAIN_GAIN = 0.05  # [rad/s] of the plain filter
RAMP = 2.0  # [s] over which iron comes and goes
LONGEST = 300.0  # [s] the one script that all dives are the beginning of
TYPICAL = Stack().section("simulator", Settings)
# The errors that no filter can tell from attitude are left out: "clean" means noise and bias only.
CLEAN = replace(TYPICAL, accelerometer_bias=0.0, hard_iron=0.0)


@dataclass(frozen=True)
class HeadingSamples:
    """What the sensors say, as plain lists."""

    rate: list[Vec3]  # [rad/s] FRD
    force: list[Vec3]  # [m/s²] FRD
    field: list[Vec3]  # [T] FRD; empty without a compass
    pressure: list[float]  # [Pa]


@dataclass(frozen=True)
class Headings:
    """Errors [rad] of each heading, from when it is calibrated; NaN before."""

    control: Floats
    navigation: Floats
    std: Floats  # [rad] of the navigation heading, as the estimator says


def dive(seconds: float) -> TruthLog:
    """The vehicle floats for as long as it calibrates, then pitches and turns for `seconds`."""
    return flown(busy(LONGEST), seconds)


def measured(
    flight: TruthLog, seed: int, sensors: Settings, iron: Floats | None = None, compass: bool = True
) -> HeadingSamples:
    """A sensor unit of its own for each seed; `iron` [T] NED, n × 3, bends the field."""
    unit = Sensors(sensors, seed)
    rates: list[Vec3] = []
    forces: list[Vec3] = []
    fields: list[Vec3] = []
    bent = np.zeros((len(flight.heading), 3)) if iron is None else iron
    table = (flight.attitude, flight.velocity, flight.rate, flight.acceleration, bent)
    for q, nu, omega, nu_dot, extra in zip(*(part.tolist() for part in table), strict=True):
        sample = unit.imu(0, q, (*nu, *omega), (*nu_dot, 0.0, 0.0, 0.0))
        rates.append(sample.angular_rate)
        forces.append(sample.specific_force)
        if compass:
            x, y, z = unit.magnetometer(0, q).field
            a, b, c = to_body(q, extra)
            fields.append((x + a, y + b, z + c))
    pressures = [unit.pressure(0, depth).pressure for depth in flight.depth.tolist()]
    return HeadingSamples(rates, forces, fields, pressures)


def passing_iron(n: int, begin: float, seconds: float, strength: float) -> Floats:
    """[T] NED, n × 3: `strength` [T] towards east from `begin` [s] on for `seconds`."""
    t = np.arange(1, n + 1) * DT
    up = np.clip((t - begin) / RAMP, 0.0, 1.0)
    down = np.clip((begin + seconds - t) / RAMP, 0.0, 1.0)
    iron = np.zeros((n, 3))
    iron[:, 1] = strength * np.minimum(up, down)
    return iron


def observed(flight: TruthLog, samples: HeadingSamples) -> Headings:
    """Both headings of the estimator, calibrated as in a dive."""
    vehicle = Stack().section("vehicle", Vehicle)
    estimator = Estimator(EstimationSettings(), vehicle.floating_depth, None, vehicle)
    n = len(flight.heading)
    control, navigation, std = (np.full(n, np.nan) for _ in range(3))
    fields = samples.field or [None] * n
    everything = zip(samples.rate, samples.force, samples.pressure, fields, strict=True)
    for k, (rate, force, pressure, field) in enumerate(everything):
        now = round((k + 1) * DT * 1e9)
        estimator.actuation(flight.actuation(k, now))
        estimator.pressure(PressureSample(stamp_ns=now, pressure=pressure))
        if field is not None:
            estimator.magnetometer(MagnetometerSample(stamp_ns=now, field=field))
        sample = ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate)
        state = estimator.imu(sample, now)
        if state is None or state.phase != "running":
            continue
        control[k] = state.heading.value
        if (found := state.heading_navigation) is not None:
            navigation[k], std[k] = found.value, found.std
    return Headings(_off(control, flight), _off(navigation, flight), std)


def plain(flight: TruthLog, samples: HeadingSamples) -> Floats:
    """Error [rad] of the plain filter's heading; it begins with the truth when ours is calibrated,
    and takes the mean rate until then for the bias."""
    n, first = len(flight.heading), flight.calibrated
    bias = np.mean(np.array(samples.rate[:first]), axis=0)
    rates: list[Vec3] = [(x, y, z) for x, y, z in (np.array(samples.rate) - bias).tolist()]
    q: Quaternion = from_euler(0.0, 0.0, float(flight.heading[first]))
    headings = np.full(n, np.nan)
    for k in range(first, n):
        q = marg.step(q, rates[k], samples.force[k], samples.field[k], PLAIN_GAIN, DT)
        w, x, y, z = q
        headings[k] = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return _off(headings, flight)


def rms(errors: Floats) -> float:
    """[same unit] NaN left out."""
    return float(np.sqrt(np.nanmean(np.square(errors))))


def _off(headings: Floats, flight: TruthLog) -> Floats:
    return np.remainder(headings - flight.heading + pi, 2 * pi) - pi
