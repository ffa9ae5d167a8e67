"""Latencies of a dive: from the stamps in the messages, as the link monitor measured them, and of
pictures as `link_monitor` did.

Every message derived from a sensor sample and a pilot command carries both stamps, so each latency
is a difference. Where topside and drone are two machines, the drone has converted the stamps of
pilot commands to its own clock; they are as exact as the clock offset it knew.

End to end, from `Actuation`:
  stick_to_thruster   actuated − stamp of the pilot command, once per pilot command
  sensor_to_thruster  actuated − stamp of the sensor sample, once per sample
Stages in between:
  stick_to_reference    first reference caused by a pilot command − its stamp; includes the tether
  sensor_to_state       stamp of the state − sensor sample
  state_to_reference    stamp of the reference − stamp of the state of the same sensor sample
  reference_to_command  stamp of the thruster command − stamp of the reference of the same sample
  command_to_thruster   actuated − stamp of the thruster command of the same sample
"""

import msgspec
import numpy as np

from messages import cameras, topics
from messages.link import DOWN_STAGES, UP_STAGES
from messages.video import PICTURE_STAGES
from tools.analysis.dive import RecordedDive
from tools.recordings.columns import Array, StreamColumns

Effect = tuple[StreamColumns, str]  # a column of stamps, read when it is needed


class LatencySpread(msgspec.Struct, frozen=True):
    """[ms] None: nothing was measured."""

    p50: float | None
    p99: float | None
    max: float | None


class LatencyReport(msgspec.Struct, frozen=True):
    stick_to_thruster: LatencySpread
    sensor_to_thruster: LatencySpread
    stages: dict[str, LatencySpread]


def latency(dive: RecordedDive) -> LatencyReport:
    """Every latency of a dive."""
    stated, referred = (dive[topics.STATE], "stamp_ns"), (dive[topics.REFERENCE], "stamp_ns")
    commanded = dive[topics.THRUSTERS], "stamp_ns"
    actuated = dive[topics.ACTUATION], "actuated_ns"
    return LatencyReport(
        stick_to_thruster=_since(actuated, "pilot_ns"),
        sensor_to_thruster=_since(actuated),
        stages={
            "stick_to_reference": _since(referred, "pilot_ns"),
            "sensor_to_state": _since(stated),
            "state_to_reference": _between(stated, referred),
            "reference_to_command": _between(referred, commanded),
            "command_to_thruster": _between(commanded, actuated),
        },
    )


def _since(effect: Effect, cause: str = "sensor_ns") -> LatencySpread:
    """Effect − cause, once per distinct cause: the first message that carries it."""
    causes, effects = _firsts(effect, cause)
    return _spread(effects - causes)


def _between(before: Effect, after: Effect) -> LatencySpread:
    """Time from one stage to the next, for each sensor sample that passed through both."""
    causes, earlier = _firsts(before)
    same, later = _firsts(after)
    there = np.minimum(np.searchsorted(same, causes), max(0, len(same) - 1))
    both = same[there] == causes if len(same) else np.zeros(len(causes), bool)
    return _spread(later[there[both]] - earlier[both])


def _firsts(of: Effect, by: str = "sensor_ns") -> tuple[Array, Array]:
    """Causes ascending, each once, and the effect of the first message of each."""
    stream, column = of
    cause, effect = stream[by], stream[column]
    known = np.isfinite(cause) & np.isfinite(effect)
    cause, effect = cause[known], effect[known]
    if np.all(cause[1:] >= cause[:-1]):  # nearly always, and then a tenth of the memory does
        first = np.append(True, cause[1:] != cause[:-1])[: len(cause)]
        return cause[first], effect[first]
    causes, places = np.unique(cause, return_index=True)
    return causes, effect[places]


def _spread(latencies_ns: Array) -> LatencySpread:
    if not len(latencies_ns):
        return LatencySpread(None, None, None)
    p50, p99, longest = np.percentile(latencies_ns, [50, 99, 100]) / 1e6
    return LatencySpread(round(float(p50), 3), round(float(p99), 3), round(float(longest), 3))


class ReportedBudget(msgspec.Struct, frozen=True):
    """[ms] Medians of `link/latency` over the dive; None: never known."""

    down: dict[str, float | None]  # stick to thruster, by stage
    stick_to_thruster: float | None  # from end to end
    up: dict[str, float | None]  # sensor to screen, by stage; None where there was no screen
    sensor_to_screen: float | None
    lost_s: float | None = None  # [s] not ms: in pauses in which no state of the drone arrived


class Clocks(msgspec.Struct, frozen=True):
    """The drone's clock minus the topside's, as last known."""

    offset_ms: float | None
    bound_ms: float | None  # greatest error of the offset
    drift_ppm: float | None


def budget(dive: RecordedDive) -> ReportedBudget:
    measured = dive[topics.LATENCY]
    return ReportedBudget(
        down={stage: _percentile(measured[f"down {stage}"]) for stage in DOWN_STAGES},
        stick_to_thruster=_percentile(measured["stick_to_thruster_ms"]),
        up={stage: _percentile(measured[f"up {stage}"]) for stage in UP_STAGES},
        sensor_to_screen=_percentile(measured["sensor_to_screen_ms"]),
        lost_s=_last(measured["lost_s"]),
    )


def clocks(dive: RecordedDive) -> Clocks:
    clock = dive[topics.CLOCK]
    return Clocks(
        offset_ms=_last(clock["offset_ns"] / 1e6),
        bound_ms=_last(clock["bound_ns"] / 1e6),
        drift_ppm=_last(clock["drift_ppm"]),
    )


def _last(values: Array) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(known[-1]), 3) if len(known) else None


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
    rate = measured["per_second"]
    seen = np.isfinite(measured["total.p50_ms"])
    # A report has the worst of its n pictures; all n are below the 99th percentile in 0.99^n of
    # the reports.
    pictures = float(np.mean(rate[seen])) / topics.PICTURE_AGE.hz if seen.any() else 1.0
    return PictureReport(
        p50_ms=_percentile(measured["total.p50_ms"]),
        p99_ms=_percentile(measured["total.p99_ms"], 100.0 * 0.99 ** max(1.0, pictures)),
        stages_ms={stage: _percentile(measured[stage]) for stage in PICTURE_STAGES},
        per_second=round(float(np.mean(rate)), 2),
    )


def _percentile(values: Array, percent: float = 50.0) -> float | None:
    known = values[np.isfinite(values)]
    return round(float(np.percentile(known, percent)), 3) if len(known) else None
