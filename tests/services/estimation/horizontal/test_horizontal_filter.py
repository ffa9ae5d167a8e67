"""The horizontal filter against its own definition: Jacobians, batch least squares, consistency."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from services.estimation.horizontal import horizontal_filter as ekf
from services.estimation.horizontal.horizontal_filter import (
    SIZE,
    HorizontalEstimate,
    Innovation,
    Interval,
)
from services.estimation.horizontal.hull_model import HullModel
from services.marine.attitude import from_euler
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack

Floats = NDArray[np.float64]
HULL = HullModel(Stack().section("vehicle", Vehicle), 1.0)
SEEDS, SECONDS = 20, 30.0
SETTLED = 5.0  # [s] before, the current is so unknown that the drag is no straight line over it
LEARNT = [*range(9), 11, 12]  # states; the damping is only considered
# The bands that hold 95 % of the mean over 20 seeds of χ² with 11 and with 2 degrees of freedom.
BAND_11, BAND_2 = (9.04, 13.15), (1.22, 2.97)

angle = st.floats(-0.5, 0.5)
speed = st.floats(-1.5, 1.5)
pairs = st.tuples(speed, speed)


def interval(
    seconds: float = 0.1,
    acceleration: tuple[float, float] | None = (0.2, -0.1),
    force: tuple[float, float] | None = (10.0, -3.0),
    roll: float = 0.1,
    pitch: float = -0.2,
    heading: float = 0.7,
    depth_rate: float = 0.2,
    yaw_rate: float = 0.3,
) -> Interval:
    return Interval(
        seconds=seconds, acceleration=acceleration, attitude=from_euler(roll, pitch, heading),
        heading_std=0.05, yaw_rate=yaw_rate, force=force, depth_rate=depth_rate,
        depth_rate_std=0.01,
    )  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(pairs, pairs, angle, angle, angle, st.floats(-3.0, 3.0), angle, angle, angle, angle)
def test_the_jacobians_are_the_slopes_of_what_is_measured(
    over_ground: tuple[float, float],
    current: tuple[float, float],
    roll: float,
    pitch: float,
    error: float,
    heading: float,
    more: float,
    aside: float,
    by_sine: float,
    by_cosine: float,
) -> None:
    deviation, damping = (error, by_sine, by_cosine), (more, aside)
    x = np.array([3.0, -2.0, *over_ground, *current, 0.1, -0.05, *np.zeros(5)])
    x[ekf.DEVIATION], x[ekf.DAMPING] = deviation, damping
    here = interval(roll=roll, pitch=pitch, heading=heading)
    P = np.eye(SIZE)
    through_water = np.subtract(over_ground, current)
    surge, sway, _ = ekf.body_axes(here) @ (*through_water.tolist(), here.depth_rate)
    assume(min(abs(surge), abs(sway)) > 1e-4)  # there the drag has a kink

    def dvl(at: Floats) -> Innovation:
        return ekf.velocity(HorizontalEstimate(at, P), here, (0.1, 0.2, 0.0), 0.01)

    def usbl(at: Floats) -> Innovation:
        return ekf.fix(HorizontalEstimate(at, P), (1.0, 2.0), 0.5)

    def balance(at: Floats) -> Innovation:
        return ekf.balance(HorizontalEstimate(at, P), here, HULL)

    for see in (dvl, usbl, balance):
        H = see(x).H
        for k in range(SIZE):
            step = 1e-6 * np.eye(SIZE)[k]
            # What is expected falls when measured minus expected grows.
            numeric = -(see(x + step).off - see(x - step).off) / 2e-6
            assert H[:, k] == pytest.approx(numeric, abs=1e-4), (see.__name__, k)


@settings(max_examples=40, deadline=None)
@given(pairs, pairs, st.tuples(angle, angle, angle), st.floats(-3.0, 3.0), st.integers(0, 10**6))
def test_the_spread_moves_as_the_mean_does(
    over_ground: tuple[float, float],
    acceleration: tuple[float, float],
    deviation: tuple[float, float, float],
    heading: float,
    seed: int,
) -> None:
    """P becomes J P Jᵀ and noise, with J the slopes of the predicted mean."""
    x, here = np.zeros(SIZE), interval(0.5, acceleration, heading=heading)
    x[ekf.VELOCITY], x[ekf.DEVIATION] = over_ground, deviation
    x[ekf.CURRENT], x[ekf.LEAN] = over_ground[::-1], (0.1, -0.2)
    known = np.zeros((SIZE, SIZE))
    slopes = [
        (ekf.predicted(HorizontalEstimate(x + e, known), here).x)
        - (ekf.predicted(HorizontalEstimate(x - e, known), here).x)
        for e in 1e-5 * np.eye(SIZE)
    ]
    J = np.array(slopes).T / 2e-5
    root = np.random.default_rng(seed).normal(size=(SIZE, SIZE))
    P = root @ root.T
    more = (
        ekf.predicted(HorizontalEstimate(x, P), here).P
        - ekf.predicted(HorizontalEstimate(x, known), here).P
    )
    assert more == pytest.approx(J @ P @ J.T, abs=1e-5)


@given(st.floats(-3.0, 3.0), st.floats(-1.4, 1.4), st.floats(-3.0, 3.0))
def test_deviation_goes_with_sine_and_cosine_of_the_heading_however_it_is_tilted(
    roll: float, pitch: float, heading: float
) -> None:
    found = ekf.card(interval(roll=roll, pitch=pitch, heading=heading))
    assert found == pytest.approx((np.sin(heading), np.cos(heading)))


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6))
def test_in_the_linear_case_it_is_batch_least_squares(seed: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    certain = 1e-4  # [rad] of the heading, which turns the velocity: a product of two states
    estimate = ekf.initial(certain)
    rows: list[tuple[Floats, Floats, Floats]] = []  # weight the residual A z - b by W
    wide = SIZE * (steps + 1)

    def take(k: int, A: Floats, b: Floats, cov: Floats, before: Floats | None = None) -> None:
        big = np.zeros((len(b), wide))
        big[:, SIZE * k : SIZE * (k + 1)] = A
        if before is not None:
            big[:, SIZE * (k - 1) : SIZE * k] = -before
        rows.append((big, b, np.asarray(np.linalg.inv(np.linalg.cholesky(cov)), dtype=np.float64)))

    take(0, np.eye(SIZE), estimate.x, estimate.P)
    for k in range(1, steps + 1):
        here = interval(seconds=rng.uniform(0.05, 2.0), acceleration=(0.0, 0.0), yaw_rate=0.0)
        here = here._replace(heading_std=certain)
        zero = HorizontalEstimate(np.zeros(SIZE), np.zeros((SIZE, SIZE)))
        push, Q = ekf.predicted(zero, here)
        units = [ekf.predicted(HorizontalEstimate(e, zero.P), here).x - push for e in np.eye(SIZE)]
        F = np.array(units).T
        take(k, np.eye(SIZE), push, Q, F)
        estimate = ekf.predicted(estimate, here)
        H, z, R = rng.normal(size=(2, SIZE)), rng.normal(size=2), np.diag(rng.uniform(0.1, 1.0, 2))
        H[:, ekf.DAMPING] = 0.0  # what is considered is not estimated
        take(k, H, z, R)
        estimate = ekf.corrected(estimate, Innovation(z - H @ estimate.x, H, R))
    A = np.vstack([W @ big for big, _, W in rows])
    b = np.concatenate([W @ off for _, off, W in rows])
    found, *_ = np.linalg.lstsq(A, b, rcond=None)
    assert estimate.x == pytest.approx(found[-SIZE:], abs=1e-5)
    spread = np.linalg.inv(A.T @ A)[-SIZE:, -SIZE:]
    assert np.diag(estimate.P) == pytest.approx(np.diag(spread), rel=1e-4)


@pytest.mark.slow
def test_errors_and_innovations_are_as_large_as_their_covariances_say() -> None:
    found = [drawn(seed) for seed in range(SEEDS)]
    errors = np.mean([nees for nees, _ in found], axis=0)
    surprises = np.mean([nis for _, nis in found], axis=0)
    assert np.mean([BAND_11[0] <= e <= BAND_11[1] for e in errors]) >= 0.9
    assert np.mean([BAND_2[0] <= s <= BAND_2[1] for s in surprises]) >= 0.9
    assert np.mean(errors) == pytest.approx(11.0, rel=0.1)
    assert np.mean(surprises) == pytest.approx(2.0, rel=0.1)


def drawn(seed: int) -> tuple[list[float], list[float]]:
    """Normalised squares of the errors once a second and of the innovations, for a truth that is
    drawn from what the filter believes of the world. As in a dive, a DVL speaks first."""
    rng = np.random.default_rng(seed)
    estimate = ekf.initial(0.05)
    truth = rng.multivariate_normal(estimate.x, estimate.P)
    first = interval()
    v_N = *truth[ekf.VELOCITY].tolist(), first.depth_rate
    u, v, w = (ekf.body_axes(first) @ v_N).tolist()
    u, v = u + 0.01 * rng.normal(), v + 0.01 * rng.normal()
    estimate = ekf.changed_to(estimate, first, (u, v, w), 0.01)
    errors, surprises, dt = list[float](), list[float](), 0.1
    for k in range(1, round(SECONDS / dt) + 1):
        t = k * dt
        push = (12.0 + 5.0 * np.sin(0.4 * t), 4.0 * np.cos(0.23 * t))
        noise = rng.normal(size=2) * ekf.MODEL_NOISE / dt**0.5
        truth, here = moved(truth, t, push, noise, rng)
        estimate = ekf.predicted(estimate, here)
        estimate = ekf.corrected(estimate, ekf.balance(estimate, here, HULL))
        if k % 10 == 0:
            seen = seen_by_dvl(estimate, truth, here, rng)
            if t > SETTLED:
                surprises.append(ekf.surprise(estimate, seen))
            estimate = ekf.corrected(estimate, seen)
        if k % 20 == 0:
            north, east = (truth[:2] + 0.5 * rng.normal(size=2)).tolist()
            estimate = ekf.corrected(estimate, ekf.fix(estimate, (north, east), 0.5))
        if k % 10 == 5 and t > SETTLED:
            off: Floats = (truth - estimate.x)[LEARNT]
            errors.append(float(off @ np.linalg.solve(estimate.P[np.ix_(LEARNT, LEARNT)], off)))
    return errors, surprises


def seen_by_dvl(
    estimate: HorizontalEstimate, truth: Floats, here: Interval, rng: np.random.Generator
) -> Innovation:
    """What a DVL measures of the truth, beside what was expected."""
    nothing = ekf.velocity(HorizontalEstimate(truth, estimate.P), here, (0.0, 0.0, 0.0), 0.01)
    surge, sway = rng.multivariate_normal(-nothing.off, nothing.R).tolist()
    return ekf.velocity(estimate, here, (surge, sway, 0.0), 0.01)


def moved(
    truth: Floats, t: float, push: tuple[float, float], noise: Floats, rng: np.random.Generator
) -> tuple[Floats, Interval]:
    """The truth one leg later, and the leg: the accelerometer measures what thrust and drag do."""
    wander: Floats = rng.normal(size=SIZE)
    acceleration = (0.0, 0.0)
    after, here, error = truth, interval(), 0.0
    for _ in range(4):  # the acceleration depends on where the leg ends, and that on it
        here = interval(
            acceleration=acceleration, force=push, roll=0.05, pitch=0.1,
            heading=0.3 * t - error, depth_rate=0.1,
        )  # fmt: skip
        after, Q = ekf.predicted(HorizontalEstimate(truth, np.zeros((SIZE, SIZE))), here)
        after = after + np.linalg.cholesky(Q) @ wander
        error = ekf.heading_error(HorizontalEstimate(after, Q), here)
        missing = ekf.balance(HorizontalEstimate(after, Q), here, HULL).off
        level = ekf.body_axes(here)[:2, :2]
        more = np.linalg.solve(level, noise - missing)
        acceleration = (acceleration[0] + float(more[0]), acceleration[1] + float(more[1]))
    return after, here


def test_without_a_force_there_is_no_balance() -> None:
    with pytest.raises(ValueError, match="no balance"):
        ekf.balance(ekf.initial(0.1), interval(force=None), HULL)


def test_a_belief_with_a_number_that_is_not_one_is_not_sound() -> None:
    good = ekf.initial(0.1)
    assert ekf.is_sound(good)
    for bad in (np.nan, np.inf):
        assert not ekf.is_sound(HorizontalEstimate(good.x + bad, good.P))
        assert not ekf.is_sound(HorizontalEstimate(good.x, good.P + bad))
    assert not ekf.is_sound(HorizontalEstimate(good.x, -good.P))
