"""The estimator as a whole, against a truth made here."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.state import VehicleState
from services.estimation.checkpoint import EstimationCheckpoint
from services.estimation.core import Estimator
from services.estimation.settings import CalibrationSettings, Settings
from services.marine.vehicle import GRAVITY, SEA_WATER

QUICK = Settings(calibration=CalibrationSettings(still_time=3.0))  # [s] less to wait for
FLOATING = 0.168  # [m]
AIR = 100_900.0  # [Pa]
MS = 1_000_000  # [ns]
Law = Callable[[float], float]


def still(_: float) -> float:
    return 0.0


@dataclass
class Dive:
    """A vehicle, level, with noisy sensors: IMU and compass at 100 Hz, pressure at 42 Hz."""

    estimator: Estimator
    rng: np.random.Generator
    depth: Law = lambda _: FLOATING  # [m] of seconds
    acceleration: Law = still  # [m/s²] down
    turn: Law = still  # [rad/s]
    field: Law = still  # [T] disturbance towards east
    pressure_error: Law = still  # [Pa]
    pressure_until: float = math.inf  # [s]
    compass: bool = False
    heading: float = 0.0  # [rad] truth
    k: int = 0
    n: int = 0

    def run(self, until: float) -> list[tuple[float, VehicleState]]:
        """(seconds, state) of each IMU sample from here to `until` [s]."""
        states: list[tuple[float, VehicleState]] = []
        while self.k * 0.01 < until:
            self.k += 1
            t = self.k * 0.01
            self.heading += self.turn(t) * 0.01
            self._press(t)
            state = self.estimator.imu(self._imu(t), self.k * 10 * MS)
            assert state is not None
            states.append((t, state))
            if self.compass:
                self.estimator.magnetometer(self._magnetometer(t))
        return states

    def _press(self, t: float) -> None:
        while self.n / 42.0 <= t:
            at = self.n / 42.0
            self.n += 1
            clean = AIR + SEA_WATER * GRAVITY * self.depth(at) + self.pressure_error(at)
            pressure = clean + 500.0 * float(self.rng.standard_normal())
            if at < self.pressure_until:
                self.estimator.pressure(PressureSample(stamp_ns=round(at * 1e9), pressure=pressure))

    def _imu(self, t: float) -> ImuSample:
        fx, fy, fz = (0.03 * self.rng.standard_normal(3)).tolist()
        p, q, r = (0.01 + 0.002 * self.rng.standard_normal(3)).tolist()
        return ImuSample(
            stamp_ns=self.k * 10 * MS,
            specific_force=(fx, fy, fz - GRAVITY + 0.05 + self.acceleration(t)),
            angular_rate=(p, q, r + self.turn(t)),
        )

    def _magnetometer(self, t: float) -> MagnetometerSample:
        north, east = 15e-6, self.field(t)
        c, s = math.cos(self.heading), math.sin(self.heading)
        body = (c * north + s * east, c * east - s * north, 48e-6)
        return MagnetometerSample(stamp_ns=self.k * 10 * MS, field=body)


def dive(seed: int = 0, checkpoint: EstimationCheckpoint | None = None) -> Dive:
    return Dive(Estimator(QUICK, FLOATING, checkpoint), np.random.default_rng(seed))


def counts(d: Dive) -> Counter[str]:
    return d.estimator.outbox.counts


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
    states = [(t, s) for t, s in d.run(35.0) if t > 6.0]
    assert all(s.depth.valid and s.depth_rate.valid for _, s in states)
    depth_error = np.array([s.depth.value - d.depth(t) for t, s in states])
    rate_error = np.array([s.depth_rate.value - rate(t) for t, s in states])
    return float(np.mean(depth_error**2)), float(np.mean(rate_error**2))


def test_the_error_is_about_as_large_as_the_spread_says():
    ratios: list[float] = []
    for seed in range(20):
        _, state = dive(seed).run(9.0)[-1]
        ratios.append((state.depth.value - FLOATING) / state.depth.std)
    assert 0.6 < np.sqrt(np.mean(np.square(ratios))) < 1.5


def test_right_after_calibration_the_rate_is_as_quiet_as_the_vehicle():
    rates = [s.depth_rate for seed in range(8) for t, s in dive(seed).run(6.0) if t > 3.02]
    assert math.sqrt(np.mean([rate.value**2 for rate in rates])) < 0.02
    assert all(abs(rate.value) < 4 * rate.std for rate in rates)


def test_acceleration_has_neither_gravity_nor_bias_in_it():
    d = dive()
    values = [s.depth_acceleration.value for t, s in d.run(12.0) if t > 4.0]
    assert np.mean(values) == pytest.approx(0.0, abs=0.01)


def test_while_calibrating_nothing_is_valid_and_depth_is_the_floating_depth():
    for _, state in dive().run(2.9):
        assert state.phase == "calibrating"
        assert state.depth.value == FLOATING
        assert not any(e.valid for e in estimates(state))


def test_after_calibration_the_bias_and_the_atmosphere_are_known():
    d = dive()
    _, state = d.run(4.0)[-1]
    assert state.phase == "running"
    kept = d.estimator.checkpoint(0)
    assert kept is not None
    assert kept.atmosphere == pytest.approx(AIR, abs=150.0)
    assert kept.gyro_bias == pytest.approx((0.01, 0.01, 0.01), abs=5e-4)
    level, text, _ = d.estimator.outbox.said[-1]
    assert level == "info"
    assert "deg/s" in text
    assert "hPa" in text


def test_calibration_waits_for_stillness():
    d = dive()
    d.turn = lambda t: 0.4 * math.sin(5 * t) if t < 4.0 else 0.0
    states = d.run(8.0)
    assert all(s.phase == "calibrating" for t, s in states if t < 6.9)
    assert states[-1][1].phase == "running"
    assert counts(d)["moved:calibration"] == 1


@pytest.mark.parametrize("depth", [0.95, 20.0])
def test_a_vehicle_that_does_not_float_uses_the_standard_atmosphere_and_says_so(depth: float):
    d = dive()
    d.depth = lambda _: depth
    _, state = d.run(8.0)[-1]
    assert state.depth.value == pytest.approx(depth, abs=0.1)
    assert state.depth.std > 0.15
    assert counts(d)["implausible:atmosphere"] == 1


@pytest.mark.parametrize("spike", [5e3, 50e3, 5e6, -50e3])
def test_a_clear_pressure_spike_of_a_second_moves_depth_by_less_than_eight_centimetres(
    spike: float,
):
    for seed in range(2):
        d, worst = worst_in_spike(spike, seed)
        assert worst < 0.08
        assert outliers(d) == 42


@pytest.mark.slow
@pytest.mark.parametrize("spike", [1e3, 2e3, 3e3, 3.5e3, 4e3, -3e3])
def test_a_spike_that_hides_in_the_noise_moves_depth_by_less_than_thirty_centimetres(spike: float):
    # Just inside the gate is the worst place: nothing tells it from a real change of depth.
    for seed in range(4):
        d, worst = worst_in_spike(spike, seed)
        assert worst < 0.30
        assert counts(d)["restarted:depth"] == 0


def worst_in_spike(spike: float, seed: int) -> tuple[Dive, float]:
    """Largest depth error [m] around a second of `spike` [Pa]."""
    d = dive(seed)
    d.pressure_error = lambda t: spike if 8.0 <= t < 9.0 else 0.0
    return d, max(abs(s.depth.value - FLOATING) for t, s in d.run(12.0) if t > 7.0)


def outliers(d: Dive) -> int:
    return counts(d)["outlier:sensor/pressure"] + counts(d)["implausible:sensor/pressure"]


def test_a_lasting_jump_of_the_sensor_is_followed_in_the_end():
    d = dive()
    d.pressure_error = lambda t: 50e3 if t >= 8.0 else 0.0
    _, state = d.run(15.0)[-1]
    assert state.depth.value == pytest.approx(FLOATING + 50e3 / (SEA_WATER * GRAVITY), abs=0.05)
    assert counts(d)["jumped:sensor/pressure"] == 1
    assert state.depth.std > 4.0  # nobody knows which of the two depths is right


def test_without_pressure_depth_becomes_invalid_after_two_seconds_and_the_rate_when_unsure():
    d = dive()
    d.pressure_until = 8.0
    states = d.run(90.0)
    assert all(s.depth.valid for t, s in states if 4.0 < t < 9.9)
    assert not any(s.depth.valid for t, s in states if t > 10.1)
    rates = [s.depth_rate for t, s in states if t > 10.1]
    known = [rate for rate in rates if rate.valid]
    assert known == rates[: len(known)]  # once lost, it stays lost
    assert 500 < len(known) < len(rates)
    assert all(rate.std <= 0.1 and abs(rate.value) < 4.0 * rate.std for rate in known)
    assert all(s.heading.valid for t, s in states if t > 10.1)
    spreads = [s.depth.std for t, s in states if 8.5 < t < 17.5]
    assert spreads == sorted(spreads)
    assert counts(d)["lost:depth"] == 1
    assert states[-1][1].pressure_age_ms == pytest.approx(82_000, abs=50)


def test_depth_comes_back_with_the_pressure():
    d = dive()
    d.pressure_until = 5.0
    d.run(20.0)
    d.pressure_until = math.inf
    d.depth = lambda _: 7.0
    _, state = d.run(22.0)[-1]
    assert state.depth.valid
    assert state.depth.value == pytest.approx(7.0, abs=0.1)


def test_a_silent_imu_says_nothing_then_predicts_with_growing_doubt():
    d = dive()
    _, last = d.run(6.0)[-1]
    start = 6000 * MS
    early = [d.estimator.silence(start + ms * MS) for ms in range(50, 200, 10)]
    assert early == [None] * 15
    later = [d.estimator.silence(start + ms * MS) for ms in range(210, 1500, 10)]
    states = [s for s in later if s is not None]
    assert len(states) == len(later)
    for state in states:
        assert state.sensor_ns == last.sensor_ns
        from_imu = [state.roll, state.pitch, state.heading, state.yaw_rate]
        assert not any(e.valid for e in [*from_imu, state.depth_acceleration])
    spreads = [s.depth_rate.std for s in states]
    assert spreads == sorted(spreads)
    assert spreads[-1] > 5 * last.depth_rate.std


def test_with_a_silent_imu_depth_goes_on_from_pressure_alone():
    d = dive()
    d.run(6.0)
    state = None
    for ms in range(6050, 20_000, 10):
        if ms % 20 == 0:
            pressure = AIR + SEA_WATER * GRAVITY * (FLOATING + 0.2 * (ms / 1000 - 6))
            d.estimator.pressure(PressureSample(stamp_ns=ms * MS, pressure=pressure))
        state = d.estimator.silence(ms * MS)
    assert state is not None
    assert state.depth.valid
    assert state.depth.value == pytest.approx(FLOATING + 0.2 * 14, abs=0.05)
    assert state.depth_rate.value == pytest.approx(0.2, abs=0.05)


@pytest.mark.slow
def test_a_magnet_leaves_the_control_heading_untouched_bit_for_bit():
    clean, bent = dive(5), dive(5)
    for d in (clean, bent):
        d.compass, d.turn = True, lambda t: 0.3 if t > 4 else 0.0
    bent.field = lambda t: 20e-6 if t > 6 else 0.0
    pairs = list(zip(clean.run(20.0), bent.run(20.0), strict=True))
    assert all(a.heading == b.heading and a.attitude == b.attitude for (_, a), (_, b) in pairs)
    (_, a), (_, b) = pairs[-1]
    assert a.heading_navigation is not None
    assert b.heading_navigation is not None
    assert a.heading_navigation != b.heading_navigation
    assert abs(a.heading_navigation.value - b.heading_navigation.value) < math.radians(5.0)
    assert counts(bent)["disturbed:sensor/magnetometer"] == 1
    assert counts(clean)["disturbed:sensor/magnetometer"] == 0


def test_control_heading_starts_at_the_compass_and_navigation_heading_stays_within_a_turn():
    d = dive()
    d.compass, d.heading, d.turn = True, 2.5, lambda t: 0.8 if t > 4 else 0.0
    states = d.run(20.0)
    first = next(s for _, s in states if s.phase == "running")
    assert first.heading.value == pytest.approx(2.5, abs=0.01)
    assert first.heading_navigation is not None
    assert first.heading_navigation.value == pytest.approx(first.heading.value, abs=1e-3)
    last = states[-1][1]
    assert last.heading.value == pytest.approx(d.heading, abs=0.05)
    assert d.heading > 4 * math.pi
    for _, state in states:
        if state.heading_navigation is not None:
            assert -math.pi < state.heading_navigation.value <= math.pi
    assert last.heading_navigation is not None
    error = math.remainder(last.heading_navigation.value - d.heading, 2 * math.pi)
    assert error == pytest.approx(0.0, abs=0.05)


def test_heading_drifts_less_than_a_degree_a_minute():
    d = dive(8)
    states = d.run(64.0)
    first = next(s for _, s in states if s.phase == "running")
    assert abs(states[-1][1].heading.value - first.heading.value) < math.radians(1.0)


def test_a_restart_keeps_depth_and_heading():
    d = dive(2)
    d.compass, d.turn = True, lambda t: 0.2 if t > 4 else 0.0
    d.depth, _, d.acceleration = smooth_steps()
    _, before = d.run(16.0)[-1]
    kept = d.estimator.checkpoint(d.k * 10 * MS)
    assert kept is not None
    d.turn = still
    d.estimator = Estimator(QUICK, FLOATING, kept)
    states = d.run(17.5)
    first, last = states[0][1], states[-1][1]
    assert first.phase == "running"
    assert first.heading.value == pytest.approx(before.heading.value, abs=1e-3)
    assert last.depth.valid
    assert last.depth.value == pytest.approx(d.depth(17.5), abs=0.06)


def imu(ms: int, force: tuple[float, float, float], rate: float = 0.0) -> ImuSample:
    return ImuSample(stamp_ns=ms * MS, specific_force=force, angular_rate=(0.0, 0.0, rate))


@pytest.mark.parametrize(
    ("sample", "what"),
    [
        (imu(4010, (0.0, 0.0, 0.0)), "implausible"),
        (imu(4010, (0.0, 0.0, -160.0)), "saturated"),
        (imu(4010, (0.0, 0.0, -9.8), rate=1e3), "saturated"),
    ],
)
def test_a_broken_imu_sample_is_counted_and_not_used(sample: ImuSample, what: str):
    d = dive()
    d.run(4.0)
    assert d.estimator.imu(sample, 4010 * MS) is None
    assert counts(d)[f"{what}:sensor/imu"] == 1


def test_an_imu_sample_that_is_not_newer_is_counted_and_not_used():
    d = dive()
    d.run(4.0)
    assert d.estimator.imu(imu(4000, (0.0, 0.0, -9.81)), 4000 * MS) is None
    assert counts(d)["not_newer:sensor/imu"] == 1


def test_the_last_rate_is_not_used_across_a_gap():
    d = dive()
    _, before = d.run(4.0)[-1]
    after = d.estimator.imu(imu(9000, (0.0, 0.0, -9.81), rate=2.0), 9000 * MS)
    assert after is not None
    assert abs(after.heading.value - before.heading.value) <= 0.6
    assert after.heading.std > 1.0
    assert counts(d)["gap:sensor/imu"] == 1


def test_pressure_in_a_vacuum_and_iron_on_the_compass_are_counted():
    d = dive()
    d.run(4.0)
    d.estimator.pressure(PressureSample(stamp_ns=4000 * MS, pressure=100.0))
    d.estimator.magnetometer(MagnetometerSample(stamp_ns=4000 * MS, field=(1.0, 0.0, 0.0)))
    seen = counts(d)
    assert seen["implausible:sensor/pressure"] == 1
    assert seen["implausible:sensor/magnetometer"] == 1


def test_a_number_that_is_not_finite_never_leaves_and_the_filter_recovers():
    d = dive()
    d.run(5.0)
    d.estimator.filter.velocity[2] = math.nan
    states = d.run(8.0)
    assert all(is_finite(s) for _, s in states)
    assert counts(d)["not_finite:state"] == 1
    assert states[-1][1].depth.value == pytest.approx(FLOATING, abs=0.1)


numbers = st.floats(-1e9, 1e9) | st.floats(-20.0, 20.0)
triples = st.tuples(numbers, numbers, numbers)
gentle = st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-12, -6))
event = st.one_of(
    st.tuples(st.just("imu"), triples | gentle, triples | gentle, st.integers(-10, 200)),
    st.tuples(st.just("silence"), st.none(), st.none(), st.integers(0, 2000)),
    st.tuples(st.just("pressure"), st.floats(0, 1e9) | st.floats(8e4, 2e6), st.none(),
              st.integers(-1000, 200)),
    st.tuples(st.just("magnetometer"), triples | st.tuples(*[st.floats(-5e-5, 5e-5)] * 3),
              st.none(), st.integers(-10, 200)),
)  # fmt: skip
KEPT = EstimationCheckpoint(
    stamp_ns=0,
    atmosphere=1e5,
    atmosphere_std=50.0,
    gyro_bias=(0.0, 0.0, 0.0),
    accelerometer_bias=(0.0, 0.0, 0.0),
    heading=1.0,
    heading_std=0.1,
)


@settings(max_examples=100, deadline=None)
@given(st.lists(event, max_size=60), st.booleans())
def test_whatever_the_sensors_say_every_number_stays_finite(
    events: list[tuple[str, tuple[float, float, float], tuple[float, float, float], int]],
    running: bool,
):
    estimator = Estimator(QUICK, FLOATING, KEPT if running else None)
    now = 0
    for kind, first, second, ms in events:
        stamp = now + ms * MS
        now = max(now, stamp)
        state = None
        if kind == "imu":
            sample = ImuSample(stamp_ns=stamp, specific_force=first, angular_rate=second)
            state = estimator.imu(sample, now)
        elif kind == "silence":
            state = estimator.silence(now)
        elif kind == "pressure":
            assert isinstance(first, float)
            estimator.pressure(PressureSample(stamp_ns=stamp, pressure=first))
        else:
            estimator.magnetometer(MagnetometerSample(stamp_ns=stamp, field=first))
        assert state is None or is_finite(state)


def is_finite(state: VehicleState) -> bool:
    parts = [(e.value, e.std) for e in estimates(state)]
    numbers = [*state.attitude, *(number for part in parts for number in part)]
    return all(math.isfinite(n) and abs(n) <= 1e9 for n in numbers) and all(
        s >= 0 for _, s in parts
    )


def estimates(state: VehicleState) -> list[Estimate]:
    found = [getattr(state, name) for name in state.__struct_fields__]
    return [value for value in found if isinstance(value, Estimate)]
