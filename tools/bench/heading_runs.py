"""Dives of a typical MEMS unit that pitches, rolls and turns: truth, samples and what the filters
make of them. Sensor errors are the simulator's (services/simulator/settings.py)."""

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from services.estimation.attitude_filter import AttitudeSettings, Quaternion, Vec3
from services.estimation.attitude_observer import AttitudeObserver
from services.estimation.calibration import Calibration, CalibrationSettings
from services.estimation.resting_bias import RestingBias
from services.marine.attitude import from_euler
from services.marine.vehicle import GRAVITY
from services.simulator.sensors import DRIFT_TIME
from services.simulator.settings import Settings
from tools.bench import marg

Floats = NDArray[np.float64]
HZ = 100.0  # [1/s]
DT = 1.0 / HZ  # [s]
RAMP = 2.0  # [s] over which the vehicle begins to move, and over which iron comes and goes
PLAIN_GAIN = 0.05  # [rad/s] of the plain filter
TYPICAL = Settings()
# The errors that no filter can tell from attitude are left out: "clean" means noise and bias only.
CLEAN = Settings(accelerometer_bias=0.0, hard_iron=0.0)


@dataclass(frozen=True)
class Truth:
    """How the vehicle lies and is pushed, sampled at HZ."""

    roll: Floats  # [rad]
    pitch: Floats
    heading: Floats  # [rad] accumulated
    rate: Floats  # [rad/s] FRD, n × 3
    force: Floats  # [m/s²] FRD, n × 3
    R_BN: Floats  # n × 3 × 3


@dataclass(frozen=True)
class Samples:
    """What the sensors say of it, as plain lists."""

    rate: list[Vec3]
    force: list[Vec3]
    field: list[Vec3]


@dataclass(frozen=True)
class Headings:
    """Errors [rad] of each heading, from when it is calibrated; NaN before."""

    control: Floats
    navigation: Floats
    std: Floats  # [rad] of the navigation heading, as the observer says


def moving(seconds: float, rest: float) -> Truth:
    """At rest for `rest` [s], then pitching ±12°, rolling ±6°, turning ±35 °/s, and surging."""
    # In the middle of each sampling period: a gyroscope gives the mean over it.
    t: Floats = np.arange(1.0, round((rest + seconds) * HZ) + 1) * DT

    def angles(t: Floats) -> tuple[Floats, Floats, Floats]:
        s = np.maximum(0.0, t - rest)
        share = np.clip(s / RAMP, 0.0, 1.0)
        share = share * share * (3.0 - 2.0 * share)
        pitch = share * np.radians(12.0) * np.sin(2 * pi * 0.10 * s)
        roll = share * np.radians(6.0) * np.sin(2 * pi * 0.17 * s)
        heading = share * (1.9 * np.sin(0.33 * s) + 0.8 * np.sin(0.071 * s) + 0.01 * s)
        return roll, pitch, heading

    roll, pitch, heading = angles(t)
    h = 1e-4
    ahead, behind, middle = angles(t - DT / 2 + h), angles(t - DT / 2 - h), angles(t - DT / 2)
    droll, dpitch, dheading = ((a - b) / (2 * h) for a, b in zip(ahead, behind, strict=True))
    cr, sr, cp, sp = np.cos(middle[0]), np.sin(middle[0]), np.cos(middle[1]), np.sin(middle[1])
    rate = np.stack(
        [droll - dheading * sp, dpitch * cr + dheading * cp * sr, dheading * cp * cr - dpitch * sr],
        axis=1,
    )
    R_BN = _rotations(roll, pitch, heading)
    surge = np.where(t > rest, 0.15 * np.sin(2 * pi * 0.13 * (t - rest)), 0.0)
    force = -GRAVITY * R_BN[:, :, 2]
    force[:, 0] += surge
    return Truth(roll, pitch, heading, rate, force, R_BN)


def measured(truth: Truth, seed: int, sensors: Settings, iron: Floats | None = None) -> Samples:
    """Samples with bias, drift and noise; `iron` [T] NED, n × 3, bends the field."""
    rng = np.random.default_rng([seed, 77])
    n, root = len(truth.heading), sqrt(HZ)
    keep = np.exp(-DT / DRIFT_TIME)
    pushes = sensors.gyro_drift * np.sqrt(1 - keep**2) * rng.standard_normal((n, 3))
    rate = truth.rate + sensors.gyro_bias * rng.standard_normal(3) + _leaky_sum(pushes, keep)
    rate = rate + sensors.gyro_noise * root * rng.standard_normal((n, 3))
    force = truth.force + sensors.accelerometer_bias * rng.standard_normal(3)
    force = force + sensors.accelerometer_noise * root * rng.standard_normal((n, 3))
    around = np.array(sensors.magnetic_field) + (0.0 if iron is None else iron)
    around = np.broadcast_to(around, (n, 3))
    field = np.einsum("nij,nj->ni", truth.R_BN, around)
    field = field + sensors.hard_iron * rng.standard_normal(3)
    field = field + sensors.magnetometer_noise * rng.standard_normal((n, 3))
    return Samples(_triples(rate), _triples(force), _triples(field))


