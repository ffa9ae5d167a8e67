"""What the map is told: where the drone is and how surely, its home, its track."""

from math import atan2, degrees, hypot, radians

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.control import Wrench
from messages.message import Estimate
from messages.state import VehicleState
from messages.vehicle import PlaceAhead, VehicleStatus
from services.cockpit.chart import (
    APART,
    BEGINS,
    CURRENT,
    MEASURED_ON,
    MOST,
    RECKONED_ON,
    REMEMBERED_NS,
    SHARE,
    Chart,
)
from services.cockpit.page_view import PageView, chart_view
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack

PIONEER = Stack().section("vehicle", Vehicle)
S = 1_000_000_000
DT = S // 25
NONE = Estimate(0.0, 0.01)


def seen(
    north: float | None = None,
    east: float = 0.0,
    *,
    valid: bool = True,
    origin: int = 0,
    heading: float = 0.0,
) -> VehicleState:
    place = None if north is None else (north, east)
    return VehicleState(
        stamp_ns=0,
        sensor_ns=0,
        phase="running",
        depth=NONE,
        depth_rate=NONE,
        depth_acceleration=NONE,
        attitude=(1.0, 0.0, 0.0, 0.0),
        roll=NONE,
        pitch=NONE,
        heading=Estimate(heading, 0.01),
        heading_navigation=None,
        yaw_rate=NONE,
        north=None if place is None else Estimate(place[0], 0.3, valid),
        east=None if place is None else Estimate(place[1], 0.2, valid),
        origin=UNSET if place is None else origin,
    )


def push(surge: float, sway: float = 0.0) -> Wrench:
    thrust = (surge, sway, 0.0, 0.0, 0.0, 0.0)
    return Wrench(
        stamp_ns=0, sensor_ns=0, wanted=thrust, achieved=thrust, depth_integral=0.0,
        heading_integral=0.0, saturated=False,
    )  # fmt: skip


class Watch:
    """A chart and its clock."""

    def __init__(self, *, begun: bool = False) -> None:
        self.chart, self.now = Chart(PIONEER, begun), 0

    def go(self, state: VehicleState | None, seconds: float = 0.04, surge: float = 0.0) -> None:
        for _ in range(max(1, round(seconds * S / DT))):
            self.now += DT
            self.chart.step(state, push(surge), self.now, armed=True)

    @property
    def points(self) -> list[tuple[int, ...]]:
        flat = self.chart.track()
        return [tuple(flat[k : k + 3]) for k in range(0, len(flat), 3)]


def test_a_measured_place_is_shown_as_it_is_and_home_is_where_it_was_armed() -> None:
    watch = Watch()
    watch.chart.step(seen(1.0, 2.0), None, 1, armed=False)
    assert watch.chart.home() is None
    watch.go(seen(3.0, 4.0))
    watch.go(seen(3.25, 4.25))
    place = watch.chart.place()
    assert place is not None
    assert (place.north, place.east, place.std, place.measured) == (3.25, 4.25, 0.3, True)
    assert watch.chart.home() == (3.0, 4.0)


@settings(max_examples=50, deadline=None)
@given(st.integers(-20, 20), st.floats(1.0, 60.0), st.floats(-3.0, 3.0))
def test_without_a_measurement_it_goes_on_from_the_last_and_the_spread_grows_by_the_rule(
    surge: int, seconds: float, heading: float
) -> None:
    watch = Watch()
    watch.go(seen(10.0, -5.0))
    watch.go(seen(10.0, -5.0, valid=False, heading=heading), seconds, surge)
    here = watch.chart.here
    assert here is not None
    assert not here.measured
    way = hypot(here.north - 10.0, here.east + 5.0)
    known = round(seconds * S / DT) * DT / S
    assert here.std == pytest.approx(hypot(0.3, CURRENT * known, SHARE * way), rel=1e-6)
    assert (way > 0.0) == (surge != 0)
    watch.go(seen(10.0, -5.0))
    assert watch.chart.here is not None
    assert watch.chart.here.measured


def test_a_drone_that_never_measured_begins_where_it_was_armed() -> None:
    watch = Watch()
    watch.chart.step(seen(), None, 1, armed=False)
    assert watch.chart.here is None
    watch.go(seen(), 20.0, surge=20.0)
    here = watch.chart.here
    assert here is not None
    assert here.north > 5.0
    assert here.east == pytest.approx(0.0, abs=1e-9)
    assert watch.chart.home() == (0.0, 0.0)


@pytest.mark.parametrize(
    ("heading", "surge", "sway", "course"),
    [
        (0.0, 10.0, 0.0, 0.0),
        (0.0, 0.0, 10.0, 90.0),
        (90.0, 10.0, 0.0, 90.0),
        (90.0, 0.0, 10.0, 180.0),
        (200.0, 0.0, -10.0, 110.0),
    ],
)
def test_thrust_moves_it_where_it_points(
    heading: float, surge: float, sway: float, course: float
) -> None:
    watch = Watch()
    state = seen(heading=radians(heading))
    for _ in range(100):
        watch.now += DT
        watch.chart.step(state, push(surge, sway), watch.now, armed=True)
    here = watch.chart.here
    assert here is not None
    assert degrees(atan2(here.east, here.north)) % 360.0 == pytest.approx(course, abs=1e-6)


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
    watch.go(seen(valid=False), 10.0, surge=20.0)
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
