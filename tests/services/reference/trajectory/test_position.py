"""Going to a position: exact arrival from any state, inside all limits."""

from itertools import pairwise
from math import inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.reference.trajectory.minimum_jerk import Limits, pair

many = settings(max_examples=200, deadline=None)
limits = st.builds(Limits, st.floats(0.2, 10.0), st.one_of(st.just(inf), st.floats(0.1, 3.0)))
speed = st.floats(0.05, 2.0)


@many
@given(st.floats(-20, 20), limits, speed, st.floats(-1, 1), st.floats(-1, 1), st.floats(0.05, 0.95))
def test_it_arrives_exactly_within_limits_and_again_when_asked_on_the_way(
    distance: float, lim: Limits, v_max: float, v: float, a: float, share: float
) -> None:
    v *= v_max
    a *= min(lim.acceleration, 1.0)
    plan = pair(distance, lim, v_max, v, a)
    end = plan.at(plan.duration)
    assert end.position == pytest.approx(distance, abs=1e-7 * (1 + abs(distance)))
    assert end.velocity == pytest.approx(0.0, abs=1e-9)
    assert end.acceleration == pytest.approx(0.0, abs=1e-6)
    for before, after in pairwise(plan.segments):
        joint = before.at(before.duration)
        assert after.v0 == pytest.approx(joint.velocity, abs=1e-9)
        assert after.a0 == pytest.approx(joint.acceleration, abs=1e-6)
    mirrored = pair(-distance, lim, v_max, -v, -a)
    assert mirrored.duration == pytest.approx(plan.duration)
    overshoot = a * a / (2 * lim.jerk)
    for k in range(101):
        here = plan.at(plan.duration * k / 100)
        assert abs(here.jerk) <= lim.jerk * (1 + 1e-9)
        assert abs(here.acceleration) <= max(lim.acceleration, abs(a)) * (1 + 1e-9)
        assert abs(here.velocity) <= max(v_max, abs(v) + overshoot) * (1 + 1e-9)
    here = plan.at(plan.duration * share)
    rest = pair(distance - here.position, lim, v_max, here.velocity, here.acceleration)
    assert rest.duration <= plan.duration * (1 - share) + 1e-3


# d, J, v_max, a_max → duration and peak of a motion from rest to rest; the first is 2 · 6^(1/3).
GOLDEN = [
    (1.0, 1.0, 1000.0, inf, 3.6342411856642793, 0.5503212081491045),
    (-1.0, 1.0, 0.3, inf, 4.674974119833207, -0.3),
    # With Fernandes' own peak acceleration and jerk (xi = 10); his run takes 228.89 s.
    (50.0, 0.0084375, 0.3, 0.015, 189.037037037, 0.3),
]


@pytest.mark.parametrize(("d", "jerk", "v_max", "a_max", "total", "peak"), GOLDEN)
def test_known_motions(
    d: float, jerk: float, v_max: float, a_max: float, total: float, peak: float
) -> None:
    plan = pair(d, Limits(jerk, a_max), v_max)
    assert plan.duration == pytest.approx(total, rel=1e-11)
    assert plan.peak == pytest.approx(peak, rel=1e-9)


def test_a_speed_limit_of_zero_is_refused() -> None:
    with pytest.raises(ValueError, match=r"v_max: found 0.0, must be more than 0"):
        pair(1.0, Limits(1.0), 0.0)
