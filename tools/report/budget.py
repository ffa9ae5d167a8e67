"""The latency budget and the clock offset, as the link monitor measured them during the dive."""

import msgspec
import numpy as np

from messages import topics
from messages.link import DOWN_STAGES, UP_STAGES
from tools.recordings.columns import Array
from tools.report.dive import RecordedDive


class ReportedBudget(msgspec.Struct, frozen=True):
    """[ms] Medians of `link/latency` over the dive; None: never known."""

    down: dict[str, float | None]  # stick to thruster, by stage
    stick_to_thruster: float | None  # from end to end
    up: dict[str, float | None]  # sensor to screen, by stage; None where there was no screen
    sensor_to_screen: float | None


class Clocks(msgspec.Struct, frozen=True):
    """The drone's clock minus the topside's, as last known."""

    offset_ms: float | None
    bound_ms: float | None  # greatest error of the offset
    drift_ppm: float | None


def budget(dive: RecordedDive) -> ReportedBudget:
    measured = dive[topics.LATENCY]
    return ReportedBudget(
        down={stage: _median(measured[f"down {stage}"]) for stage in DOWN_STAGES},
        stick_to_thruster=_median(measured["stick"]),
        up={stage: _median(measured[f"up {stage}"]) for stage in UP_STAGES},
        sensor_to_screen=_median(measured["screen"]),
    )


def clocks(dive: RecordedDive) -> Clocks:
    clock = dive[topics.CLOCK]
    return Clocks(
        offset_ms=_last(clock["offset"] / 1e6),
        bound_ms=_last(clock["bound"] / 1e6),
        drift_ppm=_last(clock["drift"]),
    )


def _median(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(np.median(known)), 3) if len(known) else None


def _last(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(known[-1]), 3) if len(known) else None
