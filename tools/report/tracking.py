"""How well the vehicle followed its reference, and how smooth the reference was."""

import math

import msgspec
import numpy as np

from messages import topics
from tools.report.dive import Dive


class Limits(msgspec.Struct, frozen=True):
    """What the reference promised."""

    heave_jerk: float  # [m/s³]
    yaw_jerk: float  # [rad/s³]


def error_rms(dive: Dive, axis: str) -> float | None:
    """Root mean square of true motion minus reference while armed, [m] for heave, [rad] for yaw.

    The truth is interpolated at the sensor sample each reference is valid for. None: no truth, or
    never armed.
    """
    truth = dive.truth(axis)
    if truth is None:
        return None
    times, true = truth
    reference = dive[topics.REFERENCE]
    at = reference["valid"]
    use = (reference["armed"] > 0) & (at >= times[0]) & (at <= times[-1])
    if not use.any():
        return None
    error = np.interp(at[use], times, true) - reference[f"{axis} position"][use]
    return math.sqrt(float(np.mean(error * error)))


def peak_jerk_ratio(dive: Dive, limits: Limits | None) -> float | None:
    """Largest |jerk| of the armed reference over its limit, of heave and yaw the worse. None: no
    limits given, or never armed."""
    reference = dive[topics.REFERENCE]
    armed = reference["armed"] > 0
    if limits is None or not armed.any():
        return None
    heave = np.max(np.abs(reference["heave jerk"][armed])) / limits.heave_jerk
    yaw = np.max(np.abs(reference["yaw jerk"][armed])) / limits.yaw_jerk
    return float(max(heave, yaw))
