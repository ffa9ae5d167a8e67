"""Attitude, depth and the velocity by the thrust in lanes, beside the estimator's own."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.sensors import ImuSample, PressureSample
from messages.vehicle import Actuation
from services.estimation.core import Estimator
from services.estimation.depth.swell import Swell
from services.estimation.settings import Settings
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.stack import Stack
from tools.sweep.fast.estimation import Estimators
from tools.sweep.fast.swell import Swells

SEEDS = st.integers(0, 2**32 - 1)
COUNT, PERIOD = 3, 10_000_000  # lanes, [ns]
# What a lane does not know, and so is lost.
DOUBTS = ("outlier:sensor/pressure", "distrusted", "doubted", "jumped", "restarted")
CALIBRATING, MOVING = 200, 300  # samples


@pytest.mark.parametrize("name", ["pioneer", "bluerov2_heavy", "minerva"])
@settings(max_examples=2)
@given(seed=SEEDS)
def test_a_lane_estimates_what_its_estimator_does(name: str, seed: int):
    """At rest and then under way: smooth turns, accelerations and thrust at random, and noise."""
    quick = "estimation.calibration.still_time=2"
    stack = Stack(pilot="script:first_dive", vehicle=name, overrides=[quick])
    its, vehicle = stack.section("estimation", Settings), stack.section("vehicle", Vehicle)
    alone = [Estimator(its, vehicle.floating_depth, vehicle=vehicle) for _ in range(COUNT)]
    lanes = Estimators(its, vehicle, COUNT)
    rng = np.random.default_rng(seed)
    turns, pushes = rng.uniform(-0.3, 0.3, (2, 3, COUNT))
    thrust = np.array([t.max_thrust for t in vehicle.thruster])[:, None]
    thrust = thrust * rng.uniform(-0.5, 0.5, (len(thrust), COUNT))
    depth, rates = np.full(COUNT, vehicle.floating_depth), rng.uniform(0.0, 0.4, COUNT)
    for k in range(1, CALIBRATING + MOVING):
        at, moves = k * PERIOD, max(0.0, np.sin(0.02 * max(0, k - CALIBRATING - 30)))
        if k % 4 == 0:
            pressure = 101_325.0 + 1025.0 * GRAVITY * depth + rng.normal(0.0, 200.0, COUNT)
            lanes.pressure(pressure, at - 3_000_000)
            for lane, estimator in enumerate(alone):
                estimator.pressure(sample_of(float(pressure[lane]), at - 3_000_000))
        force = moves * pushes + rng.normal(0.0, 0.015, (3, COUNT))
        force[2] -= GRAVITY
        rate = moves * turns + 0.01 + rng.normal(0.0, 0.001, (3, COUNT))
        depth = depth + moves * rates * 0.01
        lanes.imu(tuple(force), tuple(rate), at, 0.0 if k == 1 else 0.01)
        for lane, estimator in enumerate(alone):
            estimator.imu(imu_of(at, force[:, lane], rate[:, lane]), at)
        now = moves * thrust if k > CALIBRATING else 0.0 * thrust
        lanes.actuation(now)
        for lane, estimator in enumerate(alone):
            estimator.actuation(actuation_of(at, now[:, lane]))
    assert lanes.running
    for lane, estimator in enumerate(alone):
        compare(lanes, lane, estimator)


def compare(lanes: Estimators, lane: int, estimator: Any) -> None:
    doubts = [name for name in estimator.outbox.counts if name.startswith(DOUBTS)]
    assert bool(lanes.lost[lane]) == bool(doubts)
    if doubts:
        return
    observer, filter_ = estimator._attitude, estimator._depth._filter
    state = *observer.filter.q, *observer.gyro_bias, observer.control.yaw_rate
    here = lanes.attitude
    found = *here.q, *here.bias, here.yaw_rate
    assert [float(part[lane]) for part in found] == pytest.approx(state, abs=1e-9)
    assert here.heading[lane] == pytest.approx(observer.control.heading, abs=1e-9)
    mean = filter_.depth, filter_.rate, filter_.bias, *filter_.horizontal_bias, *filter_.tilt
    mine = lanes.depth.filter.state[:, lane]
    assert mine == pytest.approx((*mean, *filter_.velocity), abs=1e-9)
    covariance = lanes.depth.filter.covariance[:, :, lane]
    assert covariance.ravel() == pytest.approx(np.array(filter_.covariance).ravel(), abs=1e-9)
    assert lanes.depth.filter.doubt_of_force[lane] == pytest.approx(filter_.doubt_of_force)


def imu_of(at: int, force: Any, rate: Any) -> ImuSample:
    return ImuSample(
        stamp_ns=at, specific_force=tuple(force.tolist()), angular_rate=tuple(rate.tolist())
    )


def sample_of(pressure: float, at: int) -> PressureSample:
    return PressureSample(stamp_ns=at, pressure=pressure, temperature=8.0)


def actuation_of(at: int, thrust: Any) -> Actuation:
    return Actuation(
        stamp_ns=at, thrust=tuple(thrust.tolist()), measured=True, actuated_ns=None,
        sensor_ns=None, pilot_ns=None, stale=False, power=0.0,
    )  # fmt: skip


@settings(max_examples=5)
@given(seed=SEEDS)
def test_a_lane_sees_the_waves_that_its_swell_does(seed: int):
    rng = np.random.default_rng(seed)
    lanes, alone = Swells(COUNT), [Swell() for _ in range(COUNT)]
    period, size = rng.uniform(1.5, 14.0, COUNT), rng.uniform(0.0, 0.3, COUNT)
    for k in range(600):
        innovation = size * np.sin(2 * np.pi * k * 0.03 / period) + rng.normal(0.0, 0.01, COUNT)
        lanes.add(innovation, np.full(COUNT, 0.02), 0.03)
        for lane, swell in enumerate(alone):
            swell.add(float(innovation[lane]), 0.02, 0.03)
    for lane, swell in enumerate(alone):
        assert (lanes.rolls[lane], lanes.leaves[lane]) == (swell.rolls, swell.leaves)
        assert lanes.amplitude[lane] == pytest.approx(swell.amplitude, abs=1e-9)
        assert lanes.mean[lane] == pytest.approx(swell.mean, abs=1e-9)
