"""An axis whose estimate is gone: what it learnt while the estimate was wrong goes too."""

from collections import Counter

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.reference import Motion
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import DOUBTED, LastingValue, Plant

DT = 0.01  # [s]
FADE = 0.3  # [s]
PLANT = Plant(inertia=20.0, linear=0.4, quadratic=25.0)
GAINS = Gains(kp=70.0, kd=65.0, ki=12.0, max_error=0.3, max_integral=15.0, observer=4.0)
REST = Motion(0.0, 0.0, 0.0, 0.0)
GONE = Estimate(0.0, 1.0, False)
many = settings(max_examples=8, deadline=None)
buoyancy = st.floats(-8.0, 8.0)


class Bath:
    """One axis of a vehicle on which a force acts, with a sensor that may lie."""

    def __init__(self, force: float, *, own: bool = True, observer: float = 4.0) -> None:
        gains = msgspec.structs.replace(GAINS, observer=observer)
        self.counts: Counter[str] = Counter()
        self.axis = Axis(
            gains,
            PLANT,
            period=DT,
            name="depth",
            count=lambda event: self.counts.update([event.name]),
            fade=FADE,
            own=own,
        )
        self.force, self.x, self.v, self.u = force, 0.0, 0.0, 0.0
        self.lie = 0.0  # [m/s] error of the measured rate
        self.said = 0.0  # [m] its sum

    def run(self, seconds: float, *, position: bool = True, rate: bool = True) -> list[float]:
        efforts: list[float] = []
        for _ in range(round(seconds / DT)):
            self.said += self.lie * DT
            here = Estimate(self.x + self.said, 0.01, True) if position else GONE
            speed = Estimate(self.v + self.lie, 0.01, True) if rate else GONE
            self.axis.learn(speed.value if speed.valid else None, self.u, DT)
            self.u = self.axis.held(REST, here, speed, DT)
            efforts.append(self.u)
            self.v += (self.u + self.force - PLANT.drag(self.v)) / PLANT.inertia * DT
            self.x += self.v * DT
        return efforts


@many
@given(buoyancy, st.floats(-0.5, 0.5), st.floats(1.0, 8.0))
def test_a_blind_axis_applies_what_it_learnt_before_the_fault(
    force: float, lie: float, unnoticed: float
) -> None:
    bath = Bath(force)
    bath.run(30.0)
    bath.lie = lie
    bath.run(unnoticed)
    assert bath.run(1.0, position=False, rate=False)[-1] == pytest.approx(-force, abs=0.1)
    assert bath.counts["invalid:state.depth"] > 0


@many
@given(buoyancy, st.floats(-0.5, 0.5))
def test_where_rest_needs_no_force_a_blind_axis_applies_none(force: float, lie: float) -> None:
    bath = Bath(force, own=False)
    bath.run(5.0)
    bath.lie = lie
    bath.run(3.0)
    assert bath.run(1.0, position=False, rate=False)[-1] == pytest.approx(0.0, abs=1e-9)


@many
@given(buoyancy, st.floats(-0.5, 0.5), st.booleans())
def test_the_force_is_continuous_when_the_estimate_goes_and_comes_back(
    force: float, lie: float, rate: bool
) -> None:
    bath = Bath(force)
    bath.run(10.0)
    bath.lie = lie
    before = bath.run(3.0)[-1]
    first = bath.run(0.02, position=False, rate=rate)
    most = 40.0 * DT / FADE + 65.0 * 0.1  # fade, and damping of what changes in a step
    assert abs(first[0] - before) < most
    last = bath.run(5.0, position=False, rate=rate)[-1]
    bath.lie = bath.said = 0.0
    bath.x = 0.0
    assert abs(bath.run(DT)[0] - last) < most


@many
@given(st.floats(-1.0, 1.0), buoyancy)
def test_a_known_rate_is_damped_without_a_position(v: float, force: float) -> None:
    bath = Bath(force)
    bath.run(20.0)
    bath.v = v
    bath.run(3.0, position=False)
    assert bath.v == pytest.approx(0.0, abs=0.01)


def test_an_integral_falls_back_as_an_observer_does() -> None:
    bath = Bath(-3.0, observer=0.0)
    bath.run(40.0)
    bath.lie = 0.1
    bath.run(4.0)
    assert abs(bath.axis.integral - 3.0) > 0.3
    assert bath.run(1.0, position=False, rate=False)[-1] == pytest.approx(3.0, abs=0.2)


@many
@given(st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=30), st.floats(-100.0, 100.0))
def test_what_is_trusted_does_not_depend_on_the_last_seconds(
    good: list[float], wrong: float
) -> None:
    lasting = LastingValue()
    for value in [*good, *([0.0] * 2 * DOUBTED)]:
        for _ in range(100):
            lasting.add(value, DT)
    before = sorted([*good, *([0.0] * 2 * DOUBTED)])
    for _ in range(100 * (DOUBTED - 1)):
        lasting.add(wrong, DT)
    assert before[0] <= lasting.trusted <= before[-1]


def test_nothing_learnt_is_nothing_trusted() -> None:
    lasting = LastingValue()
    assert lasting.trusted == 0.0
    for _ in range(10):  # never at rest for long
        for _ in range(90):
            lasting.add(7.0, DT)
        lasting.move()
    assert lasting.trusted == 0.0
