"""Fernandes et al. 2015, figures 3, 4 and 5: twin clothoids, and what paths they make."""

from collections.abc import Sequence
from math import cos, degrees, hypot, pi, radians, sin
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy_research.papers import style
from lindy_research.papers.setups import LANE_OFFSET, MIN_RADIUS
from services.reference.paths.path import Path
from tools.generators.route import TwinClothoids, furthest

CORNERS = ((0.0, 0.0), (50.0, 0.0), (65.0, 55.0), (20.0, 75.0), (65.0, 120.0))  # [m] ours
STRAIGHT = 20.0  # [m] lines of figure 5


def antisymmetric_end(angle: float, min_radius: float) -> tuple[float, float]:
    """End point [m], forward and to starboard, of the odd pair of Fernandes et al. 2015: a clothoid
    that turns `angle`/2 to the right, then the same one rotated by 180°. Its curvature jumps from
    1/r to −1/r in the middle, so no path here uses it; two even pairs change lanes in less distance
    and without a jump.
    """
    middle = TwinClothoids(angle, min_radius).middle
    return 2 * middle.x, 2 * middle.y


class Odd(NamedTuple):
    """Two lane changes by antisymmetric pairs, as the paper draws them."""

    angle: float  # [rad] θ_c
    waypoints: tuple[tuple[float, float], ...]
    s: np.ndarray  # [m]
    north: np.ndarray
    east: np.ndarray
    curvature: np.ndarray


def arc_ratio(angle: float) -> float:
    """L_c/L_r: length of the twin clothoids over that of the arc with the same ends."""
    turn = TwinClothoids(angle, 1.0)
    end = turn.at(turn.length)
    radius = hypot(end.x, end.y) / (2 * sin(angle / 2))
    return turn.length / (angle * radius)


def radius_ratio(angle: float) -> float:
    """r_r/r_min: radius of that arc over the smallest of the twin clothoids."""
    return 2.0 / arc_ratio(angle)


def longer_by(ratio: float) -> float:
    """[rad] The turn for which L_c/L_r is `ratio`."""
    low, high = 0.01, pi
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if arc_ratio(middle) < ratio else (low, middle)
    return low


def odd_pair_angle(offset: float) -> float:
    """[rad] θ_c of the antisymmetric pair that goes `offset` [m] aside."""
    low, high = 0.01, 2.1
    for _ in range(60):
        middle = (low + high) / 2
        aside = antisymmetric_end(middle, MIN_RADIUS)[1]
        low, high = (middle, high) if aside < offset else (low, middle)
    return low


def odd_lane_changes() -> Odd:
    """Heading east: line, change to the left, line, change back, line."""
    angle = odd_pair_angle(LANE_OFFSET)
    forward, aside = antisymmetric_end(angle, MIN_RADIUS)
    length = TwinClothoids(angle, MIN_RADIUS).length
    half = np.linspace(0.0, length / 2, 200)
    turn = TwinClothoids(angle, MIN_RADIUS)
    first = np.array([turn.first_half(float(s)) for s in half])[:, [0, 1, 3]]
    second = np.array([forward, aside, 0.0]) - first[::-1]
    pair = np.concatenate([first, second])
    back = pair * (1.0, -1.0, -1.0) + (forward + STRAIGHT, aside, 0.0)
    middle = np.concatenate([pair, back]) + np.array([STRAIGHT, 0.0, 0.0])
    end = 3 * STRAIGHT + 2 * forward
    rows = np.concatenate([[[0.0, 0.0, 0.0]], middle, [[end, 0.0, 0.0]]])
    on_pair = np.concatenate([half, half + length / 2])
    s = [[0.0], on_pair + STRAIGHT, on_pair + 2 * STRAIGHT + length]
    whole = np.concatenate([*s, [3 * STRAIGHT + 2 * length]])
    easts = np.cumsum([0.0, STRAIGHT, forward, STRAIGHT, forward, STRAIGHT])
    norths = (0.0, 0.0, aside, aside, 0.0, 0.0)
    waypoints = tuple((float(n), float(e)) for n, e in zip(norths, easts, strict=True))
    east, north, curvature = rows.T  # the frame of a turn, seen in a mirror
    return Odd(angle, waypoints, whole, north, east, -curvature)


def even_lane_changes() -> Path:
    """The same way-points, by two symmetric pairs for each change."""
    return Path.through(odd_lane_changes().waypoints, MIN_RADIUS, "interpolating", TwinClothoids)


def shortest_even_change() -> tuple[float, float, float]:
    """θ_c [rad], way forward [m] and length [m] of two symmetric pairs without a line between."""
    low, high = 0.01, 2.1
    for _ in range(60):
        middle = (low + high) / 2
        aside = 2 * TwinClothoids(middle, MIN_RADIUS).tangent * sin(middle)
        low, high = (middle, high) if aside < LANE_OFFSET else (low, middle)
    turn = TwinClothoids(low, MIN_RADIUS)
    return low, 2 * turn.tangent * (1 + cos(low)), 2 * turn.length


