"""Fernandes et al. 2015, figures 10 to 13: the path of Table 4 and the motion of Table 3."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy.api.references import plan
from lindy_research.papers import style
from lindy_research.papers.fernandes_model import peak_limits
from lindy_research.papers.fernandes_turns import draw_path, map_of
from lindy_research.papers.setups import (
    MIN_RADIUS,
    TABLE_3_BEGIN,
    WAYPOINTS,
    XI,
    paper_path,
    paper_route,
    table_3,
)
from services.reference.trajectory.minimum_jerk import MotionProfile
from tools.generators.route import ProfileSequence, Route, furthest, sequence, stretch

PARTS = ("1st", "2nd", "3rd", "4th", "5th")
BESIDE = ((10, 0), (4, -26), (10, 4), (-62, 36), (10, 0))  # [points] from a part to its label


def edges(route: Route) -> list[float]:
    """[s] When the parts of the paper's run begin, and when the last ends."""
    profile = route.profile
    assert isinstance(profile, ProfileSequence)
    return [TABLE_3_BEGIN + t for t in (*profile.begins, profile.duration)]


def bounded_motion() -> ProfileSequence:
    """Lindy's law on the same path, with the peak jerk and acceleration of each part's model."""
    parts: list[MotionProfile] = []
    for request in table_3(paper_path()):
        model = plan(request)
        moves = model.phases[0].duration + model.phases[3].duration > 0
        parts.append(
            stretch(
                request.length, peak_limits(model), request.cruise, request.initial, request.final
            )
            if moves
            else model
        )
    return sequence(parts)


def plan_view(figure: Figure) -> str:
    path, smooth = paper_path(), paper_path(smooth_yaw=True)
    panel = figure.subplots()
    map_of(panel, WAYPOINTS)
    draw_path(panel, path, color=style.PAPER, lw=2.0, label="reference path")
    draw_path(panel, smooth, label="Lindy: smooth yaw", **style.OURS)
    for name, part, beside in zip(PARTS, path.parts, BESIDE, strict=True):
        start, middle = part.at(0.0), path.at(part.begin + part.length / 2)
        panel.plot(start.east, start.north, "s", color=style.PAPER, ms=5)
        panel.annotate(
            f"{name}: {part.length:.4f} m", (middle.east, middle.north), beside,
            textcoords="offset points", fontsize=9, color=style.PAPER,
        )  # fmt: skip
    panel.set(xlim=(-8, 112), ylim=(-5, 65))
    style.legend(panel, 3)
    return (
        f"Way-points of Table 4, r_min = {MIN_RADIUS:g} m, even parity. Squares: where the parts "
        f"begin. {path.length:.4f} m in all. Dashed: turns whose yaw acceleration is continuous, "
        f"at most {furthest(smooth, path):.2f} m beside."
    )


def curvature(figure: Figure) -> str:
    panels = style.stacked(
        figure, "curvature [1/m]", "yaw acceleration\n[mrad/s²]", x="path parameter $ϖ_p$ [-]"
    )
    for route, label, look in (
        (paper_route(), "twin clothoids (paper)", style.THEIRS),
        (paper_route(smooth_yaw=True), "Lindy: smooth yaw", style.OURS),
    ):
        points = [route.at(float(t)) for t in np.linspace(0.0, route.duration, 6000)]
        along = [p.s / route.path.length for p in points]
        panels[0].plot(along, [abs(p.curvature) for p in points], label=label, **look)
        panels[1].plot(along, [p.yaw_acceleration * 1e3 for p in points], **look)
    panels[0].axhline(1 / MIN_RADIUS, **style.EDGE)
    path = paper_path()
    for panel in panels:
        for part in path.parts[1:]:
            panel.axvline(part.begin / path.length, color=style.LIMIT, ls="--", lw=0.9)
    style.legend(panels[0], 2)
    return (
        f"Curvature as in (117), without its sign; dotted: 1/r_min = {1 / MIN_RADIUS:g} 1/m. Lower "
        "panel, ours: at the speeds of Table 3 the yaw acceleration of twin clothoids jumps at the "
        "start, middle and end of each turn, so that yaw reference is C1 only. Turns with a smooth "
        "curvature rate make it C2."
    )


def parameter(figure: Figure) -> str:
    panels = style.stacked(figure, "$ϖ_p$ [-]", "d$ϖ_p$/dt [1/s]", "d²$ϖ_p$/dt² [1/s²]")
    route, ours = paper_route(), bounded_motion()
    length = route.path.length
    t = np.linspace(0.0, route.duration + 20.0, 5000)
    for profile, label, look in (
        (route.profile, "reference model", style.THEIRS),
        (ours, "Lindy's bounded law, same limits", style.OURS),
    ):
        rows = np.array([profile.at(float(x)) for x in t]) / length
        for panel, column in zip(panels, rows.T, strict=False):
            panel.plot(t + TABLE_3_BEGIN, column, label=label, **look)
    for panel in panels[1:]:
        panel.ticklabel_format(axis="y", style="sci", scilimits=(0, 0))
    begins = edges(route)
    _dashed(panels, begins)
    style.legend(panels[0], 2)
    listed = ", ".join(f"{begin:.1f}" for begin in begins)
    v_m = plan(table_3(route.path)[0]).v_m
    return (
        f"Tuning of Table 3, ξ = {XI:g} (not printed). Parts of the reference model begin and end "
        f"(dashed) at {listed} s; the paper reads 50, 140.3, 313.1, 430.6, 603.5, 731.5 s. Cruise "
        f"of the first part {v_m:.4f} m/s, exact, where the paper's search found 0.372. Lindy "
        f"arrives at {TABLE_3_BEGIN + ours.duration:.1f} s."
    )


def five_parts(figure: Figure) -> str:
    route = paper_route()
    path, begins = route.path, edges(route)
    panels = style.stacked(figure, "$h_i(ϖ_p)$", "$ϖ_i$ [-]")
    t = np.linspace(0.0, route.duration, 6000)
    along = np.array([route.at(float(x)).s for x in t])
    t += TABLE_3_BEGIN
    for number, (name, part) in enumerate(zip(PARTS, path.parts, strict=True)):
        inside = (along >= part.begin) & (along <= part.begin + part.length)
        level = len(PARTS) - 1 - number
        colour = style.FAMILY[number]
        panels[0].plot(t, 0.75 * inside + level, color=colour, drawstyle="steps-mid")
        own = (along - part.begin) / part.length
        panels[1].plot(t[inside], own[inside], color=colour, label=name)
    panels[0].set_yticks(range(len(PARTS)), [f"$h_{5 - i}$" for i in range(len(PARTS))])
    panels[0].set_ylabel("characteristic\nfunctions, 0 or 1")
    panels[1].legend(title="part", loc="center left", bbox_to_anchor=(1.0, 0.5))
    _dashed(panels, begins)
    return (
        "(122) and (125), each part with its own parameter from 0 to 1; dashed: where parts meet. "
        "Lindy closes every interval, so no instant is without a part; printed, (97) to (99) give "
        "only the start point at ϖ = 1."
    )


def _dashed(panels: Sequence[Axes], times: Sequence[float]) -> None:
    for panel in panels:
        for time in times:
            panel.axvline(time, color=style.MINIMUM_TIME, ls="--", lw=1.0)
