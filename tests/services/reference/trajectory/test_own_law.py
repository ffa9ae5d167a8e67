"""A reference law of the user's: what is flown of it, and what is refused."""

from collections.abc import Callable
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from examples.library.own_law import low_pass
from messages import events
from messages.events import Outbox
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample
from services.reference.trajectory.own_law import AxisPlan, Law, LawRamp

LIMITS, STOP, FULL = Limits(1.5, 0.5), Limits(4.0, 1.0), 0.5
STICKS = st.lists(
    st.tuples(st.floats(0.02, 3.0), st.floats(-1.0, 1.0)), min_size=1, max_size=12
)  # [s] since the one before, [-]


def ramp_of(law: Law) -> tuple[LawRamp, Outbox]:
    outbox = Outbox()
    return LawRamp(LIMITS, axis="heave", law=law, full=FULL, most=STOP, outbox=outbox), outbox


def ours(_: str, here: Sample, velocity: float) -> AxisPlan:
    """Lindy's own law, as somebody else might write it."""
    ramp = Ramp(LIMITS)
    ramp.take(here, 0.0)
    ramp.aim(velocity, 0.0)
    return AxisPlan(ramp.settles(), ramp.at)


@given(sticks=STICKS)
def test_the_law_of_lindy_from_outside_is_the_law_of_lindy(sticks: list[tuple[float, float]]):
    (own, outbox), ramp, t = ramp_of(ours), Ramp(LIMITS), 0.0
    for after, stick in sticks:
        for each in (own, ramp):
            each.aim(stick * FULL, t)
        assert own.settles() == pytest.approx(ramp.settles())
        t += after
        assert own.at(t) == pytest.approx(ramp.at(t), abs=1e-9)
    assert not outbox.said


@given(sticks=STICKS)
def test_a_reference_of_another_law_is_continuous_and_comes_to_rest(
    sticks: list[tuple[float, float]],
):
    (ramp, outbox), t = ramp_of(low_pass), 0.0
    for after, stick in (*sticks, (20.0, 0.0)):
        before = ramp.at(t)
        ramp.aim(stick * FULL, t)
        assert ramp.at(t)[:3] == pytest.approx(before[:3], abs=1e-6)
        t += after
    assert not outbox.said
    assert ramp.at(t)[1:] == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    ramp.brake(t)  # a stop of Lindy's goes on from there
    assert ramp.at(t + 5.0).velocity == 0.0


def bent(change: Callable[[float, Sample], Sample], duration: float = 5.0) -> Law:
    def law(axis: str, here: Sample, velocity: float) -> AxisPlan:
        whole = low_pass(axis, here, velocity)

        def at(t: float) -> Sample:
            return change(t, whole.at(t))

        return AxisPlan(duration, at)

    return law


def fails(axis: str, _: Sample, __: float) -> AxisPlan:
    raise KeyError(axis)


@pytest.mark.parametrize(
    ("law", "why"),
    [
        (bent(lambda t, at: at._replace(velocity=nan if t > 1.0 else at.velocity)), "not finite"),
        (bent(lambda t, at: at._replace(position=at.position + (t > 1.0))), "integral of its"),
        (bent(lambda t, at: at._replace(velocity=at.velocity + (t > 1.0))), "velocity is up to"),
        (bent(lambda _, at: at._replace(acceleration=3.0)), "acceleration is up to"),
        (bent(lambda _, at: at._replace(velocity=at.velocity + 0.004)), "it begins with"),
        (bent(lambda _, at: at, 0.5), "it ends with"),
        (bent(lambda _, at: at, inf), "it lasts inf s"),
        (fails, "KeyError"),
    ],
)
def test_a_plan_that_cannot_be_flown_is_refused_and_lindys_own_flies(law: Law, why: str):
    (ramp, outbox), lindys = ramp_of(law), Ramp(LIMITS)
    for each in (ramp, lindys):
        each.aim(FULL, 0.0)
    assert outbox.counts[events.LAW_REFUSED("heave").name] == 1
    assert why in outbox.said[0][1]
    for t in (0.0, 0.5, 3.0):
        assert ramp.at(t) == lindys.at(t)
