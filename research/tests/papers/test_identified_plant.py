"""The thesis' simulations on the identified plant: exact physics, and the sums of its tables."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy.api.references import Direct
from lindy_research.bench.drag_runs import QuadraticWater
from lindy_research.papers.identified_inputs import (
    LOG_EVERY,
    LOG_FULL,
    STEP_ON,
    log_stick,
    step_stick,
    thesis_rule_reference,
)
from lindy_research.papers.identified_plant import (
    DRAG,
    DT,
    END_JERK,
    MASS,
    LinearWater,
    follow,
    law,
    ratios,
    rise_time,
    sums,
)
from lindy_research.papers.identified_runs import (
    NAIVE,
    best_share,
    equal_rise_jerk,
    expected_sums,
    improved,
    run,
)
from lindy_research.papers.thesis_tables import PRINTED

few = settings(max_examples=15, deadline=None)
many = settings(max_examples=100, deadline=None)
speed = st.floats(-2.0, 2.0)
force = st.floats(-50.0, 50.0)


@many
@given(speed, speed, force)
def test_a_step_of_the_water_loses_no_momentum(x: float, v: float, f: float) -> None:
    x_next, v_next = LinearWater().advance(x, v, f)
    assert MASS * (v_next - v) + DRAG * (x_next - x) == pytest.approx(f * DT, abs=1e-10)


@many
@given(st.floats(0.1, 2.0))
def test_quadratic_drag_holds_the_speed_that_balances_it(v: float) -> None:
    water = QuadraticWater()
    assert water.advance(0.0, v, water.plant.drag(v)) == pytest.approx((v * DT, v))


@pytest.mark.parametrize(
    ("jerk", "wanted"),
    [
        (NAIVE, (9.03, 2.0316061393886855, 6463.257858585239, 1638199.919876861)),
        (END_JERK, (5.068365609573754, 5.78751181e-05, 3529.6242233978255, 11647.671994306678)),
    ],
)
def test_without_disturbance_the_sums_are_those_of_an_independent_calculation(
    jerk: float, wanted: tuple[float, ...]
) -> None:
    assert sums(run(jerk, disturbed=False)) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    ("jerk", "wanted"),
    [
        (NAIVE, (8.828018930232954, 2.1830590347534233, 6453.809303010864, 1638383.3202919923)),
        (END_JERK, (4.878462666535101, 0.14300241253121235, 3706.637267187992, 11653.17513611307)),
    ],
)
def test_with_the_sines_too(jerk: float, wanted: tuple[float, ...]) -> None:
    assert sums(run(jerk)) == pytest.approx(wanted, rel=1e-4)


def test_the_ratios_of_table_6_1_are_those_that_are_printed() -> None:
    found = ratios(sums(run(NAIVE)), sums(run(END_JERK)))
    assert found == pytest.approx(ratios(*PRINTED["step"]), rel=0.03)


def test_at_equal_rise_time_only_error_and_jerk_are_lower() -> None:
    assert equal_rise_jerk() == pytest.approx(3.0284867500736032, abs=1e-6)
    rise = [rise_time(run(j, disturbed=False), STEP_ON) for j in (NAIVE, equal_rise_jerk())]
    assert rise == pytest.approx([0.6203310999321223] * 2, abs=1e-6)
    found = ratios(expected_sums(NAIVE, "step"), expected_sums(equal_rise_jerk(), "step"))
    assert found == pytest.approx((1.02, 15.5, 1.06, 19.1), rel=0.01)


@pytest.mark.parametrize(
    ("jerk", "rise", "peak"),
    [(0.5, 1.5237350239573586, 4.307127430024786), (3.0, 0.6232983511779737, 8.82552757546316)],
)
def test_a_higher_end_jerk_is_quicker_and_takes_more(jerk: float, rise: float, peak: float) -> None:
    each = run(jerk, disturbed=False)
    assert (rise_time(each, STEP_ON), sums(each).peak) == pytest.approx((rise, peak), rel=1e-6)


@few
@given(st.floats(0.0, 2.0))
def test_sums_are_parabolas_of_the_feed_forward_share(share: float) -> None:
    ends = [sums(run(share=k, disturbed=False)) for k in (0.0, 1.0, 2.0)]
    weights = ((1 - share) * (1 - share / 2), share * (2 - share), share * (share - 1) / 2)
    stick = step_stick()
    found = sums(follow(thesis_rule_reference(END_JERK), stick, by=law(share)))
    for of in ("position", "thrust", "jerk"):
        parabola = sum(w * getattr(end, of) for w, end in zip(weights, ends, strict=True))
        assert getattr(found, of) == pytest.approx(parabola, rel=1e-8, abs=1e-12)


def test_the_best_shares_of_feed_forward() -> None:
    assert best_share("thrust") == pytest.approx(0.7604144227, abs=1e-6)
    assert best_share("position") == pytest.approx(1.0024578688, abs=1e-6)
    others = [best_share("thrust", jerk) for jerk in (0.3, 0.5, 1.0, 2.0, 3.0)]
    assert others == pytest.approx([1.41, 1.01, 0.65, 0.43, 0.35], abs=0.006)


@few
@given(st.integers(0, 2**32))
def test_a_disturbance_moves_every_reference_alike(seed: int) -> None:
    stick = step_stick()
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, len(stick)).tolist()
    moved = [
        follow(make(), stick, noise).position - follow(make(), stick).position
        for make in (Direct, lambda: thesis_rule_reference(END_JERK))
    ]
    assert moved[0] == pytest.approx(moved[1], abs=1e-9)


def test_the_log_is_a_stick_and_gives_table_6_2() -> None:
    stick = log_stick()
    assert len(stick) == 2800
    for k, value in enumerate(stick):
        assert value == stick[k - k % LOG_EVERY]
        assert value / LOG_FULL * 64 == pytest.approx(round(value / LOG_FULL * 64), abs=1e-9)
    naive, jerky = expected_sums(NAIVE, "log"), expected_sums(END_JERK, "log")
    wanted = (6.91654513857, 5.022231737855508, 13890.850426905137, 2257731.6397371446)
    assert naive == pytest.approx(wanted, rel=1e-6)
    wanted = (4.4151870065540315, 0.4906382821887067, 7758.3406166815, 60682.83340829768)
    assert jerky == pytest.approx(wanted, rel=1e-6)
    for ours, printed in zip((naive, jerky), PRINTED["log"], strict=True):
        assert ours == pytest.approx(printed, rel=0.12)


@pytest.mark.parametrize("bandwidth", [1.0, 3.0, 10.0])
def test_an_observer_learns_a_constant_force(bandwidth: float) -> None:
    stick = [0.0] * 1000
    found = follow(Direct(), stick, [0.7] * 1000, by=law(observer=bandwidth, sampled=True))
    assert found.learnt[-1] == pytest.approx(-0.7, abs=1e-4)


def test_a_faster_observer_leaves_less_error() -> None:
    naive = sums(run(NAIVE)).position
    found = [naive / sums(improved(END_JERK, bandwidth)).position for bandwidth in (1.0, 3.0, 10.0)]
    assert found == pytest.approx([84.0, 452.0, 4132.0], rel=0.02)
