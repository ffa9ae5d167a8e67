"""Andrén 2023, figures 5.1 to 5.7: minimum-jerk velocity references."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy.api.references import Limits, PlannedBaseline, Ramp, Segment, thesis_rule
from lindy_research.laws import thesis_steps
from lindy_research.papers import style
from lindy_research.papers.curves import MOTION, Curves, plan_curves, show, steered, stick_position
from lindy_research.papers.setups import END_JERK, FIXED_TIME, JERK
from services.reference.trajectory import minimum_jerk

Planner = Callable[[float, float, float], Segment]  # velocity, acceleration, target
VELOCITIES = np.linspace(-1.0, 1.0, 9)  # [m/s]
STICK = ((0.1, 0.6), (0.9, 0.9), (1.05, 0.2), (1.35, 0.8), (1.5, -0.5), (2.4, -0.2), (2.65, 0.0))
RECTANGLE = ((0.2, 0.5), (1.2, 0.0))
NODES = (0.2, 0.35, 0.5, 1.2, 1.35, 1.5)  # [s]


def fixed_time(velocity: float, acceleration: float, target: float) -> Segment:
    """(5.8) solved by hand: the cubic that arrives after `FIXED_TIME`, whatever that takes."""
    T, e, a = FIXED_TIME, target - velocity, acceleration
    return Segment(T, velocity, a, (6 * e / T - 4 * a) / T, 3 * (a - 2 * e / T) / T / T)


def end_jerk(velocity: float, acceleration: float, target: float) -> Segment:
    """The thesis' rule with the end jerk of these figures."""
    plan = thesis_rule.plan(velocity, acceleration, target, END_JERK)
    return plan or Segment(0.0, target, 0.0, 0.0, 0.0)


def _panels(figure: Figure) -> list[Axes]:
    return style.stacked(figure, "velocity [m/s]", "acceleration [m/s²]", "jerk [m/s³]")


def initial_accelerations(figure: Figure) -> str:
    panels = _panels(figure)
    t = np.linspace(0.0, FIXED_TIME, 400)
    for a1, colour in ((-2.0, style.FAMILY[0]), (0.0, style.FAMILY[3]), (2.0, style.FAMILY[2])):
        curves = plan_curves([fixed_time(0.0, a1, 1.0)], 1.0, t)
        show(panels, _open_ended(curves), "velocity", color=colour, label=f"$a_1 = {a1:g}$ m/s²")
    style.legend(panels[0], 3)
    return (
        f"From 0 to 1 m/s in {FIXED_TIME:g} s, (5.8). The velocities are not printed, only a₁. "
        "The jerk is linear in each, and ends between −10 and −2 m/s³: with a fixed time, how "
        "hard a transition ends depends on where it began."
    )


def fixed_time_family(figure: Figure) -> str:
    _family(figure, fixed_time)
    return (
        f"From −1 … 1 m/s to 0 in {FIXED_TIME:g} s, acceleration 0 at both ends; the velocities "
        "are not printed. Acceleration and jerk grow in proportion to the change."
    )


def end_jerk_family(figure: Figure) -> str:
    panels = _family(figure, end_jerk)
    for level in (-END_JERK, END_JERK):
        panels[2].axhline(level, **style.EDGE)
    return (
        f"From −1 … 1 m/s to 0, acceleration 0 at both ends, planned end jerk {END_JERK:g} m/s³ "
        "(dotted; velocities and jerk are not printed). Each transition takes sqrt(6 |Δv| / J) and "
        "begins and ends with the same jerk. From rest, Lindy's bounded law is the same curve."
    )


def _family(figure: Figure, planner: Planner) -> list[Axes]:
    panels = _panels(figure)
    t = np.linspace(-0.05, 1.15, 800)
    moving = [v for v in VELOCITIES if v != 0]
    for v, colour in zip(moving, _spread(len(moving)), strict=True):
        plan = planner(float(v), 0.0, 0.0)
        curves = _with_lead(plan_curves([plan], 0.0, np.maximum(t, 0.0)), t)
        show(panels, curves, "velocity", color=colour, label=f"${v:+g}$")
    panels[0].legend(
        title="from [m/s]", loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2
    )
    return panels


def _with_lead(curves: Curves, t: np.ndarray) -> Curves:
    """Before 0 s nothing happens yet."""
    before = t < 0
    curves.jerk[before] = 0.0
    return curves._replace(t=t)


def _open_ended(curves: Curves) -> Curves:
    """Without the last sample, at which the plan is over and its jerk 0."""
    return Curves(*(column[:-1] for column in curves))


def _spread(count: int) -> list[str]:
    """Colours from one end to the other, blue for falling, orange for rising."""
    blues = ["#08306B", "#2171B5", "#56A0D3", "#9ECAE1"]
    return [*blues, "#FDBE85", "#FD8D3C", "#D94801", "#7F2704"][:count]


