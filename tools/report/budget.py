"""Where the time went, by the link monitor's own account, and how far the two clocks were apart."""

import msgspec
import numpy as np

from messages import topics
from messages.link import DOWN_STAGES, UP_STAGES
from tools.report.columns import Array
from tools.report.dive import RecordedDive


class ReportedBudget(msgspec.Struct, frozen=True):
    """[ms] Medians over the dive of what `link/latency` said; None: it never knew."""

    down: dict[str, float | None]  # stick to thruster, by stage
    stick_to_thruster: float | None  # from end to end
    up: dict[str, float | None]  # sensor to screen, by stage; None where nobody had a screen
    sensor_to_screen: float | None


class Clocks(msgspec.Struct, frozen=True):
    """The drone's clock minus the topside's, as it was last known."""

    offset_ms: float | None
    bound_ms: float | None  # the true offset is no further off
    drift_ppm: float | None


def budget(dive: RecordedDive) -> ReportedBudget:
    said = dive[topics.LATENCY]
    return ReportedBudget(
        down={stage: _median(said[f"down {stage}"]) for stage in DOWN_STAGES},
        stick_to_thruster=_median(said["stick"]),
        up={stage: _median(said[f"up {stage}"]) for stage in UP_STAGES},
        sensor_to_screen=_median(said["screen"]),
    )


def clocks(dive: RecordedDive) -> Clocks:
    said = dive[topics.CLOCK]
    return Clocks(
        offset_ms=_last(said["offset"] / 1e6),
        bound_ms=_last(said["bound"] / 1e6),
        drift_ppm=_last(said["drift"]),
    )


def _median(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(np.median(known)), 3) if len(known) else None


def _last(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(known[-1]), 3) if len(known) else None
