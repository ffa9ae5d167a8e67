"""The laws of the reference model, for any request it accepts, and what it refuses."""

import re
from dataclasses import replace
from math import exp, inf, nan

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from lindy.api.references import MotionRequest, ReferenceModel, plan

many = settings(max_examples=100, deadline=None)
GOOD = MotionRequest(length=50.0, cruise=0.3, accel_time=20.0, decel_time=20.0)


def motions(at_rest: bool = False) -> st.SearchStrategy[ReferenceModel]:
    """Motions of all sizes: lengths from a fraction of the change of speed to far more than it."""

    def made(values: tuple[float, ...]) -> ReferenceModel:
        stretch, cruise, t_a, t_d, i, f, eps, theta_a, theta_d, ln0, xi_a, xi_d, sign = values
        length = stretch * cruise * (t_a + t_d)
        speeds = (0.0, 0.0) if at_rest else (sign * i * cruise, sign * f * cruise)
        tuning = (eps, theta_a, theta_d, exp(ln0), xi_a, xi_d)
        request = MotionRequest(length, sign * cruise, t_a, t_d, *speeds, *tuning)
        try:
            return plan(request)
        except ValueError as error:
            assume("too short" not in str(error))
            raise

    share = st.one_of(st.just(0.0), st.just(1.0), st.floats(0.0, 1.0))
    return st.tuples(
        st.floats(0.05, 20.0),
        st.floats(0.01, 5.0),
        st.floats(0.5, 60.0),
        st.floats(0.5, 60.0),
        share,
        share,
        st.floats(0.0, 0.1),
        st.floats(0.6, 0.95),
        st.floats(0.05, 0.4),
        st.floats(-13.0, -7.0),
        st.floats(10.0, 15.0),
        st.floats(10.0, 15.0),
        st.sampled_from([1.0, -1.0]),
    ).map(made)


def steps(m: ReferenceModel, k: int) -> tuple[float, float, float]:
    """Largest (p, v, a) steps allowed at t[k]: those that the module's head states."""
    up, settle_up, _, down, settle_down = m.phases
    match k:
        case 0 | 3:
            pull, rate = (up, m.a_m) if k == 0 else (down, m.d_m)
            v = abs(rate) * pull.tau * pull.left**2
            return v * pull.tau, v, abs(rate) * pull.left
        case 1 | 4:
            settle, rate = (settle_up, m.a_m) if k == 1 else (settle_down, m.d_m)
            return 0.0, abs(settle.gap) * settle.left, abs(rate) * settle.left
        case _:
            return 0.0, 0.0, 0.0


@many
@given(motions())
def test_the_length_is_reached_exactly(m: ReferenceModel) -> None:
    assert m.P[4] == pytest.approx(m.length, rel=1e-12)
    assert m.at(m.duration) == (m.length, m.v_f, 0.0, 0.0)
    assert m.at(m.duration + 10.0).position == pytest.approx(m.length + 10.0 * m.v_f)


@many
@given(motions())
def test_it_starts_at_zero_with_the_initial_speed_and_no_acceleration(m: ReferenceModel) -> None:
    assert m.at(0.0)[:3] == pytest.approx((0.0, m.v_i, 0.0), abs=1e-12)
    assert m.at(-2.0)[:3] == pytest.approx((-2.0 * m.v_i, m.v_i, 0.0))


@many
@given(motions())
def test_between_two_phases_are_only_the_stated_steps(m: ReferenceModel) -> None:
    # Phases of no duration (nothing to speed up) have no end of their own to look at.
    for k, phase in enumerate(m.phases):
        if phase.duration < 1e-6:
            continue
        begin, start = (m.t[k - 1], m.P[k - 1]) if k else (0.0, 0.0)
        before, after = phase.at(m.t[k] - begin), m.at(m.t[k])
        p, v, a = steps(m, k)
        size = abs(m.length)
        assert abs(start + before.position - after.position) <= p * 1.01 + 1e-12 * size
        assert abs(before.velocity - after.velocity) <= v * 1.01 + 1e-12 * abs(m.v_m)
        if k + 1 < len(m.phases) and m.phases[k + 1].duration == 0:
            continue  # from cruise to cruise
        assert abs(before.acceleration - after.acceleration) <= a * 1.01 + 1e-9 * abs(m.a_m)


@many
@given(motions(), st.floats(0.001, 0.999), st.floats(0.02, 0.98))
def test_velocity_acceleration_and_jerk_are_derivatives(
    m: ReferenceModel, share: float, where: float
) -> None:
    k = min(int(share * 5), 4)
    assume(m.phases[k].duration > 1e-3)
    t = (m.t[k - 1] if k else 0.0) + where * m.phases[k].duration
    h = 1e-4 * min(getattr(m.phases[k], "tau", 1.0), m.phases[k].duration)
    before, here, after = m.at(t - h), m.at(t), m.at(t + h)
    rate = max(abs(m.a_m), abs(m.d_m))
    for n, size in ((0, abs(m.v_m)), (1, rate), (2, rate / (h * 1e4))):
        slope = (after[n] - before[n]) / (2 * h)
        rounding = 1e-15 * (abs(m.length), abs(m.v_m), rate)[n] / h
        assert abs(slope - here[n + 1]) <= 1e-6 * size + 4 * rounding


