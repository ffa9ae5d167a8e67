"""Turns against integration and the paper's printed series; and routes, of which every quantity is
the derivative of the one before."""

from collections.abc import Sequence
from math import cos, exp, inf, nan, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.paths.path import Kind, Path
from services.reference.paths.turn import SmoothTurn, Turn
from services.reference.trajectory.minimum_jerk import Limits, MotionProfile, pair, solve
from tools.generators.fernandes import MotionRequest, plan
from tools.generators.route import MotionLaw, Route, TwinClothoids, fresnel, route, stretch


def through(
    points: Sequence[Sequence[float]],
    radius: float,
    kind: Kind = "approximating",
    *,
    smooth: bool = False,
) -> Path:
    return Path.through(points, radius, kind, SmoothTurn if smooth else TwinClothoids)


POINTS = [[0.0, 0.0, 2.0], [60.0, 0.0, 5.0], [0.0, 90.0, 3.0], [60.0, 90.0, 8.0]]
LIMITS = Limits(0.3, 0.15)
SPEEDS = [0.4, 0.25, 0.4, 0.25, 0.4]


def mjvr(length: float, cruise: float, initial: float, final: float) -> MotionProfile:
    return stretch(length, LIMITS, cruise, initial, final)


def fernandes(length: float, cruise: float, initial: float, final: float) -> MotionProfile:
    return plan(MotionRequest(length, cruise, 20.0, 20.0, initial, final, theta_0=exp(-13)))


MOTIONS: dict[str, MotionLaw] = {"mjvr": mjvr, "fernandes": fernandes}


ROUTES = {
    (name, kind, smooth, per_part): route(
        path := through(POINTS, 5.0, kind, smooth=smooth),
        motion,
        [0.25 + 0.1 * (i % 2) for i in range(len(path.parts))] if per_part else [0.4],
    )
    for name, motion in MOTIONS.items()
    for kind in ("approximating", "interpolating")
    for smooth in (True, False)
    for per_part in (True, False)
}


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(sorted(ROUTES)), st.floats(0, 1))
def test_velocities_and_accelerations_are_derivatives_in_the_world_and_in_the_body(
    key: tuple[str, str, bool, bool], fraction: float
) -> None:
    way = ROUTES[key]  # type: ignore[index]
    step = 1e-3
    t = step + fraction * (way.duration - 2 * step)
    a, here, b = way.at(t - step), way.at(t), way.at(t + step)

    def rate(name: str) -> float:
        return (getattr(b, name) - getattr(a, name)) / (2 * step)

    for axis in ("north", "east", "down"):
        assert rate(axis) == pytest.approx(getattr(here, f"v_{axis}"), abs=2e-4)
        assert rate(f"v_{axis}") == pytest.approx(getattr(here, f"a_{axis}"), abs=2e-3)
    assert rate("s") == pytest.approx(here.surge_velocity, abs=2e-4)
    assert rate("surge_velocity") == pytest.approx(here.surge_acceleration, abs=2e-3)
    assert rate("heading") == pytest.approx(here.yaw_rate, abs=2e-4)
    if abs(a.yaw_acceleration - b.yaw_acceleration) < 1e-4:  # no joint in between
        assert rate("yaw_rate") == pytest.approx(here.yaw_acceleration, abs=2e-4)

    # The body's velocity is the world's, seen from the vehicle.
    ahead, aside = cos(here.heading), sin(here.heading)
    surge = here.v_north * ahead + here.v_east * aside
    sway = here.v_east * ahead - here.v_north * aside
    assert (surge, sway) == pytest.approx((here.surge_velocity, here.sway_velocity), abs=1e-12)
    surge = here.a_north * ahead + here.a_east * aside - here.yaw_rate * sway
    sway = here.a_east * ahead - here.a_north * aside - here.yaw_rate * here.surge_velocity
    expected = (here.surge_acceleration, here.sway_acceleration)
    assert (surge, sway) == pytest.approx(expected, abs=1e-12)


def when(way: Route, s: float) -> float:
    """[s] When a route is at `s` [m]."""
    early, late = 0.0, way.duration
    for _ in range(60):
        middle = (early + late) / 2
        early, late = (middle, late) if way.at(middle).s < s else (early, middle)
    return late


def test_the_speed_does_not_drop_where_a_moving_part_begins() -> None:
    way = ROUTES["fernandes", "approximating", False, True]
    for part in way.path.parts[1:]:
        t = when(way, part.begin)
        speeds = [way.at(t + dt).surge_velocity for dt in (-1e-9, 0.0, 1e-9)]
        assert speeds == pytest.approx([speeds[0]] * 3, abs=1e-6)
        assert speeds[0] > 0.2


def test_the_papers_route_takes_the_papers_time() -> None:
    """Table 3, 50 s to 731.5 s; without rounding each part up to a sample, 680.6 s."""
    way = route(through([p[:2] for p in POINTS], 10.0), fernandes, SPEEDS)
    assert way.duration == pytest.approx(680.645468, abs=1e-5)
    assert 50 + way.duration == pytest.approx(731.5, abs=1.0)


