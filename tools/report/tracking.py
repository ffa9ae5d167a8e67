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
    reference = dive[topics.REFERENCE]
    at = reference["valid"]
    use = (reference["armed"] > 0) & (at >= times[0]) & (at <= times[-1])
    error = np.interp(at[use], times, true) - reference[f"{axis} position"][use]
    return math.sqrt(float(np.mean(error * error))) if len(error) else None


def peak_jerk_ratio(dive: RecordedDive) -> float | None:
    """Largest |jerk| of the armed reference over the limit in force at that moment, of heave and
    yaw the worse. None: never armed, or a path set the pace all the time."""
    reference = dive[topics.REFERENCE]
    ratios = np.concatenate(
        [
            (np.abs(reference[f"{axis} jerk"]) / reference[f"{axis} jerk limit"])[
                reference["armed"] > 0
            ]
            for axis in ("heave", "yaw")
        ]
    )
    if not np.isfinite(ratios).any():
        return None
    return float(np.max(ratios[~np.isnan(ratios)]))
