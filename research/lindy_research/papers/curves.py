"""References as arrays, ready to be drawn."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from lindy.api.references import BaselineReference, Sample, Segment
from services.reference.trajectory.minimum_jerk import along

Floats = NDArray[np.float64]
Stick = Sequence[tuple[float, float]]  # from this time [s] on, this velocity is asked for
MOTION = ("position", "velocity", "acceleration", "jerk")


class Curves(NamedTuple):
    """A reference over time; all arrays of one length."""

    t: Floats  # [s]
    position: Floats
    velocity: Floats
    acceleration: Floats
    jerk: Floats


def sampled(at: Callable[[float], Sample], t: Floats) -> Curves:
    """A function of time at the times `t` [s]."""
    rows = np.array([at(float(moment)) for moment in t])
    return Curves(t, *rows.T)


def plan_curves(segments: Sequence[Segment], target: float, t: Floats) -> Curves:
    """A plan that begins at 0 s and holds `target` after its end."""
    return sampled(lambda moment: along(segments, moment, target), t)


def steered(reference: BaselineReference, stick: Stick, t: Floats) -> Curves:
    """A reference that follows a stick; `t` rises."""
    moves = list(stick)

    def at(moment: float) -> Sample:
        while moves and moves[0][0] <= moment:
            when, target = moves.pop(0)
            reference.aim(target, when)
        return reference.at(moment)

    return sampled(at, t)


def stick_position(stick: Stick, t: float) -> float:
    """What the stick asks for at `t` [s]; 0 before its first move."""
    return next((target for when, target in reversed(stick) if when <= t), 0.0)


def show(panels: Sequence[Axes], curves: Curves, first: str = "position", **line: Any) -> None:
    """One curve into each panel, beginning with `first` and going on with its derivatives."""
    names = MOTION[MOTION.index(first) :]
    for panel, name in zip(panels, names, strict=False):
        panel.plot(curves.t, getattr(curves, name), **line)
