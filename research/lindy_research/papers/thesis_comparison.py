"""Andrén 2023, figures 4.2 and 4.3: four ways to follow a step of the stick."""

from functools import partial

import numpy as np
from matplotlib.figure import Figure

from lindy.api.references import (
    BaselineReference,
    Direct,
    Filter,
    Limits,
    PlannedBaseline,
    Ramp,
    Segment,
    minimum_time,
)
from lindy_research.papers import style
from lindy_research.papers.curves import show, steered
from lindy_research.papers.setups import (
    FILTER_DAMPING,
    FILTER_FREQUENCY,
    JERK,
    LARGE_STEP,
    SMALL_STEP,
)
from services.reference.trajectory import minimum_jerk

START = 0.1  # [s] when the stick moves


def generators(step: float) -> list[tuple[str, str, BaselineReference]]:
    """Name, colour and generator of each curve."""
    limits = Limits(JERK)

    def quickest(velocity: float, acceleration: float, target: float) -> list[Segment]:
        return minimum_time(velocity, acceleration, target, limits)

    peak = peak_acceleration(minimum_jerk.solve(0.0, 0.0, step, limits))
    return [
        ("direct integration", style.DIRECT, Direct()),
        ("linear filter", style.FILTER, Filter(FILTER_FREQUENCY, FILTER_DAMPING)),
        ("minimum time", style.MINIMUM_TIME, PlannedBaseline(quickest)),
        ("minimum jerk", style.PAPER, Ramp(limits)),
        ("minimum jerk, acceleration bounded too", style.LINDY, Ramp(Limits(JERK, peak * 0.8))),
    ]


def peak_acceleration(segments: list[Segment]) -> float:
    """Of a transition: at a joint, or where the jerk of a segment passes zero."""
    peak = 0.0
    for part in segments:
        turning = -part.j0 / (2 * part.half_snap) if part.half_snap else 0.0
        for t in (0.0, part.duration, max(0.0, min(part.duration, turning))):
            peak = max(peak, abs(part.at(t).acceleration))
    return peak


def comparison(figure: Figure, step: float, hold: float) -> str:
    """The stick goes to `step` [m/s], stays for `hold` [s], and goes back."""
    stick = ((START, step), (START + hold, 0.0))
    end = START + hold + 1.0 if step > 0.5 else START + hold + 0.75
    t = np.arange(0.0, end, end / 2400)
    panels = style.stacked(
        figure, "position\n[m]", "velocity\n[m/s]", "acceleration\n[m/s²]", "jerk\n[m/s³]"
    )
    asked = [step if START <= moment < START + hold else 0.0 for moment in t]
    for name, colour, reference in generators(step):
        curves = steered(reference, stick, t)
        lined = {"color": colour, "label": name}
        if colour == style.LINDY:
            lined = {**style.OURS, "label": name}
        if isinstance(reference, Direct):  # its acceleration is a pulse without width
            show(panels[:2], curves, **lined)
            for moment, sign in ((START, 1.0), (START + hold, -1.0)):
                panels[2].annotate(
                    "", (moment, 0.96 if sign > 0 else 0.04), (moment, 0.5),
                    xycoords=("data", "axes fraction"), textcoords=("data", "axes fraction"),
                    arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.6},
                )  # fmt: skip
        else:
            show(panels, curves, **lined)
    panels[1].plot(t, asked, label="stick", **style.ASKED)
    for level in (-JERK, JERK):
        panels[3].axhline(level, **style.EDGE)
    handles, labels = panels[1].get_legend_handles_labels()
    panels[0].legend(
        handles, labels, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), columnspacing=1.4
    )
    return (
        f"Stick 0 → {step:g} → 0 m/s, jerk {JERK:g} m/s³ (dotted). Filter: ω = "
        f"{FILTER_FREQUENCY:g} rad/s, so that it begins the step of {SMALL_STEP:g} m/s with that "
        f"jerk; its damping is not printed, ζ = {FILTER_DAMPING:g} here. Arrows: the acceleration "
        "of direct integration is a pulse. Dashed black is not in the thesis: Lindy's bounded law "
        "with a limit of 80 % of the minimum-jerk peak acceleration."
    )


small_step = partial(comparison, step=SMALL_STEP, hold=0.7)
large_step = partial(comparison, step=LARGE_STEP, hold=1.4)
