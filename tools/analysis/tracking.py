"""How well the vehicle followed its reference, and how smooth the reference was."""

import math

import numpy as np

from messages import topics
from tools.analysis.dive import FIELD, RecordedDive


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
