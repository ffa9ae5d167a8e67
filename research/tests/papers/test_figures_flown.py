"""The figures of flights: the stand-ins play what they say, and the drone is where it is drawn."""

import re
from collections.abc import Callable
from functools import cache
from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

from lindy.api.messages import Estimate, VehicleState
from lindy.api.references import Limits
from lindy_research.papers import fernandes_loop, style
from lindy_research.papers.claims import table
from lindy_research.papers.claims_fernandes_loop import (
    FlownSection,
    claims_not_flown,
    flown_claims,
)
from lindy_research.papers.fernandes_loop import PaperLimits as Errors
from lindy_research.papers.fernandes_loop import RoutePair
from lindy_research.papers.fernandes_loop_flight import LawName, flown, survey_route, trial_route
from lindy_research.papers.fernandes_loop_guide import Guide
from services.reference.paths.path import Path
from tools.generators.route import Route, stretch

pytestmark = pytest.mark.slow

LENGTH = 1.0  # [m]
SHORT = Route(
    Path.through(((0.0, 0.0), (LENGTH, 0.0)), 5.0), stretch(LENGTH, Limits(0.1, 0.05), 0.2)
)


@cache
def short() -> RoutePair:
    """A metre north, after time to settle."""
    ways: tuple[LawName, LawName] = ("paper", "lindy")
    return RoutePair(*(flown(SHORT, way, SHORT.duration + 5.0, begin=25.0) for way in ways))


def test_both_flights_arrive_and_stay_near_the_reference() -> None:
    for flight in short():
        place = flight.truth.place
        assert place[-1] - place[0] == pytest.approx([LENGTH, 0.0, 0.0], abs=0.5)
        path, depth, heading = flight.worst()
        assert path < 0.5
        assert depth < 0.15
        assert heading < radians(2.5)
        assert len(flight.truth.t) == len(flight.estimate.t) == len(flight.thrust)
        assert flight.estimate.place == pytest.approx(flight.truth.place, abs=0.5)


def test_the_same_flight_twice_is_the_same_to_the_last_bit() -> None:
    first, again = (flown(SHORT, "paper", 0.0, begin=3.0) for _ in range(2))
    assert np.array_equal(first.truth.place, again.truth.place)
    assert np.array_equal(first.thrust, again.thrust)


def draw_errors(figure: Figure, flights: RoutePair) -> None:
    fernandes_loop.draw_errors(figure, flights, Errors(0.5, 0.1, 4.0))


DRAWN = (
    draw_errors,
    fernandes_loop.draw_velocities,
    fernandes_loop.draw_rotations,
    fernandes_loop.draw_map,
    fernandes_loop.draw_forces,
)


@pytest.mark.parametrize("draw", DRAWN)
def test_every_row_of_panels_has_a_unit_and_every_curve_is_finite(
    draw: Callable[[Figure, RoutePair], None],
) -> None:
    figure = style.sheet(8.0, 8.0)
    draw(figure, short())
    assert any("[" in panel.get_xlabel() for panel in figure.axes)
    for panel in figure.axes:
        assert panel.get_ylabel() == "" or re.search(r"\[.+\]", panel.get_ylabel())
        assert panel.lines
        for line in panel.lines:
            assert np.isfinite(np.asarray(line.get_ydata(), float)).all()


def test_the_routes_of_both_ways_go_to_the_same_place() -> None:
    for route in (trial_route, survey_route):
        paper, lindy = route("paper"), route("lindy")
        assert lindy.duration < paper.duration
        here, there = paper.at(paper.duration), lindy.at(lindy.duration)
        assert (here.north, here.east) == pytest.approx((there.north, there.east), abs=1e-6)


def test_only_lindys_yaw_is_c2() -> None:
    def largest_step(way: LawName) -> float:
        route = survey_route(way)
        yaw = [route.at(0.05 * k).yaw_acceleration for k in range(int(20 * route.duration))]
        return float(np.max(np.abs(np.diff(yaw))))

    assert largest_step("lindy") < 0.2 * largest_step("paper")


@given(st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.floats(0.0, 60.0))
@settings(max_examples=50, deadline=None)
def test_the_guide_counts_the_heading_from_north_however_the_gyroscopes_drift(
    heading: float, drift: float, later: float
) -> None:
    guide = Guide(SHORT, 80.0, 5.0)
    armed = guide.step(_state(0, heading, heading), 0)
    assert armed.armed
    now = round(later * 1e9)
    said = guide.step(_state(now, heading + drift, heading), now)
    assert said.heading.position == pytest.approx(drift, abs=1e-9)
    assert said.north is not None
    assert said.north.position == pytest.approx(SHORT.at(later - 5.0).north, abs=1e-6)


def test_claims_of_flights_are_judged_when_flown_and_else_say_when_they_are() -> None:
    what = FlownSection("4.1", ("fernandes-6",), Errors(0.5, 0.15, 2.5), short)
    found, missing = flown_claims(what), claims_not_flown(what)
    assert [claim.id for claim in found] == [claim.id for claim in missing]
    assert [claim.paper for claim in found] == [claim.paper for claim in missing]
    assert {claim.verdict for claim in found[:3]} == {"holds"}
    assert all("fernandes-6" in claim.note and claim.ours == [] for claim in missing)
    assert table(missing) == [
        "claims: 0 hold, 0 differ",
        "6 of flights not computed, since no figure of theirs is drawn",
    ]


def _state(now: int, control: float, north: float | None) -> VehicleState:
    def known(value: float) -> Estimate:
        return Estimate(value, 0.01, valid=True)

    return VehicleState(
        stamp_ns=now, sensor_ns=now, phase="running", depth=known(80.0), depth_rate=known(0.0),
        depth_acceleration=known(0.0), attitude=(1.0, 0.0, 0.0, 0.0), roll=known(0.0),
        pitch=known(0.0), heading=known(control),
        heading_navigation=None if north is None else known(north), yaw_rate=known(0.0),
        surge_velocity=known(0.0), sway_velocity=known(0.0), north=known(0.0), east=known(0.0),
    )  # fmt: skip
