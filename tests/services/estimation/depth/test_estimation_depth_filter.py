"""The depth filter against NumPy: matrix form, batch least squares, steady state, consistency."""

from math import cos, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import events
from services.estimation.attitude_axes import LEVEL, MOVING_STD, AttitudeAxes
from services.estimation.depth.depth_filter import (
    FAR,
    SPEED_DENSITY,
    SPEED_EVERY,
    TILT_WALK,
    DepthFilter,
    DepthSettings,
)
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.marine.attitude import from_euler, to_world
from services.marine.vehicle import GRAVITY

DT = 0.01  # [s]
STD = 0.05  # [m]
SET = DepthSettings()


def transition(dt: float) -> np.ndarray:
    return np.array([[1, dt, -dt * dt / 2], [0, 1, -dt], [0, 0, 1]])


def disturbance(dt: float, walk: float = SET.bias_walk) -> np.ndarray:
    qa, qb = SET.acceleration_noise**2, walk**2
    q = np.zeros((3, 3))
    q[:2, :2] = qa * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    q[2, 2] = qb * dt
    return q


def covariance(f: DepthFilter) -> np.ndarray:
    """Of depth, rate and bias."""
    return np.array(f.covariance)[:3, :3]


def states(f: DepthFilter) -> list[float]:
    return [f.depth, f.rate, f.bias, *f.horizontal_bias, *f.tilt, *f.velocity]


class Matrices:
    """The filter's equations as they are printed, with all nine states."""

    def __init__(self, f: DepthFilter) -> None:
        self.x, self.p, self.free = np.array(states(f)), np.array(f.covariance), 0.0

    def predict(self, acceleration: float | None, dt: float, lean: AttitudeAxes) -> None:
        self.x[5:7] -= lean.levelled
        q, a = np.zeros((9, 9)), np.zeros(9)
        f = np.eye(9)
        f[0, 1] = dt
        density = SET.motion_noise**2
        down = acceleration or 0.0
        if acceleration is not None:
            # R f = R̂ f + φ × R̂ f, and the biases are subtracted first.
            axes = np.array([lean.forward, lean.starboard, lean.down]).T
            force = np.array([*lean.force, acceleration]) - axes @ self.x[[3, 4, 2]]
            tilted = np.cross([*self.x[5:7], 0.0], [*force[:2], -GRAVITY])
            north, east, _ = force + tilted
            down = force[2] + tilted[2]
            a[7:] = dt * north, dt * east
            share = np.zeros((3, 9))
            share[:, [3, 4, 2]] = -axes
            share[:, 5:7] = [[0.0, -GRAVITY], [GRAVITY, 0.0], [force[1], -force[0]]]
            f[0] += dt * dt / 2 * share[2]
            f[1] += dt * share[2]
            f[7:] += dt * share[:2]
            density = SET.acceleration_noise**2
        a[:2] = dt * self.x[1] + dt * dt / 2 * down, dt * down
        q[:2, :2] = density * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        q[2:, 2:] = dt * np.diag([SET.bias_walk**2] * 3 + [TILT_WALK**2] * 2 + [density] * 2)
        self.x = self.x + a
        self.p = f @ self.p @ f.T + q
        self.free += dt
        if self.free >= SPEED_EVERY:
            known = lean if acceleration is not None else LEVEL
            expected, std = known.velocity, known.velocity_std
            spread = np.diag(self.p)[7:] + std**2
            if np.any((np.array(expected) - self.x[7:]) ** 2 > FAR**2 * spread):
                expected, std = (0.0, 0.0), MOVING_STD
            for k in (7, 8):
                variance = SPEED_DENSITY * (std / MOVING_STD) ** 2 / self.free
                self.correct(np.eye(9)[k], expected[k - 7], variance)
            self.free = 0.0

    def update(self, depth: float, age: float) -> None:
        self.correct(np.array([1, -age, *[0] * 7]), depth, STD**2)

    def correct(self, h: np.ndarray, seen: float, variance: float) -> None:
        gain = self.p @ h / (h @ self.p @ h + variance)
        self.x = self.x + gain * (seen - h @ self.x)
        self.p = self.p - np.outer(gain, h @ self.p)


