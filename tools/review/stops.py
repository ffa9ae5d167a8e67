"""Every stop of a dive, of any vehicle: how far it ran on after its stick was let go.

A vehicle that was not flown by Lindy has no reference to be compared with, so distances count from
where the stick was let go. Beside each stop is Lindy's: what its reference law makes of the same
speed, with the limits of the vehicle file.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import degrees, nan, radians
from statistics import median
from typing import TYPE_CHECKING, Literal, NamedTuple, cast

import msgspec
import numpy as np

from messages import topics
from messages.pilot import FlightMode
from messages.vehicle import OWN_WAY
from services.marine.vehicle import GRAVITY
from services.reference.guidance.axes import HELD_AXES
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import solve, travelled
from tools.analysis.dive import RecordedDive
from tools.analysis.spectra import BAND, LEAST, RATE, jerk_spectrum
from tools.analysis.stops import armed_until, releases
from tools.log.cut import ArmedSpan
from tools.recordings.columns import Array
from tools.report.report import times
from tools.review.recorded import SensorColumns, Track, digits, true_track
from tools.review.recorded import at as track_at
from tools.review.section import (
    OURS,
    OWN,
    Cell,
    ReviewSection,
    amount,
    figure,
    image,
    paragraph,
    signed,
    table,
    thinned,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WINDOW_S = 8.0  # [s] of a stop at most
SHORTEST_S = LEAST / RATE  # [s] a shorter one is no stop: the next deflection came at once
SLOWEST_S = 0.2 / BAND  # [s] between samples, of which a jerk below `BAND` can be told
STILL_FOR_S = 0.5  # [s] so long below `still`: it has come to rest


UNCOUNTED = {
    "against": " while the vehicle still moved the other way; that is no stop of it and left out.",
    "unknown": ", but the motion after it is not known throughout; that is left out.",
    "coasting": " in a flight mode in which it is a force, so that the vehicle coasts; that is no "
    "stop and left out.",
}  # why a release is no stop, in the order in which it is said


class StopAxis(NamedTuple):
    name: str
    unit: str
    position: str  # columns of a track; empty: the sum of its rate
    rate: str
    moving: float  # per s; slower at the release is no stop
    still: float  # per s; slower is rest


AXES = (
    StopAxis("surge", "m", "", "surge", 0.1, 0.03),
    StopAxis("sway", "m", "", "sway", 0.1, 0.03),
    StopAxis("heave", "m", "depth", "depth_rate", 0.05, 0.02),
    StopAxis("yaw", "rad", "heading", "yaw_rate", radians(5.0), radians(2.0)),
)


class ReviewedStop(msgspec.Struct, kw_only=True, frozen=True):
    """One stop."""

    axis: str
    by: Literal["truth", "estimate"] = "estimate"  # which says how it moved: the simulator's truth
    t: float  # [s] since the recording began
    # None, all four: nothing in the recording measures this axis, and its jerk alone is known.
    speed: float | None = None  # [m/s, rad/s] at the release
    ran_on: float | None = None  # [m, rad] farthest from where the stick was let go
    bounced_back: float | None = None  # [m, rad] from the farthest point back
    seconds: float | None = None  # [s] until it rested; None, too: not before the stick moved again
    jerk: float | None = None  # [m/s³, rad/s³] felt below 2 Hz, rms; None: too short
    # [m, rad] Lindy's reference from the same speed; None: no limits
    lindy_ran_on: float | None = None
    lindy_seconds: float | None = None  # [s]


class StopCurve(NamedTuple):
    """One stop, to be drawn."""

    since: Array  # [s] since the release
    run: Array  # [m, rad] in the direction of the motion


class Stops(NamedTuple):
    found: list[tuple[ReviewedStop, StopCurve | None]]  # None: its way is not known
    missing: list[str]  # what cannot be said, one sentence each

    @property
    def stops(self) -> list[ReviewedStop]:
        return [stop for stop, _ in self.found]


def reviewed_stops(
    dive: RecordedDive,
    motion: Track | None,
    imu: SensorColumns | None,
    limits: Settings,
    armed: Sequence[ArmedSpan] | None,
) -> Stops:
    """
    Args:
        dive: with the sticks that count.
        motion: as estimated, by us or else by the vehicle itself. Where the dive has a simulator's
            truth, depth and heading are by that.
        limits: of Lindy's reference, from the vehicle file.
        armed: a stop ends with its span; None: the recording does not say.
    """
    if why := _nothing_moves(dive, motion, armed):
        return Stops([], [why])
    assert motion is not None
    truth = true_track(dive)
    found: list[tuple[ReviewedStop, StopCurve | None]] = []
    missing: list[str] = []
    uncounted: Counter[str] = Counter()
    for axis in AXES:
        let_go = list(_let_go(dive, axis.name, armed, float(motion.t[-1])))
        felt = _felt(axis, motion, imu)
        if not np.isfinite(getattr(motion, axis.rate)).any():
            jerks = [(b, _jerk(felt, np.arange(b, end, 1.0 / RATE))) for _, b, end in let_go]
            found += [
                (ReviewedStop(axis=axis.name, t=round(begin, 3), jerk=jerk), None)
                for begin, jerk in jerks
                if jerk is not None
            ]
            if let_go:
                missing.append(
                    f"The {axis.name} stick was let go {times(len(let_go))}, but nothing in the "
                    f"recording measures {axis.name}: at most its jerk is known."
                )
            continue
        for sign, begin, end in let_go:
            is_true = truth is not None and bool(axis.position)
            moved = _moved(axis, truth if truth and is_true else motion, begin, end)
            stop = None if moved is None else _measured(axis, moved, felt, limits, is_true=is_true)
            if not _holds(dive, axis.name, begin):
                uncounted["coasting"] += 1
            elif moved is None:
                uncounted["unknown"] += 1
            elif stop is not None and sign * (stop[0].speed or 0.0) < 0.0:
                uncounted["against"] += 1
            else:
                found += filter(None, [stop])
    found.sort(key=lambda pair: pair[0].t)
    missing += [
        f"{times(uncounted[reason]).capitalize()} a stick was let go{words}"
        for reason, words in UNCOUNTED.items()
        if uncounted[reason]
    ]
    if not found and not missing:
        missing.append("No stick was let go while the vehicle moved along its axis.")
    return Stops(found, missing)


def _nothing_moves(
    dive: RecordedDive, motion: Track | None, armed: Sequence[ArmedSpan] | None
) -> str:
    """Why no stick counts. Empty: some may."""
    if not dive[topics.PILOT_COMMAND].count:
        return "The recording holds no sticks, so nobody knows when they were let go."
    if armed is not None and not armed:
        return "The vehicle was never armed, so its sticks moved nothing."
    if motion is None or not len(motion.t):
        return "Nobody estimated the motion, so it is not known how far it ran on."
    return ""


def _let_go(
    dive: RecordedDive, axis: str, armed: Sequence[ArmedSpan] | None, last: float
) -> Iterator[tuple[float, float, float]]:
    """(sign of the deflection before, begin [s], end [s]) of every time a stick was let go for long
    enough. One that ends with its armed span was not; one that the vehicle then goes on from by
    itself ends there, as all do where the motion ends, at `last` [s]."""
    status = dive[topics.STATUS]
    by_itself = status["stamp_ns"][status.said("activity", *OWN_WAY)] / 1e9
    for release in releases(dive, axis):
        begin, end = release.begin / 1e9, release.end / 1e9
        if (disarmed := armed_until(armed, begin)) is not None:
            goes = by_itself[by_itself > begin]
            end = min(end, disarmed, *goes[:1].tolist(), begin + WINDOW_S, last)
            if end - begin >= SHORTEST_S:
                yield release.sign, begin, end


def _holds(dive: RecordedDive, axis: str, begin: float) -> bool:
    """Does the drone hold an axis whose stick is let go? Of surge and sway, and of a vehicle that
    another program flew, every release is looked at."""
    status = dive[topics.STATUS]
    row = int(np.searchsorted(status["stamp_ns"], 1e9 * begin, side="right")) - 1
    if axis not in ("heave", "yaw") or row < 0 or not dive[topics.REFERENCE].count:
        return True
    held = HELD_AXES[cast(FlightMode, status.words[int(status["flight_mode"][row])])]
    return held.depth if axis == "heave" else held.heading


def _moved(
    axis: StopAxis, motion: Track, begin: float, end: float
) -> tuple[Array, Array, Array] | None:
    """Times [s], rate and position along an axis, `RATE` a second. None: not known throughout."""
    grid = np.arange(begin, end, 1.0 / RATE)
    rate = track_at(motion, axis.rate, grid)
    position = np.cumsum(rate) / RATE
    if axis.position:
        position = track_at(motion, axis.position, grid)
    if axis.position == "depth":
        position = position - np.interp(grid, motion.t, np.nan_to_num(motion.corrected))
    return (grid, rate, position) if np.isfinite(rate + position).all() else None


def _measured(
    axis: StopAxis,
    moved: tuple[Array, Array, Array],
    felt: tuple[Array, Array] | None,
    settings: Settings,
    *,
    is_true: bool,
) -> tuple[ReviewedStop, StopCurve] | None:
    """None: it did not move."""
    grid, rate, position = moved
    if abs(rate[0]) < axis.moving:
        return None
    run = float(np.sign(rate[0])) * (position - position[0])
    farthest = int(np.argmax(run))
    # Surge and sway have a velocity reference with a measured position only.
    limits = {"heave": settings.heave.limits, "yaw": settings.yaw.limits}.get(axis.name)
    segments = [] if limits is None else solve(abs(float(rate[0])), 0.0, 0.0, limits)
    stop = ReviewedStop(
        axis=axis.name,
        by="truth" if is_true else "estimate",
        t=round(float(grid[0]), 3),
        speed=digits(float(rate[0])),
        ran_on=digits(float(run[farthest])),
        bounced_back=digits(float(run[farthest] - run[farthest:].min())),
        seconds=_rest_s(np.abs(rate) < axis.still),
        jerk=_jerk(felt, grid),
        lindy_ran_on=digits(travelled(segments)) if limits else None,
        lindy_seconds=digits(sum(each.duration for each in segments)) if limits else None,
    )
    return stop, StopCurve(grid - grid[0], run)


def _rest_s(slow: np.ndarray) -> float | None:
    """[s] First time from which on it is slow for `STILL_FOR_S`. None: never."""
    need = round(STILL_FOR_S * RATE)
    run = np.convolve(slow, np.ones(need), mode="valid") >= need - 0.5
    return round(float(np.argmax(run)) / RATE, 2) if run.any() else None


def _felt(axis: StopAxis, motion: Track, imu: SensorColumns | None) -> tuple[Array, Array] | None:
    """(times, acceleration of the axis): its jerk is what a camera feels."""
    if axis.name == "heave":
        t, acceleration = motion.known("depth_acceleration")
    elif axis.name == "yaw":
        t, rate = motion.known("yaw_rate")
        acceleration = np.gradient(rate, t) if len(t) > 1 else np.full_like(t, nan)
    elif imu is None:
        return None
    else:
        t = imu.stamp
        roll, pitch = (track_at(motion, name, t) for name in ("roll", "pitch"))
        if axis.name == "surge":
            acceleration = imu.values[:, 3] - GRAVITY * np.sin(pitch)
        else:
            acceleration = imu.values[:, 4] + GRAVITY * np.sin(roll) * np.cos(pitch)
    known = np.isfinite(acceleration)
    return (t[known], acceleration[known]) if known.any() else None


def _jerk(felt: tuple[Array, Array] | None, grid: Array) -> float | None:
    """[per s³] Root mean square below `BAND`."""
    if felt is None or len(grid) < LEAST or np.median(np.diff(felt[0])) > SLOWEST_S:
        return None
    if not felt[0][0] <= grid[0] <= grid[-1] <= felt[0][-1]:
        return None
    return digits(jerk_spectrum(np.interp(grid, *felt)).rms(BAND))


BY = {"truth": "the simulator's truth", "estimate": "the estimate"}


class StopSection(ReviewSection):
    key, heading = "stops", "Every stop"

    def __init__(self, found: Stops) -> None:
        super().__init__(found.missing)
        self.stops, self._found = found.stops, found.found

    def sentences(self) -> Iterator[str]:
        for axis in AXES:
            stops = [s for s in self.stops if s.axis == axis.name and s.ran_on is not None]
            if not stops:
                continue
            ran = amount(median(stop.ran_on or 0.0 for stop in stops), axis.unit)
            back = amount(median(stop.bounced_back or 0.0 for stop in stops), axis.unit)
            lindy = [stop.lindy_ran_on for stop in stops if stop.lindy_ran_on is not None]
            said = f"{len(stops)} stop{'s' * (len(stops) > 1)} in {axis.name}, by {BY[stops[0].by]}"
            said += f": it ran on by {ran}{' (median)' * (len(stops) > 1)} and came back by {back}"
            if lindy:
                said += f"; Lindy's reference runs on by {amount(median(lindy), axis.unit)}"
            yield f"{said}."

    def html(self) -> str:
        if not self.stops:
            return ""
        by = dict.fromkeys(BY[stop.by] for stop in self.stops if stop.ran_on is not None)
        drawn = any(curve is not None for _, curve in self._found)
        return (
            paragraph(
                f"From the moment the stick was let go{', by ' * bool(by)}{' and '.join(by)}. Jerk "
                "is what a camera feels, below 2 Hz. "
                "Lindy: how far its reference runs on from the same speed, with the limits of the "
                "vehicle file."
            )
            + (image(_ways(self._found), "Every stop: the way beyond the release over time")
               if drawn else "")
            + stop_table(self.stops)
        )  # fmt: skip


def stop_table(stops: Sequence[ReviewedStop]) -> str:
    units = {axis.name: axis.unit for axis in AXES}

    def shown(value: float | None, unit: str) -> str | None:
        return None if value is None else amount(value, unit)

    rows: list[Sequence[Cell]] = []
    for s in stops:
        unit = units[s.axis]
        speed = None if s.speed is None else signed(s.speed, f"{unit}/s")
        ways = shown(s.ran_on, unit), shown(s.bounced_back, unit)
        felt, lindy = shown(s.jerk, f"{unit}/s³"), shown(s.lindy_ran_on, unit)
        rows.append((s.axis, s.t, speed, *ways, s.seconds, felt, lindy, s.lindy_seconds))
    heads = ("axis", "at [s]", "speed", "ran on", "came back", "at rest after [s]", "jerk",
             "Lindy runs on", "for [s]")  # fmt: skip
    return table(heads, rows)


def _ways(found: Sequence[tuple[ReviewedStop, StopCurve | None]]) -> "Figure":
    """Of each axis that has stops: the way beyond the release, and Lindy's as a cross."""
    curves = [(stop, curve) for stop, curve in found if curve is not None]
    axes = [axis for axis in AXES if any(stop.axis == axis.name for stop, _ in curves)]
    drawn = figure(3.8)
    for n, axis in enumerate(axes):
        panel = drawn.add_subplot(1, len(axes), n + 1)
        turn = axis.unit == "rad"
        for stop, curve in curves:
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
    return drawn
