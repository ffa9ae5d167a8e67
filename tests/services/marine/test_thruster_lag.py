"""A lag settles at the command, is stable, does not jump, and does not care how time is cut."""

from math import exp

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.vehicle import Lag, LagMode, decay, first_order, modes_of

T200 = Lag(numerator=[6136.0, 108700.0], denominator=[1.0, 89.0, 9258.0, 108700.0])
law = settings(max_examples=80, deadline=None)
times = st.floats(0.0, 2.0)


def step_response(modes: list[LagMode], seconds: float) -> float:
    return 1.0 - sum((mode.share * decay(mode.pole, seconds)).real for mode in modes)


def test_the_identified_lag_begins_at_nothing_and_settles_at_the_command() -> None:
    modes = modes_of(T200)
    assert len(modes) == 2  # a real pole, and a pair
    assert all(mode.pole.real < 0 for mode in modes)
    assert step_response(modes, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert step_response(modes, 2.0) == pytest.approx(1.0, abs=1e-9)


def test_the_modes_solve_the_differential_equation() -> None:
    """Against the state space form of the transfer function, by its own matrix exponential."""
    (b1, b0), (_, a2, a1, a0) = T200.numerator, T200.denominator
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-a0, -a1, -a2]])
    values, vectors = np.linalg.eig(A)
    steady = np.linalg.solve(A, [0.0, 0.0, -1.0])
    for seconds in (0.001, 0.01, 0.03, 0.1, 0.3):
        grown = vectors @ np.diag(np.exp(values * seconds)) @ np.linalg.inv(vectors)
        x = steady - (grown @ steady).real
        expected = b0 * x[0] + b1 * x[1]
        assert step_response(modes_of(T200), seconds) == pytest.approx(expected, abs=1e-9)


@law
@given(st.floats(0.01, 1.0), times)
def test_first_order_is_the_case_of_one_pole(tau: float, seconds: float) -> None:
    general = modes_of(Lag(numerator=[1.0], denominator=[tau, 1.0]))
    expected = 1.0 - exp(-seconds / tau)
    assert step_response(first_order(tau), seconds) == pytest.approx(expected, abs=1e-12)
    assert step_response(general, seconds) == pytest.approx(expected, abs=1e-9)


@law
@given(times, times)
def test_decay_does_not_care_how_time_is_cut(first: float, second: float) -> None:
    for mode in modes_of(T200):
        parts = decay(mode.pole, first) * decay(mode.pole, second)
        assert abs(parts - decay(mode.pole, first + second)) < 1e-12


@pytest.mark.parametrize(
    ("numerator", "denominator", "words"),
    [
        ([1.0], [1.0, -1.0], "settle at the command"),
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