@settings(max_examples=80, deadline=None)
@given(st.floats(0.01, 100), st.floats(0.05, 1), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_a_stretch_covers_its_length_between_its_speeds_within_its_limits(
    distance: float, cruise: float, initial: float, final: float, fraction: float
) -> None:
    initial, final = initial * cruise, final * cruise
    least = needed(initial, final)
    if distance < least:
        with pytest.raises(ValueError, match=f"too short .* needs {least:.6g} m"):
            stretch(distance, LIMITS, cruise, initial, final)
        return
    motion = stretch(distance, LIMITS, cruise, initial, final)
    first, last = motion.at(0.0), motion.at(motion.duration)
    assert (first.velocity, first.acceleration) == pytest.approx((initial, 0.0), abs=1e-12)
    assert last[:3] == pytest.approx((distance, final, 0.0), abs=1e-9)
    here = motion.at(fraction * motion.duration)
    assert -1e-12 <= here.velocity <= cruise + 1e-12
    assert abs(here.acceleration) <= LIMITS.acceleration + 1e-12
    assert abs(here.jerk) <= LIMITS.jerk + 1e-12


def needed(initial: float, final: float) -> float:
    """[m] From one speed to the other."""
    return sum(part.at(part.duration).position for part in solve(initial, 0.0, final, LIMITS))


def test_impossible_speeds_are_refused_with_the_part() -> None:
    path = through(POINTS, 5.0)
    with pytest.raises(ValueError, match="speeds: found 2, must be one, or one for each of the 5"):
        route(path, mjvr, [0.3, 0.3])
    with pytest.raises(ValueError, match=r"part 1 \(line\): .* m are too short to get from 0"):
        route(path, mjvr, [50.0] * 5)
    with pytest.raises(ValueError, match="must be 0 to cruise"):
        route(path, mjvr, [-1.0])
    with pytest.raises(ValueError, match="must end at rest after"):
        Route(path, pair(path.length - 1.0, LIMITS, 0.4))
    with pytest.raises(ValueError, match="must end at rest after"):
        Route(path, stretch(path.length, LIMITS, 0.4, 0.0, 0.2))


# Turns.


SHAPES = pytest.mark.parametrize("shape", [TwinClothoids, SmoothTurn])
ANGLES = st.floats(1e-8, pi)
RADII = st.floats(0.1, 100.0)
FRACTIONS = st.floats(0.0, 1.0)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)


def integrated(turn: Turn, s: float) -> tuple[float, float]:
    """The place `s` from the start, from the courses alone, in pieces without a kink."""
    x = y = 0.0
    middle = min(s, turn.length / 2)
    for begin, end in ((0.0, middle), (middle, s)):
        for node, weight in zip(NODES.tolist(), WEIGHTS.tolist(), strict=True):
            course = turn.at(begin + (end - begin) * (1 + node) / 2).course
            x += cos(course) * weight * (end - begin) / 2
            y += sin(course) * weight * (end - begin) / 2
    return x, y


def test_fresnel_integrals_have_their_tabled_values() -> None:
    assert fresnel(1.0) == pytest.approx((0.7798934003768228, 0.4382591473903548), abs=1e-15)
    for z in (1.6, nan, inf):
        with pytest.raises(ValueError, match="the series is good for"):
            fresnel(z)


@SHAPES
@settings(max_examples=60, deadline=None)
@given(ANGLES, RADII, FRACTIONS)
def test_a_turn_is_the_integral_of_its_courses_and_ends_one_tangent_after_its_corner(
    shape: type[Turn], angle: float, radius: float, fraction: float
) -> None:
    turn = shape(angle, radius)
    s = fraction * turn.length
    here, last = turn.at(s), turn.at(turn.length)
    assert (here.x, here.y) == pytest.approx(integrated(turn, s), abs=1e-13 * turn.length)
    if 1e-6 <= angle <= 3.1:  # half a circle has no corner
        corner = turn.tangent
        expected = (corner + corner * cos(angle), corner * sin(angle))
        assert (last.x, last.y) == pytest.approx(expected, abs=1e-12 * corner)


@SHAPES
@settings(max_examples=60, deadline=None)
@given(st.floats(0.01, pi), RADII, st.floats(0.01, 0.99))
def test_course_and_curvature_are_each_others_integral_and_rate(
    shape: type[Turn], angle: float, radius: float, fraction: float
) -> None:
    turn = shape(angle, radius)
    step = 1e-5 * turn.length
    s = fraction * turn.length
    if abs(s - turn.length / 2) < step:
        return
    before, here, after = turn.at(s - step), turn.at(s), turn.at(s + step)
    assert (after.course - before.course) / (2 * step) == pytest.approx(
        here.curvature, abs=1e-8 / radius
    )
    assert (after.curvature - before.curvature) / (2 * step) == pytest.approx(
        here.curvature_rate, abs=1e-6 / radius / turn.length + 1e-9 * abs(here.curvature_rate)
    )
    assert 0 <= here.curvature <= 1 / radius * (1 + 1e-15)


def test_the_curvature_rate_of_a_smooth_turn_vanishes_where_clothoids_jump() -> None:
    smooth, twin = SmoothTurn(2.0, 5.0), TwinClothoids(2.0, 5.0)
    for s in (0.0, smooth.length / 2, smooth.length):
        assert smooth.at(s).curvature_rate == pytest.approx(0.0, abs=1e-15)
    steepest = max(smooth.at(s).curvature_rate for s in np.linspace(0, smooth.length, 401).tolist())
    assert steepest == pytest.approx(1.5 * twin.at(0.0).curvature_rate, rel=1e-6)
    assert smooth.length == twin.length


@SHAPES
def test_a_turn_of_half_a_circle_exists_but_has_no_corner(shape: type[Turn]) -> None:
    turn = shape(pi, 2.0)
    assert turn.at(turn.length).x == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(ValueError, match="180° has no corner"):
        _ = turn.tangent


def test_an_impossible_angle_or_radius_is_refused() -> None:
    for angle in (0.0, 3.2, nan):
        with pytest.raises(ValueError, match="must be more than 0, at most π"):
            TwinClothoids(angle, 1.0)
    for radius in (0.0, -1.0, nan, inf):
        with pytest.raises(ValueError, match=r"min_radius: found .*, must be a finite number more"):
            SmoothTurn(1.0, radius)
