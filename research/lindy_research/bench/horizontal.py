"""What position, velocity and current are worth in simulated dives, beside the newest fix and the
newest DVL sample as they are, and what an estimation step costs while all of it runs.

The vehicle file is wrong by up to 20 % in every damping and added mass and the told thrust by up to
10 %. Goals are for DVL 1 Hz, 1 cm/s and USBL 0.5 Hz, 0.5 m.
"""

from collections.abc import Callable, Iterator

import numpy as np

from lindy_research.bench import horizontal_runs as runs
from lindy_research.bench.horizontal_runs import (
    CURRENT,
    POSITION,
    VELOCITY,
    Floats,
    HorizontalRun,
    HorizontalWorld,
)
from lindy_research.bench.table import Figure
from lindy_research.bench.timing import race
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings

SEEDS = range(10)
SECONDS = 90.0  # [s] in motion
PLACE_GOAL, SPEED_GOAL, CURRENT_GOAL = 0.3, 0.02, 0.05  # [m], [m/s], [m/s] rms of one component
LATE = 1.5  # [s] of USBL
STEP_LIMIT = 60.0  # [µs]
STEPS, REPEATS = 300, 15  # a dive is not endless


def figures() -> list[Figure]:
    turning = [runs.world(seed, runs.place(seed), SECONDS) for seed in SEEDS]
    return [
        *_judged("steady current", turning, runs.observe),
        *_judged(f"fixes {LATE} s late", turning, lambda w: runs.observe(w, usbl_latency=LATE)),
        _without_thrust(turning),
        *_judged("current wanders by 0.1 m/s", _worlds(wander=0.1), runs.observe),
        *_judged("legs of 50 s", _worlds(leg=runs.STRAIGHT), runs.observe),
        _cost(turning[0]),
    ]


def _worlds(wander: float = 0.0, leg: float = runs.LEG) -> list[HorizontalWorld]:
    return [runs.world(seed, runs.place(seed, wander), SECONDS, leg) for seed in SEEDS]


def _judged(
    name: str, worlds: list[HorizontalWorld], way: Callable[[HorizontalWorld], HorizontalRun]
) -> Iterator[Figure]:
    found = [way(each) for each in worlds]
    for of, what, unit, naive, goal in (
        (POSITION, "position", "m", "newest fix", PLACE_GOAL),
        (VELOCITY, "velocity", "m/s", "held DVL", SPEED_GOAL),
    ):
        ours, theirs = (
            _rms(found, HorizontalRun.errors, of),
            _rms(found, HorizontalRun.naive_errors, of),
        )
        yield _figure(f"{name}: {what}", unit, ours, naive, theirs)
        yield _figure(f"{name}: {what}, as asked for", unit, ours, "goal", goal, 1.0)
    current = _rms(found, HorizontalRun.errors, CURRENT)
    yield _figure(f"{name}: current", "m/s", current, "goal", CURRENT_GOAL, 1.0)
    yield from _consistency(name, found)


def _without_thrust(worlds: list[HorizontalWorld]) -> Figure:
    """What the accelerometer alone makes of the same dives; the current is then unknown."""
    found = [runs.observe(each, thrust_heard=False) for each in worlds]
    with_thrust = [runs.observe(each) for each in worlds]
    ours, theirs = (_rms(each, HorizontalRun.errors, VELOCITY) for each in (with_thrust, found))
    return _figure("steady current: velocity, thrust heard", "m/s", ours, "not heard", theirs)


def _consistency(name: str, found: list[HorizontalRun]) -> Iterator[Figure]:
    """Errors and innovations over their stated deviation, squared: 1 is honest, less is careful."""
    for of, what in ((POSITION, "position"), (VELOCITY, "velocity"), (CURRENT, "current")):
        ours = float(np.mean(np.concatenate([each.squares(of) for each in found])))
        yield _figure(f"{name}: {what} error², of its own variance", "", ours, "honest", 1.0)
    for sensor in ("dvl", "usbl"):
        values = [value for each in found for value in each.squares_of[sensor]]
        ours = float(np.mean(values))
        yield _figure(f"{name}: innovation² of {sensor}", "", ours, "honest", 1.0)


def _cost(seen: HorizontalWorld) -> Figure:
    (step,) = race(Underway(seen), repeats=REPEATS)
    name = "one step: IMU, magnetometer, pressure, thrust and aids to state"
    return _figure(name, "µs", step / 1e3, "limit", STEP_LIMIT, 1.0)


class Underway:
    """Steps of the whole estimator in motion, with everything heard."""

    def __init__(self, seen: HorizontalWorld) -> None:
        settings = Settings(calibration=CalibrationSettings(still_time=runs.STILL))
        self._estimator = Estimator(settings, seen.vehicle.floating_depth, None, seen.vehicle)
        self._moments = iter(seen.moments)
        for _ in range(round(runs.SETTLED * runs.HZ)):
            self._step()

    def __call__(self) -> int:
        for _ in range(STEPS):
            self._step()
        self._estimator.outbox.said.clear()
        return STEPS

    def _step(self) -> None:
        moment = next(self._moments)
        for aid in moment.aids:
            runs.tell(self._estimator, aid)
        runs.step(self._estimator, moment, thrust_heard=True)


def _rms(
    found: list[HorizontalRun], errors: Callable[[HorizontalRun, slice], Floats], of: slice
) -> float:
    return runs.rms(np.concatenate([errors(each, of) for each in found]))


def _figure(
    name: str, unit: str, ours: float, beside: str, other: float, goal: float | None = None
) -> Figure:
    return Figure(
        section="horizontal", name=name, unit=unit, ours=ours,
        baseline_name=beside, baseline=other, goal=goal,
    )  # fmt: skip
