"""Every stop of a dive: how far the vehicle ran past where the reference came to rest, and how long
it took to stay there. The bounce-back a pilot sees when letting go of the stick.

A stop begins when the stick of heave or yaw goes from deflected to zero: because the pilot let
go, requested a stop, or was lost. It ends when that stick is deflected again, the drone is
disarmed or the recording ends. A stop counts if the reference is at rest when it ends; a shorter
one has no final reference to run past.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, radians
from typing import Any, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.vehicle import OWN_WAY
from services.reference.guidance.axes import CENTRED
from tools.analysis.dive import FIELD, STICKS, RecordedDive, kept
from tools.log.cut import ArmedSpan
from tools.recordings.columns import Array, Flags

StopAxis = Literal["heave", "yaw"]
REST_VELOCITY = 1e-3  # [m/s, rad/s] a reference slower than this …
REST_ACCELERATION = 1e-2  # [m/s², rad/s²] … and steadier than this is at rest
SETTLED: dict[StopAxis, float] = {"heave": 0.05, "yaw": radians(1.0)}  # [m, rad] from the reference


class StickStop(msgspec.Struct, frozen=True):
    axis: StopAxis
    t: float  # [s] since the first arming, of the release
    overshoot: float  # [m] or [rad] of the motion past the final reference, never negative
    settle_s: float | None  # [s] from the release until it stays within SETTLED; None: never
    by: Literal["estimate"] | msgspec.UnsetType = msgspec.UNSET  # where no simulator knew better


@dataclass(frozen=True, slots=True)
class StickRelease:
    """One release of a stick."""

    begin: float  # [ns]
    end: float  # [ns] next deflection of the same stick or what else moves the drone, or infinity
    sign: float  # of the deflection before


def stops(dive: RecordedDive) -> list[StickStop]:
    """All stops in order of time; none on a dive without arming. Where there is no simulator, as
    on a real dive, the drone's own estimate says how it moved."""
    found: list[StickStop] = []
    axes: tuple[StopAxis, ...] = ("heave", "yaw")
    for axis in axes:
        by = msgspec.UNSET if dive[topics.TRUTH].count else "estimate"
        known = dive.estimate(axis) if by else dive.truth(axis)
        if known is not None:
            learnt = np.zeros(len(known[0]))
            if by and axis == "heave":
                learnt = kept(dive[topics.STATE]["depth_corrected"])
            ends = np.append(stop_ends(dive, axis), inf)
            for release in releases(dive, axis):
                end = min(release.end, float(ends[np.searchsorted(ends, release.begin)]))
                until_then = StickRelease(release.begin, end, release.sign)
                stop = _measure(dive, axis, until_then, *known, learnt)
                found += [] if stop is None else [msgspec.structs.replace(stop, by=by)]
    return sorted(found, key=lambda stop: stop.t)


def releases(dive: RecordedDive, axis: str) -> list[StickRelease]:
    """Every time the stick of surge, sway, heave or yaw went from deflected to zero. It counts as
    zero while the pilot is lost or a failsafe acts, and after a stop request until all sticks have
    been centred."""
    command, request, status = (
        dive[topic] for topic in (topics.PILOT_COMMAND, topics.PILOT_REQUEST, topics.STATUS)
    )
    acts = _in_control(dive)
    at, lost = command["stamp_ns"][acts], command.said("pilot", "lost")[acts]
    centred = np.max([np.abs(command[name]) for name in STICKS], axis=0)[acts] < CENTRED
    # Of a command it counts first whether its pilot is lost, then whether it is centred, then its
    # stick.
    times = np.concatenate([np.repeat(at, 3), request["stamp_ns"], status["stamp_ns"]])
    order = np.argsort(times, kind="stable")
    times, rows = times[order], np.argsort(order, kind="stable")
    of_command, others = rows[: 3 * len(at)].reshape(-1, 3), rows[3 * len(at) :]
    asked = others[: request.count][request.said("kind", "stop")]
    centring = of_command[:, 1][centred & ~lost]
    count = len(times)
    stopped = _from(count, asked, asked + 1.0) > _from(count, centring, centring + 1.0)
    idle = _from(count, of_command[:, 0], lost) + _from(
        count, others[request.count :], ~status.said("failsafe", "none")
    )
    stick = _from(count, of_command[:, 2], np.sign(command[axis][acts]))
    wanted = np.where(stopped | (idle > 0.0), 0.0, stick)
    before = np.append(0.0, wanted[:-1])
    deflected = np.flatnonzero(wanted)
    let_go = np.flatnonzero((before != 0.0) & (wanted == 0.0))
    ends = np.append(times[deflected], inf)[np.searchsorted(deflected, let_go)]
    return [
        StickRelease(*each)
        for each in zip(times[let_go].tolist(), ends.tolist(), before[let_go].tolist(), strict=True)
    ]


def _from(count: int, rows: NDArray[np.intp], values: NDArray[Any]) -> Array:
    """(count,) Each value from its row on; zero before the first."""
    newest = np.searchsorted(rows, np.arange(count), side="right")
    return np.append(0.0, values)[newest]