@many
@given(motions(), st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_it_only_moves_forward_and_within_its_limits(
    m: ReferenceModel, one: float, other: float
) -> None:
    sign = 1.0 if m.length > 0 else -1.0
    first, last = m.at(min(one, other) * m.duration), m.at(max(one, other) * m.duration)
    assert sign * last.position >= sign * first.position - 1e-9 * abs(m.length)
    for here in (first, last):
        assert -1e-9 <= sign * here.velocity / abs(m.v_m) <= 1 + 1e-9
        assert -abs(m.d_m) * (1 + 1e-9) <= sign * here.acceleration <= abs(m.a_m) * (1 + 1e-9)


@many
@given(st.floats(30.0, 90.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(-0.1, 1.1))
def test_backwards_is_the_mirror_of_forwards(
    length: float, initial: float, final: float, share: float
) -> None:
    there = MotionRequest(length, 1.0, 7.0, 9.0, initial, final)
    away = MotionRequest(length, -1.0, 7.0, 9.0, -initial, -final)  # as in the paper
    one = plan(there)
    here = one.at(share * one.duration)
    for other in (away, replace(there, length=-length), replace(away, length=-length)):
        back = plan(other)
        assert back.t == one.t
        assert list(back.P) == [-value for value in one.P]
        assert (back.v_m, back.a_m, back.d_m) == (-one.v_m, -one.a_m, -one.d_m)
        assert back.at(share * back.duration) == tuple(-value for value in here)


@many
@given(st.floats(1.0, 200.0), st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(0.0, 1.0))
def test_a_motion_can_be_stretched_in_time_and_length(
    length: float, longer: float, slower: float, share: float
) -> None:
    one = plan(MotionRequest(length, 1.0, 6.0, 9.0, final=0.1))
    speed = longer / slower
    slow = plan(MotionRequest(longer * length, speed, 6 * slower, 9 * slower, final=0.1 * speed))
    here, there = one.at(share * one.duration), slow.at(share * one.duration * slower)
    assert there.position == pytest.approx(longer * here.position, rel=1e-9, abs=1e-9 * longer)
    # at the ends of phases the one may be just before and the other just after the stated step
    assert there.velocity == pytest.approx(speed * here.velocity, abs=2e-5 * speed)


@many
@given(motions())
def test_at_least_the_wanted_fraction_is_covered_at_cruise_speed(m: ReferenceModel) -> None:
    assert m.phases[2].length / m.length >= -1e-12
    if abs(m.v_m) == m.v_c:  # the length is the limit, else the wanted cruise velocity is
        assert abs(m.v_m) >= max(abs(m.v_i), abs(m.v_f))


@many
@given(st.floats(1.0, 50.0), st.floats(0.0, 0.1), st.floats(0.0, 0.03), st.floats(0.0, 0.03))
def test_a_length_that_limits_the_speed_leaves_exactly_the_least_fraction(
    length: float, epsilon: float, initial: float, final: float
) -> None:
    """The closed form of v_c against the paper's own condition, L2 = ε L."""
    speed = length**0.5  # never reached with these times
    m = plan(MotionRequest(length, speed, 20.0, 12.0, initial, final, epsilon))
    assert abs(m.v_m) == m.v_c < speed
    assert m.phases[2].length == pytest.approx(epsilon * length, abs=1e-12 * length)


@many
@given(st.floats(0.0, 0.9), st.floats(0.5, 20.0), st.floats(0.02, 0.9), st.booleans())
def test_the_quoted_least_length_is_the_boundary(
    slow: float, time: float, share: float, faster: bool
) -> None:
    speeds = (slow, 1.0) if faster else (1.0, slow)
    first = 0 if faster else 3
    phases = plan(MotionRequest(1e3 * time, 1.0, time, time, *speeds)).phases
    needed = (phases[first].length + phases[first + 1].length) / 0.95
    request = MotionRequest(share * needed, 1.0, time, time, *speeds)
    with pytest.raises(ValueError, match="too short") as caught:
        plan(request)
    length = float(re.findall(r"at least ([\d.e+-]+)", str(caught.value))[0])
    plan(replace(request, length=length))
    with pytest.raises(ValueError, match="too short"):
        plan(replace(request, length=length * (1 - 1e-4)))


BAD = [
    ({"length": 0.0}, "length is 0"),
    ({"length": inf}, "length is inf"),
    ({"length": 1e-300}, "length is 1e-300"),
    ({"cruise": 0.0}, "cruise is 0"),
    ({"cruise": nan}, "cruise is nan"),
    ({"cruise": 1e300}, r"cruise is 1e\+300"),
    ({"accel_time": 0.0}, "accel_time is 0"),
    ({"accel_time": -5.0}, "accel_time is -5"),
    ({"decel_time": nan}, "decel_time is nan"),
    ({"decel_time": inf}, "decel_time is inf"),
    ({"initial": -0.1}, "initial is -0.1, expected 0 to the cruise velocity 0.3"),
    ({"initial": 0.31}, "initial is 0.31"),
    ({"final": 0.4}, "final is 0.4"),
    ({"final": nan}, "final is nan"),
    ({"cruise": -0.3, "final": 0.1}, "final is 0.1, expected 0 to the cruise velocity -0.3"),
    ({"epsilon": -0.01}, "epsilon is -0.01"),
    ({"epsilon": 0.2}, "epsilon is 0.2"),
    ({"theta_a": 1.0}, "theta_a is 1, expected 0.6 to less than 1"),
    ({"theta_a": 0.5}, "theta_a is 0.5"),
    ({"theta_d": 0.0}, "theta_d is 0"),
    ({"theta_d": 0.41}, "theta_d is 0.41"),
    ({"theta_0": 0.0}, "theta_0 is 0"),
    ({"theta_0": 0.01}, "theta_0 is 0.01"),
    ({"xi_a": 9.0}, "xi_a is 9, expected 10 to 15"),
    ({"xi_d": nan}, "xi_d is nan"),
]


@pytest.mark.parametrize(("change", "says"), BAD)
def test_a_value_that_is_not_allowed_is_refused(change: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        plan(replace(GOOD, **change))
