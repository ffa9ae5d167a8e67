"""What the horizontal filter cannot depend on, and the sizes of its noises.

Which way is north, and which side is starboard, are conventions: turned or mirrored input gives
turned or mirrored output, mean and covariance.
"""

from math import cos, exp, hypot, pi, sin
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
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
Pair = tuple[float, float]
HULL = HullModel(Stack().section("vehicle", Vehicle), 1.0)
POSITIONS, PAIRS = [0, 1], ([0, 1], [2, 3], [4, 5], [6, 7])  # states, north and east
few = settings(max_examples=25, deadline=None)

small = st.floats(-0.5, 0.5)
number = st.floats(-1.5, 1.5)
pairs = st.tuples(number, number)
headings = st.floats(-3.0, 3.0)


class Moment(NamedTuple):
    """What an interval is made of."""

    seconds: float
    acceleration: Pair | None  # [m/s²] north and east
    euler: tuple[float, float, float]  # [rad] roll, pitch, heading
    yaw_rate: float  # [rad/s]
    force: Pair  # [N] surge and sway
    depth_rate: float  # [m/s]


newtons = st.floats(-40.0, 40.0)
moments = st.builds(
    Moment,
    st.floats(0.02, 1.0),
    st.none() | pairs,
    st.tuples(small, small, headings),
    small,
    st.tuples(newtons, newtons),
    small,
)
seeds = st.integers(0, 10**6)


def interval(moment: Moment) -> Interval:
    return Interval(
        seconds=moment.seconds, acceleration=moment.acceleration,
        attitude=from_euler(*moment.euler), heading_std=0.1, yaw_rate=moment.yaw_rate,
        force=moment.force, depth_rate=moment.depth_rate, depth_rate_std=0.02,
    )  # fmt: skip


def drawn(seed: int) -> HorizontalEstimate:
    """Any estimate, of the size that they have."""
    rng = np.random.default_rng(seed)
    size = np.array([5.0] * 2 + [0.8] * 2 + [0.3] * 2 + [0.1] * 2 + [0.2] + [0.1] * 2 + [0.1] * 2)
    root = size[:, None] * rng.normal(size=(SIZE, SIZE)) / SIZE**0.5
    return HorizontalEstimate(size * rng.normal(size=SIZE), root @ root.T)


def through(T: Floats, estimate: HorizontalEstimate) -> HorizontalEstimate:
    return HorizontalEstimate(T @ estimate.x, T @ estimate.P @ T.T)


def assert_same(
    one: HorizontalEstimate, other: HorizontalEstimate, rel: float = 1e-7, atol: float = 1e-9
) -> None:
    for a, b in zip(one, other, strict=True):
        assert a == pytest.approx(b, rel=rel, abs=atol)


def turned(p: Pair, angle: float) -> Pair:
    """A vector north and east, clockwise."""
    return p[0] * cos(angle) - p[1] * sin(angle), p[0] * sin(angle) + p[1] * cos(angle)


def turning(angle: float) -> Floats:
    """The states as they are if everything in the world is turned clockwise by an angle."""
    T, c, s = np.eye(SIZE), cos(angle), sin(angle)
    for pair in PAIRS:
        T[np.ix_(pair, pair)] = [[c, -s], [s, c]]
    T[np.ix_([11, 12], [11, 12])] = [[c, s], [-s, c]]  # deviation at the same direction of the hull
    return T


MIRROR = np.diag([1.0, -1.0] * 4 + [-1.0] + [1.0, 1.0] + [1.0, -1.0])


def mirrored(moment: Moment) -> Moment:
    """Starboard for port."""
    seconds, a, (roll, pitch, heading), yaw_rate, (ahead, aside), down = moment
    a = None if a is None else (a[0], -a[1])
    return Moment(seconds, a, (-roll, pitch, -heading), -yaw_rate, (ahead, -aside), down)


