"""The law of one axis, with each windup guard alone."""

import math
from collections import Counter

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.reference import Motion
from services.control.axis.axis import DECAY, Axis, Gains, StaticGains
from services.control.axis.plant import Plant

GAINS = Gains(kp=50.0, kd=40.0, ki=10.0, max_error=0.3, max_integral=8.0)
PLANT = Plant(inertia=20.0, linear=0.4, quadratic=25.0)
DT = 0.01


def hold(position: float) -> Motion:
    return Motion(position, 0.0, 0.0, 0.0)


def law(**more: float) -> Axis:
    return Axis(msgspec.structs.replace(GAINS, **more), PLANT)


@given(st.floats(-1, 1), st.floats(-2, 2))
def test_on_a_steady_reference_only_the_drag_is_asked_for(x: float, v: float) -> None:
    effort = law().step(Motion(x, v, 0.0, 0.0), x, v, DT)
    assert effort == pytest.approx(PLANT.linear * v + PLANT.quadratic * v * abs(v))


@given(st.floats(-1, 1), st.floats(-2, 2), st.floats(-5, 5), st.floats(0.0, 50.0))
def test_the_feed_forward_carries_a_sampled_plant_exactly(
    v: float, a: float, j: float, damping: float
) -> None:
    plant = Plant(inertia=20.0, linear=damping)
    force = Axis(GAINS, plant, period=DT).feed_forward(Motion(0.0, v, a, j))
    left = math.exp(-damping * DT / 20.0)
    gain = -math.expm1(-damping * DT / 20.0) / damping if damping > 1e-9 else DT / 20.0
    assert left * v + gain * force == pytest.approx(v + a * DT + j * DT * DT / 2, abs=1e-9)


def test_the_feed_forward_runs_ahead_of_lagging_thrusters() -> None:
    """A lagging thruster follows a changing reference with a tenth of the error."""
    errors: dict[float, float] = {}
    for percent in (0.0, 100.0):
        gains = msgspec.structs.replace(GAINS, kp=0.0, kd=0.0, lead_percent=percent)
        axis, v, f, dt = Axis(gains, PLANT, lag=0.08, period=1e-3), 0.0, 0.0, 1e-3
        for k in range(1000):
            t = k * dt
            command = axis.feed_forward(Motion(0.0, t**2 / 2, t, 1.0))
            f += (command - f) * dt / 0.08
            v += (f - PLANT.drag(v)) / PLANT.inertia * dt
        errors[percent] = abs(v - 0.5)
    assert errors[100.0] < 0.1 * errors[0.0]


@given(st.floats(-0.5, 0.5), st.floats(-1, 1))
def test_the_integral_pauses_during_requested_motion(velocity: float, error: float) -> None:
    axis = law()
    axis.take_over(0.5 if error >= 0 else -0.5)
    before = axis.standing
    moving = Motion(error, velocity or 0.1, 0.1, 0.0)
    axis.step(moving, 0.0, 0.0, DT)
    assert axis.standing == before


def test_guards_1_and_2_clamp_the_position_error_and_the_integral() -> None:
    told = Counter[str]()
    axis = Axis(GAINS, PLANT, name="x", count=lambda event: told.update([event.name]))
    assert axis.step(hold(0.3), 0.0, 0.0, 0.0) == 50.0 * 0.3
    assert not told
    assert axis.step(hold(9.0), 0.0, 0.0, 0.0) == 50.0 * 0.3
    assert told == {"clamped:control.x": 1}
    told.clear()
    for _ in range(2000):
        axis.step(hold(0.09), 0.0, 0.0, DT)
    assert axis.standing == 8.0
    assert told["clamped:control.x"]


def test_guard_3_lets_a_contrary_integral_decay() -> None:
    axis = law()
    axis.take_over(5.0)
    axis.step(hold(-0.2), 0.0, 0.0, DT)
    assert axis.standing == pytest.approx(5.0 * DECAY)
    axis.take_over(5.0 - axis.standing)
    axis.step(hold(-0.05), 0.0, 0.0, DT)  # below the threshold the law stays linear
    assert axis.standing == pytest.approx(5.0 - 10.0 * 0.05 * DT)


def test_two_laws_learn_the_same_but_the_observer_sooner() -> None:
    """A force of 5 N begins to act on both: the observer lets the vehicle off a third as far."""
    worst: dict[float, float] = {}
    for observer in (0.0, 3.0):
        axis, x, v, u = law(observer=observer, max_integral=20.0), 0.0, 0.0, 0.0
        worst[observer] = 0.0
        for k in range(4000):
            if k:
                axis.learn(v, u, DT)
            u = axis.step(hold(0.0), x, v, DT)
            v += (u + 5.0 - PLANT.drag(v)) / PLANT.inertia * DT
            x += v * DT
            worst[observer] = max(worst[observer], abs(x))
        assert axis.standing == pytest.approx(-5.0, abs=0.02)
        assert x == pytest.approx(0.0, abs=1e-3)
    assert worst[3.0] < worst[0.0] / 3


def on_the_floor(**more: float) -> Axis:
    """Pushed for five seconds against something that does not yield, then released."""
    axis, u = law(observer=3.0, max_integral=15.0, **more), 0.0
    for k in range(1000):
        reference = Motion(0.2, 0.4, 0.0, 0.0) if k < 500 else hold(0.2 * 0.98 ** (k - 500))
        if k:
            axis.learn(0.0, u, DT)
        u = axis.step(reference, 0.0, 0.0, DT)
    return axis


def test_an_observer_does_not_wind_up_against_the_sea_floor() -> None:
    assert on_the_floor().standing > 5.0
    assert on_the_floor(still=0.03, ki=6.0).standing < 1.0


