"""Latencies of a dive, from the stamps in the messages.

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

from messages import topics
from tools.recordings.columns import Array, StreamColumns
from tools.report.dive import RecordedDive

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
    state, reference = dive[topics.STATE], dive[topics.REFERENCE]
    thrusters, actuation = dive[topics.THRUSTERS], dive[topics.ACTUATION]
    stated = state, "stamp"
    referred = reference, "stamp"
    commanded = thrusters, "stamp"
    actuated = actuation, "actuated"
    return LatencyReport(
        stick_to_thruster=_since(actuated, "pilot"),
        sensor_to_thruster=_since(actuated),
        stages={
            "stick_to_reference": _since(referred, "pilot"),
            "sensor_to_state": _since(stated),
            "state_to_reference": _between(stated, referred),
            "reference_to_command": _between(referred, commanded),
            "command_to_thruster": _between(commanded, actuated),
        },
    )


def _since(effect: Effect, cause: str = "sensor") -> LatencySpread:
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


def _firsts(of: Effect, by: str = "sensor") -> tuple[Array, Array]:
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
