"""Paths: what holds for every polyline with room, the paper's path, and what is refused."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, hypot, inf, nan, pi, sin
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.paths.path import Kind, Path
from services.reference.paths.turn import SmoothTurn
from tools.generators.route import TwinClothoids


def through(
    points: Sequence[Sequence[float]],
    radius: float,
    kind: Kind = "approximating",
    *,
    smooth: bool = False,
) -> Path:
    return Path.through(points, radius, kind, SmoothTurn if smooth else TwinClothoids)


PAPER = [[0.0, 0.0], [60.0, 0.0], [0.0, 90.0], [60.0, 90.0]]
KINDS: st.SearchStrategy[Kind] = st.sampled_from(["approximating", "interpolating"])
Points = list[list[float]]


@st.composite
def polylines(draw: st.DrawFn) -> Points:
    """Polylines whose legs have room for their turns at a radius of 4 m, and depths."""
    heading = draw(st.floats(-pi, pi))
    n, e = draw(st.floats(-100, 100)), draw(st.floats(-100, 100))
    points = [[n, e, draw(st.floats(0, 30))]]
    for _ in range(draw(st.integers(1, 5))):
        length = draw(st.floats(60, 120))
        n, e = n + length * cos(heading), e + length * sin(heading)
        points.append([n, e, draw(st.floats(0, 30))])
        heading += draw(st.floats(-2.3, 2.3))
    return points


@st.composite
def paths(draw: st.DrawFn, kinds: st.SearchStrategy[Kind] = KINDS) -> tuple[Points, float, Path]:
    points, radius = draw(polylines()), draw(st.floats(0.5, 4.0))
    return points, radius, through(points, radius, draw(kinds), smooth=draw(st.booleans()))


@settings(max_examples=80, deadline=None)
@given(paths())
def test_parts_meet_without_a_step_and_turns_reach_the_smallest_radius_and_no_less(
    case: tuple[Points, float, Path],
) -> None:
    _, radius, path = case
    for before, after in pairwise(path.parts):
        a, b = before.at(before.length), after.at(0.0)
        assert hypot(a.north - b.north, a.east - b.east) < 1e-9
        assert a.course == pytest.approx(b.course, abs=1e-9)
        assert a.curvature == pytest.approx(b.curvature, abs=1e-12)
        assert after.begin == pytest.approx(before.begin + before.length, abs=1e-9)
        if before.kind != "clothoids" != after.kind:
            assert a.curvature_rate == pytest.approx(b.curvature_rate, abs=1e-9)
    turns = [part for part in path.parts if part.kind != "line"]
    sharpest = [abs(part.at(part.length / 2).curvature) for part in turns]
    assert sharpest == pytest.approx([1 / radius] * len(sharpest))
    assert path.max_curvature == (1 / radius if sharpest else 0.0)


@settings(max_examples=80, deadline=None)
@given(paths(), st.floats(0, 1))
def test_s_is_the_distance_and_every_rate_is_a_derivative(
    case: tuple[Points, float, Path], fraction: float
) -> None:
    _, _, path = case
    s = 1e-4 + fraction * (path.length - 2e-4)
    step = 1e-5
    a, here, b = path.at(s - step), path.at(s), path.at(s + step)

    def rate(name: str) -> float:
        return (getattr(b, name) - getattr(a, name)) / (2 * step)

    assert hypot(rate("north"), rate("east")) == pytest.approx(1.0, abs=1e-8)
    assert rate("north") == pytest.approx(cos(here.course), abs=1e-8)
    assert rate("east") == pytest.approx(sin(here.course), abs=1e-8)
    assert rate("course") == pytest.approx(here.curvature, abs=1e-4)
    assert rate("down") == pytest.approx(here.slope, abs=1e-7)
    assert rate("slope") == pytest.approx(here.slope_rate, abs=1e-5)
    if a.curvature_rate == pytest.approx(b.curvature_rate, abs=1e-3):  # no joint in between
        assert rate("curvature") == pytest.approx(here.curvature_rate, abs=1e-3)


@settings(max_examples=100, deadline=None)
@given(paths(st.just("interpolating")))
def test_an_interpolating_path_visits_every_way_point(case: tuple[Points, float, Path]) -> None:
    points, _, path = case
    assert len(path.passes) == len(points)
    for point, s in zip(points, path.passes, strict=True):
        assert path.at(s)[:3] == pytest.approx(tuple(point), abs=1e-9)
        assert path.at(s).curvature == pytest.approx(0.0, abs=1e-6)
    assert list(path.passes) == sorted(path.passes)


@settings(max_examples=60, deadline=None)
@given(paths())
def test_depth_is_level_at_every_way_point_and_never_overshoots(
    case: tuple[Points, float, Path],
) -> None:
    points, _, path = case
    for (a, b), (from_s, to_s) in zip(pairwise(points), pairwise(path.passes), strict=True):
        for s, point in ((from_s, a), (to_s, b)):
            assert path.at(s).down == pytest.approx(point[2], abs=1e-9)
            assert path.at(s).slope == pytest.approx(0.0, abs=1e-12)
            assert path.at(s).slope_rate == pytest.approx(0.0, abs=1e-9)
        for i in range(11):
            down = path.at(from_s + (to_s - from_s) * i / 10).down
            assert min(a[2], b[2]) - 1e-9 <= down <= max(a[2], b[2]) + 1e-9


PAPERS_PLACES = [  # s, north, east, course, curvature
    (35.0, 34.986813091075255, 0.3324158799020641, 0.13217498476789807, 0.03499319003323832),
    (60.0, 47.02781359390633, 17.798555633367226, 1.8974973798876844, 0.0492016756922413),
    (120.0, 14.717024023409273, 68.27566762528664, 2.0662747194843654, -0.029277675675594417),
]


def test_the_papers_path_has_the_papers_lengths_and_runs_where_it_should() -> None:
    path = through(PAPER, 10.0)
    lengths = [27.4456738787, 43.1759786068, 43.0578860213, 43.1759786068, 27.4456738787]
    assert [part.length for part in path.parts] == pytest.approx(lengths, abs=1e-9)
    assert path.max_curvature == 0.1
    for s, *expected in PAPERS_PLACES:
        here = path.at(s)
        found = [here.north, here.east, here.course, here.curvature]
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_lane_change_is_two_even_pairs_and_its_lanes_are_flown_exactly() -> None:
    """10 m aside at 10 m radius: the shortest has no line in the middle."""
    forward = 26.25433367959574 + 1e-7
    points = [[0.0, 0.0], [20.0, 0.0], [20.0 + forward, 10.0], [70.0, 10.0]]
    path = through(points, 10.0, "interpolating")
    first, change_out, *middle, change_back, last = path.parts
    assert (first.kind, first.length) == ("line", 20.0)
    assert change_out.length == pytest.approx(29.11392340373238 / 2, abs=1e-4)
    assert change_back.length == pytest.approx(29.11392340373238 / 2, abs=1e-4)
    assert change_out.turn is not None
    assert change_out.turn.angle == pytest.approx(0.7278480850933094, abs=1e-5)
    assert sum(part.length for part in middle) < 1e-4
    assert (last.course, last.length) == pytest.approx((0.0, 70.0 - 20.0 - forward))
    assert path.passes[2] - path.passes[1] < 35.64038131819847  # the antisymmetric pair's length


def test_a_lane_change_without_room_is_passed_on_the_bisecting_courses() -> None:
    points = [[0.0, 0.0], [40.0, 0.0], [60.0, 10.0], [95.0, 10.0]]
    path = through(points, 10.0, "interpolating")
    bisecting = path.at(path.passes[1]).course
    assert bisecting == pytest.approx(path.at(path.passes[2]).course)
    assert 2 * bisecting == pytest.approx(atan2(10, 20))


@pytest.mark.parametrize("angle", [1e-8, 1e-6, 1e-3])
@pytest.mark.parametrize("kind", ["approximating", "interpolating"])
def test_a_corner_that_is_hardly_one_is_still_smooth(angle: float, kind: Kind) -> None:
    points = [[0.0, 0.0], [50.0, 0.0], [50.0 + 50 * cos(angle), 50 * sin(angle)]]
    path = through(points, 5.0, kind)
    assert path.length == pytest.approx(100.0, abs=1e-4)
    for a, b in pairwise(path.parts):
        assert a.at(a.length)[:4] == pytest.approx(b.at(0.0)[:4], abs=2e-9)


def test_beyond_its_ends_a_path_stays_on_its_ends() -> None:
    path = through(PAPER, 10.0)
    assert path.at(-5.0) == path.at(0.0)
    assert path.at(path.length + 5.0) == path.at(path.length)
    for s in (nan, inf):
        with pytest.raises(ValueError, match="must be a finite number"):
            path.at(s)


@pytest.mark.parametrize(
    ("points", "radius", "kind", "says"),
    [
        ([[0, 0]], 5, "approximating", "at least 2 way-points, found 1"),
        ([[0, 0], [1]], 5, "approximating", "way-point 2: found 1 numbers"),
        ([[0, 0], [nan, 1]], 5, "approximating", "way-point 2: found .* must be finite"),
        ([[0, 0], [9, 0], [9, 0]], 5, "approximating", "way-points 2 and 3 are 0 m apart"),
        ([[0, 0, 1], [0, 0, 9]], 5, "approximating", "way-points 1 and 2 are 0 m apart"),
        ([[0, 0], [9, 0], [1, 0]], 5, "approximating", "way-point 2: the path goes exactly back"),
        ([[0, 0], [9, 0]], 0, "approximating", "min_radius: found 0 m"),
        ([[0, 0], [9, 0]], nan, "interpolating", "min_radius: found nan m"),
        ([[0, 0], [9, 0]], 1, "curvy", "kind: found 'curvy', must be 'approximating' or"),
        ([[0, 0], [30, 0], [30, 9], [0, 9]], 5, "approximating", r"leg 2 .* is 9 m long, its"),
        ([[0, 0], [30, 0], [30, 3], [60, 3]], 5, "interpolating", r"leg 2 .* is 3 m long, its"),
    ],
)
def test_a_path_that_cannot_be_is_refused_with_the_reason(
    points: Any, radius: float, kind: Any, says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        through(points, radius, kind)


@pytest.mark.parametrize("kind", ["approximating", "interpolating"])
def test_a_leg_as_long_as_the_refusal_asks_for_is_long_enough(kind: Kind) -> None:
    def middle(length: float) -> Points:
        return [[0.0, 0.0], [50.0, 0.0], [50.0, length], [0.0, length]]

    with pytest.raises(ValueError, match="leg 2") as refused:
        through(middle(8.0), 5.0, kind)
    need = float(str(refused.value).split("need")[1].split()[0])
    parts = through(middle(need * 1.001), 5.0, kind).parts
    for before, after in pairwise(parts):
        assert before.at(before.length)[:4] == pytest.approx(after.at(0.0)[:4], abs=1e-9)
    with pytest.raises(ValueError, match="leg 2"):
        through(middle(need * 0.999), 5.0, kind)
