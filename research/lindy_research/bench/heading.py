"""What the two headings are worth, beside a plain filter that follows the compass (Madgwick 2010),
and what one step of estimation costs.

Goals are absolute: the goal itself stands as the baseline where nothing else is measured.
"""

import time
from math import degrees

import numpy as np

from lindy.api.messages import ImuSample, MagnetometerSample, PressureSample
from lindy.api.vehicle import GRAVITY
from lindy_research import heading_runs as runs
from lindy_research.bench.table import Figure
from lindy_research.flights import HZ, TruthLog
from services.estimation.core import Estimator
from services.estimation.settings import Settings

Moment = tuple[ImuSample, MagnetometerSample, PressureSample]
SEEDS = 20
MINUTES = 5.0
FEW = range(5)  # seeds of the runs with a compass
IRON_AT, IRON_FOR, IRON = 60.0, 20.0, 20e-6  # [s], [s], [T]


def figures() -> list[Figure]:
    return [*_drift(), *_clean(), *_disturbed(), _cost()]


def _drift() -> list[Figure]:
    """Control heading over 5 min with pitching and turns, after the default calibration alone."""
    flight = runs.dive(60.0 * MINUTES)
    drifts = [_drift_of(flight, seed) for seed in range(SEEDS)]
    name = f"control drift, {SEEDS} seeds, {flight.calibrated / HZ:.0f} s of calibration"
    each = (("rms", runs.rms(np.array(drifts)), 0.2), ("worst", max(map(abs, drifts)), 0.5))
    return [
        _figure(f"{name}, {what}", "°/min", value, "limit", limit, 1.0)
        for what, value, limit in each
    ]


def _drift_of(flight: TruthLog, seed: int) -> float:
    """[°/min] between arming and the end."""
    samples = runs.measured(flight, seed, runs.TYPICAL, compass=False)
    error = runs.observed(flight, samples).control
    return degrees(float(error[-1] - error[flight.armed])) / MINUTES


def _clean() -> list[Figure]:
    """Navigation heading without iron."""
    flight = runs.dive(120.0)
    found: list[Figure] = []
    for sensors, name, goal in (
        (runs.CLEAN, "navigation, clean, rms", 2.0),
        (runs.TYPICAL, "navigation, accelerometer 10 mg, iron 0.2 µT, rms", None),
    ):
        ours: list[float] = []
        theirs: list[float] = []
        for seed in FEW:
            samples = runs.measured(flight, seed, sensors)
            ours.append(runs.rms(runs.observed(flight, samples).navigation))
            theirs.append(runs.rms(runs.plain(flight, samples)))
        mean, other = degrees(runs.rms(np.array(ours))), degrees(runs.rms(np.array(theirs)))
        found.append(_figure(name, "°", mean, "plain filter", other))
        if goal is not None:
            found.append(_figure(name, "°", mean, "limit", goal, 1.0))
    return found


def _disturbed() -> list[Figure]:
    """20 µT towards east for 20 s: peak errors while it lasts and 10 s after."""
    flight = runs.dive(120.0)
    n = len(flight.heading)
    iron = runs.passing_iron(n, IRON_AT, IRON_FOR, IRON)
    window = slice(round(IRON_AT * HZ), round((IRON_AT + IRON_FOR + 10.0) * HZ))
    navigation, control, plain = 0.0, 0.0, 0.0
    for seed in FEW:
        samples = runs.measured(flight, seed, runs.CLEAN, iron)
        seen = runs.observed(flight, samples)
        drifted = seen.control[window] - seen.control[window.start]
        navigation = max(navigation, degrees(float(np.max(np.abs(seen.navigation[window])))))
        control = max(control, degrees(float(np.max(np.abs(drifted)))))
        plain = max(plain, degrees(float(np.max(np.abs(runs.plain(flight, samples)[window])))))
    name = f"navigation, 20 µT for 20 s, {len(FEW)} seeds, peak"
    return [
        _figure(name, "°", navigation, "plain filter", plain),
        _figure(name, "°", navigation, "limit", 10.0, 1.0),
        _figure("control in the same window, peak", "°", control, "plain filter", plain),
        _figure("control in the same window, peak", "°", control, "limit", 0.3, 1.0),
    ]


def _cost() -> Figure:
    """One IMU sample with its magnetometer and pressure sample, in mid-dive."""
    estimator = Estimator(Settings(), 0.17)
    noise = np.random.default_rng(1).standard_normal((2000, 3)).tolist()
    samples = [_at(k, a, b, c) for k, (a, b, c) in enumerate(noise)]
    _feed(estimator, samples[:500])
    best = min(_feed(estimator, samples[k : k + 100]) for k in range(500, 2000, 100))
    return _figure("one step of estimation", "µs", best / 1e3, "limit", 60.0, 1.0)


def _feed(estimator: Estimator, samples: list[Moment]) -> float:
    """[ns] per moment."""
    began = time.perf_counter_ns()
    for imu, field, pressure in samples:
        estimator.pressure(pressure)
        estimator.magnetometer(field)
        estimator.imu(imu, imu.stamp_ns)
    return (time.perf_counter_ns() - began) / len(samples)


def _at(k: int, a: float, b: float, c: float) -> Moment:
    now = (k + 1) * 10_000_000
    force = (0.015 * a, 0.015 * b, 0.015 * c - GRAVITY)
    rate = (0.001 * b, 0.001 * c, 0.001 * a)
    return (
        ImuSample(stamp_ns=now, specific_force=force, angular_rate=rate),
        MagnetometerSample(stamp_ns=now, field=(15e-6 + 1e-7 * a, 1e-7 * b, 49e-6 + 1e-7 * c)),
        PressureSample(stamp_ns=now, pressure=103_000.0 + 100.0 * a),
    )


def _figure(
    name: str, unit: str, ours: float, other: str, baseline: float, goal: float | None = None
) -> Figure:
    return Figure(
        section="heading", name=name, unit=unit, ours=ours,
        baseline_name=other, baseline=baseline, goal=goal,
    )  # fmt: skip
