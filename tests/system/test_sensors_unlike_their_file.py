"""Sensors that are not what the vehicle file says: how far off the estimate is, and whether it says
so.

One dive of the simulated hull, open loop, at 200 Hz. Each test hangs other sensors on it and gives
what they say to the estimator alone. NEES is the mean of (error / stated standard deviation)²: 1 is
an honest spread, above is one that is too small.
"""

from collections import Counter
from functools import cache
from math import degrees, inf, pi, remainder
from typing import Any, NamedTuple

import numpy as np
import pytest
from msgspec.structs import replace

from messages.message import Estimate
from messages.state import VehicleState
from messages.units import Quaternion, Vec3, Vec6
from services.estimation.core import Estimator
from services.estimation.settings import Settings as EstimationSettings
from services.marine.attitude import heading_of, to_euler, to_world
from services.marine.mounting import ImuMount, Mounting
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.core import at_the_surface
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings
from services.simulator.vessel import STEP, Vessel
from services.simulator.waves import Sea, Waves
from services.vehicle.mounting import place_of

pytestmark = pytest.mark.slow

PIONEER = Stack().section("vehicle", Vehicle)
FILE = Stack().section("estimation", EstimationSettings)
SEA = Stack(overrides=["simulator.floor_depth=30"]).section("simulator", Settings)
STEP_NS = round(STEP * 1e9)
# [s] until, and port, starboard, lateral, vertical thrust [N]: down, turn, ahead in a curve, up,
# turn back, down again.
LEGS = (
    (12.0, (0.0, 0.0, 0.0, 0.0)),
    (20.0, (0.0, 0.0, 0.0, 7.0)),
    (24.0, (8.0, -8.0, 0.0, 1.0)),
    (30.0, (16.0, 12.0, 0.0, 1.0)),
    (34.0, (0.0, 0.0, 0.0, -4.5)),
    (38.0, (-12.0, 12.0, 0.0, 1.0)),
    (44.0, (0.0, 0.0, 0.0, 9.0)),
    (48.0, (0.0, 0.0, 0.0, 1.0)),
)


class Now(NamedTuple):
    """The truth at one instant."""

    stamp_ns: int
    position: Vec3
    attitude: Quaternion
    velocity: Vec6
    acceleration: Vec6


@cache
def dive() -> tuple[Now, ...]:
    world = at_the_surface(PIONEER, SEA)
    hull = Vessel(PIONEER, SEA, world.state, world.thrust)
    found = list[Now]()
    for n in range(round(LEGS[-1][0] / STEP)):
        hull.propulsion.drive(next(thrust for until, thrust in LEGS if n * STEP < until))
        hull.advance(STEP)
        v, nu = hull.through_water, hull.acceleration
        found.append(Now((n + 1) * STEP_NS, hull.position, hull.attitude, v, nu))
    return tuple(found)


class Row(NamedTuple):
    """What one set of sensors made of the dive."""

    errors: dict[str, list[float]]
    ratios: dict[str, list[float]]  # error over stated standard deviation
    events: Counter[str]

    def nees(self, part: str) -> float:
        return float(np.mean(np.square(self.ratios[part])))

    def rms(self, part: str) -> float:
        return float(np.sqrt(np.mean(np.square(self.errors[part]))))


def row(
    seeds: int,
    *,
    waves: Waves | None = None,
    real: Mounting | None = None,
    says: dict[str, Any] | None = None,
    **sensors: Any,
) -> Row:
    """
    Args:
        real: where the sensors really are.
        says: settings of the depth estimate, as the file has them.
        sensors: settings of the simulated ones.
    """
    told = replace(FILE, depth=replace(FILE.depth, **(says or {})))
    all_rows = [
        one(seed, replace(SEA, **sensors), told, waves, real or Mounting()) for seed in range(seeds)
    ]
    together = Row({}, {}, Counter())
    for each in all_rows:
        together.events.update(each.events)
        for part, values in each.errors.items():
            together.errors.setdefault(part, []).extend(values)
            together.ratios.setdefault(part, []).extend(each.ratios[part])
    return together


def one(
    seed: int, place: Settings, told: EstimationSettings, waves: Waves | None, real: Mounting
) -> Row:
    of, sea = Sensors(place, seed, real), None if waves is None else Sea(waves, seed)
    estimator = Estimator(told, PIONEER.floating_depth, vehicle=PIONEER)
    every, found = round(1.0 / (STEP * place.imu_rate)), Row({}, {}, Counter())
    next_pressure_s = 0.0
    for n, now in enumerate(dive()):
        if n * STEP >= next_pressure_s:
            next_pressure_s += 1.0 / place.pressure_rate
            rise = 0.0
            at = place_of(real.pressure.position, now.position, now.attitude)
            if sea is not None:
                rise = sea.at(now.stamp_ns * 1e-9, at).rise
            estimator.pressure(of.pressure(now.stamp_ns, at[2], rise))
        if n % every:
            continue
        estimator.magnetometer(of.magnetometer(now.stamp_ns, now.attitude))
        sample = of.imu(now.stamp_ns, now.attitude, now.velocity, now.acceleration)
        state = estimator.imu(sample, now.stamp_ns)
        if state is not None and state.phase == "running":
            compare(state, now, found)
    found.events.update(estimator.outbox.counts)
    return found


