"""Fernandes et al. 2015, figures 6 to 8 and 14 to 17: Minerva flown through the whole stack.

Each figure has the flight with the paper's law, reference model and paths, and the one with
Lindy's, in the same water and with the same sensors.
"""

from collections.abc import Callable, Sequence
from functools import cache
from math import degrees
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from lindy_research.papers import style
from lindy_research.papers.fernandes_loop_flight import (
    BEGIN,
    Floats,
    LawName,
    LoopRun,
    survey,
    trial,
)
from lindy_research.papers.fernandes_paths import edges
from lindy_research.papers.fernandes_turns import map_of
from lindy_research.papers.setups import WAYPOINTS, paper_route
from tools.sweep.all_cores import in_order


class RoutePair(NamedTuple):
    """Two flights of one route."""

    paper: LoopRun
    lindy: LoopRun


class PaperLimits(NamedTuple):
    """What the paper says its errors stay below."""

    path: float  # [m]
    depth: float  # [m]
    heading: float  # [°]


TRIAL_LIMITS = PaperLimits(0.5, 0.1, 4.0)  # 4.1
SURVEY_LIMITS = PaperLimits(0.5, 0.15, 2.5)  # 4.3

THEIRS: style.Look = {"color": style.PAPER, "linewidth": 1.2}
OURS: style.Look = {"color": style.LINDY, "linewidth": 1.0}
WANTED: style.Look = {"color": style.TARGET, "linewidth": 3.2, "alpha": 0.7}
SAID: style.Look = {"color": style.LIMIT, "marker": ".", "linestyle": "", "markersize": 2.5}
LAW, STACK = "paper's law", "Lindy"
DASHED = "Dashed: where parts of the paper's route begin and end."

THRUSTERS = ("port", "starboard", "lateral", "vertical")
COLUMNS = (0, 1, 2, 4)  # of these in a thruster command; both verticals are asked for the same
PATCH_ROWS = 200  # 20 s
FULL = ((111.7, 243.7), (111.7, 243.7), (195.0, 195.0), (90.0, 195.0))  # [N] astern, ahead


@cache
def trials() -> RoutePair:
    """4.1, flown once in a process."""
    return _at_once(trial)


@cache
def surveys() -> RoutePair:
    """4.3, flown once in a process."""
    return _at_once(survey)


def _at_once(fly: Callable[[LawName], LoopRun]) -> RoutePair:
    """Both flights, each in a process of its own: a flight of twelve minutes takes half of one."""
    names: tuple[LawName, LawName] = ("paper", "lindy")
    return RoutePair(*in_order(fly, names))


# The figures.


def figure_6(figure: Figure) -> str:
    draw_errors(figure, trials(), TRIAL_LIMITS)
    return f"50 m to the north from {BEGIN:g} s on, with an umbilical. {said_of_errors(trials())}"


def figure_7(figure: Figure) -> str:
    draw_velocities(figure, trials())
    return said_of_velocities(trials())


def figure_8(figure: Figure) -> str:
    draw_rotations(figure, trials())
    return (
        "Of the rotation that gives a thruster's greatest thrust in that direction, from commanded "
        "thrust, to which the square of the rotation is proportional. Both verticals turn alike."
    )


def figure_14(figure: Figure) -> str:
    draw_map(figure, surveys())
    return (
        "Patches: where Lindy's Minerva is every 20 s and where it points, four times as large as "
        "life. Enlarged: 6 m of the first turn, with both references, pale. Lindy's "
        f"turns, whose yaw is C2, are not the paper's, whose yaw is C1. {said_of_errors(surveys())}"
    )


def figure_15(figure: Figure) -> str:
    draw_errors(figure, surveys(), SURVEY_LIMITS)
    _parts(figure.axes)
    return f"{DASHED} No umbilical. {said_of_errors(surveys())}"


def figure_16(figure: Figure) -> str:
    draw_velocities(figure, surveys())
    _parts(figure.axes)
    return f"{said_of_velocities(surveys())} {DASHED}"