def recalculated_fixed_time(figure: Figure) -> str:
    moments = (0.0, 0.25, 0.5, 0.75, 1.0)
    _recalculated(figure, fixed_time, moments, 2.2)
    return (
        f"From 0 to 1 m/s in {FIXED_TIME:g} s, calculated again at each dot with a full "
        f"{FIXED_TIME:g} s to go; the instants are not printed. The target moves away in time, so "
        "the recalculated motion leaves the first plan (dashed) and arrives late."
    )


def recalculated_end_jerk(figure: Figure) -> str:
    moments = (0.0, 0.2, 0.4, 0.6, 0.8)
    _recalculated(figure, end_jerk, moments, 1.3)
    return (
        f"The same with the time from the planned end jerk, {END_JERK:g} m/s³ (not printed), with "
        "which the first plan takes 1 s: every recalculated plan lies on the first one."
    )


def _recalculated(figure: Figure, planner: Planner, moments: tuple[float, ...], end: float) -> None:
    panels = _panels(figure)
    t = np.linspace(0.0, end, 1600)
    first = plan_curves([planner(0.0, 0.0, 1.0)], 1.0, t)
    since, v, a = 0.0, 0.0, 0.0
    begins: list[tuple[float, Segment]] = []
    for moment in moments:
        here = begins[-1][1].at(moment - since) if begins else None
        v, a = (here.velocity, here.acceleration) if here else (v, a)
        since = moment
        begins.append((moment, planner(v, a, 1.0)))
    for number, (begin, plan) in enumerate(begins):
        stop = begins[number + 1][0] if number + 1 < len(begins) else end
        part = plan_curves([plan], 1.0, np.linspace(0.0, stop - begin, 400, endpoint=False))
        label = "recalculated" if number == 0 else None
        show(panels, part._replace(t=part.t + begin), "velocity", color=style.PAPER, lw=2.4,
             label=label)  # fmt: skip
        for panel, name in zip(panels, MOTION[1:], strict=True):
            panel.plot(begin, getattr(part, name)[0], "o", color=style.PAPER, ms=6)
    show(panels, first, "velocity", label="first plan", color=style.MINIMUM_TIME, ls="--", lw=1.3)
    style.legend(panels[0], 2)


def jumping_stick(figure: Figure) -> str:
    dt = 0.01  # [s] printed
    panels = _panels(figure)
    t = np.arange(0.0, 3.3, dt / 4)
    panels[0].plot(t, [stick_position(STICK, x) for x in t], label="stick", **style.ASKED)
    x = v = a = j = 0.0
    rows: list[tuple[float, ...]] = []
    for k in range(round(3.3 / dt)):
        rows.append((k * dt, x, v, a, j))
        x, v, a, j = thesis_steps.step(x, v, a, stick_position(STICK, k * dt), JERK, dt)
    thesis = Curves(*np.array(rows).T)
    bounded = steered(Ramp(Limits(JERK)), STICK, t)
    show(panels, thesis, "velocity", color=style.PAPER, label=f"thesis, every {dt * 1e3:g} ms")
    show(panels, bounded, "velocity", label="Lindy: jerk bounded", **style.OURS)
    for level in (-JERK, JERK):
        panels[2].axhline(level, **style.EDGE)
    style.legend(panels[0], 3)
    largest = float(np.max(np.abs(thesis.jerk)))
    return (
        f"Planned end jerk {JERK:g} m/s³ (dotted) and dt = {dt:g} s as printed; the stick is not. "
        f"Where the stick moves during a transition the thesis' rule exceeds its design jerk, here "
        f"up to {largest:.1f} m/s³. Lindy's law stays within it."
    )


def position_reference(figure: Figure) -> str:
    panels = style.stacked(figure, "position [m]", "velocity [m/s]", "acceleration [m/s²]")
    t = np.arange(0.0, 2.0, 0.001)

    def planner(velocity: float, acceleration: float, target: float) -> list[Segment]:
        plan = thesis_rule.plan(velocity, acceleration, target, JERK)
        return [plan] if plan else []

    curves = steered(PlannedBaseline(planner), RECTANGLE, t)
    show(panels, curves, color=style.PAPER, label="minimum jerk")
    for panel, name in zip(panels, MOTION, strict=False):
        values = [getattr(curves, name)[int(np.searchsorted(t, node))] for node in NODES]
        panel.plot(NODES, values, "o", color=style.PAPER, ms=5, label="recalculated")
    asked = [stick_position(RECTANGLE, moment) for moment in t]
    panels[1].plot(t, asked, label="stick", **style.ASKED)
    direct = np.concatenate([[0.0], np.cumsum(asked)[:-1]]) * 0.001
    panels[0].plot(t, direct, label="stick, integrated", **style.ASKED)
    for panel in panels[:2]:
        panel.legend(loc="lower right" if panel is panels[0] else "upper right")
    lag = RECTANGLE[0][1] * sum(p.duration for p in minimum_jerk.solve(0, 0, 0.5, Limits(JERK))) / 2
    return (
        f"Stick 0 → 0.5 → 0 m/s, planned end jerk {JERK:g} m/s³, recalculated at the dots (not "
        f"printed). The position, (5.16), stays behind by Δv T/2 = {lag * 1e3:.0f} mm while it "
        "moves; what starting loses, stopping gives back."
    )
