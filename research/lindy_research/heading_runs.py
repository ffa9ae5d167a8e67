"""What the filters make of a flown dive (flights.py) with a typical MEMS unit: samples from the
simulator's sensors, a new unit for each seed, and the errors of each heading."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from msgspec.structs import replace

from lindy.api.dives import Stack
from lindy.api.messages import ImuSample, MagnetometerSample, PressureSample, Quaternion, Vec3
from lindy.api.vehicle import Vehicle, from_euler, to_body, to_world
from lindy_research.dives import DT, Floats
from lindy_research.flights import TruthLog, busy, flown
from services.estimation.core import Estimator
from services.estimation.settings import Settings as EstimationSettings
from services.marine.attitude import down_in_body, normalised
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings

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
        q = followed(q, rates[k], samples.force[k], samples.field[k], PLAIN_GAIN, DT)
        w, x, y, z = q
        headings[k] = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return _off(headings, flight)


def rms(errors: Floats) -> float:
    """[same unit] NaN left out."""
    return float(np.sqrt(np.nanmean(np.square(errors))))


def _off(headings: Floats, flight: TruthLog) -> Floats:
    return np.remainder(headings - flight.heading + pi, 2 * pi) - pi


def followed(
    q: Quaternion, rate: Vec3, force: Vec3, field: Vec3, beta: float, dt: float
) -> Quaternion:
    """The plain filter: Madgwick's for gyroscope, accelerometer and magnetometer (Madgwick 2010,
    section 3.3), which follows whatever the compass says.

    q_NB after `dt` [s] with the angular rate [rad/s], the specific force and the magnetic field
    (any unit), FRD; `beta` [rad/s] is the filter's gain (Madgwick 2010, eq. 29 to 34 and 45, 46:
    north is where the field shows now, so it pulls on the heading alone)."""
    down = _scaled(force, -1.0)
    m = _scaled(field, 1.0)
    north, east, _ = to_world(q, m)
    bx = sqrt(north * north + east * east)
    dx, dy, dz = down_in_body(q)
    bz = dx * m[0] + dy * m[1] + dz * m[2]
    w, x, y, z = q
    ex, ey, ez = dx - down[0], dy - down[1], dz - down[2]
    # bx times the world's north plus bz times its down, in the body, against what was measured.
    fx = bx * (1 - 2 * (y * y + z * z)) + bz * dx - m[0]
    fy = bx * 2 * (x * y - w * z) + bz * dy - m[1]
    fz = bx * 2 * (x * z + w * y) + bz * dz - m[2]
    ax, ay, az = ex + bz * fx, ey + bz * fy, ez + bz * fz  # both pull along the down axis
    gw = 2 * (x * ay - y * ax + bx * (y * fz - z * fy))
    gx = 2 * (z * ax + w * ay - 2 * x * az + bx * (y * fy + z * fz))
    gy = 2 * (z * ay - w * ax - 2 * y * az + bx * (x * fy + w * fz - 2 * y * fx))
    gz = 2 * (x * ax + y * ay + bx * (x * fz - w * fy - 2 * z * fx))
    slope = sqrt(gw * gw + gx * gx + gy * gy + gz * gz)
    tw, tx, ty, tz = _turned(q, rate, dt)
    if slope > 0.0:
        k = beta * dt / slope
        tw, tx, ty, tz = tw - k * gw, tx - k * gx, ty - k * gy, tz - k * gz
    return normalised((tw, tx, ty, tz))


def _turned(q: Quaternion, rate: Vec3, dt: float) -> Quaternion:
    """q + dt dq/dt, not yet a unit (Madgwick 2010, eq. 12)."""
    w, x, y, z = q
    a, b, c = (0.5 * dt * r for r in rate)
    return (
        w - x * a - y * b - z * c,
        x + w * a + y * c - z * b,
        y + w * b - x * c + z * a,
        z + w * c + x * b - y * a,
    )


def _scaled(v: Vec3, sign: float) -> Vec3:
    size = sign * sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v[0] / size, v[1] / size, v[2] / size
