"""Figures of a dive: the energy it used, what the drone did by itself, how well the vehicle
followed its reference, and how smooth the reference was."""

import math
from typing import cast

import msgspec
import numpy as np

from messages import topics
from messages.vehicle import Failsafe, Reaction
from tools.analysis.dive import FIELD, RecordedDive
from tools.recordings.columns import StreamColumns

FASTEST = 20.0  # [1/h] no battery of a drone gives its whole capacity in three minutes
ROUGH = 1e-3  # [-] of the capacity: a gauge may count in steps as large as this, so less used is
# not measured
# [h] Longer no battery of a drone lasts: a BlueROV2 whose thrusters stand still empties its own in
# 18. The drone is fed from elsewhere, as Minerva from its ship, or the gauge does not count all.
LONGEST_H = 24.0


class Energy(msgspec.Struct, frozen=True):
    thrust_squared_n2s: float  # [N² s] sum of thrust² over all thrusters and time
    wh: float  # [Wh] electrical, thrusters and all the rest, from `Actuation`
    battery_wh: float | None  # [Wh] out of the battery
    endurance_h: float | None  # [h] a full battery lasts, used as in this dive


def energy(dive: RecordedDive) -> Energy:
    """Integrals over the whole recording by the trapezium rule, from `Actuation`."""
    actuation = dive[topics.ACTUATION]
    seconds = (actuation["stamp_ns"] - actuation["stamp_ns"][:1]) / 1e9
    used, endurance = _battery(dive)
    return Energy(
        thrust_squared_n2s=float(np.trapezoid(actuation["thrust_squared"], seconds)),
        wh=float(np.trapezoid(actuation["power"], seconds)) / 3600.0,
        battery_wh=used,
        endurance_h=endurance,
    )


def _battery(dive: RecordedDive) -> tuple[float | None, float | None]:
    """[Wh] used and [h] of endurance, where the battery reports them, what it reports was used in
    this dive, and it can be true."""
    battery = dive[topics.BATTERY]
    if battery.count < 2 or not np.isfinite(battery["used_wh"]).all() or _jumped(battery):
        return None, None
    used = float(battery["used_wh"][-1] - battery["used_wh"][0])
    hours = float(battery["stamp_ns"][-1] - battery["stamp_ns"][0]) / 3.6e12
    capacity = float(battery["capacity_wh"][-1])
    if not used > ROUGH * capacity or not capacity >= battery["used_wh"][-1]:  # or not known
        return used, None
    lasts = capacity * hours / used
    return used, lasts if lasts <= LONGEST_H else None


def _jumped(battery: StreamColumns) -> bool:
    """Did the used energy become less, or more by what no battery gives in that time? A fault, a
    restart or another battery does that."""
    steps, hours = np.diff(battery["used_wh"]), np.diff(battery["stamp_ns"]) / 3.6e12
    most = battery["capacity_wh"][1:] * np.maximum(ROUGH, FASTEST * hours)  # NaN: not known
    return bool(np.any(steps < 0.0) or np.any(steps > most))


class ActedReaction(msgspec.Struct, frozen=True):
    """One reaction, from its beginning to the next change."""

    condition: Failsafe
    reaction: Reaction
    t: float  # [s] since the first arming
    seconds: float  # [s] that it lasted, or until the last status
    noticed: float | None = None  # [s] since the first arming, of the beginning of the condition


def failsafes(dive: RecordedDive) -> list[ActedReaction]:
    """All reactions in order of time; none on a dive without arming."""
    status, armed = dive[topics.STATUS], dive.armed
    if armed is None or not status.count:
        return []
    stamp, acting, doing = status["stamp_ns"], status["failsafe"], status["reaction"]
    acts = ~status.said("failsafe", "none") & np.isfinite(doing)
    changed = (np.diff(acting) != 0) | (np.diff(np.nan_to_num(doing, nan=-1.0)) != 0)
    begins = [0, *(np.flatnonzero(changed) + 1).tolist()]
    ends = [*begins[1:], status.count - 1]
    return [
        ActedReaction(
            condition=cast(Failsafe, status.words[int(acting[begin])]),
            reaction=cast(Reaction, status.words[int(doing[begin])]),
            t=float(stamp[begin] - armed[0]) / 1e9,
            seconds=float(stamp[end] - stamp[begin]) / 1e9,
            noticed=float(since - armed[0]) / 1e9 if np.isfinite(since) else None,
        )
        for begin, end, since in zip(begins, ends, status["since_ns"][begins], strict=True)
        if acts[begin]
    ]


def error_rms(dive: RecordedDive, axis: str) -> float | None:
    """Root mean square of true motion minus reference while armed, [m] for heave, [rad] for yaw.

    The truth is interpolated at the sensor sample each reference is valid for. None: no truth, or
    never armed.
    """
    truth = dive.truth(axis)
    if truth is None:
        return None
    times, true = truth
    reference = dive[topics.REFERENCE]
    at = reference["valid_ns"]
    use = (reference["armed"] > 0) & (at >= times[0]) & (at <= times[-1])
    error = np.interp(at[use], times, true) - reference[f"{FIELD[axis]}.position"][use]
    return math.sqrt(float(np.mean(error * error))) if len(error) else None


def peak_jerk_ratio(dive: RecordedDive) -> float | None:
    """Largest |jerk| of the armed reference over the limit in force at that moment, of heave and
    yaw the worse. None: never armed, or a path set the pace all the time."""
    reference = dive[topics.REFERENCE]
    armed = reference["armed"] > 0
    ratios = [
        (np.abs(reference[f"{field}.jerk"]) / reference[f"{field}.jerk_limit"])[armed]
        for field in FIELD.values()
    ]
    known = np.concatenate(ratios)
    known = known[~np.isnan(known)]
    return float(np.max(known)) if np.isfinite(known).any() else None