def all_of(
    estimate: HorizontalEstimate, here: Interval, seen: tuple[float, float, float]
) -> tuple[list[HorizontalEstimate], list[float]]:
    """The estimate after each of the filter's steps, and how surprising each measurement was."""
    after, surprises = [ekf.predicted(estimate, here)], list[float]()
    measured = [ekf.velocity(estimate, here, seen, 0.05)]
    if here.acceleration is not None:
        measured.append(ekf.balance(estimate, here, HULL))
    for innovation in measured:
        after.append(ekf.corrected(estimate, innovation))
        surprises.append(ekf.surprise(estimate, innovation))
    return [*after, ekf.changed_to(estimate, here, seen, 0.05)], surprises


@few
@given(seeds, moments, st.tuples(number, number, number), headings, pairs)
def test_which_way_is_north_does_not_matter(
    seed: int, moment: Moment, seen: tuple[float, float, float], angle: float, place: Pair
) -> None:
    (roll, pitch, heading), a = moment.euler, moment.acceleration
    a = None if a is None else turned(a, angle)
    there = interval(moment._replace(acceleration=a, euler=(roll, pitch, heading + angle)))
    estimate, T = drawn(seed), turning(angle)
    expected, surprises = all_of(estimate, interval(moment), seen)
    found, as_surprising = all_of(through(T, estimate), there, seen)
    for one, other in zip(found, expected, strict=True):
        assert_same(one, through(T, other))
    assert as_surprising == pytest.approx(surprises)
    fixed = ekf.corrected(estimate, ekf.fix(estimate, place, 0.7))
    other = through(T, estimate)
    assert_same(ekf.corrected(other, ekf.fix(other, turned(place, angle), 0.7)), through(T, fixed))
    assert_same(
        ekf.moved_to(other, turned(place, angle), 0.7),
        through(T, ekf.moved_to(estimate, place, 0.7)),
    )


@few
@given(seeds, moments, st.tuples(number, number, number))
def test_which_side_is_starboard_does_not_matter(
    seed: int, moment: Moment, seen: tuple[float, float, float]
) -> None:
    estimate, (u, v, w) = drawn(seed), seen
    expected, surprises = all_of(estimate, interval(moment), seen)
    found, as_surprising = all_of(through(MIRROR, estimate), interval(mirrored(moment)), (u, -v, w))
    for one, other in zip(found, expected, strict=True):
        assert_same(one, through(MIRROR, other))
    assert as_surprising == pytest.approx(surprises)


@few
@given(seeds, moments, st.floats(0.1, 0.9))
def test_two_steps_without_the_imu_are_one_as_long(seed: int, moment: Moment, share: float) -> None:
    """With a heading that is known: its error is forgotten from step to step."""
    one, other, both = (
        interval(moment._replace(seconds=part * moment.seconds, acceleration=None))._replace(
            heading_std=1e-9
        )
        for part in (share, 1.0 - share, 1.0)
    )
    known = np.eye(SIZE)
    known[ekf.DEVIATION, ekf.DEVIATION] = 0.0
    estimate = through(known, drawn(seed))
    found = ekf.predicted(ekf.predicted(estimate, one), other)
    assert_same(found, ekf.predicted(estimate, both))


@few
@given(seeds, moments)
def test_velocity_is_what_the_acceleration_adds_up_to_and_position_what_that_adds_up_to(
    seed: int, moment: Moment
) -> None:
    """Of the acceleration less the lean; the position turned by the heading error; noise of its
    density."""
    estimate, here = drawn(seed), interval(moment._replace(yaw_rate=0.0))
    dt, x = here.seconds, estimate.x
    a = np.zeros(2)
    if here.acceleration is not None:
        a = here.acceleration - x[[6, 7]]
    way = turned(tuple(dt * x[[2, 3]] + dt * dt / 2 * a), ekf.heading_error(estimate, here))
    found = ekf.predicted(estimate, here)
    assert found.x[[0, 1]] == pytest.approx(x[[0, 1]] + way)
    assert found.x[[2, 3]] == pytest.approx(x[[2, 3]] + dt * a)
    nothing = ekf.predicted(HorizontalEstimate(x, np.zeros((SIZE, SIZE))), here)
    noise = ekf.MOTION_NOISE if here.acceleration is None else ekf.ACCELERATION_NOISE
    assert np.diag(nothing.P)[[2, 3]] == pytest.approx(noise**2 * dt)
    assert np.diag(nothing.P)[[0, 1]] == pytest.approx(noise**2 * dt**3 / 3)


