"""How old each camera's picture was once it was whole topside, as `camera_monitor` measured it."""

import msgspec
import numpy as np

from messages import cameras, topics
from messages.video import PICTURE_STAGES
from tools.recordings.columns import Array, StreamColumns
from tools.report.dive import RecordedDive


class PictureReport(msgspec.Struct, frozen=True):
    """Of the whole dive. None: no picture could be decoded."""

    p50_ms: float | None  # [ms] light to picture
    p99_ms: float | None  # [ms]
    stages_ms: dict[str, float | None]  # [ms] medians, by stage
    per_second: float  # [1/s] pictures that can be decoded


def picture(dive: RecordedDive) -> PictureReport | msgspec.UnsetType:
    """Of the first camera. Unset: there was none."""
    measured = dive[topics.PICTURE_AGE]
    return _of(measured) if measured.count else msgspec.UNSET


def further_pictures(dive: RecordedDive) -> dict[str, PictureReport] | msgspec.UnsetType:
    """Of each further camera, by name. Unset: there was none."""
    keys = sorted(filter(topics.FURTHER_AGE.covers, dive.streams))
    return {cameras.camera_of(key) or key: _of(dive.streams[key]) for key in keys} or msgspec.UNSET


def _of(measured: StreamColumns) -> PictureReport:
    rate = measured["rate"]
    seen = np.isfinite(measured["p50"])
    # A report has the worst of its n pictures; all n are below the 99th percentile in 0.99^n of
    # the reports.
    pictures = float(np.mean(rate[seen])) / topics.PICTURE_AGE.hz if seen.any() else 1.0
    return PictureReport(
        p50_ms=_percentile(measured["p50"], 50.0),
        p99_ms=_percentile(measured["worst"], 100.0 * 0.99 ** max(1.0, pictures)),
        stages_ms={stage: _percentile(measured[stage], 50.0) for stage in PICTURE_STAGES},
        per_second=round(float(np.mean(rate)), 2),
    )


def _percentile(values: Array, percent: float) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(np.percentile(known, percent)), 3) if len(known) else None
