"""The depth filter against NumPy: matrix form, batch least squares, steady state, consistency."""

from math import sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.estimation.depth.depth_filter import LEVEL, DepthFilter, DepthSettings, Lean
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver

DT = 0.01  # [s]
STD = 0.05  # [m]
SET = DepthSettings()


def transition(dt: float) -> np.ndarray:
    return np.array([[1, dt, -dt * dt / 2], [0, 1, -dt], [0, 0, 1]])


def disturbance(dt: float) -> np.ndarray:
    qa, qb = SET.acceleration_noise**2, SET.bias_walk**2
    q = np.zeros((3, 3))
    q[:2, :2] = qa * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    q[2, 2] = qb * dt
    return q


def covariance(f: DepthFilter) -> np.ndarray:
    return np.array([[f.p00, f.p01, f.p02], [f.p01, f.p11, f.p12], [f.p02, f.p12, f.p22]])


class Matrices:
    """The filter's equations as they are printed, with all four states."""

    def __init__(self, f: DepthFilter) -> None:
        self.x = np.array([f.depth, f.rate, f.bias, f.forward_bias])
        self.p = whole_covariance(f)

    def predict(self, acceleration: float | None, dt: float, measured: bool, lean: Lean) -> None:
        forward, starboard = lean
        f, q = np.eye(4), np.zeros((4, 4))
        f[0, 1] = dt
        density = SET.motion_noise**2
        if acceleration is not None and measured:
            f[:2, 2:] = -np.outer([dt * dt / 2, dt], [1.0, forward])
            density = SET.acceleration_noise**2
            density += (SET.pitch_noise * forward) ** 2 + (SET.roll_noise * starboard) ** 2
        q[:2, :2] = density * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        q[2, 2] = q[3, 3] = SET.bias_walk**2 * dt
        self.x = f @ self.x + np.array([dt * dt / 2, dt, 0, 0]) * (acceleration or 0.0)
        self.p = f @ self.p @ f.T + q

    def update(self, depth: float, age: float) -> None:
        h = np.array([1, -age, 0, 0])
        gain = self.p @ h / (h @ self.p @ h + STD**2)
        self.x = self.x + gain * (depth - h @ self.x)
        self.p = self.p - np.outer(gain, h @ self.p)


def whole_covariance(f: DepthFilter) -> np.ndarray:
    return np.array(
        [
            [f.p00, f.p01, f.p02, f.p03],
            [f.p01, f.p11, f.p12, f.p13],
            [f.p02, f.p12, f.p22, f.p23],
            [f.p03, f.p13, f.p23, f.p33],
        ]
    )


sine = st.floats(-0.7, 0.7) | st.just(0.0)
motion = st.tuples(
    st.none() | st.floats(-2.0, 2.0),  # [m/s²]
    st.floats(0.001, 0.1),  # [s]
    st.booleans(),  # measured
    st.tuples(sine, sine) | st.just(LEVEL),
)
sample = st.none() | st.tuples(st.floats(-5.0, 5.0), st.floats(-0.01, 0.2))  # depth [m], age [s]


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(motion, sample), min_size=1, max_size=60))
def test_plain_floats_give_what_matrices_give(
    steps: list[tuple[tuple[float | None, float, bool, Lean], tuple[float, float] | None]],
):
    f = DepthFilter(SET)
    f.start(1.0, 0.3)
    printed = Matrices(f)
    for moved, told in steps:
        f.predict(*moved)
        printed.predict(*moved)
        if told is not None:
            depth, age = told
            f.update(*f.innovation(depth, STD, age), age)
            printed.update(depth, age)
    states = [f.depth, f.rate, f.bias, f.forward_bias]
    assert states == pytest.approx(printed.x.tolist(), rel=1e-7, abs=1e-9)
    assert whole_covariance(f) == pytest.approx(printed.p, rel=1e-6, abs=1e-12)


spread = st.floats(0.01, 10.0)


@given(st.floats(-5.0, 5.0), spread, spread, spread, st.floats(-0.1, 0.1))
def test_it_begins_at_rest_with_the_spreads_it_is_given(
    depth: float, depth_std: float, rate_std: float, bias_std: float, bias: float
):
    f = DepthFilter(SET)
    f.predict(0.3, 0.1, True, (0.2, 0.1))
    f.start(depth, depth_std, rate_std, bias, bias_std)
    assert (f.depth, f.rate, f.bias) == (depth, 0.0, bias)
    assert (f.depth_std, f.rate_std, f.bias_std) == pytest.approx((depth_std, rate_std, bias_std))
    assert np.array_equal(whole_covariance(f), np.diag(np.diag(whole_covariance(f))))


