"""Turns against integration, the printed series of the paper, and what symmetry demands."""

from math import cos, inf, nan, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.paths.turn import SmoothTurn, Turn
from tools.generators.route import TwinClothoids, fresnel

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
def test_a_turn_is_the_integral_of_its_courses(
    shape: type[Turn], angle: float, radius: float, fraction: float
) -> None:
    turn = shape(angle, radius)
    s = fraction * turn.length
    here = turn.at(s)
    assert (here.x, here.y) == pytest.approx(integrated(turn, s), abs=1e-13 * turn.length)


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


@SHAPES
@settings(max_examples=60, deadline=None)
@given(ANGLES, RADII)
def test_a_turn_begins_and_ends_straight_and_is_sharpest_in_the_middle(
    shape: type[Turn], angle: float, radius: float
) -> None:
    turn = shape(angle, radius)
    first, middle, last = turn.at(0.0), turn.middle, turn.at(turn.length)
    assert first[:4] == (0.0, 0.0, 0.0, 0.0)
    assert middle.curvature == pytest.approx(1 / radius, rel=1e-15)
    assert middle.course == pytest.approx(angle / 2, rel=1e-15)
    assert last.course == angle
    assert last.curvature == 0.0


@SHAPES
@settings(max_examples=60, deadline=None)
@given(st.floats(1e-6, 3.1), RADII)
def test_a_turn_ends_one_tangent_after_its_corner(
    shape: type[Turn], angle: float, radius: float
) -> None:
    turn = shape(angle, radius)
    last = turn.at(turn.length)
    corner = turn.tangent
    expected = (corner + corner * cos(angle), corner * sin(angle))
    assert (last.x, last.y) == pytest.approx(expected, abs=1e-12 * corner)


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


@pytest.mark.parametrize("angle", [0.0, -1.0, 3.2, nan, inf])
def test_an_impossible_angle_is_refused(angle: float) -> None:
    with pytest.raises(ValueError, match="must be more than 0, at most π"):
        TwinClothoids(angle, 1.0)


@pytest.mark.parametrize("radius", [0.0, -1.0, nan, inf])
def test_an_impossible_radius_is_refused(radius: float) -> None:
    with pytest.raises(ValueError, match=r"min_radius: found .*, must be a finite number more"):
        SmoothTurn(1.0, radius)
