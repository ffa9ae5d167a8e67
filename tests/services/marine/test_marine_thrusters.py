"""Thrusters push where they point, within their limits, after a moment."""

import msgspec
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from services.marine.thrusters import driven, lagged, limited, total_wrench, wrench_per_newton
from services.marine.vehicle import Thruster, Vec3

LATERAL = Thruster(
    name="lateral",
    position=(0.1, 0.0, -0.05),
    direction=(0.0, 1.0, 0.0),
    max_thrust=30.0,
    dead_band=0.8,
)
number = st.floats(-5, 5)
vector = st.tuples(number, number, number)
law = settings(max_examples=80, deadline=None)


@law
@given(vector, vector)
def test_a_newton_is_a_newton_whatever_the_length_of_the_direction(
    place: Vec3, pointing: Vec3
) -> None:
    assume(sum(abs(x) for x in pointing) > 0.1)
    thruster = msgspec.structs.replace(LATERAL, position=place, direction=pointing)
    force, moment = wrench_per_newton(thruster)[:3], wrench_per_newton(thruster)[3:]
    assert sum(f * f for f in force) == pytest.approx(1.0)
    assert sum(f * m for f, m in zip(force, moment, strict=True)) == pytest.approx(0, abs=1e-9)
    assert sum(p * m for p, m in zip(place, moment, strict=True)) == pytest.approx(0, abs=1e-9)


def test_a_force_to_starboard_ahead_of_and_above_the_origin_turns_clockwise_and_rolls() -> None:
    assert wrench_per_newton(LATERAL) == pytest.approx((0, 1, 0, 0.05, 0, 0.1))
    assert total_wrench([wrench_per_newton(LATERAL)] * 2, [3.0, 1.0]) == pytest.approx(
        (0, 4, 0, 0.2, 0, 0.4)
    )


def test_a_thruster_without_direction_is_refused() -> None:
    with pytest.raises(ValueError, match="lateral: direction"):
        wrench_per_newton(msgspec.structs.replace(LATERAL, direction=(0.0, 0.0, 0.0)))


@law
@given(st.floats(-1000, 1000))
def test_dead_band_gives_nothing_and_the_limit_holds(command: float) -> None:
    thrust = driven(LATERAL, command)
    if abs(command) < LATERAL.dead_band:
        assert thrust == 0.0
    else:
        assert thrust == limited(LATERAL, command)
        assert abs(thrust) == min(abs(command), LATERAL.max_thrust)
        assert thrust * command > 0


@law
@given(number, number, st.floats(0.01, 1), st.floats(0, 2), st.floats(0, 2))
def test_the_lag_does_not_care_how_time_is_cut(
    start: float, goal: float, tau: float, first: float, second: float
) -> None:
    halfway = lagged(start, goal, tau, first)
    assert lagged(halfway, goal, tau, second) == pytest.approx(
        lagged(start, goal, tau, first + second), abs=1e-9
    )
    assert abs(halfway - goal) <= abs(start - goal) + 1e-12


def test_after_one_time_constant_63_percent_is_there() -> None:
    assert lagged(0.0, 10.0, 0.08, 0.08) == pytest.approx(6.32, abs=0.01)
