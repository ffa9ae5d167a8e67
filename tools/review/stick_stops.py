"""Every stop of a dive, of any vehicle: how far it ran on after its stick was let go.

A vehicle that was not flown by Lindy has no reference to be compared with, so distances count from
where the stick was let go. Beside each stop is Lindy's: what its reference law makes of the same
speed, with the limits of the vehicle file.
"""

from collections.abc import Iterator, Sequence
from math import inf, radians
from typing import NamedTuple

import msgspec
import numpy as np

from messages import topics
from services.marine.vehicle import GRAVITY
from services.reference.guidance.axes import CENTRED
from services.reference.guidance.modes import HELD_AXES
from services.reference.settings import Settings
from services.reference.trajectory.minimum_jerk import Limits, solve
from services.reference.trajectory.position import travelled
from tools.log.armed_spans import ArmedSpan
from tools.recordings.columns import Array, StreamColumns
from tools.report import RecordedDive
from tools.report.columns import FLIGHT_MODES
from tools.report.jerk import BAND, LEAST, RATE, jerk_spectrum
from tools.report.stops import releases
from tools.review.beside import at as track_at
from tools.review.recorded import SensorColumns
from tools.review.track import Track

WINDOW_S = 8.0  # [s] of a stop at most
STICKS = ("surge", "sway", "heave", "yaw")
SHORTEST_S = LEAST / RATE  # [s] a shorter one is no stop: the next deflection came at once
SLOWEST_S = 0.2 / BAND  # [s] between samples, of which a jerk below `BAND` can be told
STILL_FOR_S = 0.5  # [s] so long below `still`: it has come to rest


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
    t: float  # [s] since the recording began
    # None, all four: nothing in the recording measures this axis, and its jerk alone is known.
    speed: float | None  # [m/s, rad/s] at the release
    ran_on: float | None  # [m, rad] farthest from where the stick was let go
    bounced_back: float | None  # [m, rad] from the farthest point back
    seconds: float | None  # [s] until it rested; None, too: not before the stick moved again
    jerk: float | None  # [m/s³, rad/s³] felt below 2 Hz, rms; None: too short
    lindy_ran_on: float | None  # [m, rad] Lindy's reference from the same speed; None: no limits
    lindy_seconds: float | None  # [s]


class StopCurve(NamedTuple):
    """One stop, to be drawn."""

    since: Array  # [s] since the release
    run: Array  # [m, rad] in the direction of the motion


class Stops(NamedTuple):
    stops: list[ReviewedStop]
    curves: list[StopCurve | None]  # of each; None: it is not known
    missing: list[str]  # what cannot be said, one sentence each


def reviewed_stops(
    dive: RecordedDive,
    motion: Track | None,
    imu: SensorColumns | None,
    limits: Settings,
    begin_ns: int,
    armed: Sequence[ArmedSpan] | None,
) -> Stops:
    """
    Args:
        dive: with the sticks that count.
        motion: as estimated, by us or else by the vehicle itself.
        limits: of Lindy's reference, from the vehicle file.
        begin_ns: [ns] from which the times of `motion` count, by the clock of the stamps.
        armed: a stop ends with its span; None: the recording does not say.
    """
    why = _nothing_moves(dive, armed)
    if motion is None or not len(motion.t) or why:
        why = why or "Nobody estimated the motion, so it is not known how far it ran on."
        return Stops([], [], [why])
    found: list[tuple[ReviewedStop, StopCurve | None]] = []
    missing: list[str] = []
    against = unknown = coasting = 0
    for axis in AXES:
        let_go = list(_let_go(dive, axis.name, armed, begin_ns, float(motion.t[-1])))
        felt = _felt(axis, motion, imu)
        if not np.isfinite(getattr(motion, axis.rate)).any():
            found += filter(None, [_only_felt(axis, begin, end, felt) for _, begin, end in let_go])
            missing += _unmeasured(axis, len(let_go))
            continue
        for sign, begin, end in let_go:
            if not _holds(dive, axis.name, begin_ns + 1e9 * begin):
                coasting += 1
                continue
            moved = _moved(axis, motion, begin, end)
            unknown += moved is None
            if moved is None or (stop := _measured(axis, moved, felt, limits)) is None:
                continue
            if sign * (stop[0].speed or 0.0) < 0.0:
                against += 1
            else:
                found.append(stop)
    found.sort(key=lambda pair: pair[0].t)
    missing += _left_out(against, unknown, coasting)
    if not found and not missing:
        missing.append("No stick was let go while the vehicle moved along its axis.")
    return Stops([stop for stop, _ in found], [curve for _, curve in found], missing)