def passing_iron(n: int, begin: float, seconds: float, strength: float) -> Floats:
    """[T] NED, n × 3: `strength` [T] towards east from `begin` [s] on for `seconds`."""
    t = np.arange(1, n + 1) * DT
    up = np.clip((t - begin) / RAMP, 0.0, 1.0)
    down = np.clip((begin + seconds - t) / RAMP, 0.0, 1.0)
    iron = np.zeros((n, 3))
    iron[:, 1] = strength * np.minimum(up, down)
    return iron


def observed(truth: Truth, samples: Samples, compass: bool = True) -> Headings:
    """Both headings of the service's observers, calibrated as in the service."""
    calibration, settings = Calibration(CalibrationSettings()), CalibrationSettings()
    observer: AttitudeObserver | None = None
    resting = RestingBias(settings, (0.0, 0.0, 0.0))
    n = len(truth.heading)
    control, navigation, std = (np.full(n, np.nan) for _ in range(3))
    everything = zip(samples.rate, samples.force, samples.field, strict=True)
    for k, (rate, force, field) in enumerate(everything):
        at_ns = round((k + 1) * DT * 1e9)
        if observer is None:
            observer = _calibrated(calibration, rate, force, field, at_ns)
            if observer is not None:
                resting = RestingBias(settings, observer.gyro_bias)
            continue
        observer.step(rate, force, DT)
        resting.imu(rate, force, DT)
        observer.gyro_bias = resting.bias
        control[k] = observer.control.heading
        if compass:
            observer.magnetometer(field, at_ns)
            if observer.compass.offset is not None:
                navigation[k] = control[k] + observer.compass.offset
                std[k] = observer.compass.std
    return Headings(_off(control, truth), _off(navigation, truth), std)


def plain(truth: Truth, samples: Samples, start: float) -> Floats:
    """Error [rad] of the plain filter's heading; it begins at `start` [s] with the truth and the
    mean rate until then as bias."""
    n, first = len(truth.heading), round(start * HZ)
    bias = np.mean(np.array(samples.rate[:first]), axis=0)
    rates = _triples(np.array(samples.rate) - bias)
    q: Quaternion = from_euler(0.0, 0.0, float(truth.heading[first]))
    headings = np.full(n, np.nan)
    for k in range(first, n):
        q = marg.step(q, rates[k], samples.force[k], samples.field[k], PLAIN_GAIN, DT)
        w, x, y, z = q
        headings[k] = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return _off(headings, truth)


def rms(errors: Floats) -> float:
    """[same unit] NaN left out."""
    return float(np.sqrt(np.nanmean(np.square(errors))))


def _calibrated(
    calibration: Calibration, rate: Vec3, force: Vec3, field: Vec3, at_ns: int
) -> AttitudeObserver | None:
    calibration.imu(rate, force, DT)
    calibration.pressure(101_325.0)
    calibration.magnetometer(field)
    learnt = calibration.result()
    if learnt is None or learnt.heading is None or learnt.field is None:
        return None
    observer = AttitudeObserver(AttitudeSettings(), learnt.gyro_bias, learnt.heading, 0.0)
    observer.start(learnt.specific_force)
    observer.agree(at_ns, learnt.field)
    return observer


def _rotations(roll: Floats, pitch: Floats, heading: Floats) -> Floats:
    """R_BN, n × 3 × 3 (Fossen 2011, eq. 2.18, transposed)."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    ch, sh = np.cos(heading), np.sin(heading)
    rows = [
        [ch * cp, sh * cp, -sp],
        [-sh * cr + ch * sp * sr, ch * cr + sr * sp * sh, cp * sr],
        [sh * sr + ch * cr * sp, -ch * sr + sp * sh * cr, cp * cr],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _leaky_sum(pushes: Floats, keep: float) -> Floats:
    sums = np.empty_like(pushes)
    now = np.zeros(3)
    for k, push in enumerate(pushes):
        now = keep * now + push
        sums[k] = now
    return sums


def _off(headings: Floats, truth: Truth) -> Floats:
    return np.remainder(headings - truth.heading + pi, 2 * pi) - pi


def _triples(values: Floats) -> list[Vec3]:
    return [(x, y, z) for x, y, z in values.tolist()]
