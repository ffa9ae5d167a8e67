"""What depth and its rate are worth, beside the thesis' observer in the same dives; and their cost.

The thesis' process noise is tuned on one dive, for the least error of the rate, and judged on
others. Lindy's settings are as shipped, told only what a data sheet says of the pressure sensor.
"""

from collections.abc import Iterator

import numpy as np

from lindy.api.messages import ImuSample, MagnetometerSample, PressureSample, VehicleState
from lindy.api.vehicle import GRAVITY
from lindy_research.bench.depth_runs import (
    RATE,
    TYPICAL,
    DepthWorld,
    Estimates,
    Score,
    Sensor,
    lindy,
    score,
    thesis,
    world,
)
from lindy_research.bench.table import Figure
from lindy_research.bench.timing import race
from lindy_research.dives import Floats
from services.estimation.core import Estimator
from services.estimation.settings import Settings

COARSE = Sensor("σ 5 cm", 0.05)
LATE = Sensor("σ 5 mm, 30 ms late", 0.005, latency=0.03)
SENSORS = (
    COARSE,
    Sensor("5 cm steps", 0.0, step=0.05),
    Sensor("σ 2 cm, 5 cm steps", 0.02, step=0.05),
    Sensor("σ 5 mm", 0.005),
    LATE,
)
TUNING_SEED, SEEDS = 0, (1, 2, 3, 4)
MOTION_NOISES = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)  # [m/s²/√Hz]
WORDS = ("depth", "depth rate", "lag of the rate")
UNITS = ("mm", "mm/s", "ms")
GOALS = {COARSE: (10.0, 9.0, 20.0), LATE: (2.0, 4.0, 20.0)}
CONSISTENCY_SEEDS = 20
NORMAL_95 = 1.96  # [σ] half of the band that holds 95 % of a Gaussian
STEP_LIMIT = 60.0  # [µs]
STEPS = 300


def figures() -> list[Figure]:
    return [*_observers(), *_consistency(), _cost()]


def _observers() -> Iterator[Figure]:
    for sensor in SENSORS:
        dives = [world(sensor, seed) for seed in SEEDS]
        noise = tuned(world(sensor, TUNING_SEED), sensor)
        theirs = _scored(dives, [thesis(seen, "hold", sensor, noise) for seen in dives])
        ours = _scored(dives, [lindy(seen, sensor.settings()) for seen in dives])
        limits = GOALS.get(sensor, (None, None, None))
        for word, unit, mine, other, limit in zip(WORDS, UNITS, ours, theirs, limits, strict=True):
            name = f"{sensor.name}: {word}"
            yield Figure(
                section="estimation", name=name, unit=unit, ours=mine,
                baseline_name="thesis", baseline=other,
            )  # fmt: skip
            if limit is not None:
                yield _against(name, unit, mine, "goal", limit)


def tuned(seen: DepthWorld, sensor: Sensor) -> float:
    """[m/s²/√Hz] The thesis' process noise with the least error of the rate."""
    return min(
        MOTION_NOISES, key=lambda noise: score(seen, thesis(seen, "hold", sensor, noise)).rate
    )


def _scored(dives: list[DepthWorld], found: list[Estimates]) -> Score:
    """Root mean square over the dives."""
    rows: Floats = np.array([score(*pair) for pair in zip(dives, found, strict=True)])
    depth, rate, lag = np.sqrt(np.mean(rows**2, axis=0)).tolist()
    return Score(depth, rate, lag)


def _consistency() -> Iterator[Figure]:
    """Normalised innovation squared (Bar-Shalom, Li and Kirubarajan 2001, section 5.4.2)."""
    for sensor in (COARSE, LATE):
        seeds = range(CONSISTENCY_SEEDS)
        found = [lindy(world(sensor, seed), sensor.settings()).squares for seed in seeds]
        squares: Floats = np.concatenate(found)
        band = NORMAL_95 * (2.0 / squares.size) ** 0.5
        name = f"{sensor.name}: innovations squared, mean off 1 by"
        off = abs(float(np.mean(squares)) - 1.0)
        yield _against(name, "", off, f"95 % band over {CONSISTENCY_SEEDS} seeds", band)


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
