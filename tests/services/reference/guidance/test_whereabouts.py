"""Where the drone is, as its status says it, the way home, and the bottom below."""

from math import pi, tau

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import UNSET

from messages.events import Outbox
from messages.sensors import AltitudeSample, DvlSample
from services.marine.attitude import from_euler, to_body, whole_turns, wrapped
from services.reference.core import ReferenceGenerator, Settings
from services.reference.guidance.bottom import Bottom
from services.reference.guidance.station_keeping import (
    MOST_GAP_S,
    Home,
    HomePlace,
    ground_of,
    whereabouts,
)
from tests.support.said import state

STATE = state(depth=2.5)
angle = st.floats(-50.0, 50.0)


@given(angle, st.none() | st.floats(-pi, pi))
def test_the_heading_is_that_of_the_compass_however_often_the_drone_has_turned(
    control: float, compass: float | None
) -> None:
    said = whereabouts(state(heading=control, heading_navigation=compass))[1]
    assert isinstance(said, float)
    assert -pi <= said <= pi
    wanted = control if compass is None else compass
    assert wrapped(said - wanted) == pytest.approx(0.0, abs=1e-9)
    assert abs(control - tau * whole_turns(control)) <= tau / 2 + 1e-9


def test_what_is_not_known_is_not_said() -> None:
    assert whereabouts(None) == (UNSET, UNSET)
    assert whereabouts(state(depth=2.5, invalid=("depth",)))[0] is UNSET
    assert whereabouts(state(heading=2.5, invalid=("heading",)))[1] is UNSET
    generator = ReferenceGenerator(Settings(), Outbox())
    for now, seen, depth in ((0, None, UNSET), (1, STATE, 2.5), (2, None, UNSET)):
        generator.step(seen, None, now * S)
        assert generator.status(now * S).depth == depth


def test_a_vehicle_that_dives_nose_down_does_not_move_over_the_ground() -> None:
    """Straight down by the compass's north, whatever the control heading."""
    tilted = from_euler(0.0, -0.35, 1.0)
    surge, sway, _ = to_body(tilted, (0.1, 0.0, 0.4))
    seen = state(
        attitude=tilted, pitch=-0.35, heading=1.0, heading_navigation=1.0 - pi / 2, depth_rate=0.4,
        surge_velocity=surge, sway_velocity=sway, north=0.0, east=0.0,
    )  # fmt: skip
    found = ground_of(seen)
    assert found is not None
    assert found.velocity == pytest.approx((0.0, -0.1), abs=1e-9)


metres = st.floats(-1000.0, 1000.0)
places = st.tuples(metres, metres)


def seen(
    home: Home, place: tuple[float, float], t: float, origin: int = 1, armed: bool = True
) -> None:
    here = state(
        north=place[0], east=place[1], surge_velocity=0.0, sway_velocity=0.0, origin=origin
    )
    home.see(here, ground_of(here), t, armed=armed)


@given(places, places)
def test_it_is_the_first_position_while_armed(
    deck: tuple[float, float], later: tuple[float, float]
):
    home = Home()
    assert "since the drone was armed" in home.missing
    seen(home, (5.0, 5.0), 0.0, armed=False)
    assert home.place is None
    seen(home, deck, 0.1)
    seen(home, later, 0.2)
    seen(home, later, 0.3, armed=False)
    seen(home, later, 0.4)
    assert home.place == HomePlace(*deck, 1)
    assert not home.missing


@given(places, places, places)
def test_it_stays_the_same_place_where_another_origin_takes_over(
    deck: tuple[float, float], here: tuple[float, float], anew: tuple[float, float]
) -> None:
    """As with the first acoustic fix after a DVL: the drone has not moved, only its numbers."""
    home = Home()
    seen(home, deck, 0.0)
    seen(home, here, 0.1)
    seen(home, anew, 0.2, origin=0)
    assert home.place is not None
    assert abs(home.place.north - anew[0] - (deck[0] - here[0])) < 1e-9
    assert abs(home.place.east - anew[1] - (deck[1] - here[1])) < 1e-9
    assert home.place.origin == 0


def test_after_a_gap_it_is_the_same_place_of_the_same_origin_and_of_another_lost_for_good() -> None:
    home = Home()
    seen(home, (1.0, 2.0), 0.0)
    home.see(None, None, 5.0, armed=True)
    seen(home, (4.0, 2.0), 60.0)
    again = Home(home.place, home.lost)  # after a restart
    seen(again, (5.0, 2.0), 61.0)
    assert again.place == HomePlace(1.0, 2.0, 1)
    seen(again, (0.0, 0.0), 61.0 + MOST_GAP_S + 0.5, origin=7)
    assert again.place is None
    assert "began anew" in again.missing
    lost = Home(again.place, again.lost)
    for home in (again, lost):
        seen(home, (3.0, 0.0), 100.0, origin=7)
        assert home.place is None


# What is known of the bottom, by which instrument.


S = 1_000_000_000  # [ns]


@pytest.mark.parametrize(("altitude", "depth"), [(3.0, 8.0), (None, 14.0)])
def test_an_altimeter_says_how_high_before_the_dvl_which_says_how_fast(
    altitude: float | None, depth: float
) -> None:
    bottom = Bottom()
    for k in range(1, 31):
        now, seen = k * S // 10, (0.3, 0.4, 0.0) if k < 30 else None
        dvl = DvlSample(stamp_ns=now, velocity=seen, std=0.01, altitude=9.0)
        sounder = None if altitude is None else AltitudeSample(stamp_ns=now, altitude=altitude)
        bottom.see(dvl, state(now, depth=5.0), now / S, sounder)
    assert bottom.depth(2.9) == pytest.approx(depth)
    assert bottom.speed == pytest.approx(0.5)  # the newest that was measured


@pytest.mark.parametrize(("hz", "lost_after"), [(10.0, 1.0), (4.0, 2.5), (1.0, 5.0)])
def test_it_is_lost_by_the_rate_at_which_altitudes_come(hz: float, lost_after: float) -> None:
    bottom, period = Bottom(), round(S / hz)
    for k in range(1, 60):
        now = k * period
        bottom.see(None, state(now, depth=5.0), now / S, AltitudeSample(stamp_ns=now, altitude=3.0))
    newest, last = AltitudeSample(stamp_ns=59 * period, altitude=3.0), 59 * period / S
    bottom.see(None, state(59 * period, depth=5.0), last + lost_after - 0.05, newest)
    assert bottom.known
    bottom.see(None, state(59 * period, depth=5.0), last + lost_after + 0.05, newest)
    assert not bottom.known
    assert bottom.lost


def test_a_step_of_the_floor_does_not_lose_it() -> None:
    """What is doubted is heard all the same, also of a sounder that is fast and answers late."""
    bottom = Bottom()
    for k in range(1, 80):
        now, altitude = k * S // 10, 3.0 if k < 40 else 6.0
        sample = AltitudeSample(stamp_ns=now - S // 5, altitude=altitude)
        bottom.see(None, state(now, depth=5.0), now / S, sample)
        assert bottom.known
    assert bottom.depth(7.9) == pytest.approx(11.0, abs=0.1)
