"""Where the drone is, as its status says it, the way home, and the bottom below."""

from math import pi, tau

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.events import Outbox
from messages.message import Estimate
from messages.sensors import AltitudeSample, DvlSample
from services.marine.attitude import from_euler, to_body, whole_turns, wrapped
from services.reference.core import ReferenceGenerator, Settings
from services.reference.guidance.bottom import Bottom
from services.reference.guidance.ground_motion import (
    MOST_GAP_S,
    Home,
    HomePlace,
    ground_of,
    whereabouts,
)
from tests.support.said import state

ZERO = Estimate(0.0, 0.01)
STATE = state(depth=2.5)
angle = st.floats(-50.0, 50.0)


@given(angle, st.none() | st.floats(-pi, pi))
def test_the_heading_is_that_of_the_compass_however_often_the_drone_has_turned(
    control: float, compass: float | None
) -> None:
    seen = replace(
        STATE,
        heading=Estimate(control, 0.01),
        heading_navigation=None if compass is None else Estimate(compass, 0.1),
    )
    said = whereabouts(seen)[1]
    assert isinstance(said, float)
    assert -pi <= said <= pi
    wanted = control if compass is None else compass
    assert wrapped(said - wanted) == pytest.approx(0.0, abs=1e-9)


def test_what_is_not_known_is_not_said() -> None:
    unknown = Estimate(2.5, 0.01, valid=False)
    assert whereabouts(None) == (UNSET, UNSET)
    assert whereabouts(replace(STATE, depth=unknown))[0] is UNSET
    assert whereabouts(replace(STATE, heading=unknown))[1] is UNSET


def test_a_status_says_where_the_drone_is_only_while_there_is_a_state() -> None:
    generator = ReferenceGenerator(Settings(), Outbox())
    assert generator.status(0).depth is UNSET
    generator.step(STATE, None, 0)
    assert generator.status(0).depth == 2.5
    generator.step(None, None, 10_000_000)
    assert generator.status(10_000_000).depth is UNSET


def test_a_vehicle_that_dives_nose_down_does_not_move_over_the_ground() -> None:
    """Straight down by the compass's north, whatever the control heading."""
    tilted = from_euler(0.0, -0.35, 1.0)
    surge, sway, _ = to_body(tilted, (0.1, 0.0, 0.4))
    seen = replace(
        STATE,
        attitude=tilted,
        pitch=Estimate(-0.35, 0.01),
        heading=Estimate(1.0, 0.01),
        heading_navigation=Estimate(1.0 - pi / 2, 0.1),
        depth_rate=Estimate(0.4, 0.01),
        surge_velocity=Estimate(surge, 0.01),
        sway_velocity=Estimate(sway, 0.01),
        north=ZERO,
        east=ZERO,
    )
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


def test_after_a_gap_with_another_origin_it_is_lost_for_good_and_says_so() -> None:
    home = Home()
    seen(home, (1.0, 2.0), 0.0)
    seen(home, (0.0, 0.0), MOST_GAP_S + 0.5, origin=7)
    assert home.place is None
    assert "began anew" in home.missing
    seen(home, (3.0, 0.0), MOST_GAP_S + 0.6, origin=7)
    assert home.place is None
    again = Home(home.place, home.lost)  # after a restart
    seen(again, (3.0, 0.0), 100.0, origin=7)
    assert again.place is None


def test_a_gap_with_the_same_origin_and_a_restart_change_nothing() -> None:
    home = Home()
    seen(home, (1.0, 2.0), 0.0)
    home.see(None, None, 5.0, armed=True)
    seen(home, (4.0, 2.0), 60.0)
    again = Home(home.place, home.lost)
    seen(again, (5.0, 2.0), 61.0)
    assert again.place == HomePlace(1.0, 2.0, 1)


@given(st.floats(-100.0, 100.0))
def test_less_than_half_a_turn_is_left_after_the_whole_ones(heading: float) -> None:
    assert abs(heading - tau * whole_turns(heading)) <= tau / 2 + 1e-9


# What is known of the bottom, by which instrument.


S = 1_000_000_000  # [ns]


def test_an_altimeter_says_how_high_and_the_dvl_how_fast() -> None:
    bottom = Bottom()
    for k in range(1, 30):
        now = k * S // 10
        dvl = DvlSample(stamp_ns=now, velocity=(0.3, 0.4, 0.0), std=0.01, altitude=9.0)
        bottom.see(dvl, state(now, depth=5.0), now / S, AltitudeSample(stamp_ns=now, altitude=3.0))
    assert bottom.depth(2.9) == pytest.approx(8.0)
    assert bottom.speed == pytest.approx(0.5)
    lost = DvlSample(stamp_ns=3 * S, velocity=None, std=0.01)
    bottom.see(lost, state(3 * S, depth=5.0), 3.0, AltitudeSample(stamp_ns=3 * S, altitude=3.0))
    assert bottom.speed == pytest.approx(0.5)  # the newest that was measured


def test_without_an_altimeter_the_altitude_is_the_dvls() -> None:
    bottom = Bottom()
    for k in range(1, 30):
        now = k * S // 10
        dvl = DvlSample(stamp_ns=now, velocity=None, std=0.01, altitude=9.0)
        bottom.see(dvl, state(now, depth=5.0), now / S)
    assert bottom.depth(2.9) == pytest.approx(14.0)


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
