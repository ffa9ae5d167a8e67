"""Thrusters push where they point, within their limits, after a moment."""

import msgspec
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from services.marine.vehicle import Thruster, driven, limited, total_wrench, wrench_per_newton

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
    weak_astern = msgspec.structs.replace(LATERAL, max_reverse=12.0)
    thrust = driven(weak_astern, command)
    if abs(command) < LATERAL.dead_band:
        assert thrust == 0.0
    else:
        assert thrust == limited(weak_astern, command)
        assert abs(thrust) == min(abs(command), 30.0 if command > 0 else 12.0)
        assert thrust * command > 0


@law
@given(st.floats(-1000, 1000))
def test_without_a_limit_of_its_own_astern_is_as_strong_as_ahead(command: float) -> None:
    assert LATERAL.limits == (-30.0, 30.0)
    assert limited(LATERAL, -command) == -limited(LATERAL, command)
