"""How well the vehicle followed its reference, and how smooth the reference was."""

import math

import numpy as np

from messages import topics
from tools.report.dive import RecordedDive


def error_rms(dive: RecordedDive, axis: str) -> float | None:
    """Root mean square of true motion minus reference while armed, [m] for heave, [rad] for yaw.

    The truth is interpolated at the sensor sample each reference is valid for. None: no truth, or
    never armed.
    """
    truth = dive.truth(axis)
    if truth is None:
        return None
    times, true = truth
    squares, count = 0.0, 0
    for at, armed, position in dive[topics.REFERENCE].parts("valid", "armed", f"{axis} position"):
        use = (armed > 0) & (at >= times[0]) & (at <= times[-1])
        error = np.interp(at[use], times, true) - position[use]
        squares += float(np.sum(error * error))
        count += len(error)
    return math.sqrt(squares / count) if count else None


def peak_jerk_ratio(dive: RecordedDive) -> float | None:
    """Largest |jerk| of the armed reference over the limit in force at that moment, of heave and
    yaw the worse. None: never armed, or a path set the pace all the time."""
    columns = ("armed", "heave jerk", "heave jerk limit", "yaw jerk", "yaw jerk limit")
    highest, known = 0.0, False
    for armed, *jerks in dive[topics.REFERENCE].parts(*columns):
        for jerk, limit in (jerks[:2], jerks[2:]):
            ratios = (np.abs(jerk) / limit)[armed > 0]
            known = known or bool(np.isfinite(ratios).any())
            highest = max(highest, float(np.max(ratios[~np.isnan(ratios)], initial=0.0)))
    return highest if known else None
