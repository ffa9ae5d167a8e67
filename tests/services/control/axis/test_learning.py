"""What an axis learns of the water, when it must not, and what is left without an estimate."""

from collections import Counter
from math import exp, inf

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.message import Estimate
from messages.reference import Motion
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import DOUBTED, DisturbanceObserver, LastingValue, Plant

DT = 0.01
many = settings(max_examples=100, deadline=None)
forces = st.lists(st.floats(-20, 20), min_size=5, max_size=60)


@many
@given(st.floats(-3.0, 3.0), st.floats(0.0, 50.0), st.floats(0.0, 50.0))
def test_at_a_steady_speed_against_its_drag_alone_nothing_is_learnt(
    v: float, linear: float, quadratic: float
) -> None:
    plant = Plant(13.3, linear, quadratic)
    observer = DisturbanceObserver(plant, 3.0, 1e3)
    for _ in range(3):
        observer.learn(v, plant.drag(v), DT)
    assert observer.estimate == pytest.approx(0.0, abs=1e-9)


def test_in_motion_it_may_find_the_model_s_drag_wrong_but_at_rest_no_more_than_its_limit() -> None:
    """A vehicle with 60 % of its thrust takes 6.2 N m of commands for a turn that 3.7 drag."""
    plant = Plant(0.375, 0.87, 1.53)
    observer = DisturbanceObserver(plant, 5.0, 2.0, drag_speed=0.1, drag_doubt=1.0)
    for _ in range(300):
        observer.learn(1.05, 6.0, DT, reference=1.05)
    assert observer.expected(1.05) == pytest.approx(plant.drag(1.05) - 6.0, abs=0.01)
    assert abs(observer.expected(1.05)) > 2.0
    assert abs(observer.expected(0.0)) <= 2.0
    for _ in range(300):
        observer.learn(1.05, 60.0, DT, reference=1.05)
    assert abs(observer.expected(1.05)) <= 2.0 + plant.drag(1.05)


@many
@given(
    st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-8.0, 8.0)), min_size=2, max_size=50),
    st.floats(-5.0, 5.0).filter(bool),
    st.floats(-1.0, 1.0),
)
def test_what_is_short_is_never_asked_for_more_but_may_be_asked_for_less(
    steps: list[tuple[float, float]], short: float, reference: float
) -> None:
    """What is learnt is compensated by its opposite. What asks for less is learnt in full."""

    def observer() -> DisturbanceObserver:
        return DisturbanceObserver(Plant(0.375, 0.87, 1.53), 5.0, 2.0, drag_speed=0.1)

    one, free = observer(), observer()
    for velocity, force in steps:
        before = free.estimate, free.drag = one.estimate, one.drag
        free.learn(velocity, force, DT, reference=reference)
        one.learn(velocity, force, DT, reference=reference, short=short)
        asked = before[0] + before[1] * reference - (free.estimate + free.drag * reference)
        if asked * short > 0.0 and reference != 0.0:
            assert (one.estimate, one.drag) == before
        elif reference != 0.0:
            assert (one.estimate, one.drag) == (free.estimate, free.drag)


speed = st.floats(-1.0, 1.0)
drag_speeds = st.just(inf) | st.floats(0.02, 1.0)  # [m/s]


@many
@given(st.floats(0.1, 40.0), speed, drag_speeds, st.floats(-10, 10), forces)
def test_a_constant_disturbance_is_learnt_exactly_whatever_of_it_counts_as_drag(
    bandwidth: float, asked: float, drag_speed: float, w: float, pushes: list[float]
) -> None:
    plant = Plant(13.3, 5.0)
    observer, v = DisturbanceObserver(plant, bandwidth, 1e3, drag_speed), 0.0
    left = exp(-0.05 / 13.3)
    observer.learn(v, 0.0, DT)
    for k, force in enumerate(pushes, 1):
        v = left * v + (1 - left) / plant.linear * (force + w)
        observer.learn(v, force, DT, reference=asked)
        learnt = w * (1 - exp(-bandwidth * DT * k))
        assert observer.expected(asked) == pytest.approx(learnt, abs=1e-6)


@many
@given(st.floats(0.2, 1.0), st.booleans(), st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))
def test_drag_goes_with_the_motion_and_a_constant_stays(
    fast: float, down: bool, constant: float, drag: float
) -> None:
    """At rest, then at speed, as a plant without inertia shows it: what is believed in at rest is
    near the constant again as soon as the motion ends, not a second later."""
    observer = DisturbanceObserver(Plant(1e-6, 0.0), 4.0, 1e3, 0.1)
    asked = fast if down else -fast
    for k in range(1000):
        at = asked if k >= 500 else 0.0
        observer.learn(0.0, -(constant + drag * at), DT, reference=at)
    assert observer.expected(asked) == pytest.approx(constant + drag * asked, abs=1e-3)
    left = abs(observer.expected(0.0) - constant)
    assert left <= abs(drag * asked) * 0.1**2 / (0.1**2 + asked**2) + 1e-3
    for _ in range(1000):
        observer.learn(0.0, -constant, DT)
    assert observer.expected(asked) == pytest.approx(constant, abs=1e-2)  # forgotten by then


