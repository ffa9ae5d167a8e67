"""The figures of a dive that two recordings are compared by."""

import msgspec

from tools.analysis.dive import RecordedDive, read_dive
from tools.recordings.recording import Recording
from tools.report import report_on
from tools.report.report import Extras, Report
from tools.report.summary import is_loss


class ComparedFigure(msgspec.Struct):
    name: str
    unit: str
    a: float | None  # None: not measurable on that dive
    b: float | None


def figures(a: Recording, b: Recording) -> list[ComparedFigure]:
    """Side by side."""
    return [
        ComparedFigure(name, unit, left, right)
        for (name, unit, left), (_, _, right) in zip(_of(a), _of(b), strict=True)
    ]


def _of(recording: Recording) -> list[tuple[str, str, float | None]]:
    dive = read_dive(recording)
    return _named(dive, report_on(dive, Extras()))


def _named(dive: RecordedDive, report: Report) -> list[tuple[str, str, float | None]]:
    stick = report.latency_ms.stick_to_thruster
    stops = [stop.overshoot for stop in report.stops if stop.axis == "heave"]
    return [
        ("length", "s", report.seconds),
        ("armed", "s", report.armed_seconds),
        ("deepest", "m", dive.max_depth_m),
        ("depth error, rms", "m", report.depth_error_rms_m),
        ("heading error, rms", "°", report.heading_error_rms_deg),
        ("worst depth stop", "m", max(stops, default=None)),
        ("jerk over its limit, peak", "-", report.peak_jerk_ratio),
        ("stick to thruster, median", "ms", stick.p50),
        ("stick to thruster, 99 %", "ms", stick.p99),
        ("energy", "Wh", report.energy.wh),
        ("thrust squared", "N² s", report.energy.thrust_squared_n2s),
        ("failsafes", "", float(len(report.failsafes))),
        ("losses of all kinds", "", float(_lost(report))),
    ]


def _lost(report: Report) -> int:
    """By the rule of the dive's summary."""
    return sum(count for name, count in report.losses.items() if is_loss(name))
