"""The estimator as a whole, against a truth made here."""

import math
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from msgspec import UNSET
from msgspec.structs import replace

from messages.message import Estimate
from messages.state import VehicleState
from services.marine.attitude import from_euler, to_body, to_world
from services.marine.mounting import Mounting, Placed
from services.marine.vehicle import GRAVITY, Vehicle
from services.runtime.config.stack import Stack
from tests.services.estimation.sensed import AIR, FLOATING, Law, Sensed

BIAS = (0.01, 0.01, 0.01)  # [rad/s]


def dive(seed: int = 0, *, compass: bool = False) -> Sensed:
    """With an IMU that is off, and a noisy pressure."""
    d = Sensed(seed=seed, compass=compass)
    d.noise = {"force": 0.03, "rate": 0.002, "pressure": 500.0, "field": 1e-9}
    d.more = {"force": (0.0, 0.0, 0.05), "rate": BIAS}
    return d


STEPS = [(5, 0.0), (9, 0.5), (14, 0.0), (18, -0.5), (22, 0.5), (26, 0.0), (30, -0.5), (33, 0.0)]
RAMP = 1.2  # [s]


def smooth_steps() -> tuple[Law, Law, Law]:
    """Depth [m], rate [m/s], acceleration [m/s²]: rate steps of parabolic acceleration."""
    t = np.arange(0, 36, 0.001)
    rate, acceleration = np.zeros_like(t), np.zeros_like(t)
    for (_, before), (at, after) in pairwise(STEPS):
        s = np.clip((t - at) / RAMP, 0, 1)
        rate += (after - before) * (3 * s**2 - 2 * s**3)
        acceleration += (after - before) * (6 * s - 6 * s**2) / RAMP
    depth = FLOATING + np.cumsum(rate) * 0.001

    def law(values: np.ndarray) -> Law:
        return lambda at: float(values[min(round(at * 1000), len(t) - 1)])

    return law(depth), law(rate), law(acceleration)


@pytest.mark.slow
def test_depth_and_rate_follow_smooth_steps_of_half_a_metre_per_second():
    depth_squares, rate_squares = zip(*(squared_errors(seed) for seed in range(8)), strict=True)
    assert math.sqrt(np.mean(depth_squares)) <= 0.012
    assert math.sqrt(np.mean(rate_squares)) <= 0.011


def squared_errors(seed: int) -> tuple[float, float]:
    """Mean squares [m²], [m²/s²] of one dive, with what calibration got wrong of the atmosphere."""
    d = dive(seed)
    d.depth, rate, d.acceleration = smooth_steps()
    states = [(t, s) for t, s in d.go(35.0).states if t > 6.0]
    assert all(s.depth.valid and s.depth_rate.valid for _, s in states)
    depth_error = np.array([s.depth.value - d.depth(t) for t, s in states])
    rate_error = np.array([s.depth_rate.value - rate(t) for t, s in states])
    return float(np.mean(depth_error**2)), float(np.mean(rate_error**2))


def test_at_rest_it_is_as_quiet_as_the_vehicle_and_as_sure_as_it_is_right():
    ratios, rates, accelerations = list[float](), list[Estimate](), list[float]()
    for seed in range(10):
        d = dive(seed)
        state = d.run(7.0)
        ratios.append((state.depth.value - FLOATING) / state.depth.std)
        rates += [s.depth_rate for t, s in d.states if t > 3.02]
        accelerations += [s.depth_acceleration.value for t, s in d.states if t > 4.0]
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5
    assert math.sqrt(np.mean([rate.value**2 for rate in rates])) < 0.02
    assert all(abs(rate.value) < 4 * rate.std for rate in rates)
    assert np.mean(accelerations) == pytest.approx(0.0, abs=0.01)  # neither gravity nor bias


def test_calibration_says_nothing_valid_and_then_knows_the_bias_and_the_atmosphere():
    d = dive()
    for _, state in d.go(2.9).states:
        assert state.phase == "calibrating"
        assert state.depth.value == FLOATING
        assert not any(e.valid for e in estimates(state))
    assert d.run(1.1).phase == "running"
    kept = d.checkpoint
    assert kept.atmosphere == pytest.approx(AIR, abs=150.0)
    assert kept.gyro_bias == pytest.approx(BIAS, abs=5e-4)
    level, text, _ = d.estimator.outbox.said[-1]
    assert level == "info"
    assert "deg/s" in text
    assert "hPa" in text


def estimates(state: VehicleState) -> list[Estimate]:
    found = [getattr(state, name) for name in state.__struct_fields__]
    return [value for value in found if isinstance(value, Estimate)]


def test_calibration_waits_for_stillness():
    d = dive()
    d.turn = lambda t: 0.4 * math.sin(5 * t) if t < 4.0 else 0.0
    d.run(8.0)
    assert all(s.phase == "calibrating" for t, s in d.states if t < 6.9)
    assert d.states[-1][1].phase == "running"
    assert d.counts["moved:calibration"] == 1


