"""What the map is told: where the drone is and how surely, its home, its track."""

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.message import Estimate
from messages.state import VehicleState
from messages.vehicle import PlaceAhead, VehicleStatus
from services.cockpit.page_view import PageView, chart_view
from services.cockpit.past import (
    APART,
    BEGINS,
    MEASURED_ON,
    MOST,
    RECKONED_ON,
    REMEMBERED_NS,
    Chart,
)
from tests.support.messages import example

S = 1_000_000_000
DT = S // 25


def seen(
    north: float | None = None,
    east: float = 0.0,
    *,
    valid: bool = True,
    origin: int = 0,
    heading: float = 0.0,
) -> VehicleState:
    place = None if north is None else (north, east)
    return example(
        VehicleState, phase="running", heading=Estimate(heading, 0.01),
        north=None if place is None else Estimate(place[0], 0.3, valid),
        east=None if place is None else Estimate(place[1], 0.2, valid),
        origin=UNSET if place is None else origin,
    )  # fmt: skip


class Watch:
    """A chart and its clock."""

    def __init__(self, *, begun: bool = False) -> None:
        self.chart, self.now = Chart(begun), 0

    def go(self, state: VehicleState | None) -> None:
        self.now += DT
        self.chart.step(state, self.now, armed=True)

    @property
    def points(self) -> list[tuple[int, ...]]:
        flat = self.chart.track()
        return [tuple(flat[k : k + 3]) for k in range(0, len(flat), 3)]


def test_a_measured_place_is_shown_as_it_is_and_home_is_where_it_was_armed() -> None:
    watch = Watch()
    watch.go(seen())
    assert (watch.chart.here, watch.chart.home(), watch.points) == (None, None, [])
    watch.chart.step(seen(1.0, 2.0), 1, armed=False)
    assert watch.chart.home() is None
    watch.go(seen(3.0, 4.0))
    watch.go(seen(3.25, 4.25))
    place = watch.chart.place()
    assert place is not None
    assert (place.north, place.east, place.std, place.measured) == (3.25, 4.25, 0.3, True)
    assert watch.chart.home() == (3.0, 4.0)


def test_what_was_measured_a_while_ago_goes_on_as_the_state_says_and_is_marked() -> None:
    watch = Watch()
    watch.go(seen(10.0, -5.0))
    watch.go(seen(12.0, -5.0, valid=False))
    here = watch.chart.here
    assert here is not None
    assert (here.place, here.std, here.measured) == ((12.0, -5.0), 0.3, False)
    watch.go(seen(12.0, -5.0))
    watch.go(None)  # nothing is heard: where it was seen last, and no longer measured
    assert watch.chart.here == here
    watch.go(seen())
    assert watch.chart.here is None


def test_of_another_origin_neither_home_nor_track_is_shown_until_the_first_is_back() -> None:
    watch = Watch()
    for k in range(10):
        watch.go(seen(float(k), 0.0))
    assert len(watch.points) == 10
    watch.go(seen(0.0, 0.0, origin=77))
    assert watch.chart.home() is None
    assert watch.points == [(0, 0, BEGINS)]
    watch.go(seen(10.0, 0.0))
    assert watch.chart.home() == (0.0, 0.0)
    assert len(watch.points) == 11
    assert watch.points[-1] == (100, 0, BEGINS)


def test_a_service_that_was_restarted_under_way_does_not_take_this_place_for_home() -> None:
    watch = Watch(begun=True)
    watch.go(seen(5.0, 5.0))
    assert watch.chart.home() is None
    assert watch.chart.place() is not None


def test_a_jump_breaks_the_line_and_what_is_reckoned_is_marked() -> None:
    watch = Watch()
    watch.go(seen(0.0, 0.0))
    watch.go(seen(1.0, 0.0))
    watch.go(seen(9.0, 0.0))
    for k in range(10, 20):
        watch.go(seen(float(k), 0.0, valid=False))
    kinds = [point[2] for point in watch.points]
    assert kinds[:3] == [BEGINS, MEASURED_ON, BEGINS]
    assert set(kinds[3:]) == {RECKONED_ON}


@settings(max_examples=10, deadline=None)
@given(st.integers(1, 6 * MOST), st.floats(0.1, 3.0))
def test_the_track_is_bounded_keeps_its_ends_and_forgets_after_an_hour(
    count: int, step: float
) -> None:
    watch = Watch()
    for k in range(count):
        watch.go(seen(k * step, 0.0))
    points = watch.points
    assert len(points) <= MOST
    assert points[0][2] == BEGINS
    assert points[0][0] == 0
    behind = (count - 1) * step - points[-1][0] / 10
    assert behind <= max(step, APART * max(1.0, 2 * count * step / MOST / APART)) + 0.1
    watch.now += REMEMBERED_NS
    watch.go(seen((count + 1) * step + APART, 0.0))
    assert len(watch.points) == 1


def test_the_page_is_told_the_goal_or_the_way_points_ahead() -> None:
    watch = Watch()
    status = VehicleStatus(stamp_ns=0, activity="follow", armed=True)
    going = replace(status, goal=(1.0, 2.0))
    following = replace(status, waypoints=(PlaceAhead(1.0 / 3.0, 2.0), PlaceAhead(30.0, -4.0)))
    assert chart_view(watch.chart, None, None)["waypoints"] == ()
    assert chart_view(watch.chart, None, going)["waypoints"] == ()
    shown = chart_view(watch.chart, None, following)
    assert shown["goal"] is None
    view = msgspec.json.decode(msgspec.json.encode(PageView(**shown)))
    assert view["waypoints"] == [[0.33, 2.0], [30.0, -4.0]]


@pytest.mark.parametrize(
    ("compass", "shown"),
    [(None, None), (Estimate(1.0, 0.1, valid=False), None), (Estimate(-0.1, 0.1), 354.3)],
)
def test_the_compass_is_shown_beside_the_heading_of_the_tape_and_nothing_passes_for_it(
    compass: Estimate | None, shown: float | None
) -> None:
    state = replace(seen(heading=2.0), heading_navigation=compass)
    assert chart_view(Chart(), state, None)["compass_deg"] == shown