def figure_17(figure: Figure) -> str:
    draw_forces(figure, surveys())
    _parts(figure.axes)
    return (
        "What the laws ask for. Heave holds the drone down against its buoyancy of 100 N. Lindy "
        f"asks a hundred times a second, the paper's law 6.7 times. {DASHED}"
    )


# How they are drawn, whatever was flown.


def draw_errors(figure: Figure, flights: RoutePair, limits: PaperLimits) -> None:
    """Where it was, and how far from where it should have been."""
    labels = ("north, east\n[m]", "heading [°]", "path error\n[m]", "depth error\n[m]",
              "heading error\n[°]")  # fmt: skip
    panels = style.stacked(figure, *labels)
    wanted, t = flights.paper.wanted, flights.paper.truth.t
    for column in (0, 1):
        panels[0].plot(t, wanted.place[:, column], **WANTED)
    panels[1].plot(t, np.degrees(wanted.heading), label="paper's reference", **WANTED)
    for flight, name, look in _both(flights):
        truth = flight.truth
        for column in (0, 1):
            panels[0].plot(truth.t, truth.place[:, column], **look)
        panels[1].plot(truth.t, np.degrees(truth.heading), label=name, **look)
        errors = flight.path_error, flight.depth_error, np.degrees(flight.heading_error)
        for panel, error in zip(panels[2:], errors, strict=True):
            panel.plot(truth.t, error, **look)
    for panel, limit in zip(panels[2:], limits, strict=True):
        for sign in (1, -1) if panel is not panels[2] else (1,):
            panel.axhline(sign * limit, **style.EDGE)
    handles, names = panels[1].get_legend_handles_labels()
    panels[0].legend(handles, names, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    _as_long_as(panels, flights)


def draw_velocities(figure: Figure, flights: RoutePair) -> None:
    """Body velocities: asked for, measured, and as they were."""
    labels = ("surge [m/s]", "sway [m/s]", "heave [m/s]", "yaw rate [°/s]")
    panels = style.stacked(figure, *labels)
    scales = (1.0, 1.0, 1.0, degrees(1.0))
    t, measured = flights.lindy.measured
    for k, (panel, scale) in enumerate(zip(panels, scales, strict=True)):
        if k < 3:
            panel.plot(t, measured[:, k], label="DVL, Lindy's flight", **SAID)
        for flight, name, look in _both(flights):
            panel.plot(flight.truth.t, scale * flight.truth.velocity[:, k], label=name, **look)
        wanted = flights.paper.wanted
        panel.plot(wanted.t, scale * wanted.velocity[:, k], label="paper's reference",
                   color=style.TARGET, lw=1.2, ls="--")  # fmt: skip
    style.legend(panels[0], 4)
    _as_long_as(panels, flights)


def draw_rotations(figure: Figure, flights: RoutePair) -> None:
    """Commanded rotations of the propellers."""
    rows = _side_by_side(figure, flights, [f"{name}\n[% of full]" for name in THRUSTERS])
    for panels, column, full in zip(rows, COLUMNS, FULL, strict=True):
        for panel, (flight, _, look) in zip(panels, _both(flights), strict=True):
            share = rotation(flight.thrust[:, column], full)
            panel.plot(flight.commanded[0], 100.0 * share, **look)


def rotation(thrust: Floats, full: tuple[float, float]) -> Floats:
    """[-] Of full rotation, for a thrust [N]; `full` [N] astern and ahead."""
    most = np.where(thrust < 0.0, full[0], full[1])
    return np.sign(thrust) * np.sqrt(np.abs(thrust) / most)


def draw_forces(figure: Figure, flights: RoutePair) -> None:
    """Commanded forces and moment."""
    labels = ("surge [N]", "sway [N]", "heave [N]", "yaw [N m]")
    for k, panels in enumerate(_side_by_side(figure, flights, labels)):
        for panel, (flight, _, look) in zip(panels, _both(flights), strict=True):
            t, wrench = flight.commanded
            panel.plot(t, wrench[:, k], **look)


def draw_map(figure: Figure, flights: RoutePair) -> None:
    """The plane, north up."""
    panel = figure.subplots()
    map_of(panel, WAYPOINTS)
    near = panel.inset_axes((0.36, 0.60, 0.34, 0.38))
    lindy, paper = flights.lindy, flights.paper
    for axes in (panel, near):
        wanted = lindy.wanted.place
        axes.plot(wanted[:, 1], wanted[:, 0], label="Lindy's path", **WANTED)
        for flight, name, look in _both(flights):
            place = flight.truth.place
            axes.plot(place[:, 1], place[:, 0], label=name, **look)
    printed = paper.wanted.place
    near.plot(printed[:, 1], printed[:, 0], color=style.PAPER, lw=3.2, alpha=0.35)
    for row in range(0, len(lindy.truth.t), PATCH_ROWS):
        panel.add_patch(_patch(lindy, row))
    turn = lindy.wanted.velocity[:, 3]
    north, east, _ = lindy.wanted.place[int(np.argmax(turn))]
    near.set(xlim=(east - 3.0, east + 3.0), ylim=(north - 3.0, north + 1.0), aspect="equal")
    near.set(xticks=[], yticks=[])
    panel.indicate_inset_zoom(near, edgecolor=style.LIMIT)
    panel.set(xlim=(-8, 112), ylim=(-5, 65))
    style.legend(panel, 4)


# What is said.


def said_of_errors(flights: RoutePair) -> str:
    (p, d, h), (ours_p, ours_d, ours_h) = flights.paper.worst(), flights.lindy.worst()
    return (
        f"Largest errors against the truth under way: path {p:.2f} m with the paper's law, "
        f"{ours_p:.2f} m with Lindy's; depth {1e3 * d:.0f} mm and {1e3 * ours_d:.0f} mm; heading "
        f"{degrees(h):.1f}° and {degrees(ours_h):.1f}°, nearly all of it the estimate's own."
    )


def said_of_velocities(flights: RoutePair) -> str:
    off = [_rms_off(flight) for flight in flights]
    return (
        "Over the ground, in body axes. DVL once a second. Of the reference's surge, the true one "
        f"is {1e3 * off[0]:.0f} mm/s rms off with the paper's law and {1e3 * off[1]:.0f} mm/s with "
        "Lindy's, each against its own reference."
    )


def _rms_off(flight: LoopRun) -> float:
    off = flight.truth.velocity[:, 0] - flight.wanted.velocity[:, 0]
    return float(np.sqrt(np.mean(np.square(off[flight.under_way]))))


# Parts.


def _both(flights: RoutePair) -> Sequence[tuple[LoopRun, str, style.Look]]:
    return (flights.paper, LAW, THEIRS), (flights.lindy, STACK, OURS)


def _side_by_side(figure: Figure, flights: RoutePair, labels: Sequence[str]) -> list[list[Axes]]:
    """A row of panels for each label, with a column for each flight."""
    grid = figure.subplots(len(labels), 2, sharex=True, sharey="row", squeeze=False)
    rows = [list(row) for row in grid]
    for panels, label in zip(rows, labels, strict=True):
        panels[0].set_ylabel(label)
    for panel, last, name in zip(rows[0], rows[-1], (LAW, STACK), strict=True):
        panel.set_title(name)
        last.set_xlabel("time [s]")
    figure.align_ylabels()
    _as_long_as(rows[0], flights)
    return rows


def _as_long_as(panels: Sequence[Axes], flights: RoutePair) -> None:
    t = flights.paper.truth.t
    panels[0].set_xlim(t[0], t[-1])


def _parts(panels: Sequence[Axes]) -> None:
    for panel in panels:
        for time in edges(paper_route()):
            panel.axvline(time, color=style.MINIMUM_TIME, ls="--", lw=0.9)


def _patch(flight: LoopRun, row: int) -> Polygon:
    """A Minerva, seen from above."""
    north, east, _ = flight.truth.place[row]
    heading = flight.truth.heading[row]
    hull = 4.0 * np.array([(0.72, 0.0), (0.4, 0.41), (-0.72, 0.41), (-0.72, -0.41), (0.4, -0.41)])
    c, s = np.cos(heading), np.sin(heading)
    corners = [(east + s * x + c * y, north + c * x - s * y) for x, y in hull]
    return Polygon(corners, closed=True, facecolor=style.FAMILY[1], alpha=0.55, lw=0.0)
