"""Where the drone is, as whoever watches many drones is told."""

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.events import Outbox
from messages.message import Estimate
from services.marine.attitude import from_euler, to_body, wrapped
from services.reference.core import ReferenceGenerator, Settings
from services.reference.guidance.ground_motion import Whereabouts, ground_of, whereabouts
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
    said = whereabouts(seen).heading
    assert isinstance(said, float)
    assert -pi <= said <= pi
    wanted = control if compass is None else compass
    assert wrapped(said - wanted) == pytest.approx(0.0, abs=1e-9)


def test_what_is_not_known_is_not_said() -> None:
    unknown = Estimate(2.5, 0.01, valid=False)
    assert whereabouts(None) == Whereabouts(UNSET, UNSET)
    assert whereabouts(replace(STATE, depth=unknown)).depth is UNSET
    assert whereabouts(replace(STATE, heading=unknown)).heading is UNSET


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
