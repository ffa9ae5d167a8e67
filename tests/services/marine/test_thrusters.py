"""Thrusters: geometry, limits, curve and lag."""

from itertools import pairwise
from math import exp
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from messages.units import Vec3
from services.marine.vehicle import (
    CURVES,
    Lag,
    LagMode,
    Thruster,
    decay,
    driven,
    first_order,
    limited,
    modes_of,
    total_wrench,
    wrench_per_newton,
)

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


T200 = CURVES["t200"]


def thruster(**changes: Any) -> Thruster:
    fields: dict[str, Any] = {
        "position": (0.0, 0.0, 0.0), "direction": (1.0, 0.0, 0.0), "max_thrust": 30.4,
        "dead_band": 0.87, "curve": "t200",
    }  # fmt: skip
    return Thruster(name="port", **(fields | changes))


@law
@given(st.floats(-1.0, 1.0))
def test_the_driver_gives_the_thrust_that_it_is_asked_for_by_one_voltage(part: float) -> None:
    newtons, share = part * T200.most, part * T200.top
    assert T200.thrust(T200.share(newtons)) == pytest.approx(newtons, abs=1e-9)
    assert T200.share(-newtons) == -T200.share(newtons) or newtons == 0.0
    assert T200.share(T200.thrust(share)) == pytest.approx(share, abs=1e-6)


def test_the_curve_is_that_of_the_paper_and_rises_to_its_top() -> None:
    assert T200.thrust(1.0) == pytest.approx(30.4)
    assert T200.share(1000.0) == T200.top
    values = [T200.thrust(k / 1000) for k in range(int(1000 * T200.top))]
    assert all(a < b for a, b in pairwise(values))
    assert T200.most > T200.thrust(1.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"curve": "t500"}, "unknown curve 't500'; there are linear, t200"),
        ({"max_thrust": 40.0}, "t200 gives at most 30.62 N, found 40"),
        ({"max_reverse": 31.0}, "t200 gives at most 30.62 N, found 31"),
        ({"dead_band": 0.1}, "t200 gives nothing below 0.863 N, found a dead_band of 0.1 N"),
        ({"dead_band": 30.4}, "dead_band must be less than its limits, found 30.4 N"),
        ({"direction": (0.0, 0.0, 0.0)}, "port: direction"),
    ],
)
def test_what_no_thruster_can_do_is_refused(change: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        thruster(**change)


T200_LAG = Lag(numerator=[6136.0, 108700.0], denominator=[1.0, 89.0, 9258.0, 108700.0])
times = st.floats(0.0, 2.0)


def step_response(modes: list[LagMode], seconds: float) -> float:
    return 1.0 - sum((mode.share * decay(mode.pole, seconds)).real for mode in modes)


def test_the_modes_solve_the_differential_equation() -> None:
    """Against the state space form of the transfer function, by its own matrix exponential."""
    (b1, b0), (_, a2, a1, a0) = T200_LAG.numerator, T200_LAG.denominator
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-a0, -a1, -a2]])
    assert len(modes_of(T200_LAG)) == 2  # a real pole, and a pair
    values, vectors = np.linalg.eig(A)
    steady = np.linalg.solve(A, [0.0, 0.0, -1.0])
    for seconds in (0.0, 0.001, 0.01, 0.1, 2.0):
        grown = vectors @ np.diag(np.exp(values * seconds)) @ np.linalg.inv(vectors)
        x = steady - (grown @ steady).real
        expected = b0 * x[0] + b1 * x[1]
        assert step_response(modes_of(T200_LAG), seconds) == pytest.approx(expected, abs=1e-9)


@law
@given(st.floats(0.01, 1.0), times)
def test_first_order_is_the_case_of_one_pole(tau: float, seconds: float) -> None:
    general = modes_of(Lag(numerator=[1.0], denominator=[tau, 1.0]))
    expected = 1.0 - exp(-seconds / tau)
    assert step_response(first_order(tau), seconds) == pytest.approx(expected, abs=1e-12)
    assert step_response(general, seconds) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("numerator", "denominator", "words"),
    [
        ([2.0], [1.0, 1.0], "found 2 and 1"),
        ([1.0, 1.0], [1.0, 1.0], "longer than"),
        ([1.0], [0.0, 1.0, 1.0], "not 0"),
        ([-1.0], [1.0, -1.0], "not stable"),
        ([1.0], [1.0, 2.0, 1.0], "two poles are the same"),
    ],
)
def test_what_is_no_lag_is_refused(
    numerator: list[float], denominator: list[float], words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        Lag(numerator=numerator, denominator=denominator)