@pytest.mark.parametrize("depth", [0.95, 20.0])
def test_a_vehicle_that_does_not_float_uses_the_standard_atmosphere_and_says_so(depth: float):
    d = dive()
    d.depth = lambda _: depth
    state = d.run(8.0)
    assert state.depth.value == pytest.approx(depth, abs=0.1)
    assert state.depth.std > 0.15
    assert d.counts["implausible:atmosphere"] == 1


@pytest.mark.parametrize("spike", [5e3, 5e6, -50e3])
def test_a_clear_pressure_spike_of_a_second_moves_depth_by_less_than_eight_centimetres(
    spike: float,
):
    d, worst = worst_in_spike(spike, 1)
    assert worst < 0.08
    outliers = d.counts["outlier:sensor/pressure"] + d.counts["implausible:sensor/pressure"]
    assert outliers == 50  # every sample


@pytest.mark.slow
@pytest.mark.parametrize("spike", [1e3, 2e3, 3e3, 3.5e3, 4e3, -3e3])
def test_a_spike_that_hides_in_the_noise_moves_depth_by_less_than_thirty_centimetres(spike: float):
    # Just inside the gate is the worst place: nothing tells it from a real change of depth.
    for seed in range(4):
        d, worst = worst_in_spike(spike, seed)
        assert worst < 0.30
        assert d.counts["restarted:depth"] == 0


def worst_in_spike(spike: float, seed: int) -> tuple[Sensed, float]:
    """Largest depth error [m] around a second of `spike` [Pa]."""
    d = dive(seed)
    d.run(8.0)
    d.more["pressure"] = (spike,)
    d.run(1.0)
    del d.more["pressure"]
    d.run(3.0)
    return d, max(abs(s.depth.value - FLOATING) for t, s in d.states if t > 7.0)


def test_without_pressure_depth_is_lost_after_two_seconds_and_the_rate_when_unsure():
    d = dive()
    d.run(8.0)
    d.absent.add("pressure")
    last = d.run(82.0)
    assert all(s.depth.valid for t, s in d.states if 4.0 < t < 9.9)
    lost = [s for t, s in d.states if t > 10.1]
    assert not any(s.depth.valid for s in lost)
    assert all(s.heading.valid for s in lost)
    rates = [s.depth_rate for s in lost]
    known = [rate for rate in rates if rate.valid]
    assert known == rates[: len(known)]  # once lost, it stays lost
    assert 500 < len(known) < len(rates)
    assert all(rate.std <= 0.1 and abs(rate.value) < 4.0 * rate.std for rate in known)
    spreads = [s.depth.std for t, s in d.states if 8.5 < t < 17.5]
    assert spreads == sorted(spreads)
    assert d.counts["lost:depth"] == 1
    assert last.pressure_age_ms == pytest.approx(82_000, abs=50)
    d.absent.clear()
    d.depth = lambda _: 7.0
    state = d.run(2.0)
    assert state.depth.valid
    assert state.depth.value == pytest.approx(7.0, abs=0.1)


def sinking(t: float) -> float:
    return FLOATING + 0.2 * (t - 7.5)


def test_a_silent_imu_says_nothing_then_depth_goes_on_from_pressure_with_growing_doubt():
    d = dive()
    last = d.run(6.0)
    d.absent = {"imu", "magnetometer", "pressure"}
    d.run(1.5)
    states = [(t, s) for t, s in d.states if t > 6.001]
    assert 6.19 < states[0][0] < 6.22
    assert len(states) == pytest.approx(130, abs=2)
    for _, state in states:
        assert state.sensor_ns == last.sensor_ns
        from_imu = [state.roll, state.pitch, state.heading, state.yaw_rate]
        assert not any(e.valid for e in [*from_imu, state.depth_acceleration])
    spreads = [s.depth_rate.std for _, s in states]
    assert spreads == sorted(spreads)
    assert spreads[-1] > 5 * last.depth_rate.std
    d.absent.remove("pressure")
    d.depth = sinking
    state = d.run(14.0)
    assert state.depth.valid
    assert state.depth.value == pytest.approx(FLOATING + 0.2 * 14, abs=0.1)
    assert state.depth_rate.value == pytest.approx(0.2, abs=0.05)


@pytest.mark.slow
def test_a_magnet_leaves_the_control_heading_untouched_bit_for_bit():
    clean, bent = dive(5, compass=True), dive(5, compass=True)
    for d in (clean, bent):
        d.turn = lambda t: 0.3 if t > 4 else 0.0
        d.run(6.0)
    bent.earth = (15e-6, 20e-6, 48e-6)
    clean.run(14.0)
    bent.run(14.0)
    pairs = list(zip(clean.states, bent.states, strict=True))
    assert all(a.heading == b.heading and a.attitude == b.attitude for (_, a), (_, b) in pairs)
    (_, a), (_, b) = pairs[-1]
    assert a.heading_navigation is not None
    assert b.heading_navigation is not None
    assert a.heading_navigation != b.heading_navigation
    assert abs(a.heading_navigation.value - b.heading_navigation.value) < math.radians(5.0)
    assert bent.counts["disturbed:sensor/magnetometer"] == 1
    assert clean.counts["disturbed:sensor/magnetometer"] == 0