def test_without_noise_on_the_way_it_is_the_least_squares_line_through_all_samples():
    tiny = DepthSettings(acceleration_noise=1e-9, bias_walk=1e-9)
    f = DepthFilter(tiny)
    f.start(0.0, 1e4, rate_std=1e3, bias_std=1e-9)
    rng = np.random.default_rng(4)
    times = np.arange(1, 301) * DT
    depths = 3.0 + 0.4 * times + STD * rng.standard_normal(300)
    for depth in depths.tolist():
        f.predict(0.0, DT)
        f.update(*f.innovation(depth, STD, 0.0), 0.0)
    slope, at_zero = np.polyfit(times, depths, 1).tolist()
    assert f.rate == pytest.approx(slope, abs=1e-5)
    assert f.depth == pytest.approx(at_zero + slope * 3.0, abs=1e-5)


def test_a_sample_of_age_d_says_what_a_fresh_sample_would_have_said_then():
    fresh, late = DepthFilter(SET), DepthFilter(SET)
    for f in (fresh, late):
        f.start(0.0, 0.2, bias_std=1e-6)
        f.rate = 0.5
    fresh.update(*fresh.innovation(0.1, STD, 0.0), 0.0)
    fresh.predict(0.0, 0.03)
    late.predict(0.0, 0.03)
    late.update(*late.innovation(0.1, STD, 0.03), 0.03)
    assert late.depth == pytest.approx(fresh.depth, abs=1e-5)
    assert late.rate == pytest.approx(fresh.rate, abs=1e-5)


def test_the_covariance_settles_where_the_riccati_equation_says():
    f = DepthFilter(SET)
    f.start(0.0, 1.0)
    for _ in range(60_000):
        f.predict(0.0, DT)
        f.update(*f.innovation(0.0, STD, 0.0), 0.0)
    f.predict(0.0, DT)
    # The fixed point, found the other way: by doubling (Anderson and Moore 1979, section 6.7).
    h = np.array([[1.0, 0.0, 0.0]])
    a, g, p = transition(DT).T, h.T @ h / STD**2, disturbance(DT)
    for _ in range(30):
        inverse = np.linalg.inv(np.eye(3) + g @ p)
        a, g, p = a @ inverse @ a, g + a @ inverse @ g @ a.T, p + a.T @ p @ inverse @ a
    assert covariance(f) == pytest.approx(p, rel=1e-3)


def test_innovations_are_as_large_as_the_filter_says():
    squares = [s for seed in range(12) for s in normalised_innovations(seed)]
    # Mean of n chi-square values: 1 ± 4 √(2/n).
    assert np.mean(squares) == pytest.approx(1.0, abs=4 * sqrt(2 / len(squares)))


def normalised_innovations(seed: int) -> list[float]:
    """Of a world that is exactly as the filter believes."""
    rng = np.random.default_rng(seed)
    f = DepthFilter(SET)
    f.start(0.0, 0.3)
    x = np.array([0.3, 0.5, 0.1]) * rng.standard_normal(3)
    root = np.linalg.cholesky(disturbance(DT))
    squares: list[float] = []
    for k in range(1500):
        acceleration = float(np.sin(k * DT))
        x = transition(DT) @ x + np.array([DT * DT / 2, DT, 0]) * acceleration
        x = x + root @ rng.standard_normal(3)
        f.predict(acceleration, DT)
        if k % 2 == 0:
            depth = float(x[0] + STD * rng.standard_normal())
            surprise, variance = f.innovation(depth, STD, 0.0)
            squares.append(surprise * surprise / variance)
            f.update(surprise, variance, 0.0)
    return squares


def test_without_an_accelerometer_the_spread_grows_faster():
    driven, blind = DepthFilter(SET), DepthFilter(SET)
    for _ in range(100):
        driven.predict(0.0, DT)
        blind.predict(None, DT)
    assert blind.rate_std > driven.rate_std


@pytest.mark.parametrize("field", ["depth", "rate", "bias", "p00", "p11", "p22"])
def test_a_number_that_is_not_finite_is_noticed(field: str):
    f = DepthFilter(SET)
    assert f.is_sound()
    setattr(f, field, float("nan"))
    assert not f.is_sound()


def test_a_growing_acceleration_is_integrated_without_half_a_step_of_lead():
    o = DepthObserver(SET, Atmosphere(101_325.0, 0.0), 1025.0, 0.0)
    o.start(101_325.0, 100, 0)
    for k in range(101):
        o.predict(k * DT, k * 10_000_000)  # 1 m/s³
    depth, rate, _ = o.estimates(0)
    assert rate.value == pytest.approx(0.5, abs=1e-4)
    assert depth.value == pytest.approx(1 / 6, abs=1e-3)


def test_a_sample_far_too_late_is_not_used():
    o = DepthObserver(SET, Atmosphere(101_325.0, 0.0), 1025.0, 0.0)
    o.start(101_325.0, 100, 0)
    for k in range(1, 101):
        o.predict(0.0, k * 10_000_000)
    assert o.pressure(101_900.0, 400_000_000) == "late:sensor/pressure"
    assert o.estimates(0)[0].value == 0.0
    assert o.pressure(101_900.0, 600_000_000) is None
    assert o.estimates(0)[0].value > 0.0