def compare(state: VehicleState, now: Now, found: Row) -> None:
    roll, pitch, _ = to_euler(now.attitude)
    u, v, w, *_ = now.velocity
    rate = to_world(now.attitude, (u, v, w))[2]
    assert state.heading_navigation is not None
    parts: dict[str, tuple[Estimate, float]] = {
        "depth": (state.depth, now.position[2]),
        "rate": (state.depth_rate, rate),
        "yaw rate": (state.yaw_rate, now.velocity[5]),
        "roll": (state.roll, roll),
        "pitch": (state.pitch, pitch),
        "north": (state.heading_navigation, heading_of(now.attitude)),
    }
    for part, (estimate, true) in parts.items():
        if not estimate.valid:
            continue
        error = remainder(estimate.value - true, 2.0 * pi)
        found.errors.setdefault(part, []).append(error)
        found.ratios.setdefault(part, []).append(error / estimate.std)


INCONSISTENT = "inconsistent:sensor/imu"


def rotated(*rows: Vec3) -> Mounting:
    a, b, c = rows
    return Mounting(imu=ImuMount(rotation=(a, b, c)))


ROLLED = rotated((1.0, 0.0, 0.0), (0.0, 0.9962, -0.0872), (0.0, 0.0872, 0.9962))  # by 5°
PITCHED = rotated((0.9986, 0.0, 0.0523), (0.0, 1.0, 0.0), (-0.0523, 0.0, 0.9986))  # by 3°


def test_spreads_are_honest_where_the_file_is_right() -> None:
    found = row(24)  # of 8 the mean of roll and pitch is within 15 %
    for part in ("yaw rate", "roll", "pitch", "north", "depth", "rate"):
        assert 0.4 < found.nees(part) < 1.5, part
    assert found.rms("depth") < 0.010  # [m]
    assert found.rms("rate") < 0.009  # [m/s]
    assert found.events[INCONSISTENT] == 0


LATE = {"pressure_latency": 0.03}
VERY_LATE = {"pressure_latency": 0.1}
ARM = Mounting(imu=ImuMount(position=(0.2, 0.05, 0.1)))
NONE = inf


@pytest.mark.parametrize(
    ("seeds", "sensors", "depth", "rate", "nees_depth", "nees_rate"),
    [
        (2, {"imu_rate": 50.0}, 0.011, 0.010, 1.5, 1.5),
        (2, {"imu_rate": 200.0}, 0.011, 0.010, 1.5, 1.5),
        (3, {"pressure_rate": 10.0}, 0.020, NONE, 1.5, 1.5),
        # At a steady rate a latency cannot be told from depth: the spread does not hold 0.1 s.
        (5, {"says": LATE}, 0.020, NONE, 3.0, 2.5),
        (5, {"says": VERY_LATE}, 0.045, NONE, 9.0, 2.5),
        (3, {"accelerometer_noise": 0.015}, NONE, NONE, 1.5, 5.0),
        (4, {"accelerometer_bias": 0.294}, NONE, NONE, 1.8, 3.0),  # three times the file's
        (2, {"real": ARM}, NONE, 0.021, 1.5, NONE),
        # Until the filter knows the waves, for some seconds, its spread is too small.
        (3, {"waves": Waves(height=0.3, period=4.0, lines=1, begins=12.0)}, 0.03, 0.02, 3.0, 2.5),
    ],
)
def test_what_is_unlike_the_file_costs_no_more_than_this(
    seeds: int,
    sensors: dict[str, Any],
    depth: float,
    rate: float,
    nees_depth: float,
    nees_rate: float,
) -> None:
    """Errors [m] and [m/s], and how much too small the stated spread may be."""
    found = row(seeds, **sensors)
    assert found.rms("depth") < depth
    assert found.rms("rate") < rate
    assert found.nees("depth") < nees_depth
    assert found.nees("rate") < nees_rate
    if "imu_rate" in sensors:
        assert found.events["rate:sensor/imu"] == seeds  # counted: not what the topic says
    if "pressure_rate" in sensors:
        assert found.events[INCONSISTENT] == 0


@pytest.mark.parametrize(("real", "off"), [(ROLLED, 18.0), (PITCHED, 4.5)])
def test_a_turned_imu_that_the_file_does_not_say_costs_the_compass(
    real: Mounting, off: float
) -> None:
    """Its tilt is the accelerometer's, which nothing contradicts at rest; once the vehicle turns,
    the field no longer looks like the Earth's."""
    found = row(2, real=real)
    assert degrees(found.rms("north")) < off
    assert found.events["disturbed:sensor/magnetometer"] == 2
    assert found.nees("depth") < 1.5


def test_the_hull_goes_where_the_tests_think() -> None:
    assert 4.0 < max(now.position[2] for now in dive()) < 12.0
    assert max(now.velocity[5] for now in dive()) > 0.5
    assert min(now.velocity[5] for now in dive()) < -0.5