angle, force = st.floats(-0.7, 0.7) | st.just(0.0), st.floats(-3.0, 3.0) | st.just(0.0)


@st.composite
def a_lean(draw: st.DrawFn) -> AttitudeAxes:
    q = from_euler(draw(angle), draw(angle), 5.0 * draw(angle))
    turn = draw(angle), draw(angle)
    return AttitudeAxes(
        to_world(q, (1.0, 0.0, 0.0)),
        to_world(q, (0.0, 1.0, 0.0)),
        (draw(force), draw(force)),
        (0.01 * turn[0], 0.01 * turn[1]),
        velocity=(draw(force), draw(force)),
        velocity_std=draw(st.floats(0.1, MOVING_STD)),
    )


motion = st.tuples(
    st.none() | st.floats(-2.0, 2.0),  # [m/s²]
    st.floats(0.001, 0.1),  # [s]
    a_lean() | st.just(LEVEL),
)
sample = st.none() | st.tuples(st.floats(-5.0, 5.0), st.floats(-0.01, 0.2))  # depth [m], age [s]


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(motion, sample), min_size=1, max_size=60))
def test_plain_floats_give_what_matrices_give(
    steps: list[tuple[tuple[float | None, float, AttitudeAxes], tuple[float, float] | None]],
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
    assert states(f) == pytest.approx(printed.x.tolist(), rel=1e-6, abs=1e-8)
    assert np.array(f.covariance) == pytest.approx(printed.p, rel=1e-6, abs=1e-11)
    assert np.array_equal(f.covariance, np.transpose(f.covariance))


spread = st.floats(0.01, 10.0)


@given(st.floats(-5.0, 5.0), spread, spread, spread, st.floats(-0.1, 0.1))
def test_it_begins_at_rest_with_the_spreads_it_is_given(
    depth: float, depth_std: float, rate_std: float, bias_std: float, bias: float
):
    f = DepthFilter(SET)
    f.predict(0.3, 0.1, AttitudeAxes((0.9, 0.2, 0.3), (0.1, 0.9, -0.4), (1.0, 2.0)))
    f.start(depth, depth_std, rate_std, bias, bias_std)
    assert (f.depth, f.rate, f.bias) == (depth, 0.0, bias)
    assert (f.depth_std, f.rate_std, f.bias_std) == pytest.approx((depth_std, rate_std, bias_std))
    assert np.array_equal(covariance(f), np.diag(np.diag(covariance(f))))
    assert not np.array(f.covariance)[:3, 3:].any()


def test_at_rest_in_a_tilted_vehicle_the_lack_of_gravity_is_shared_by_the_axes_that_lean():
    """Half a radian of pitch: what is known of the sum is not known of one axis."""
    q = from_euler(0.0, 0.5, 0.0)
    axes = AttitudeAxes(to_world(q, (1.0, 0.0, 0.0)), to_world(q, (0.0, 1.0, 0.0)))
    f = DepthFilter(SET)
    f.start(0.0, 0.01)
    f.level(axes, 0.05, 0.001)
    below, ahead = cos(0.5), -sin(0.5)
    assert f.bias * below + f.horizontal_bias[0] * ahead == pytest.approx(0.05, abs=1e-4)
    assert f.bias / below == pytest.approx(f.horizontal_bias[0] / ahead)
    assert f.bias_std > 0.4 * SET.horizontal_bias_std
    level = DepthFilter(SET)
    level.level(LEVEL, 0.05, 0.001)
    assert (level.bias, level.horizontal_bias) == (pytest.approx(0.05, abs=1e-4), (0.0, 0.0))


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
    walk = 0.002  # [m/s²/√s] so that it settles soon
    f = DepthFilter(DepthSettings(bias_walk=walk))
    f.start(0.0, 1.0)
    for _ in range(15_000):
        f.predict(0.0, DT)
        f.update(*f.innovation(0.0, STD, 0.0), 0.0)
    f.predict(0.0, DT)
    # The fixed point, found the other way: by doubling (Anderson and Moore 1979, section 6.7).
    h = np.array([[1.0, 0.0, 0.0]])
    a, g, p = transition(DT).T, h.T @ h / STD**2, disturbance(DT, walk)
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


@pytest.mark.parametrize("field", ["depth", "rate", "bias", "covariance"])
def test_a_number_that_is_not_finite_is_noticed(field: str):
    f = DepthFilter(SET)
    assert f.is_sound()
    if field == "covariance":
        f.covariance[4][4] = float("nan")
    else:
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
    assert o.pressure(101_900.0, 400_000_000) == events.LATE_PRESSURE()
    assert o.estimates(0)[0].value == 0.0
    assert o.pressure(101_900.0, 600_000_000) is None
    assert o.estimates(0)[0].value > 0.0


def test_tilt_and_biases_of_a_vehicle_under_way_are_in_the_spread():
    squares = np.array([normalised_errors(seed) for seed in range(20)])
    depth, rate = np.mean(squares, axis=0).tolist()
    assert 0.6 < depth < 1.5
    assert 0.6 < rate < 1.5


def normalised_errors(seed: int) -> tuple[float, float]:
    """Mean of the squares of the depth's and the rate's errors, in σ, of 10 s in which a vehicle
    with accelerometer biases, calibrated at rest, starts, turns and stops."""
    rng = np.random.default_rng(seed)
    forward, starboard = (SET.horizontal_bias_std * rng.standard_normal(2)).tolist()
    tilt = starboard / GRAVITY, -forward / GRAVITY  # what the accelerometer says is level, is not
    f = DepthFilter(SET)
    f.start(2.0, 0.01, 0.01)
    f.level(LEVEL)
    bias, heading = 0.01 * float(rng.standard_normal()), 0.0
    depth, rate = 2.0 + 0.01 * float(rng.standard_normal()), 0.01 * float(rng.standard_normal())
    squares: list[tuple[float, float]] = []
    for k in range(1000):
        t = k * DT
        push = 1.0 if 1.0 < t % 5.0 < 2.0 else -1.0 if 3.0 < t % 5.0 < 4.0 else 0.0  # [m/s²]
        heading += DT * (1.0 if 2.0 < t % 5.0 < 3.5 else 0.0)
        q = from_euler(0.1 * push, -0.2 * push, heading)
        ahead, aside = to_world(q, (1.0, 0.0, 0.0)), to_world(q, (0.0, 1.0, 0.0))
        below = to_world(q, (0.0, 0.0, 1.0))
        sink = 0.3 * sin(t)  # [m/s²]
        depth, rate = depth + DT * rate + DT * DT / 2 * sink, rate + DT * sink
        # In the axes of the attitude's estimate, of which the truth is a turn by `tilt`.
        x, y, z = push * cos(heading), push * sin(heading), sink - GRAVITY
        three = zip(ahead, aside, below, strict=True)
        off = [forward * a + starboard * b + bias * c for a, b, c in three]
        north, east = x - tilt[1] * z + off[0], y + tilt[0] * z + off[1]
        down = sink - tilt[0] * y + tilt[1] * x + off[2]
        noise = SET.acceleration_noise / sqrt(DT) * float(rng.standard_normal())
        f.predict(down + noise, DT, AttitudeAxes(ahead, aside, (north, east)))
        if k % 2 == 0:
            f.update(*f.innovation(depth + STD * float(rng.standard_normal()), STD, 0.0), 0.0)
        if k > 100:
            off = (f.depth - depth) / f.depth_std, (f.rate - rate) / f.rate_std
            squares.append((off[0] ** 2, off[1] ** 2))
    a, b = np.mean(squares, axis=0).tolist()
    return a, b


def test_an_attitude_that_was_restarted_makes_the_tilt_unknown_once():
    f = DepthFilter(SET)
    f.level(LEVEL)
    f.predict(0.0, DT, AttitudeAxes(force=(2.0, 0.0)))
    assert f.covariance[6][6] < 2.0 * (SET.horizontal_bias_std / GRAVITY) ** 2
    f.predict(0.0, DT, AttitudeAxes(tilt_std=0.1))
    assert f.covariance[6][6] == pytest.approx(0.01, rel=1e-3)
    for _ in range(100):
        f.predict(0.0, DT, AttitudeAxes(force=(2.0, 0.0), tilt_std=0.1))
    assert f.rate_std > 0.15  # 0.1 rad of 2 m/s² for a second, and no new errors at each step


def test_a_correction_of_the_attitude_is_taken_from_the_tilt_error():
    f = DepthFilter(SET)
    f.predict(0.0, DT, AttitudeAxes(levelled=(0.01, -0.02)))
    assert f.tilt == (-0.01, 0.02)


def pushed(velocity: tuple[float, float], std: float, push: float, tilt: float) -> DepthFilter:
    """Ten seconds in which a vehicle accelerates north with `push` [m/s²] for two, and an attitude
    that lacks a turn of `tilt` [rad] about east; `velocity` is expected after those two."""
    f = DepthFilter(SET)
    for k in range(1000):
        now = push if k < 200 else 0.0
        share = min(1.0, k / 200)
        expected = velocity[0] * share, velocity[1] * share
        lean = AttitudeAxes(force=(now + GRAVITY * tilt, 0.0), velocity=expected, velocity_std=std)
        f.predict(0.0, DT, lean)
    return f


def test_a_velocity_known_by_the_thrust_shows_the_tilt_error():
    tilt = 0.01  # [rad]
    worst = {True: 0.0, False: 0.0}
    for way in (1.0, -1.0):
        informed = pushed((way, 0.0), 0.3, 0.5 * way, tilt)
        alone = pushed((0.0, 0.0), MOVING_STD, 0.5 * way, tilt)
        for f in (informed, alone):  # what is the bias's and what the tilt's, nothing shows
            wrong = abs(f.tilt[1] + f.horizontal_bias[0] / GRAVITY - tilt)
            worst[f is informed] = max(worst[f is informed], wrong)
        assert informed.covariance[6][6] < alone.covariance[6][6]
    assert worst[True] < 0.5 * worst[False]


def test_a_velocity_that_cannot_be_is_as_none_and_is_counted():
    blocked, alone = pushed((5.0, 0.0), 0.3, 0.0, 0.0), pushed((0.0, 0.0), MOVING_STD, 0.0, 0.0)
    assert blocked.compared is not None
    assert blocked.compared.refused
    assert alone.compared is None
    assert states(blocked)[5:] == pytest.approx(states(alone)[5:], abs=0.3)
    o = DepthObserver(SET, Atmosphere(101_325.0, 0.0), 1025.0, 0.0)
    o.start(101_325.0, 100, 0)
    far = AttitudeAxes(velocity=(5.0, 0.0), velocity_std=0.3)
    told = [o.predict(0.0, 10_000_000 * k, far) for k in range(1, 900)]
    assert [event for event in told if event] == [events.OUTLIER_ACTUATION()]


def test_after_a_shock_the_rate_is_known_no_better_than_what_was_between_two_samples():
    o = DepthObserver(SET, Atmosphere(101_325.0, 0.0), 1025.0, 0.0)
    o.start(101_325.0, 100, 0)
    for k in range(1, 1001):
        o.predict(0.0, k * 10_000_000)
        o.pressure(101_325.0, k * 10_000_000)
    _, quiet, _ = o.estimates(1)
    o.predict(-12.0, 10_010_000_000)
    _, shocked, _ = o.estimates(1)
    assert quiet.std < 0.01
    assert shocked.std == pytest.approx(0.06, rel=0.1)
    # A stop of 0.1 m/s that no sample saw: pressure corrects it, and the accelerometer is believed.
    o.predict(0.0, 10_020_000_000)
    for k in range(1003, 1303):
        o.predict(0.0, k * 10_000_000)
        assert o.pressure(101_325.0, k * 10_000_000) is None
    assert abs(o.estimates(1)[1].value) < 0.02