def ratios(figure: Figure) -> str:
    panel = figure.subplots()
    angle = np.linspace(1.0, 180.0, 360)
    arcs = [arc_ratio(radians(x)) for x in angle]
    radii = [radius_ratio(radians(x)) for x in angle]
    panel.plot(angle, arcs, color=style.PAPER, label="arc length ratio $L_c/L_r$")
    panel.plot(angle, radii, color=style.MINIMUM_TIME, label="radius ratio $r_r/r_c^{min}$")
    longer = degrees(longer_by(1.1))
    panel.plot([longer, longer, 0.0], [0.0, 1.1, 1.1], **style.EDGE)
    panel.plot(longer, 1.1, "o", color=style.PAPER)
    panel.annotate(f"{longer:.2f}°, 10 % longer", (longer, 1.1), (longer + 4, 0.98), fontsize=9)
    panel.set(xlim=(0, 180), ylim=(0.8, 2.1), xlabel="angle span $θ_c$ [°]", ylabel="ratio [-]")
    panel.set_xticks(range(0, 181, 20))
    style.legend(panel, 2)
    return (
        "The arc has the same two ends and tangents as the pair. The two ratios are one: "
        "r_r/r_min = 2 L_r/L_c, since the mean curvature of the pair is half its greatest."
    )


def approximating(figure: Figure) -> str:
    path = Path.through(CORNERS, MIN_RADIUS, shape=TwinClothoids)
    smooth = Path.through(CORNERS, MIN_RADIUS)
    panel, below = _map_and_curvature(figure, 3.0, 1.1)
    map_of(panel, CORNERS)
    draw_path(panel, path, color=style.PAPER, label="lines and twin clothoids")
    draw_path(panel, smooth, label="Lindy: smooth yaw", **style.OURS)
    style.legend(panel, 3)
    _curvatures(below, ((path, style.THEIRS), (smooth, style.OURS)))
    return (
        f"Way-points are ours, r_min = {MIN_RADIUS:g} m in every turn. Dashed: turns with a "
        f"continuous curvature rate, at most {furthest(smooth, path):.2f} m beside the clothoids."
    )


def interpolating(figure: Figure) -> str:
    odd, even = odd_lane_changes(), even_lane_changes()
    panel, lower = _map_and_curvature(figure, 1.0, 1.7)
    map_of(panel, odd.waypoints)
    panel.plot(odd.east, odd.north, color=style.PAPER, label="antisymmetric pairs (paper)")
    draw_path(panel, even, label="Lindy: symmetric pairs", **style.OURS)
    panel.set_ylim(-5, LANE_OFFSET + 5)
    style.legend(panel, 3)
    lower.plot(odd.s, odd.curvature, color=style.PAPER)
    _curvatures(lower, ((even, style.OURS),))
    angle, forward, length = shortest_even_change()
    odd_forward, odd_length = odd.waypoints[2][1] - STRAIGHT, 2 * odd.angle * MIN_RADIUS
    return (
        f"Two lane changes of {LANE_OFFSET:g} m at r_min = {MIN_RADIUS:g} m (ours; the paper's "
        "co-ordinates are not printed). An antisymmetric pair turns "
        f"{degrees(odd.angle):.1f}°, takes {odd_forward:.2f} m forward and {odd_length:.2f} m of "
        "path, and its curvature jumps in the middle. Symmetric pairs do not jump, and need only "
        f"{degrees(angle):.1f}°, {forward:.2f} m and {length:.2f} m."
    )


def _map_and_curvature(figure: Figure, upper: float, lower: float) -> tuple[Axes, Axes]:
    labels = ("north [m]", "curvature [1/m]")
    panels = style.above_each_other(figure, labels, (upper, lower), "east [m]", below=1)
    return panels[0], panels[1]


def map_of(panel: Axes, points: Sequence[Sequence[float]]) -> None:
    """Way-points, north up; the panel is made a map."""
    north, east = [p[0] for p in points], [p[1] for p in points]
    panel.plot(east, north, marker="o", ms=5, label="way-points", **style.ASKED)
    panel.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")


def draw_path(panel: Axes, path: Path, **line: Any) -> None:
    """A path on a map."""
    points = [path.at(float(s)) for s in np.linspace(0.0, path.length, 2000)]
    panel.plot([p.east for p in points], [p.north for p in points], **line)


def _curvatures(panel: Axes, paths: Sequence[tuple[Path, style.Look]]) -> None:
    for path, look in paths:
        s = np.linspace(0.0, path.length, 3000)
        panel.plot(s, [path.at(float(x)).curvature for x in s], **look)
    for sign in (-1, 1):
        panel.axhline(sign / MIN_RADIUS, **style.EDGE)
    panel.set_xlabel("distance along the path [m]")