DAMPING_TIME = 600.0  # [s] ten minutes, of the share of the damping
TIMES = {
    4: ekf.CURRENT_TIME, 5: ekf.CURRENT_TIME, 6: ekf.LEAN_TIME, 7: ekf.LEAN_TIME,
    8: ekf.HEADING_TIME, 9: DAMPING_TIME, 10: DAMPING_TIME, 11: ekf.IRON_TIME,
    12: ekf.IRON_TIME,
}  # fmt: skip


@few
@given(seeds, moments, st.floats(0.01, 0.5))
def test_what_is_not_measured_is_forgotten_and_its_spread_stays(
    seed: int, moment: Moment, heading_std: float
) -> None:
    """Each state in its own time: the mean falls, and the variance at the start is the lasting
    one."""
    here = interval(moment._replace(yaw_rate=0.0))._replace(heading_std=heading_std)
    estimate = drawn(seed)
    after = ekf.predicted(estimate, here).x
    begin = ekf.initial(heading_std)
    later = np.diag(ekf.predicted(begin, here).P)
    for k, time in TIMES.items():
        assert after[k] == pytest.approx(estimate.x[k] * exp(-here.seconds / time), rel=1e-9)
        assert later[k] == pytest.approx(begin.P[k, k], rel=1e-9)


@given(st.floats(1e-3, 1.0), headings, small)
def test_at_the_start_only_the_origin_and_the_settings_are_known(
    std: float, heading: float, pitch: float
) -> None:
    """The heading error is as large as said at every heading, and never all of it is iron."""
    here = interval(Moment(0.1, None, (0.0, pitch, heading), 0.0, (0.0, 0.0), 0.0))
    start = ekf.initial(std)
    assert not start.x.any()
    assert ekf.heading_std(start, here) == pytest.approx(std)
    spread = np.sqrt(np.diag(start.P))
    assert spread[:8] == pytest.approx(
        [0.01] * 2 + [1.0] * 2 + [ekf.CURRENT_STD] * 2 + [ekf.LEAN_STD] * 2
    )
    assert spread[9:11] == pytest.approx([ekf.DAMPING_SHARE] * 2)
    assert spread[8] > 0.0
    assert spread[11:] == pytest.approx([min(ekf.IRON_STD, 0.98 * std)] * 2)


@few
@given(seeds, moments)
def test_the_spread_of_the_heading_error_is_that_of_its_slopes(seed: int, moment: Moment) -> None:
    estimate, here = drawn(seed), interval(moment)
    nowhere = HorizontalEstimate(np.zeros(SIZE), estimate.P)
    slopes = np.array([ekf.heading_error(nowhere._replace(x=unit), here) for unit in np.eye(SIZE)])
    assert ekf.heading_std(estimate, here) ** 2 == pytest.approx(slopes @ estimate.P @ slopes)
    assert ekf.heading_error(estimate, here) == pytest.approx(slopes @ estimate.x)


@few
@given(seeds, moments)
def test_the_noise_of_the_balance_is_that_of_forces_and_of_the_bend_of_drag(
    seed: int, moment: Moment
) -> None:
    """White noise over the interval, and what the slopes leave out: half the second derivative
    times the square of the velocity's error, in each of ten intervals, and the product of the
    errors of velocity and damping. E[x⁴] = 3 σ⁴."""
    acceleration = moment.acceleration or (0.0, 0.0)
    estimate, here = drawn(seed), interval(moment._replace(acceleration=acceleration))

    def through_water(x: Floats) -> Floats:
        north, east = (x[[2, 3]] - x[[4, 5]]).tolist()
        return ekf.body_axes(here)[:2, :] @ np.array((north, east, here.depth_rate))

    steps = 1e-6 * np.eye(SIZE)
    slopes = [(through_water(estimate.x + d) - through_water(estimate.x - d)) / 2e-6 for d in steps]
    J = np.array(slopes).T
    water = np.diag(J @ estimate.P @ J.T)
    surge, sway = through_water(estimate.x).tolist()
    more = (float(estimate.x[9]), float(estimate.x[10]))
    assert here.force is not None
    hull = HULL.expected((surge, sway), here.yaw_rate, here.force, more)
    for k in (0, 1):
        second = hull.curvature[k] * (water[k] * max(water)) ** 0.5
        product = hull.by_velocity[k][k] ** 2 * water[k] * estimate.P[9 + k, 9 + k]
        expected = ekf.MODEL_NOISE**2 / here.seconds + 10 * 3 * second**2 + product
        noise = ekf.balance(estimate, here, HULL).R
        assert noise[k, k] == pytest.approx(expected, rel=1e-4)
        assert noise[k, 1 - k] == 0.0


