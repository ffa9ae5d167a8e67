"""What is learnt of an axis in flight: the truth, from moves of a calm vehicle, and no more."""

from itertools import pairwise
from math import sin

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages.control import LearntModel
from services.control.axis.adaptation import (
    HEAVE_NOISE,
    RATE,
    AdaptationSettings,
    ModelEstimate,
)
from services.control.axis.plant import Plant

DT = 0.01
PIONEER = Plant(19.86, 0.38, 25.5)
FAR = AdaptationSettings(thrust=(0.2, 5.0), drag=(0.2, 5.0))
few = settings(max_examples=12, deadline=None)
many = settings(max_examples=60, deadline=None)


def moves(
    thrust: float = 1.0,
    drag: float = 1.0,
    lasting: float = 0.0,
    *,
    calm: bool = True,
    blocked: bool = False,
    seconds: float = 40.0,
    chosen: AdaptationSettings = FAR,
) -> tuple[ModelEstimate, list[float]]:
    """The estimate after moves of 4 s up and down, with rests between, and the scale of the thrust
    that was used at each step. The vehicle follows its reference exactly, as the commands of a good
    controller make it do: κ u = M v' + δ D(v) - b."""
    speed, before = 0.0, 0.0
    steps = list[tuple[float, float, float]]()  # reference, velocity, and force since the last step
    for step in range(round(seconds / DT)):
        # 0.4 m/s reached and left within 0.8 s each, every 8 s, down and up.
        phase, way = step * DT % 8.0, 1.0 if step * DT % 16.0 < 8.0 else -1.0
        share = min(1.0, max(0.0, min(phase - 2.0, 6.0 - phase) / 0.8))
        before, speed = speed, 0.4 * way * share * share * (3.0 - 2.0 * share)
        needed = PIONEER.inertia * ((speed - before) / DT - lasting)
        needed += drag * PIONEER.drag((speed + before) / 2)
        steps.append((speed, 0.0, 20.0 * share) if blocked else (speed, speed, needed / thrust))
    estimate = ModelEstimate(PIONEER, HEAVE_NOISE, chosen, chosen.heave)
    used = list[float]()
    for (reference, velocity, _), (_, _, force) in pairwise(steps):  # it takes effect a step later
        estimate.step(velocity, force, DT, reference, calm=calm)
        used.append(estimate.thrust.value)
    return estimate, used


@few
@given(st.floats(0.4, 2.2), st.floats(0.4, 2.2), st.floats(-0.2, 0.2))
@example(0.6, 1.0, 0.0)
def test_thrust_and_drag_are_learnt_whatever_lasts(
    thrust: float, drag: float, lasting: float
) -> None:
    estimate, _ = moves(thrust, drag, lasting, seconds=80.0)
    assert estimate.learnt.thrust == pytest.approx(thrust, rel=0.08)
    assert estimate.learnt.drag == pytest.approx(drag, rel=0.2, abs=0.1)


@few
@given(st.floats(0.93, 1.07), st.floats(0.85, 1.15), st.floats(-0.2, 0.2))
def test_a_vehicle_nearly_as_in_its_file_flies_exactly_as_in_its_file(
    thrust: float, drag: float, lasting: float
) -> None:
    estimate, used = moves(thrust, drag, lasting)
    assert set(used) == {1.0}
    assert estimate.model == PIONEER


def test_a_sagging_battery_is_counted_with_and_that_comes_slowly() -> None:
    _, used = moves(0.6)
    assert used[-1] == pytest.approx(0.6, abs=0.05)
    assert max(abs(b - a) for a, b in pairwise(used)) <= RATE * DT * (1.0 + 1e-9)


def test_double_drag_is_counted_with_in_the_feed_forward() -> None:
    estimate, _ = moves(drag=2.0, seconds=80.0)
    assert estimate.model.quadratic == pytest.approx(2.0 * PIONEER.quadratic, rel=0.25)
    assert estimate.thrust.value == 1.0


@pytest.mark.parametrize("held", [{"calm": False}, {"blocked": True}])
def test_a_disturbed_or_blocked_vehicle_learns_nothing(held: dict[str, bool]) -> None:
    estimate, used = moves(0.6, **held)  # type: ignore[arg-type]
    assert estimate.estimate == (1.0, 1.0, 0.0)
    assert set(used) == {1.0}


def test_a_vehicle_at_rest_learns_nothing_from_what_its_thrusters_hold_against() -> None:
    """Thrust that answers a disturbance looks like thrust without effect."""
    estimate = ModelEstimate(PIONEER, HEAVE_NOISE, FAR)
    for step in range(6000):
        estimate.step(0.0, 10.0 * sin(0.01 * step), DT, 0.0, calm=True)
    assert estimate.estimate == (1.0, 1.0, 0.0)


def test_switched_off_it_reports_and_does_nothing() -> None:
    estimate, used = moves(0.6, chosen=AdaptationSettings(on=False))
    assert set(used) == {1.0}
    assert estimate.learnt.thrust == pytest.approx(0.6, abs=0.05)


def test_a_pause_keeps_what_is_learnt() -> None:
    estimate, _ = moves(0.6)
    before = estimate.learnt
    estimate.pause()
    estimate.step(None, 0.0, DT, 0.0, calm=True)
    estimate.step(0.0, 0.0, DT, 0.0, calm=True)
    assert estimate.learnt.thrust == before.thrust
    assert estimate.learnt.drag == before.drag


values = st.floats(-1e3, 1e3)


@many
@given(st.lists(st.tuples(values, values, values, st.booleans()), min_size=1, max_size=40))
def test_whatever_happens_it_stays_within_its_bounds(
    steps: list[tuple[float, float, float, bool]],
) -> None:
    chosen = AdaptationSettings()
    estimate = ModelEstimate(PIONEER, HEAVE_NOISE, chosen)
    for velocity, force, reference, calm in steps:
        for _ in range(60):
            estimate.step(velocity, force, 0.05, reference, calm=calm)
        for value, (least, most) in (
            (estimate.learnt.thrust, chosen.thrust),
            (estimate.learnt.thrust_used, chosen.thrust),
            (estimate.learnt.drag, chosen.drag),
            (estimate.learnt.drag_used, chosen.drag),
        ):
            assert least <= value <= most


def test_what_an_earlier_dive_has_learnt_counts_from_the_first_move() -> None:
    known = AdaptationSettings(heave=(0.6, 1.0))
    estimate = ModelEstimate(PIONEER, HEAVE_NOISE, known, known.heave)
    assert estimate.learnt == LearntModel(0.6, 1.0, 0.6, 1.0)
    _, used = moves(0.6, chosen=known)
    assert used == pytest.approx([0.6] * len(used), abs=0.05)


def test_what_an_earlier_dive_has_learnt_wrongly_is_learnt_anew() -> None:
    _, used = moves(1.0, chosen=AdaptationSettings(heave=(0.6, 1.0)), seconds=80.0)
    assert used[-1] == 1.0


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"thrust": (1.1, 2.0)}, "1 must lie between"),
        ({"drag": (0.4, 0.9)}, "1 must lie between"),
        ({"yaw": (0.3, 1.0)}, "yaw: it begins with 0.3 of the thrust, allowed are 0.5 to 2"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(
    wrong: dict[str, tuple[float, float]], why: str
) -> None:
    with pytest.raises(ValueError, match=why):
        AdaptationSettings(**wrong)  # type: ignore[arg-type]
