"""The control section of the bench: on the exact plant every goal that is not a time is met but for
one, and the timed steps are real work; in the loop, what is scored is what was flown."""

from functools import cache

import numpy as np
import pytest

from lindy_research.bench import control, control_cost, control_loop, control_plant
from lindy_research.bench.control_loop import NAMES, SEEDS, ControlScores
from lindy_research.bench.drag_runs import worst_errors
from lindy_research.bench.table import Figure

pytestmark = pytest.mark.slow

# As fast as naive to the last digit, the jerk is 18.9 times smaller, and the goal is 19.
MISSED = "squared jerk of thrust, equal rise, end jerk 3.024 m/s³"


@cache
def found() -> list[Figure]:
    return control_plant.figures()


def named(text: str) -> Figure:
    return next(figure for figure in found() if text in figure.name)


def test_every_figure_has_a_baseline_from_the_same_run() -> None:
    assert len({figure.name for figure in found()}) == len(found())
    for figure in found():
        assert figure.section == "control"
        assert figure.ratio is not None
        assert figure.ratio > 0


def test_a_missed_goal_is_shown_as_missed_and_there_is_one() -> None:
    judged = [figure for figure in found() if figure.goal is not None and figure.unit != "µs"]
    assert len(judged) == 6
    assert [figure.name for figure in judged if not figure.met] == [MISSED]


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("position error, thesis' way", 15.266),
        ("sines, observer 1 rad/s", 83.976),
        ("sines, observer 3 rad/s", 453.37),
        ("sines, observer 10 rad/s", 4166.0),
        ("position error, equal rise, end jerk 3.024", 450.8),
        (MISSED, 18.91),
        ("position error, equal rise, end jerk 3 ", 453.7),
        ("jerk of thrust, equal rise, end jerk 3 ", 19.46),
    ],
)
def test_the_note_says_how_many_times_smaller(name: str, times: float) -> None:
    figure = named(name)
    assert figure.ratio is not None
    assert 1.0 / figure.ratio == pytest.approx(times, rel=1e-3)
    assert figure.note.endswith(f"{1.0 / figure.ratio:.4g} times smaller than naive")


@pytest.mark.parametrize("place", [False, True])
@pytest.mark.parametrize("vehicle", control_cost.VEHICLES)
def test_the_timed_steps_are_real_work(vehicle: str, *, place: bool) -> None:
    controller = control_cost.controller(vehicle)
    steps = [controller.step(*inputs) for inputs in control_cost.moving_inputs(place=place)]
    for thruster in zip(*(command.thrust for _, command in steps), strict=True):
        assert max(thruster) > 1.0
        assert min(thruster) < -1.0
    assert not any(wrench.saturated for wrench, _ in steps)
    surge = [wrench.wanted[0] for wrench, _ in steps]
    assert (max(map(abs, surge)) > 6.0) == place  # the pilot's own force is 5 N


def test_the_four_ways_are_timed() -> None:
    times = [figure for figure in found() if figure.unit == "µs"]
    assert len(times) == 4
    for figure in times:
        assert figure.baseline == control_cost.MOST


def test_known_quadratic_drag_is_what_the_error_was() -> None:
    naive, linearised, known = worst_errors()
    assert (naive, linearised) == pytest.approx((0.584, 0.479), abs=0.002)
    assert known < 0.01 * linearised


def test_the_section_joins_plant_and_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, ...]] = []

    def scores(overrides: tuple[str, ...]) -> ControlScores:
        asked.append(overrides)
        return ControlScores(*(1.0 + len(asked),) * len(NAMES))

    monkeypatch.setattr(control_loop, "scores", scores)
    monkeypatch.setattr(control_plant, "figures", found)
    figures = control.figures()
    assert figures[: len(found())] == found()
    loop = figures[len(found()) :]
    assert asked == [(), control_loop.INTEGRAL]
    assert {(each.ours, each.baseline) for each in loop} == {(2.0, 3.0)}
    assert [each.unit for each in loop] == [unit for _, unit in NAMES.values()]
    assert loop[0].note == f"mean of {len(SEEDS)} seeds"


def test_a_vehicle_that_becomes_lighter_is_pushed_up_by_what_it_lost() -> None:
    dives = [
        control_loop.flown(
            control_loop.STICKS + "0,0,0,0,0\n1,0,0,0.8,0\n4,0,0,0,0\n60,0,0,0,0\n",
            control_loop.DROP_S + 3.0, control_loop.INTEGRAL, 0, drops=drops,
        )
        for drops in (False, True)
    ]  # fmt: skip
    still, lighter = dives
    unlike = np.abs(still.depth - lighter.depth)
    assert float(np.max(unlike[: round(100 * control_loop.DROP_S)])) == 0.0
    assert float(np.max(unlike)) > 0.02
    pushed = lighter.heave[-100:] - still.heave[-100:]
    assert float(np.mean(pushed)) == pytest.approx(10.0, abs=2.0)