def test_a_collision_teaches_little_and_a_limit_reached_by_drag_shows() -> None:
    """Half a metre per second lost at once is a hundred times the limit's force."""
    observer = DisturbanceObserver(Plant(20.0), 3.0, 15.0)
    observer.learn(0.5, 0.0, DT)
    observer.learn(0.0, 0.0, DT)
    assert 0.0 < abs(observer.estimate) < 0.5
    assert not observer.is_limited(0.0)
    observer = DisturbanceObserver(Plant(20.0), 4.0, 15.0, 0.1)
    for _ in range(500):
        observer.learn(0.0, -100.0, DT, reference=0.5)
    assert observer.is_limited(0.5)
    assert not observer.is_limited(0.0)


@many
@given(st.floats(-5, 5), st.floats(-2, 2))
def test_a_pause_keeps_and_forgetting_forgets(velocity: float, later: float) -> None:
    observer = DisturbanceObserver(Plant(20.0, 0.4, 25.0), 3.0, 15.0)
    for k in range(50):
        observer.learn(0.01 * k, 0.0, DT)
    learnt = observer.estimate
    assert learnt != 0.0
    observer.pause()
    observer.learn(velocity, later, DT)  # nothing to compare this velocity with
    assert observer.estimate == learnt
    observer.forget()
    assert observer.estimate == 0.0


# An axis whose estimate is gone: what it learnt while the estimate was wrong goes too.


FADE = 0.3  # [s]
PLANT = Plant(inertia=20.0, linear=0.4, quadratic=25.0)
GAINS = Gains(kp=70.0, kd=65.0, ki=12.0, max_error=0.3, max_integral=15.0, observer=4.0)
REST = Motion(0.0, 0.0, 0.0, 0.0)
GONE = Estimate(0.0, 1.0, False)
few = settings(max_examples=8, deadline=None)
buoyancy = st.floats(-8.0, 8.0)


class Bath:
    """One axis of a vehicle on which a force acts, with a sensor that may lie."""

    def __init__(self, force: float, *, own: bool = True, observer: float = 4.0) -> None:
        gains = msgspec.structs.replace(GAINS, observer=observer)
        self.counts = Counter[str]()
        self.axis = Axis(
            gains, PLANT, period=DT, name="depth", fade=FADE, own=own,
            count=lambda event: self.counts.update([event.name]),
        )  # fmt: skip
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


@few
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


@few
@given(buoyancy, st.floats(-0.5, 0.5))
def test_where_rest_needs_no_force_a_blind_axis_applies_none(force: float, lie: float) -> None:
    bath = Bath(force, own=False)
    bath.run(5.0)
    bath.lie = lie
    bath.run(3.0)
    assert bath.run(1.0, position=False, rate=False)[-1] == pytest.approx(0.0, abs=1e-9)


@few
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
    bath.lie = bath.said = bath.x = 0.0
    assert abs(bath.run(DT)[0] - last) < most
    bath.run(20.0)
    bath.v = 2.0 * lie  # a known rate is damped without a position
    bath.run(3.0, position=False)
    assert bath.v == pytest.approx(0.0, abs=0.01)


def test_an_integral_falls_back_as_an_observer_does() -> None:
    bath = Bath(-3.0, observer=0.0)
    bath.run(40.0)
    bath.lie = 0.1
    bath.run(4.0)
    assert abs(bath.axis.standing - 3.0) > 0.3
    assert bath.run(1.0, position=False, rate=False)[-1] == pytest.approx(3.0, abs=0.2)


@few
@given(st.lists(st.floats(-5.0, 5.0), min_size=1, max_size=30), st.floats(-100.0, 100.0))
def test_what_is_trusted_does_not_depend_on_the_last_seconds(
    good: list[float], wrong: float
) -> None:
    lasting = LastingValue()
    for _ in range(10):  # never at rest for long: nothing is learnt, and nothing trusted
        for _ in range(90):
            lasting.add(7.0, DT)
        lasting.move()
    assert lasting.trusted == 0.0
    for value in [*good, *([0.0] * 2 * DOUBTED)]:
        for _ in range(100):
            lasting.add(value, DT)
    before = sorted([*good, *([0.0] * 2 * DOUBTED)])
    for _ in range(100 * (DOUBTED - 1)):
        lasting.add(wrong, DT)
    assert before[0] <= lasting.trusted <= before[-1]