@given(st.floats(0.05, 2.0) | st.floats(-2.0, -0.05), st.floats(0.0, 1.0), st.floats(2.0, 10.0))
def test_only_a_vehicle_that_follows_what_is_asked_of_it_teaches_in_motion(
    asked: float, share: float, force: float
) -> None:
    """One that is held back, at less than a tenth of the speed, may lie on something. One at a
    third of it moves freely: what it needs more force for is the water's."""
    axis, speed = law(observer=3.0), share * asked
    for _ in range(2):
        axis.step(Motion(0.0, asked, 0.0, 0.0), 0.0, speed, DT)
        axis.learn(speed, force + PLANT.drag(speed), DT)
    if share < 0.1:
        assert axis.standing == 0.0
    if share > 1 / 3:
        assert axis.standing > 0.0


@pytest.mark.parametrize("observer", [0.0, 3.0])
@given(error=st.floats(-0.09, 0.09), force=st.floats(-20.0, 20.0), zone=st.floats(0.0, 0.05))
def test_at_rest_nothing_is_learnt_faster_than_the_error_outside_the_static_zone_says(
    observer: float, error: float, force: float, zone: float
) -> None:
    static = StaticGains(kp=50.0, kd=40.0, zone=zone, leave=0.1)
    gains = msgspec.structs.replace(GAINS, observer=observer, still=0.03, static=static)
    axis = Axis(gains, PLANT)
    axis.learn(0.0, 0.0, DT)
    axis.step(hold(error), 0.0, 0.0, DT)
    axis.learn(0.0, force, DT)
    wanted = GAINS.ki * outside(error, zone) * DT
    if observer == 0.0:
        assert axis.standing == pytest.approx(wanted, abs=1e-12)
    else:
        assert abs(axis.standing) <= abs(wanted) + 1e-12
    if observer > 0.0 and abs(force) > 10.0:  # more than enough to learn from
        assert abs(axis.standing) == pytest.approx(abs(wanted), abs=1e-12)


def outside(error: float, zone: float) -> float:
    return math.copysign(max(0.0, abs(error) - zone), error)


learnt = st.floats(-8.0, 8.0)
either = pytest.mark.parametrize("observer", [0.0, 3.0])


def that_learnt(force: float, observer: float) -> Axis:
    axis = law(observer=observer)
    axis.take_over(force)
    assert axis.standing == pytest.approx(force)
    return axis


@either
@given(learnt, st.floats(-20.0, 20.0))
def test_what_the_feed_forward_gives_more_or_less_is_learnt_less_or_more(
    observer: float, before: float, force: float
) -> None:
    """Less no further than it was learnt, more up to the limit."""
    axis = that_learnt(before, observer)
    axis.give_up(force)
    same_way = before * force > 0.0
    gone = math.copysign(min(abs(before), abs(force)), before) if same_way else 0.0
    assert axis.standing == pytest.approx(before - gone, abs=1e-12)
    axis = that_learnt(before, observer)
    axis.take_over(force)
    assert axis.standing == pytest.approx(max(-8.0, min(8.0, before + force)))


@either
@given(learnt, st.floats(-1, 1), st.floats(-2, 2), st.floats(-2, 2), st.floats(-5, 5))
def test_without_an_error_the_feedback_adds_nothing_to_what_a_blind_axis_does(
    observer: float, force: float, x: float, v: float, a: float, j: float
) -> None:
    axis, motion = that_learnt(force, observer), Motion(x, v, a, j)
    axis._blind = True  # type: ignore[reportPrivateUsage]
    assert axis.blind(motion, DT) == pytest.approx(axis.step(motion, x, v, DT))
    assert axis.blind(hold(x), DT) == pytest.approx(force)


@given(st.floats(0.001, 0.3), st.floats(0.01, 2.0))
def test_gains_for_a_late_rate_are_weaker_and_damp_no_less(error: float, rate: float) -> None:
    """The damping ratio is that of a mass on spring and damper, kd / (2 √(kp m))."""

    def effort(error: float, rate: float, *, late: bool) -> float:
        return law(ki=0.0).step(hold(error), 0.0, rate, DT, late=late)

    spring = effort(error, 0.0, late=True) / effort(error, 0.0, late=False)
    damper = effort(0.0, rate, late=True) / effort(0.0, rate, late=False)
    assert 0.0 < spring < 1.0
    assert 0.0 < damper < 1.0
    assert damper >= math.sqrt(spring)


@pytest.mark.parametrize("speed", [5e-324, 9e-4])
def test_a_drag_speed_too_small_to_divide_by_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match=r"drag_speed is .*, allowed are 0 and 0.001 or more"):
        msgspec.structs.replace(GAINS, drag_speed=speed)


@given(lead=st.floats(0.0, 200.0), speed=st.floats(-1.0, 1.0), brake=st.floats(-2.0, 2.0))
def test_learnt_drag_is_that_of_the_speed_when_the_thrust_follows(
    lead: float, speed: float, brake: float
) -> None:
    gains = msgspec.structs.replace(GAINS, observer=3.0, drag_speed=0.1, drag_lead_percent=lead)
    axis = Axis(gains, PLANT, lag=0.08)
    axis._observer.drag = -4.0  # type: ignore[reportPrivateUsage]  # [N s/m] more than the plant's
    axis.step(Motion(0.0, speed, brake, 0.0), 0.0, speed, DT)
    assert axis.standing == pytest.approx(4.0 * (speed + lead / 100 * 0.08 * brake))
    axis.forced(0.0, DT)
    assert axis.standing == 0.0