def _unmeasured(axis: StopAxis, count: int) -> list[str]:
    if not count:
        return []
    return [
        f"The {axis.name} stick was let go {_times(count)}, but nothing in the "
        f"recording measures {axis.name}: at most its jerk is known."
    ]


def _left_out(against: int, unknown: int, coasting: int) -> list[str]:
    """One sentence for each reason for which a stop does not count."""
    said: list[str] = []
    if against:
        said.append(
            f"{_times(against).capitalize()} a stick was let go while the vehicle still moved the "
            f"other way; that is no stop of it and left out."
        )
    if unknown:
        said.append(
            f"{_times(unknown).capitalize()} a stick was let go, but the motion after it is not "
            f"known throughout; that is left out."
        )
    if coasting:
        said.append(
            f"{_times(coasting).capitalize()} a stick was let go in a flight mode in which it is a "
            f"force, so that the vehicle coasts; that is no stop and left out."
        )
    return said


def _holds(dive: RecordedDive, axis: str, at_ns: float) -> bool:
    """Does the drone hold an axis whose stick is let go? Of surge and sway, and of a vehicle that
    another program flew, every release is looked at."""
    status = dive[topics.STATUS]
    row = int(np.searchsorted(status["stamp"], at_ns, side="right")) - 1
    if axis not in ("heave", "yaw") or row < 0 or not dive[topics.REFERENCE].count:
        return True
    held = HELD_AXES[FLIGHT_MODES[int(status["flight mode"][row])]]
    return held.depth if axis == "heave" else held.heading


def _nothing_moves(dive: RecordedDive, armed: Sequence[ArmedSpan] | None) -> str:
    """Why no stick counts. Empty: some may."""
    if not dive[topics.PILOT_COMMAND].count:
        return "The recording holds no sticks, so nobody knows when they were let go."
    if armed is not None and not armed:
        return "The vehicle was never armed, so its sticks moved nothing."
    return ""


def _let_go(
    dive: RecordedDive,
    axis: str,
    armed: Sequence[ArmedSpan] | None,
    begin_ns: int,
    last: float,
) -> Iterator[tuple[float, float, float]]:
    """(sign of the deflection before, begin [s], end [s]) of every time a stick was let go for long
    enough. One that ends with its armed span was not; one that the vehicle then goes on from by
    itself ends there, as all do where the motion ends, at `last` [s]."""
    status = dive[topics.STATUS]
    by_itself = status["stamp"][status["own way"] > 0.0] if status.count else np.zeros(0)
    for release in releases(dive, axis):
        begin, end = (release.begin - begin_ns) / 1e9, (release.end - begin_ns) / 1e9
        if (disarmed := _disarmed(armed, begin)) is not None:
            later = (by_itself[by_itself > release.begin] - begin_ns) / 1e9
            goes = float(later[0]) if len(later) else inf
            end = min(end, disarmed, goes, begin + WINDOW_S, last)
            if end - begin >= SHORTEST_S:
                yield release.sign, begin, end


def counting(dive: RecordedDive, armed: Sequence[ArmedSpan] | None, begin_ns: int) -> RecordedDive:
    """The same with sticks at zero where they are as good as centred, because a foreign log has
    them as the pad said them, and where they move nothing, because the vehicle is not armed.

    Args:
        armed: [s] since `begin_ns`; None: the recording does not say, so all count.
        begin_ns: [ns] by the clock of the stamps.
    """
    command = dive[topics.PILOT_COMMAND]
    names = ("stamp", *STICKS, "deflection", "lost", "epoch")
    columns = [command[name].copy() for name in names]
    for column in columns[1:6]:
        column[np.abs(column) < CENTRED] = 0.0
    if armed is not None:
        t = (columns[0] - begin_ns) / 1e9
        idle = [_disarmed(armed, at) is None for at in t.tolist()]
        for column in columns[1:6]:
            column[idle] = 0.0
    streams = {
        **dive.streams, topics.PILOT_COMMAND.key: StreamColumns(names, np.column_stack(columns))
    }  # fmt: skip
    return RecordedDive(dive.about, dive.traffic, streams)


def _disarmed(armed: Sequence[ArmedSpan] | None, t: float) -> float | None:
    """[s] Until when it stays armed. None: at `t` it is not."""
    if armed is None:
        return inf
    inside = [span for span in armed if span.from_s <= t and (t < span.to_s or not span.ended)]
    return None if not inside else inside[0].to_s if inside[0].ended else inf