def test_control_heading_starts_at_the_compass_and_navigation_heading_stays_within_a_turn():
    d = dive(compass=True)
    d.heading = 2.5
    d.turn = lambda t: 0.8 if t > 4 else 0.0
    last = d.run(20.0)
    first = next(s for _, s in d.states if s.phase == "running")
    assert first.heading.value == pytest.approx(2.5, abs=0.01)
    assert first.heading_navigation is not None
    assert first.heading_navigation.value == pytest.approx(first.heading.value, abs=1e-3)
    assert last.heading.value == pytest.approx(d.heading, abs=0.05)
    assert d.heading > 4 * math.pi
    for _, state in d.states:
        if state.heading_navigation is not None:
            assert -math.pi < state.heading_navigation.value <= math.pi
    assert last.heading_navigation is not None
    error = math.remainder(last.heading_navigation.value - d.heading, 2 * math.pi)
    assert error == pytest.approx(0.0, abs=0.05)


def test_heading_drifts_less_than_a_degree_a_minute():
    d = dive(8)
    last = d.run(64.0)
    first = next(s for _, s in d.states if s.phase == "running")
    assert abs(last.heading.value - first.heading.value) < math.radians(1.0)


def test_the_last_rate_is_not_used_across_a_gap():
    d = dive()
    before = d.run(4.0)
    d.ms = 9000
    d.turn = lambda _: 2.0
    after = d.feel()
    assert after is not None
    assert abs(after.heading.value - before.heading.value) <= 0.6
    assert after.heading.std > 1.0
    assert d.counts["gap:sensor/imu"] == 1


def test_a_number_that_is_not_finite_never_leaves_and_the_filter_recovers():
    d = dive()
    d.run(5.0)
    d.estimator.filter.velocity[2] = math.nan
    last = d.run(3.0)
    for _, state in d.states:
        assert np.isfinite([*state.attitude, *(e.value for e in estimates(state))]).all()
        assert all(e.std >= 0.0 for e in estimates(state))
    assert d.counts["not_finite:state"] == 1
    assert last.depth.value == pytest.approx(FLOATING, abs=0.1)


def constant(value: float, _: float) -> float:
    return value


def test_a_pressure_sensor_on_an_arm_tells_the_depth_of_the_origin() -> None:
    """The air above is that above the origin, and tilting the vehicle changes no depth."""
    arm, mounted = (0.6, 0.0, 0.4), Stack().section("vehicle", Vehicle)
    mounting = Mounting(pressure=Placed(position=arm))
    d = Sensed(vehicle=replace(mounted, mounting=mounting), compass=False)
    d.noise |= {"force": 1e-4, "pressure": 10.0, "rate": 1e-6}
    d.depth = lambda _: FLOATING + arm[2]
    d.run(4.0)
    assert d.checkpoint.atmosphere == pytest.approx(AIR, abs=50.0)
    pitch = 0.0  # [rad] up, within a second
    for _ in range(100):
        pitch += math.radians(0.3)
        down = FLOATING + to_world(from_euler(0.0, pitch, 0.0), arm)[2]
        d.gravity = to_body(from_euler(0.0, pitch, 0.0), (0.0, 0.0, -GRAVITY))
        d.more["rate"], d.depth = (0.0, math.radians(30.0), 0.0), partial(constant, down)
        d.run(0.01)
    del d.more["rate"]
    state = d.run(1.0)
    assert state.pitch.value == pytest.approx(pitch, abs=0.02)
    assert state.depth.value == pytest.approx(FLOATING, abs=0.02)  # and not 0.35 m shallower


def test_what_is_learnt_of_where_it_came_to_rest_is_told_for_ten_seconds() -> None:
    sensed = Sensed(compass=False)
    assert sensed.run(5.0).depth_corrected == UNSET
    went = 1e-3 * sensed.ms
    sensed.depth = lambda t: FLOATING + 0.25 * (1.0 - math.cos(min(2.0 * (t - went), math.pi)))
    sensed.acceleration = lambda t: (
        math.cos(2.0 * (t - went)) if 2.0 * (t - went) < math.pi else 0.0
    )
    assert sensed.run(1.4).depth_corrected == UNSET
    told = {sensed.run(0.5).depth_corrected for _ in range(19)}
    assert len(told) == 19
    assert UNSET not in told
    assert sensed.run(1.5).depth_corrected == UNSET
