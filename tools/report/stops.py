"""Every stop of a dive: how far the vehicle ran past where the reference came to rest, and how long
it took to stay there. The bounce-back a pilot sees when letting go of the stick.

A stop begins when the stick of heave or yaw goes from deflected to zero: because the pilot let
go, requested a stop, or was lost. It ends when that stick is deflected again, the drone is
disarmed or the recording ends. A stop counts if the reference is at rest when it ends; a shorter
one has no final reference to run past.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, radians
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from services.reference.guidance.axes import CENTRED
from tools.recordings.columns import Array
from tools.report.dive import RecordedDive
from tools.report.stop_ends import stop_ends

Flags = NDArray[np.bool_]
Source = tuple[Array, str, Array | Flags]  # times [ns], what they say, values
StopAxis = Literal["heave", "yaw"]
REST_VELOCITY = 1e-3  # [m/s, rad/s] a reference slower than this …
REST_ACCELERATION = 1e-2  # [m/s², rad/s²] … and steadier than this is at rest
SETTLED: dict[StopAxis, float] = {"heave": 0.05, "yaw": radians(1.0)}  # [m, rad] from the reference


class StickStop(msgspec.Struct, frozen=True):
    axis: StopAxis
    t: float  # [s] since the first arming, of the release
    overshoot: float  # [m] or [rad] of the true motion past the final reference, never negative
    settle_s: float | None  # [s] from the release until it stays within SETTLED; None: never


@dataclass(frozen=True, slots=True)
class StickRelease:
    """One release of a stick."""

    begin: float  # [ns]
    end: float  # [ns] next deflection of the same stick or what else moves the drone, or infinity
    sign: float  # of the deflection before


def stops(dive: RecordedDive) -> list[StickStop]:
    """All stops in order of time; none on a dive without truth or without arming."""
    found: list[StickStop] = []
    valid = dive[topics.REFERENCE]["valid"]
    axes: tuple[StopAxis, ...] = ("heave", "yaw")
    for axis in axes:
        if (truth := dive.truth(axis)) is not None:
            ends = np.append(stop_ends(dive, axis), inf)
            for release in releases(dive, axis):
                whole = replace(release, end=min(release.end, _next(ends, release)))
                stop = _measure(dive, axis, whole, truth, valid)
                found += [] if stop is None else [stop]
    return sorted(found, key=lambda stop: stop.t)


def _next(ends: Array, release: StickRelease) -> float:
    """[ns] First of the ends, the last of which is infinity, that is not before the release."""
    return float(ends[np.searchsorted(ends, release.begin)])


def releases(dive: RecordedDive, axis: str) -> Iterator[StickRelease]:
    """Every time the stick of surge, sway, heave or yaw went from deflected to zero."""
    stick, since, sign = 0.0, None, 0.0
    for at, wanted in _wanted(dive, axis):
        if stick != 0.0 and wanted == 0.0:
            since, sign = at, np.sign(stick)
        elif wanted != 0.0 and since is not None:
            yield StickRelease(since, at, float(sign))
            since = None
        stick = wanted
    if since is not None:
        yield StickRelease(since, inf, float(sign))


def _wanted(dive: RecordedDive, axis: str) -> Iterator[tuple[float, float]]:
    """(time [ns], sign of the stick that counts): zero while the pilot is lost or a failsafe acts,
    and after a stop request until all sticks have been centred."""
    now = {"stick": 0.0, "lost": 0.0, "failsafe": 0.0, "stop": 0.0}
    for at, kind, value in _events(dive, axis):
        if kind == "centred":
            if value and not now["lost"]:
                now["stop"] = 0.0
        elif kind == "stop":
            now["stop"] = max(now["stop"], value)
        else:
            now[kind] = value
        yield at, 0.0 if now["lost"] or now["failsafe"] or now["stop"] else now["stick"]


def _events(dive: RecordedDive, axis: str) -> list[tuple[float, str, float]]:
    """(time [ns], kind, value) of everything that decides whether a stick counts, by time."""
    command, request = dive[topics.PILOT_COMMAND], dive[topics.PILOT_REQUEST]
    status = dive[topics.STATUS]
    holder = _in_control(dive)
    sources: list[Source] = [
        (command["stamp"][holder], "lost", command["lost"][holder]),
        (command["stamp"][holder], "centred", command["deflection"][holder] < CENTRED),
        (command["stamp"][holder], "stick", np.sign(command[axis][holder])),
        (request["stamp"], "stop", request["stop"]),
        (status["stamp"], "failsafe", status["failsafe"]),
    ]
    events = [
        (at, kind, value)
        for times, kind, values in _that_matter(sources)
        for at, value in zip(times.tolist(), values.tolist(), strict=True)
    ]
    return sorted(events, key=lambda event: event[0])


def _that_matter(sources: list[Source]) -> Iterator[Source]:
    """The same without what only repeats what was said before: of hours a hundredth is left. A
    request is none, and sticks that are still centred behind a request or a loss are none."""
    asked = [
        times if kind == "stop" else times[_changed(values)]
        for times, kind, values in sources
        if kind in ("stop", "lost")
    ]
    others = np.concatenate(asked)
    for times, kind, values in sources:
        news = _changed(values) | (kind == "stop")
        if kind == "centred":
            for side in ("left", "right"):
                behind = np.searchsorted(times, others, side=side)
                news[behind[behind < len(times)]] = True
        yield times[news], kind, values[news]


def _changed(values: Array | Flags) -> Flags:
    """Of each value: is it the first, or another than the one before?"""
    return np.append(True, values[1:] != values[:-1])[: len(values)]


def _in_control(dive: RecordedDive) -> Flags:
    """Of each command: does it carry the epoch that acts, which the newest reference names? Every
    command does before there is one."""
    command, reference = dive[topics.PILOT_COMMAND], dive[topics.REFERENCE]
    newest = np.searchsorted(reference["valid"], command["stamp"], side="right")
    acting = np.append(0.0, reference["epoch"])[newest]
    return (acting == 0.0) | (command["epoch"] == acting)


def _measure(
    dive: RecordedDive,
    axis: StopAxis,
    release: StickRelease,
    truth: tuple[Array, Array],
    valid: Array,
) -> StickStop | None:
    """One stop compared with the truth (times [ns], motion), or None if it does not count.

    The direction is that of the reference's velocity at the release, or, if the reference was still
    at rest after a very short deflection, that of the stick. `valid` [ns] are its times.
    """
    reference = dive[topics.REFERENCE]
    first, last = _armed_span(dive, valid, release)
    if dive.armed is None or first == last or not _at_rest(dive, axis, last - 1):
        return None
    final = reference[f"{axis} position"][last - 1]
    velocity = reference[f"{axis} velocity"][first]
    direction = np.sign(velocity) if abs(velocity) > REST_VELOCITY else release.sign
    times, true = truth
    begin, end = np.searchsorted(times, [release.begin, valid[last - 1]])
    if begin == end:
        return None
    past = direction * (true[begin:end] - final)
    return StickStop(
        axis=axis,
        t=(release.begin - dive.armed[0]) / 1e9,
        overshoot=max(0.0, float(np.max(past))),
        settle_s=_settle_s(times[begin:end] - release.begin, np.abs(past) <= SETTLED[axis]),
    )


def _armed_span(dive: RecordedDive, valid: Array, release: StickRelease) -> tuple[int, int]:
    """Rows of the reference from the release to its end, as long as the drone stayed armed."""
    reference = dive[topics.REFERENCE]
    first, last = np.searchsorted(valid, [release.begin, release.end])
    disarmed = np.flatnonzero(reference["armed"][first:last] == 0)
    return int(first), int(first + disarmed[0] if len(disarmed) else last)


def _at_rest(dive: RecordedDive, axis: StopAxis, row: int) -> bool:
    reference = dive[topics.REFERENCE]
    velocity, acceleration = (
        float(reference[f"{axis} {of}"][row]) for of in ("velocity", "acceleration")
    )
    return abs(velocity) < REST_VELOCITY and abs(acceleration) < REST_ACCELERATION


def _settle_s(since: Array, near: Flags) -> float | None:
    """First of the times `since` [ns] from which on every sample is near, in s."""
    far = np.flatnonzero(~near)
    if not len(far):
        return 0.0
    return None if far[-1] == len(near) - 1 else float(since[far[-1] + 1]) / 1e9
