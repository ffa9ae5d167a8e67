"""A driver that inverts the curve gives what it is asked for, as far as the motor can."""

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.thrust_curve import CURVES
from services.marine.vehicle import Thruster

T200 = CURVES["t200"]
law = settings(max_examples=100, deadline=None)


def thruster(**changes: Any) -> Thruster:
    fields: dict[str, Any] = {"max_thrust": 30.4, "dead_band": 0.87, "curve": "t200"} | changes
    return Thruster(name="port", position=(0.0, 0.0, 0.0), direction=(1.0, 0.0, 0.0), **fields)


@law
@given(st.floats(-1.0, 1.0))
def test_asking_for_what_a_voltage_gives_asks_for_that_voltage(part: float) -> None:
    share = part * T200.top
    assert T200.share(T200.thrust(share)) == pytest.approx(share, abs=1e-6)


@law
@given(st.floats(-1.0, 1.0))
def test_the_driver_gives_the_thrust_that_it_is_asked_for(part: float) -> None:
    newtons = part * T200.most
    assert T200.thrust(T200.share(newtons)) == pytest.approx(newtons, abs=1e-9)
    assert T200.share(-newtons) == -T200.share(newtons) or newtons == 0.0


def test_the_curve_is_that_of_the_paper_and_rises_to_its_top() -> None:
    assert T200.thrust(1.0) == pytest.approx(30.4)
    assert T200.share(1000.0) == T200.top
    values = [T200.thrust(k / 1000) for k in range(int(1000 * T200.top))]
    assert all(a < b for a, b in pairwise(values))
    assert T200.most > T200.thrust(1.0)


def test_an_unknown_curve_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ValueError, match="unknown curve 't500'; there are linear, t200"):
        thruster(curve="t500")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"max_thrust": 40.0}, "t200 gives at most 30.62 N, found 40"),
        ({"max_reverse": 31.0}, "t200 gives at most 30.62 N, found 31"),
        ({"dead_band": 0.1}, "t200 gives nothing below 0.863 N, found a dead_band of 0.1 N"),
        ({"dead_band": 30.4}, "dead_band must be less than its limits, found 30.4 N"),
    ],
)
def test_what_the_curve_cannot_do_is_refused(change: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        thruster(**change)
