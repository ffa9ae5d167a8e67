"""What the reference generators cost per step, beside the thesis' ways and ruckig.

The loops are those of a 100 Hz controller. Where the target changes at every step it is a moving
stick (two sines). The thesis' closed form has the same inlining and exact position as ours.
"""

from collections.abc import Callable
from importlib import import_module
from math import sin
from typing import Any

import numpy as np

from lindy.api.references import Limits, solve, thesis_rule
from lindy_research.bench.table import Figure
from lindy_research.bench.timing import race
from lindy_research.laws import batch, thesis_steps
from lindy_research.laws.stepping import stepper
from services.reference.trajectory.minimum_jerk import reader

DT = 0.01  # [s]
STEPS = 300
JERK, A_MAX = 2.0, 0.5
STICK = [0.6 * sin(0.01 * k) + 0.3 * sin(0.037 * k) for k in range(STEPS)]
TIMES = [k * DT for k in range(STEPS)]
AXES = 10_000
BOUND = "bounded by axes whose acceleration reverses inside the step: they are solved in full"
Turn = Callable[[], int]


def figures() -> list[Figure]:
    return [*_constant_target(), *_changing_target(), *_batch()]


def _constant_target() -> list[Figure]:
    """One transition of 1 m/s that lasts all steps."""
    read = reader(solve(0.0, 0.0, 1.0, Limits(0.6, 0.5)), 1.0)

    def evaluate() -> int:
        for t in TIMES:
            _, _, _, _ = read(t)
        return STEPS

    ours, closed = race(evaluate, _closed_form)
    solved, roots = race(_linear_solve, _polynomial_roots, repeats=5)
    name = "evaluate a plan"
    return [
        _figure(name, ours, "thesis closed form, re-solved", closed, 0.75),
        _figure(name, ours, "closed form T + numpy.linalg.solve", solved),
        _figure(name, ours, "numpy.roots + numpy.linalg.solve", roots),
        *_beside_ruckig(name, evaluate),
    ]


def _beside_ruckig(name: str, evaluate: Turn) -> list[Figure]:
    """Not judged: for a constant target ruckig reads its plan too, in C++."""
    try:
        theirs = _ruckig(A_MAX, [1.0] * STEPS)
    except ImportError:
        return []
    ours, ruckig = race(evaluate, theirs)
    return [_figure(name, ours, "ruckig update(), constant target", ruckig)]


def _changing_target() -> list[Figure]:
    free, limited = _steps(Limits(JERK)), _steps(Limits(JERK, A_MAX))
    name, other = "re-plan every step", "ruckig update()"
    try:
        contenders = (free, limited, _ruckig(1e6, STICK), _ruckig(A_MAX, STICK))
    except ImportError:
        ours = race(free, limited)[1]
        note = "skipped: ruckig is not installed"
        return [Figure(section="reference", name=name, unit="ns", ours=ours, note=note)]
    ours, ours_limited, ruckig, ruckig_limited = race(*contenders)
    return [
        _figure(name, ours, other, ruckig, 1.0),
        _figure(f"{name}, acceleration limited", ours_limited, other, ruckig_limited, 1.0),
    ]


def _batch() -> list[Figure]:
    """Per axis and step, against 50 ns."""
    swing = np.random.default_rng(1).uniform(0.5, 3.0, AXES)  # [rad/s] each has its own stick
    targets = [0.8 * np.sin(swing * k * DT + 1.0) for k in range(40)]
    thrown = list(np.random.default_rng(2).uniform(-1.0, 1.0, (20, AXES)))
    plans = batch.solve(np.zeros(AXES), 0.0, targets[0], JERK, A_MAX)

    def evaluate() -> int:
        plans.at(0.3)
        return AXES

    def replan(targets: list[batch.Floats]) -> int:
        x = v = a = np.zeros(AXES)
        for target in targets:
            x, v, a, _ = batch.step(x, v, a, target, JERK, A_MAX, DT)
        return AXES * len(targets)

    at, sticks, jumps = race(evaluate, lambda: replan(targets), lambda: replan(thrown), repeats=20)
    other = "limit per axis and step"
    return [
        _figure("batch of 10,000 axes, evaluate", at, other, 50.0, 1.0),
        _figure("batch of 10,000 axes, re-plan, moving sticks", sticks, other, 50.0, 1.0),
        _figure("batch of 10,000 axes, re-plan, random jumps", jumps, other, 50.0, 1.0, BOUND),
    ]


def _figure(
    name: str, ours: float, other: str, baseline: float, goal: float | None = None, note: str = ""
) -> Figure:
    return Figure(
        section="reference", name=name, unit="ns", ours=ours,
        baseline_name=other, baseline=baseline, goal=goal, note=note,
    )  # fmt: skip


def _steps(limits: Limits) -> Turn:
    advance = stepper(limits, DT)

    def turn() -> int:
        x = v = a = 0.0
        for target in STICK:
            x, v, a, _ = advance(x, v, a, target)
        return STEPS

    return turn


def _ruckig(a_max: float, targets: list[float]) -> Turn:
    """The least that a controller must do: nothing is read out, so ruckig has the advantage."""
    ruckig: Any = import_module("ruckig")
    generator, state, out = (
        ruckig.Ruckig(1, DT), ruckig.InputParameter(1), ruckig.OutputParameter(1),
    )  # fmt: skip
    state.control_interface = ruckig.ControlInterface.Velocity
    state.current_position = state.current_velocity = state.current_acceleration = [0.0]
    state.target_velocity = state.target_acceleration = [0.0]
    state.max_acceleration, state.max_jerk = [a_max], [JERK]

    def turn() -> int:
        for target in targets:
            state.target_velocity = [target]
            generator.update(state, out)
            out.pass_to_input(state)
        return STEPS

    return turn


def _closed_form() -> int:
    x = v = a = 0.0
    for _ in TIMES:
        x, v, a, _ = thesis_steps.step(x, v, a, 1.0, 0.6, DT)
    return STEPS


def _linear_solve() -> int:
    return _as_written(lambda a, e: thesis_rule.duration(0.0, a, e, 0.6))


def _polynomial_roots() -> int:
    """Both quadratics (5.12) and (5.13); the largest real root of the four."""

    def duration(a: float, e: float) -> float:
        four = [*np.roots([0.6, 2 * a, -6 * e]), *np.roots([-0.6, 2 * a, -6 * e])]
        return max((float(r.real) for r in four if r.imag == 0), default=0.0)

    return _as_written(duration)


def _as_written(duration: Callable[[float, float], float]) -> int:
    """The loop of 5.2.3 with the 4x4 system of (5.8)."""
    x = v = a = 0.0
    steps = 100
    for _ in range(steps):
        whole = duration(a, 1.0 - v)
        A = np.array(
            [[1, 0, 0, 0], [0, 1, 0, 0],
             [1, whole, whole**2, whole**3], [0, 1, 2 * whole, 3 * whole**2]]
        )  # fmt: skip
        c1, c2, c3, c4 = np.linalg.solve(A, np.array([v, a, 1.0, 0.0]))
        x += DT * (c1 + DT * (c2 / 2 + DT * (c3 / 3 + DT * c4 / 4)))
        v, a = c1 + DT * (c2 + DT * (c3 + DT * c4)), c2 + DT * (2 * c3 + DT * 3 * c4)
    return steps
