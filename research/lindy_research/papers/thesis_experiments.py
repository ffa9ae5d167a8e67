"""Andrén 2023, figures 6.5 to 6.8: steps in depth and heading, with and without ramps, not in a
basin but in the simulated one, with all of the stack between stick and thruster."""

from functools import partial
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy_research.dives import Floats
from lindy_research.papers import style
from lindy_research.papers.full_stack_runs import (
    DEPTH,
    HEADING,
    AxisLog,
    StepRun,
    StepScores,
    StickStep,
    flown,
    scores,
)

Which = Literal["depth", "heading"]
BEFORE = 0.5  # [s] shown before the stick moves
ROOM = 0.06  # [-] of a panel's height above and below the curves
LABELS = {
    "depth": ("depth\n[m]", "depth rate\n[m/s]", "force down\n[N]", "error of\ndepth [mm]"),
    "heading": ("heading\n[°]", "yaw rate\n[°/s]", "moment\n[N m]", "error of\nheading [°]"),
}
TRUE: style.Look = {"color": style.LIMIT, "linewidth": 3.2, "alpha": 0.45}
REFERENCE: style.Look = {"color": style.DIRECT, "linewidth": 1.4}
FOUND: style.Look = {"color": style.PAPER, "linewidth": 1.1}


def step(figure: Figure, which: Which, *, naive: bool) -> str:
    """One step of one way. The panels have the limits of both ways, so that they compare."""
    panels = style.stacked(figure, *LABELS[which])
    about, other = flown(naive=naive), flown(naive=not naive)
    when = _step(which)
    for panel, curves in zip(panels, _curves(about, which), strict=True):
        for name, values, look in curves:
            panel.plot(_time(about, when), values, label=name, **look)
    for k, panel in enumerate(panels):
        both = [*_curves(about, which)[k], *_curves(other, which)[k]]
        _limit(panel, np.concatenate([values for _, values, _ in both]))
    if which == "depth":
        panels[0].invert_yaxis()  # down is down
    panels[3].axhline(0.0, **style.EDGE)
    for panel in panels:
        for moment in (0.0, when.off - when.on):
            panel.axvline(moment, **style.EDGE)
    style.legend(panels[0], 3)
    style.legend(panels[2], 2)
    return _caption(which, scores(_axis(about, which), when), naive=naive)


def _caption(which: Which, found: StepScores, *, naive: bool) -> str:
    unit, size = ("N", 1e3) if which == "depth" else ("N m", 1.0)
    length = "{:.0f} mm" if which == "depth" else "{:.1f}°"
    way = (
        "The velocity reference jumps with the stick, without feed-forward of acceleration."
        if naive
        else "The reference is Lindy's bounded minimum jerk, as in the vehicle file."
    )
    speed = "0.3 m/s down" if which == "depth" else "30 °/s to starboard"
    beyond, error, left = (
        length.format(size * max(0.0, value))
        for value in (found.overshoot, found.error, found.left)
    )
    return (
        f"{way} The simulated Pioneer with estimator, sensor noise, dead-band and tether; the "
        f"stick asks for {speed} between the dotted lines. Gains, seed and scales are the same "
        f"with and without ramps. The truth overshoots by {beyond}; largest error {error}, apart "
        f"from what is left at rest, which is {left} by the estimate; peak {found.peak:.3g} "
        f"{unit}. The thesis shows measurements and prints no numbers here."
    )


def _curves(dive: StepRun, which: Which) -> tuple[tuple[tuple[str, Floats, style.Look], ...], ...]:
    """What is in each panel: label, values, look."""
    when = _step(which)
    axis = _axis(dive, which).between(when.on - BEFORE, when.end)
    size = 1e3 if which == "depth" else 1.0  # the error is in millimetres
    return (
        (
            ("truth", axis.truth, TRUE),
            ("reference", axis.wanted, REFERENCE),
            ("estimate", axis.estimate, FOUND),
        ),
        (
            ("truth", axis.truth_rate, TRUE),
            ("reference", axis.wanted_rate, REFERENCE),
            ("estimate", axis.estimate_rate, FOUND),
        ),
        (
            ("produced by the thrusters", axis.produced, TRUE),
            ("asked for", axis.asked, FOUND),
        ),
        (
            ("truth", size * (axis.wanted - axis.truth), TRUE),
            ("estimate", size * (axis.wanted - axis.estimate), FOUND),
        ),
    )


def _axis(dive: StepRun, which: Which) -> AxisLog:
    return dive.depth if which == "depth" else dive.heading


def _step(which: Which) -> StickStep:
    return DEPTH if which == "depth" else HEADING


def _time(dive: StepRun, when: StickStep) -> Floats:
    """[s] Since the stick moved."""
    return dive.t[(dive.t >= when.on - BEFORE - 1e-6) & (dive.t < when.end - 1e-6)] - when.on


def _limit(panel: Axes, values: Floats) -> None:
    low, high = float(values.min()), float(values.max())
    room = ROOM * (high - low)
    panel.set_ylim(low - room, high + room)


depth_naive = partial(step, which="depth", naive=True)
depth_ramped = partial(step, which="depth", naive=False)
heading_naive = partial(step, which="heading", naive=True)
heading_ramped = partial(step, which="heading", naive=False)
