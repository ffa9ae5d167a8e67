"""The pictures of a review, each a PNG."""

import io
from collections.abc import Sequence
from math import degrees
from typing import TYPE_CHECKING

import numpy as np

from tools.recordings.columns import Array
from tools.review.beside import COLUMNS, in_one_turn
from tools.review.estimated import Innovations
from tools.review.recorded import Track
from tools.review.stick_stops import AXES, Stops
from tools.review.vibration import AXES as IMU_AXES
from tools.review.vibration import MOTION_HZ, ImuVibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

WIDTH = 9.0  # [in]
DPI = 100
MOST_POINTS = 4000  # of a line: more cannot be seen
ANGLES = ("roll", "pitch", "heading", "yaw_rate")
TRACKS = (
    *(("roll", "roll [°]"), ("pitch", "pitch [°]"), ("heading", "heading [°]")),
    *(("depth", "depth [m]"), ("depth_rate", "depth rate [m/s]")),
)
OURS, OWN = "C0", "C1"  # colours


def spectra(found: ImuVibration) -> bytes:
    figure = _figure(4.2)
    panels = figure.subplots(1, 2)
    for panel, first, unit in ((panels[0], 3, "m/s²"), (panels[1], 0, "rad/s")):
        for k in range(first, first + 3):
            name, colour = IMU_AXES[k][0].split()[1], f"C{k % 3}"
            for spectrum, style, what in (
                (found.quiet[k], ":", "quiet"),
                (found.shaken[k], "-", "shaken"),
            ):
                shown = spectrum.frequency > 0.0
                panel.loglog(
                    spectrum.frequency[shown], np.sqrt(spectrum.density[shown]), style,
                    color=colour, linewidth=1.2, label=f"{name}, {what}",
                )  # fmt: skip
        panel.axvline(MOTION_HZ, color="0.6", linewidth=0.8)
        panel.set_title("accelerometer" if first else "gyroscope")
        panel.set_ylabel(f"[{unit}/√Hz]")
        panel.set_xlabel("frequency [Hz]")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="x-small")
    return _png(figure)


def motion(ours: Track | None, own: Track | None, offsets: dict[str, float], whose: str) -> bytes:
    """
    Args:
        offsets: [SI] taken off ours, so that heading and depth count from the same zero.
        whose: `own` is, in words.
    """
    figure = _figure(8.5)
    rows: Sequence[Panel] = figure.subplots(len(TRACKS), 1, sharex=True)
    for panel, (name, label) in zip(rows, TRACKS, strict=True):
        for track, colour, who, off in (
            (own, OWN, whose, 0.0),
            (ours, OURS, "Lindy's estimation of today", offsets.get(name, 0.0)),
        ):
            if track is not None:
                t, values = thinned(*track.known(COLUMNS.get(name, name)))
                if len(t):
                    values = values - off
                    if name == "heading":
                        t, values = _in_one_turn(t, values)
                    shown = np.degrees(values) if name in ANGLES else values
                    panel.plot(*_with_breaks(t, shown), color=colour, linewidth=1.1, label=who)
        panel.set_ylabel(label)
        panel.grid(alpha=0.3)
        if name == "depth":
            panel.invert_yaxis()
    rows[-1].set_xlabel("time since the recording began [s]")
    _legend_above(figure, rows)
    return _png(figure)


def stops(found: Stops) -> bytes:
    """Of each axis that has stops: the way beyond the release, and Lindy's as a cross."""
    drawn = [(stop, curve) for stop, curve in found.found if curve is not None]
    axes = [axis for axis in AXES if any(stop.axis == axis.name for stop, _ in drawn)]
    figure = _figure(3.8)
    for n, axis in enumerate(axes):
        panel = figure.add_subplot(1, len(axes), n + 1)
        turn = axis.unit == "rad"
        for stop, curve in drawn:
            if stop.axis != axis.name:
                continue
            t, run = thinned(curve.since, curve.run)
            panel.plot(t, np.degrees(run) if turn else run, color=OWN, alpha=0.6, linewidth=1.1)
            if stop.lindy_ran_on is not None and stop.lindy_seconds is not None:
                way = degrees(stop.lindy_ran_on) if turn else stop.lindy_ran_on
                panel.plot(stop.lindy_seconds, way, "x", color=OURS)
        panel.plot([], [], color=OWN, label="the vehicle")
        panel.plot([], [], "x", color=OURS, label="at rest by Lindy's reference")
        panel.axhline(0.0, color="0.6", linewidth=0.8)
        panel.set_title(axis.name)
        panel.set_ylabel(f"beyond the release [{'°' if turn else 'm'}]")
        panel.set_xlabel("time since the release [s]")
        panel.grid(alpha=0.3)
        panel.legend(fontsize="x-small")
    return _png(figure)


def used(found: dict[str, Innovations]) -> bytes:
    """The share of each measurement's samples that was used."""
    figure = _figure(0.9 + 0.75 * len(found))
    rows = np.atleast_1d(figure.subplots(len(found), 1, sharex=True))
    for panel, (name, each) in zip(rows, found.items(), strict=True):
        t, share = thinned(each.t, 1.0 - each.rejected)
        panel.fill_between(t, share, step="mid", color=OURS, alpha=0.5, linewidth=0)
        panel.set_ylim(0.0, 1.05)
        panel.set_ylabel(
            name.replace("_", "\n"), rotation=0, ha="right", va="center", fontsize="small"
        )
        panel.grid(alpha=0.3)
    rows[-1].set_xlabel("time since the recording began [s]")
    return _png(figure)


def thinned(t: Array, values: Array) -> tuple[Array, Array]:
    """At most `MOST_POINTS`: of each stretch the least and the greatest, in their order."""
    step = -(-2 * len(t) // MOST_POINTS)
    if step <= 2:
        return t, values
    whole = len(t) // step * step
    blocks = values[:whole].reshape(-1, step)
    ends = np.sort(np.column_stack([blocks.argmin(axis=1), blocks.argmax(axis=1)]), axis=1)
    rows = (ends + np.arange(0, whole, step)[:, None]).ravel()
    return t[rows], values[rows]


def _with_breaks(t: Array, values: Array) -> tuple[Array, Array]:
    """A line is not drawn over what is not known."""
    if len(t) < 2:
        return t, values
    periods = np.diff(t)
    after = np.flatnonzero(periods > max(1.0, 10.0 * float(np.median(periods)))) + 1
    return np.insert(t, after, np.nan), np.insert(values, after, np.nan)


def _in_one_turn(t: Array, heading: Array) -> tuple[Array, Array]:
    """[rad] No line from one end of the turn to the other."""
    values = in_one_turn(heading)
    ends = np.flatnonzero(np.abs(np.diff(values)) > np.pi) + 1
    return np.insert(t, ends, t[ends]), np.insert(values, ends, np.nan)


def _figure(height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def _legend_above(figure: "Figure", rows: Sequence["Panel"]) -> None:
    named = {
        label: handle
        for panel in rows
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True)
    }
    figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=3)


def _png(figure: "Figure") -> bytes:
    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=DPI)
    return png.getvalue()
