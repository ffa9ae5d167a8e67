"""Allocation, pulses, guards and the whole control law in lanes, beside the scalar ones."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from services.control.allocation.allocation import Allocation
from services.control.axis.plant import Plant
from services.control.axis.rest_pulse import RestPulse
from services.control.core import Controller
from services.control.settings import Settings
from services.marine.attitude import from_euler
from services.marine.vehicle import Vehicle
from services.reference.guidance.guards import ReferenceGovernor, Standstill, TiltLimit, is_released
from services.reference.settings import VelocityAxis
from services.runtime.config.stack import Stack
from tools.sweep.fast.allocation import LaneAllocation
from tools.sweep.fast.axis import LanePulse
from tools.sweep.fast.control import Controllers
from tools.sweep.fast.dives import LaneState
from tools.sweep.fast.reference import (
    HeldAxis,
    LaneMotion,
    LaneReference,
    Standstills,
    TiltLimits,
)

SEEDS = st.integers(0, 2**32 - 1)
COUNT, DT = 4, 0.01
NAMES = ["pioneer", "bluerov2_heavy", "minerva"]


def control_of(name: str) -> tuple[Settings, Vehicle]:
    stack = Stack(pilot="script:first_dive", vehicle=name)
    return stack.section("control", Settings), stack.section("vehicle", Vehicle)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15)
@given(seed=SEEDS)
def test_a_lane_is_allocated_as_alone(name: str, seed: int):
    """Small wrenches within dead-bands, and demands that no thrusters meet."""
    gains, vehicle = control_of(name)
    rng = np.random.default_rng(seed)
    lanes = LaneAllocation(vehicle, gains.allocation, COUNT)
    alone = [Allocation(vehicle, gains.allocation) for _ in range(COUNT)]
    most = max(thruster.max_thrust for thruster in vehicle.thruster)
    for _ in range(6):
        size = most * 10.0 ** rng.uniform(-2.5, 0.7, COUNT)
        wrench = size * rng.normal(0.0, 1.0, (6, COUNT)) * (rng.random((6, COUNT)) < 0.7)
        done = lanes.allocate_all(wrench)
        for lane, allocation in enumerate(alone):
            x, y, z, k, m, n = wrench[:, lane].tolist()
            single = allocation.allocate((x, y, z, k, m, n))
            assert done.thrust[:, lane] == pytest.approx(single.thrust, abs=1e-9)
            assert done.achieved[:, lane] == pytest.approx(single.achieved, abs=1e-9)
            assert bool(done.saturated[lane]) == bool(single.saturated)


@settings(max_examples=5)
@given(seed=SEEDS)
def test_a_lane_pulses_as_alone(seed: int):
    """A heading that drifts within the dead-band, that pulses move as they should, or hardly."""
    rng, plant, pushes = np.random.default_rng(seed), Plant(0.37, 0.87, 1.5), [0.07, 0.065]
    lanes = LanePulse(plant, 0.08, DT, pushes, 0.003, COUNT)
    alone = [RestPulse(plant, 0.08, DT, pushes, 0.003) for _ in range(COUNT)]
    error, answers = rng.normal(0.0, 0.02, COUNT), rng.uniform(0.0, 2.0, COUNT)
    rate, effective = np.zeros(COUNT), np.zeros(COUNT, bool)
    for k in range(500):
        resting = not 250 < k < 270
        given_ = lanes.step(error, rate, effective, resting=resting)
        for lane, pulse in enumerate(alone):
            pulse.effective = bool(effective[lane])
            single = pulse.step(float(error[lane]), float(rate[lane]), resting=resting)
            assert given_[lane] == pytest.approx(np.nan if single is None else single, nan_ok=True)
            assert lanes.turn[lane] == pulse.turn
        force = answers * 0.07 * np.nan_to_num(given_)
        rate = rate + DT / plant.inertia * (force - plant.linear * rate)
        error = error - rate * DT + rng.normal(0.0, 1e-5, COUNT)
        effective = (np.nan_to_num(given_) != 0.0) | (rng.random(COUNT) < 0.005)


@settings(max_examples=5)
@given(seed=SEEDS)
def test_a_lane_is_guarded_as_alone(seed: int):
    rng = np.random.default_rng(seed)
    axis_limits = VelocityAxis(0.5, 0.5, 1.5, 0.2, 1.0, 4.0)
    axis, limits, stills = (
        HeldAxis(axis_limits, COUNT),
        TiltLimits(0.5, COUNT),
        Standstills(0.05, COUNT),
    )
    governors = [ReferenceGovernor(0.2) for _ in range(COUNT)]
    tilts = [TiltLimit(0.5) for _ in range(COUNT)]
    single = [Standstill(0.05) for _ in range(COUNT)]
    axis.rest(np.zeros(COUNT), 0.0)
    position, pitch = np.zeros(COUNT), np.zeros(COUNT)
    for k in range(1, 500):
        t = k * DT
        axis.ramp.aim(0.4 if k % 350 < 120 else 0.0, t)
        here, now = axis.ramp.at(t), axis.now(t)
        position = position + rng.uniform(-0.001, 0.006, COUNT) * (k % 350 < 200)
        pitch = np.clip(pitch + rng.normal(0.002, 0.02, COUNT), -1.0, 1.0)
        limits.step(np.zeros(COUNT), pitch, DT)
        by = axis.keep(position, t, DT)
        resting = here.velocity == 0.0 == here.acceleration
        off, rate = position - now.position, rng.normal(0.0, 0.01, COUNT)
        moved = stills.step(off, rate, here, t, resting=resting, apart=axis.blocked)
        for lane in range(COUNT):
            error = float(now.position[lane] - position[lane])
            share = governors[lane].keep(abs(error), DT, released=is_released(here))
            assert by[lane] == pytest.approx(error * (share - 1.0), abs=1e-12)
            assert bool(axis.blocked[lane]) == governors[lane].blocked
            assert limits.share[lane] == pytest.approx(
                tilts[lane].step(abs(float(pitch[lane])), DT), abs=1e-9
            )
            if governors[lane].blocked:
                single[lane].cancel()
                assert moved[lane] == 0.0
            else:
                alone = single[lane].step(
                    float(off[lane]), float(rate[lane]), t, resting=resting, velocity=here.velocity
                )
                assert moved[lane] == pytest.approx(alone, abs=1e-12)
        axis.shift(by)


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=2)
@given(seed=SEEDS)
def test_a_lane_is_controlled_as_alone(name: str, seed: int):
    """Moves and rests, errors small and large, tilt, and forces that saturate thrusters."""
    gains, vehicle = control_of(name)
    rng = np.random.default_rng(seed)
    lanes = Controllers(gains, vehicle, COUNT)
    alone = [Controller(gains, vehicle, Outbox()) for _ in range(COUNT)]
    most = sum(thruster.max_thrust for thruster in vehicle.thruster)
    force = 0.5 * most * rng.uniform(-1.0, 1.0, (2, COUNT)) * (rng.random(COUNT) < 0.7)
    sizes = rng.uniform(0.0, [[0.05], [0.2], [0.3], [0.3], [0.2]], (5, COUNT))
    phases, speeds = rng.uniform(0.0, 6.3, (5, COUNT)), rng.uniform(0.5, 3.0, (5, COUNT))
    # In the step before arming the law only takes in the time.
    done: Any = None
    for k in range(150):
        t, moves = k * DT, 40 < k % 100 < 70
        swing = sizes * np.sin(speeds * t + phases)
        rates = sizes * speeds * np.cos(speeds * t + phases)
        depth, turn = swing[0] + 5.0, swing[1]
        roll, pitch = swing[2], swing[3]
        motion = (0.2, 0.1, -0.3) if moves else (0.0, 0.0, 0.0)
        q: Any = np.array([from_euler(a, b, 0.0) for a, b in zip(roll, pitch, strict=True)]).T
        if k > 0:
            reference = LaneReference(
                LaneMotion(np.full(COUNT, 5.0), *motion),
                LaneMotion(np.zeros(COUNT), *motion),
                force[0], force[1],
            )  # fmt: skip
            state = LaneState(depth, rates[0], turn, rates[1], roll, pitch, tuple(q))
            done = lanes.step(reference, state, DT)
        for lane, controller in enumerate(alone):
            numbers = [x[lane] for x in (depth, rates[0], turn, rates[1], roll, pitch)]
            at = 1_000_000_000 + k * 10_000_000
            message = state_of(at, numbers, tuple(q[:, lane].tolist()))
            wanted = reference_of(at, motion, force[:, lane], armed=k > 0)
            wrench, command = controller.step(wanted, message, at)
            if k > 0:
                assert done.thrust[:, lane] == pytest.approx(command.thrust, abs=1e-7)
                assert done.achieved[:, lane] == pytest.approx(wrench.achieved, abs=1e-7)


def state_of(at: int, numbers: list[float], q: Any) -> VehicleState:
    depth, rate, heading, yaw_rate, roll, pitch = (
        Estimate(float(number), 0.01, valid=True) for number in numbers
    )
    none = dict.fromkeys(
        ("surge_velocity", "sway_velocity", "north", "east", "current_north", "current_east")
    )
    return VehicleState(
        stamp_ns=at, sensor_ns=at, phase="running", calibration_left=None, depth=depth,
        depth_rate=rate, depth_acceleration=Estimate(0.0, 0.1, valid=True), attitude=q, roll=roll,
        pitch=pitch, heading=heading, heading_navigation=None, yaw_rate=yaw_rate,
        pressure_age_ms=1.0, **none,
    )  # fmt: skip


def reference_of(at: int, motion: tuple[float, ...], force: Any, *, armed: bool) -> Reference:
    return Reference(
        stamp_ns=at, sensor_ns=at, pilot_ns=None, epoch=1, armed=armed,
        armed_ns=1_000_000_000 if armed else None, depth=Motion(5.0, *motion),
        heading=Motion(0.0, *motion), surge_force=float(force[0]), sway_force=float(force[1]),
        heave_force=None, yaw_moment=None, surge=None, north=None, east=None,
        tilt=Motion(0.0, 0.0, 0.0, 0.0), gripper=0.0,
    )  # fmt: skip