@few
@given(seeds, moments, st.tuples(number, number, number), st.floats(0.01, 1.0))
def test_the_noise_of_a_velocity_is_its_own_and_that_of_the_depth_rate_along_each_axis(
    seed: int, moment: Moment, seen: tuple[float, float, float], std: float
) -> None:
    estimate, here = drawn(seed), interval(moment)
    roll, pitch, _ = moment.euler
    down = np.array((-sin(pitch), cos(pitch) * sin(roll)))
    noise = ekf.velocity(estimate, here, seen, std).R
    assert noise == pytest.approx(
        std**2 * np.eye(2) + here.depth_rate_std**2 * np.outer(down, down)
    )


def without_knowledge_of(estimate: HorizontalEstimate, states: list[int]) -> HorizontalEstimate:
    P = estimate.P.copy()
    P[states, :] = P[:, states] = 0.0
    P[states, states] = 1e8
    return HorizontalEstimate(estimate.x, P)


@few
@given(seeds, moments, st.tuples(number, number), st.floats(0.01, 1.0))
def test_a_restart_is_the_measurement_of_what_was_unknown(
    seed: int, moment: Moment, seen: Pair, std: float
) -> None:
    """Level, with a depth rate that is known: of both the third axis says nothing."""
    estimate = drawn(seed)
    here = interval(moment._replace(euler=(0.0, 0.0, moment.euler[2]), depth_rate=0.0))
    here = here._replace(depth_rate_std=0.0)
    found = ekf.changed_to(estimate, here, (*seen, 0.0), std)
    there = without_knowledge_of(HorizontalEstimate(found.x, estimate.P), [2, 3])
    measured = ekf.corrected(there, ekf.velocity(there, here, (*seen, 0.0), std))
    assert_same(found, measured, 1e-4, 1e-5)
    assert hypot(*found.x[[2, 3]].tolist()) == pytest.approx(hypot(*seen))
    placed = ekf.moved_to(estimate, seen, std)
    lost = without_knowledge_of(estimate, POSITIONS)
    fixed = ekf.corrected(lost, ekf.fix(lost, seen, std))
    assert_same(placed, fixed, 1e-4, 1e-5)


@few
@given(seeds, seeds, st.integers(1, 3))
def test_a_measurement_is_weighed_by_its_covariance_and_teaches_nothing_of_the_damping(
    seed: int, other: int, count: int
) -> None:
    estimate, rng = drawn(seed), np.random.default_rng(other)
    root = rng.normal(size=(count, count))
    seen = Innovation(
        rng.normal(size=count), rng.normal(size=(count, SIZE)), root @ root.T + 0.1 * np.eye(count)
    )
    S = seen.H @ estimate.P @ seen.H.T + seen.R
    assert ekf.covariance(estimate, seen) == pytest.approx(S)
    nis, after = ekf.weighed(estimate, seen)
    assert nis == pytest.approx(seen.off @ np.linalg.inv(S) @ seen.off, rel=1e-6)
    assert ekf.surprise(estimate, seen) == pytest.approx(nis)
    assert after.x[9:11] == pytest.approx(estimate.x[9:11])
    assert after.P[9:11, 9:11] == pytest.approx(estimate.P[9:11, 9:11])
    others = [k for k in range(SIZE) if k not in (9, 10)]
    gain = estimate.P @ seen.H.T @ np.linalg.inv(S)
    assert after.x[others] == pytest.approx((estimate.x + gain @ seen.off)[others], rel=1e-6)
    free = estimate.P - gain @ S @ gain.T
    block = np.ix_(others, others)
    assert after.P[block] == pytest.approx(free[block], rel=1e-6, abs=1e-9)