def _in_control(dive: RecordedDive) -> Flags:
    """Of each command: does it carry the epoch that acts, which the newest reference names? Every
    command does before there is one."""
    command, reference = dive[topics.PILOT_COMMAND], dive[topics.REFERENCE]
    newest = np.searchsorted(reference["valid_ns"], command["stamp_ns"], side="right")
    acting = np.append(0.0, reference["epoch"])[newest]
    return (acting == 0.0) | (command["epoch"] == acting)


def counting(dive: RecordedDive, armed: Sequence[ArmedSpan] | None) -> RecordedDive:
    """The same with sticks at zero where they are as good as centred, because a foreign log has
    them as the pad said them, and where they move nothing, because the vehicle is not armed.

    Args:
        armed: by the clock of the dive's times; None: the recording does not say, so all count.
    """
    command = dive[topics.PILOT_COMMAND]
    times = command["stamp_ns"]
    idle = np.array([armed_until(armed, at / 1e9) is None for at in times.tolist()], dtype=bool)
    sticks = {
        name: np.where(idle | (np.abs(command[name]) < CENTRED), 0.0, command[name])
        for name in STICKS
    }
    counted = command.with_columns({"stamp_ns": times, **sticks})
    return replace(dive, streams={**dive.streams, topics.PILOT_COMMAND.key: counted})


def armed_until(armed: Sequence[ArmedSpan] | None, t: float) -> float | None:
    """[s] Until when it stays armed. None: at `t` it is not."""
    if armed is None:
        return inf
    inside = [span for span in armed if span.from_s <= t and (t < span.to_s or not span.ended)]
    return None if not inside else inside[0].to_s if inside[0].ended else inf


def stop_ends(dive: RecordedDive, axis: str) -> Array:
    """[ns] Ascending: every instant at which a failsafe, a path of the drone's own or another
    flight mode moves the reference, or the estimate it is compared with jumps or is not valid. A
    drone that only comes to rest and holds goes on with the same stop.

    Args:
        axis: heave or yaw.
    """
    status, state = dive[topics.STATUS], dive[topics.STATE]
    moving = (
        status.said("reaction", "ascend", "surface")
        | status.said("failsafe", "state_lost", "imu_lost")
        | status.said("activity", *OWN_WAY)
        | _changed(status["flight_mode"])
    )
    unknown = state[f"{FIELD[axis]}.valid"] == 0
    if axis == "heave":
        moving = moving | status.said("flight_mode", "altitude_hold")  # the bottom does
        unknown = unknown | _changed(np.nan_to_num(state["depth_moved"]))
    return np.sort(np.concatenate([status["stamp_ns"][moving], state["sensor_ns"][unknown]]))


def _changed(values: Array) -> Flags:
    """Of each value: does it differ from the one before?"""
    return np.diff(values, prepend=values[:1]) != 0.0


def _measure(
    dive: RecordedDive,
    axis: StopAxis,
    release: StickRelease,
    times: Array,
    motion: Array,
    learnt: Array,
) -> StickStop | None:
    """One stop, or None if it does not count.

    The direction is that of the reference's velocity at the release, or, if the reference was still
    at rest after a very short deflection, that of the stick.

    Args:
        times, motion: [ns], [m] or [rad] as known.
        learnt: [m] or [rad] sum of what corrected the place where it came to rest.
    """
    reference = dive[topics.REFERENCE]
    valid = reference["valid_ns"]
    position, velocity, acceleration = (
        reference[f"{FIELD[axis]}.{of}"] for of in ("position", "velocity", "acceleration")
    )
    # As long as the drone stayed armed.
    first, last = np.searchsorted(valid, [release.begin, release.end])
    disarmed = np.flatnonzero(reference["armed"][first:last] == 0)
    last = first + disarmed[0] if len(disarmed) else last
    if dive.armed is None or first == last:
        return None
    end = last - 1
    if abs(velocity[end]) >= REST_VELOCITY or abs(acceleration[end]) >= REST_ACCELERATION:
        return None
    moves = abs(velocity[first]) > REST_VELOCITY
    direction = np.sign(velocity[first]) if moves else release.sign
    begin, until = np.searchsorted(times, [release.begin, float(valid[end])])
    if begin == until:
        return None
    true = motion + learnt[until - 1] - learnt
    past = direction * (true[begin:until] - position[end])
    return StickStop(
        axis=axis,
        t=(release.begin - dive.armed[0]) / 1e9,
        overshoot=max(0.0, float(np.max(past))),
        settle_s=_settle_s(times[begin:until] - release.begin, np.abs(past) <= SETTLED[axis]),
    )


def _settle_s(since: Array, near: Flags) -> float | None:
    """First of the times `since` [ns] from which on every sample is near, in s."""
    far = np.flatnonzero(~near)
    if not len(far):
        return 0.0
    return None if far[-1] == len(near) - 1 else float(since[far[-1] + 1]) / 1e9