def limits_of(axis: str, settings: Settings) -> Limits | None:
    """Of Lindy's velocity reference; surge and sway have one with a measured position only."""
    return {"heave": settings.heave.limits, "yaw": settings.yaw.limits}.get(axis)


def _moved(
    axis: StopAxis, motion: Track, begin: float, end: float
) -> tuple[Array, Array, Array] | None:
    """Times [s], rate and position along an axis, `RATE` a second. None: not known throughout."""
    grid = np.arange(begin, end, 1.0 / RATE)
    rate = track_at(motion, axis.rate, grid)
    position = track_at(motion, axis.position, grid) if axis.position else None
    if axis.position == "" and rate is not None:
        position = np.cumsum(rate) / RATE
    if rate is None or position is None or not np.isfinite(rate + position).all():
        return None
    return grid, rate, position


def _measured(
    axis: StopAxis,
    moved: tuple[Array, Array, Array],
    felt: tuple[Array, Array] | None,
    settings: Settings,
) -> tuple[ReviewedStop, StopCurve] | None:
    """None: it did not move."""
    grid, rate, position = moved
    if abs(rate[0]) < axis.moving:
        return None
    sign = float(np.sign(rate[0]))
    run = sign * (position - position[0])
    farthest = int(np.argmax(run))
    plan = limits_of(axis.name, settings)
    segments = [] if plan is None else solve(abs(float(rate[0])), 0.0, 0.0, plan)
    stop = ReviewedStop(
        axis=axis.name,
        t=round(float(grid[0]), 3),
        speed=_digits(float(rate[0])),
        ran_on=_digits(float(run[farthest])),
        bounced_back=_digits(float(run[farthest] - run[farthest:].min())),
        seconds=_rest_s(np.abs(rate) < axis.still),
        jerk=_jerk(felt, grid),
        lindy_ran_on=_digits(travelled(segments)) if plan else None,
        lindy_seconds=_digits(sum(each.duration for each in segments)) if plan else None,
    )
    return stop, StopCurve(grid - grid[0], run)


def _only_felt(
    axis: StopAxis, begin: float, end: float, felt: tuple[Array, Array] | None
) -> tuple[ReviewedStop, None] | None:
    """None: not even its jerk is known."""
    grid = np.arange(begin, end, 1.0 / RATE)
    if (jerk := _jerk(felt, grid)) is None:
        return None
    stop = ReviewedStop(
        axis=axis.name, t=round(begin, 3), speed=None, ran_on=None, bounced_back=None,
        seconds=None, jerk=jerk, lindy_ran_on=None, lindy_seconds=None,
    )  # fmt: skip
    return stop, None


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _rest_s(slow: np.ndarray) -> float | None:
    """[s] First time from which on it is slow for `STILL_FOR_S`. None: never."""
    need = round(STILL_FOR_S * RATE)
    run = np.convolve(slow, np.ones(need), mode="valid") >= need - 0.5
    return round(float(np.argmax(run)) / RATE, 2) if run.any() else None


def _felt(axis: StopAxis, motion: Track, imu: SensorColumns | None) -> tuple[Array, Array] | None:
    """(times, acceleration of the axis): its jerk is what a camera feels."""
    if axis.name == "heave":
        t, acceleration = motion.known("depth_acceleration")
        return (t, acceleration) if len(t) else None
    if axis.name == "yaw":
        t, rate = motion.known("yaw_rate")
        return (t, np.gradient(rate, t)) if len(t) > 1 else None
    if imu is None:
        return None
    roll, pitch = (track_at(motion, name, imu.stamp) for name in ("roll", "pitch"))
    if roll is None or pitch is None:
        return None
    if axis.name == "surge":
        acceleration = imu.values[:, 3] - GRAVITY * np.sin(pitch)
    else:
        acceleration = imu.values[:, 4] + GRAVITY * np.sin(roll) * np.cos(pitch)
    known = np.isfinite(acceleration)
    return (imu.stamp[known], acceleration[known]) if known.any() else None


def _jerk(felt: tuple[Array, Array] | None, grid: Array) -> float | None:
    """[per s³] Root mean square below `BAND`."""
    if felt is None or len(grid) < LEAST or np.median(np.diff(felt[0])) > SLOWEST_S:
        return None
    if not felt[0][0] <= grid[0] <= grid[-1] <= felt[0][-1]:
        return None
    return _digits(jerk_spectrum(np.interp(grid, *felt)).rms(BAND))


def _digits(value: float) -> float:
    return float(f"{value:.3g}") + 0.0  # no -0
