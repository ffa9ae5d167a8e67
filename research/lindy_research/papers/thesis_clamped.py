"""Andrén 2023, figures 5.8 and 5.9: minimum-jerk velocity references with an acceleration limit."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy.api.references import thesis_rule
from lindy_research.laws import thesis_steps
from lindy_research.laws.thesis_steps import State
from lindy_research.papers import style
from lindy_research.papers.curves import Curves, plan_curves, show
from lindy_research.papers.setups import CLAMPED, CLAMPED_TARGETS
from services.reference.trajectory import minimum_jerk

Step = Callable[..., State]
LABELS = ("velocity [m/s]", "acceleration [m/s²]", "jerk [m/s³]")
DT = 0.01  # [s]
COARSE = 0.05  # [s]
COLOURS = ["#9ECAE1", "#56A0D3", "#2171B5", "#08306B"]


class Arrived(NamedTuple):
    """A recipe, run step by step until it arrives."""

    curves: Curves
    time: float  # [s]


def run(step: Step, velocity: float, acceleration: float, target: float, dt: float) -> Arrived:
    """The thesis' loop with the limits of these figures."""
    x, v, a, j = 0.0, velocity, acceleration, 0.0
    rows: list[tuple[float, ...]] = []
    time, arrived = 0.0, False
    while not arrived and time < 60.0:
        left = thesis_rule.duration(v, a, target, CLAMPED.jerk)
        arrived = left <= dt  # by a plain plan, which no limit holds up so near the end
        before = (x, v, a)
        x, v, a, j = step(x, v, a, target, *CLAMPED, dt)
        rows.append((time, *before, j))
        time += left if arrived else dt
    return Arrived(Curves(*np.array(rows).T), time)


def _show_runs(panels: list[Axes], step: Step) -> None:
    for target, colour in zip(CLAMPED_TARGETS, COLOURS, strict=True):
        curves = _held(run(step, 0.0, 0.0, target, DT), target)
        show(panels, curves, "velocity", color=colour, label=f"{target:g} m/s")
    for sign in (-1, 1):
        panels[2].axhline(sign * CLAMPED.jerk, **style.EDGE)
    panels[1].axhline(CLAMPED.acceleration, **style.EDGE)


def _held(run_: Arrived, target: float) -> Curves:
    """With the target held until the end of the figure."""
    last = run_.curves.position[-1]
    ends = np.array([[t, last, target, 0.0, 0.0] for t in (run_.time, 5.3)])
    return Curves(*np.concatenate([np.array(run_.curves).T, ends]).T)


def _bounded(target: float) -> Curves:
    t = np.linspace(0.0, 5.3, 1500)
    return plan_curves(minimum_jerk.solve(0.0, 0.0, target, CLAMPED), target, t)


def cut_off(figure: Figure) -> str:
    panels = style.stacked(figure, *LABELS)
    _show_runs(panels, thesis_steps.clamped_step)
    largest = CLAMPED_TARGETS[-1]
    free = minimum_jerk.solve(0.0, 0.0, largest, CLAMPED._replace(acceleration=float("inf")))
    show(panels, plan_curves(free, largest, np.linspace(0.0, 5.3, 1500)), "velocity",
         color=style.LIMIT, ls="--", lw=1.2, label=f"{largest:g} m/s, no limit")  # fmt: skip
    style.legend(panels[0], 5)
    time = run(thesis_steps.clamped_step, 0.0, 0.0, largest, 0.001).time
    return (
        f"J = {CLAMPED.jerk:g} m/s³, limit {CLAMPED.acceleration:g} m/s² (dotted), targets and "
        f"limits not printed; dt = {DT * 1e3:g} ms. Cutting keeps the limit, but the jerk falls to "
        f"0 at once where the cut begins: rise and fade differ. To {largest:g} m/s in {time:.4f} s."
    )


def planned_for(figure: Figure) -> str:
    chatter = "acceleration\nminus limit\n[mm/s²]"
    panels = style.above_each_other(figure, (*LABELS, chatter), (1, 1, 1, 0.8), "time [s]", below=1)
    _show_runs(panels, thesis_steps.planned_clamp_step)
    largest = CLAMPED_TARGETS[-1]
    show(panels[:3], _bounded(largest), "velocity", label=f"Lindy, {largest:g} m/s", **style.OURS)
    style.legend(panels[0], 5)
    coarse = run(thesis_steps.planned_clamp_step, 0.0, 0.0, largest, COARSE).curves
    below = panels[3]
    looks: tuple[tuple[str, Curves, style.Look], ...] = (
        (f"thesis' recipe, dt = {COARSE * 1e3:g} ms", coarse, {"color": COLOURS[-1], "lw": 1.0}),
        ("Lindy, any dt", _bounded(largest), style.OURS),
    )
    for label, curves, look in looks:
        gap = (curves.acceleration - CLAMPED.acceleration) * 1e3
        below.plot(curves.t, gap, label=label, **look)
    below.set(xlim=(0.8, 3.9), ylim=(-6.5, 1.5), xlabel="time [s]")
    style.legend(below, 2)
    time = sum(part.duration for part in minimum_jerk.solve(0.0, 0.0, largest, CLAMPED))
    return (
        f"As figure 5.8, with the recipe (5.17) to (5.20), (5.17) read with a minus sign. Now rise "
        f"and fade are alike; to {largest:g} m/s in {time:.4f} s. Below: near the limit the recipe "
        "steps past the top of its parabola and is pulled back, again and again; Lindy solves "
        "once, holds the limit exactly, and does not depend on dt."
    )