@given(seeds, st.integers(0, SIZE - 1), st.floats(-3.0, 15.0))
def test_a_variance_is_sound_between_nothing_and_a_million_metres_squared(
    seed: int, which: int, power: float
) -> None:
    estimate = drawn(seed)
    for sign in (1.0, -1.0):
        P = estimate.P.copy()
        P[which, which] = variance = sign * 10.0**power
        sound = 0.0 < variance < 1e12
        assert ekf.is_sound(HorizontalEstimate(estimate.x, P)) == sound
        assert ekf.is_sound(HorizontalEstimate(1e9 * estimate.x, P)) == sound


@given(st.floats(-pi, pi), pairs)
def test_a_vector_turned_is_as_long_and_that_much_further_round(angle: float, v: Pair) -> None:
    assert ekf.turned(v, angle) == pytest.approx(turned(v, angle))


@few
@given(seeds, moments, st.floats(0.02, 0.4))
def test_in_a_turn_the_true_velocity_and_the_true_current_stay(
    seed: int, moment: Moment, turn: float
) -> None:
    """The compass' error changes with the heading, and what is said by its north with it."""
    roll, pitch, heading = 0.0, 0.0, moment.euler[2]
    estimate = drawn(seed)
    before = interval(moment._replace(euler=(roll, pitch, heading), acceleration=None))
    after = before._replace(attitude=from_euler(roll, pitch, heading + turn))
    steps = 50
    part = after._replace(seconds=0.1 / steps, yaw_rate=turn / 0.1)
    now = estimate
    for k in range(steps):
        here = part._replace(attitude=from_euler(roll, pitch, heading + turn * (k + 0.5) / steps))
        now = ekf.predicted(now, here)
    for pair in ((2, 3), (4, 5)):
        old = turned(tuple(estimate.x[[*pair]]), ekf.heading_error(estimate, before))
        aged = now._replace(x=now.x)
        new = turned(tuple(aged.x[[*pair]]), ekf.heading_error(aged, after))
        assert new == pytest.approx(old, abs=2e-3)


@few
@given(seeds, st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)), headings)
def test_a_drone_at_rest_learns_nothing_of_its_heading(
    seed: int, lean: Pair, heading: float
) -> None:
    """However long a DVL says so. The accelerometer and the velocity are as noisy as they may be;
    the place where it rests must not turn about the origin, nor become better known."""
    rng = np.random.default_rng(seed)
    began = ekf.initial(0.1)
    x, P = began.x.copy(), began.P.copy()
    x[ekf.POSITION], x[ekf.LEAN] = (30.0, -40.0), lean
    turns = np.array((40.0, 30.0))  # [m] by which the place moves for a radian of deviation A
    P[0:2, 8] = turns * P[8, 8]
    P[8, 0:2] = P[0:2, 8]
    P[0:2, 0:2] += P[8, 8] * np.outer(turns, turns)
    still = HorizontalEstimate(x, P)
    for _ in range(1200):
        a = (lean[0] + rng.normal(0.0, 0.1), lean[1] + rng.normal(0.0, 0.1))
        here = interval(Moment(0.1, a, (0.0, 0.0, heading), 0.0, (0.0, 0.0), 0.0))
        still = ekf.predicted(still, here)
        u, v = rng.normal(0.0, 0.01, 2)
        still = ekf.corrected(still, ekf.velocity(still, here, (u, v, 0.0), 0.01))
    assert hypot(*(still.x[ekf.POSITION] - (30.0, -40.0)).tolist()) < 0.1
    assert still.P[0, 0] + still.P[1, 1] > 0.99 * (P[0, 0] + P[1, 1])
