"""What the depth observers are worth, beside the thesis' way, in the same dives; and their cost.

Each observer has its process noise tuned on one dive, for the least error of the depth rate, and is
judged on others. The goals are for the settings as shipped, told only what a data sheet says of the
pressure sensor.
"""

from collections.abc import Iterator

import numpy as np

from lindy_research.bench.depth_runs import (
    PRESSURE_RATE,
    RATE,
    SETTLED,
    TYPICAL,
    DepthWorld,
    Score,
    Sensor,
    observe,
    score,
    world,
)
from lindy_research.bench.depth_variants import WAYS
from lindy_research.bench.table import Figure
from lindy_research.bench.timing import race
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from services.estimation.core import Estimator, Settings
from services.estimation.depth.depth_filter import DepthSettings
from services.marine.vehicle import GRAVITY
from tests.support.flights import Floats

COARSE = Sensor("σ 5 cm", 0.05)
LATE = Sensor("σ 5 mm, 30 ms late", 0.005, latency=0.03)
SENSORS = (
    COARSE,
    Sensor("5 cm steps", 0.0, step=0.05),
    Sensor("σ 2 cm, 5 cm steps", 0.02, step=0.05),
    Sensor("σ 5 mm", 0.005),
    LATE,
)
THESIS = "hold"
TUNING_SEED, SEEDS = 0, (1, 2, 3, 4)
MOTION_NOISES = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)  # [m/s²/√Hz]
ACCELERATION_NOISES = (0.002, 0.003, 0.005, 0.01)  # [m/s²/√Hz]
WORDS = ("depth", "depth rate", "lag of the rate")
UNITS = ("mm", "mm/s", "ms")
GOALS = ((COARSE, (10.0, 9.0, 20.0)), (LATE, (2.0, 4.0, 20.0)))
CONSISTENCY_SEEDS = 20
NORMAL_95 = 1.96  # [σ] half of the band that holds 95 % of a Gaussian
CHI2_20_95 = (9.591, 34.170)  # the band that holds 95 % of χ² with 20 degrees of freedom
STEP_LIMIT = 60.0  # [µs]
STEPS = 300


def figures() -> list[Figure]:
    return [*_observers(), *_goals(), *_consistency(), _cost()]


def _observers() -> Iterator[Figure]:
    for sensor in SENSORS:
        tuning = world(sensor, TUNING_SEED)
        dives = [world(sensor, seed) for seed in SEEDS]
        scores = {way: _scored(dives, way, tuned(tuning, sensor, way)) for way in WAYS}
        for way, ours in scores.items():
            if way != THESIS:
                yield from _rows(f"{sensor.name}, {way}", ours, scores[THESIS])


def tuned(seen: DepthWorld, sensor: Sensor, way: str) -> DepthSettings:
    """The settings of a way with the process noise that gives the least error of the rate."""
    if way == "accelerometer":
        tries = [sensor.settings(acceleration_noise=noise) for noise in ACCELERATION_NOISES]
    else:
        tries = [sensor.settings(motion_noise=noise) for noise in MOTION_NOISES]
    return min(tries, key=lambda settings: score(seen, observe(seen, way, settings)).rate)


def _scored(dives: list[DepthWorld], way: str, settings: DepthSettings) -> Score:
    """Root mean square over the dives."""
    rows: Floats = np.array([score(seen, observe(seen, way, settings)) for seen in dives])
    depth, rate, lag = np.sqrt(np.mean(rows**2, axis=0)).tolist()
    return Score(depth, rate, lag)


def _rows(name: str, ours: Score, thesis: Score) -> Iterator[Figure]:
    for word, unit, mine, other in zip(WORDS, UNITS, ours, thesis, strict=True):
        yield Figure(
            section="estimation", name=f"{name}: {word}", unit=unit, ours=mine,
            baseline_name="thesis: hold", baseline=other,
        )  # fmt: skip


def _goals() -> Iterator[Figure]:
    for sensor, limits in GOALS:
        dives = [world(sensor, seed) for seed in SEEDS]
        ours = _scored(dives, "accelerometer", sensor.settings())
        for word, unit, mine, limit in zip(WORDS, UNITS, ours, limits, strict=True):
            yield _against(f"{sensor.name}, as shipped: {word}", unit, mine, "goal", limit)


def _consistency() -> Iterator[Figure]:
    """Normalised innovation squared (Bar-Shalom, Li and Kirubarajan 2001, section 5.4.2)."""
    for sensor in (COARSE, LATE):
        squares: Floats = (
            np.array([_surprises(sensor, seed) for seed in range(CONSISTENCY_SEEDS)]) ** 2
        )
        off = abs(float(np.mean(squares)) - 1.0)
        band = NORMAL_95 * (2.0 / squares.size) ** 0.5
        low, high = CHI2_20_95
        total: Floats = np.sum(squares, axis=0)
        outside = 100.0 * sum(not low <= each <= high for each in total.tolist()) / len(total)
        name = f"{sensor.name}, as shipped: innovations squared"
        yield _against(f"{name}, mean off 1 by", "", off, "95 % band over 20 seeds", band)
        yield Figure(
            section="estimation", name=f"{name}, times outside their band", unit="%",
            ours=outside, baseline_name="expected", baseline=5.0,
        )  # fmt: skip


def _surprises(sensor: Sensor, seed: int) -> list[float]:
    """[σ] Innovations once settled, as many for each seed."""
    found = observe(world(sensor, seed), "accelerometer", sensor.settings())
    first = round(SETTLED * PRESSURE_RATE)
    return found.surprise[first : first + 3000].tolist()


def _cost() -> Figure:
    (step,) = race(AtRest())
    name = "one step: IMU, magnetometer and pressure to state"
    return _against(name, "µs", step / 1e3, "limit", STEP_LIMIT)


def _against(name: str, unit: str, ours: float, limit_name: str, limit: float) -> Figure:
    return Figure(
        section="estimation", name=name, unit=unit, ours=ours,
        baseline_name=limit_name, baseline=limit, goal=1.0,
    )  # fmt: skip


class AtRest:
    """Steps of the whole estimator at rest, all three sensors heard at each."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        # Samples that never change would be those of a frozen sensor.
        self._noise: list[list[float]] = rng.standard_normal((STEPS, 10)).tolist()
        self._estimator = Estimator(Settings(), 0.0)
        self._steps = 0
        while (state := self._step()) is None or state.phase != "running":
            assert self._steps < 6000, "the estimator does not calibrate at rest"

    def __call__(self) -> int:
        for _ in range(STEPS):
            self._step()
        self._estimator.outbox.said.clear()
        return STEPS

    def _step(self) -> VehicleState | None:
        self._steps += 1
        now = round(self._steps * 1e9 / RATE)
        p, q, r, x, y, z, a, b, c, d = self._noise[self._steps % STEPS]
        field = (15e-6 + 4e-7 * a, 4e-7 * b, 48e-6 + 4e-7 * c)
        self._estimator.magnetometer(MagnetometerSample(stamp_ns=now, field=field))
        pressure = TYPICAL.atmosphere + 500.0 * d
        self._estimator.pressure(PressureSample(stamp_ns=now, pressure=pressure))
        still = ImuSample(
            stamp_ns=now,
            specific_force=(0.03 * x, 0.03 * y, 0.03 * z - GRAVITY),
            angular_rate=(1e-3 * p, 1e-3 * q, 1e-3 * r),
        )
        return self._estimator.imu(still, now)
