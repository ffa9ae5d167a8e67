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
from tools.report.columns import Array
from tools.report.dive import RecordedDive


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
    stated = state["sensor"], state["stamp"]
    referred = reference["sensor"], reference["stamp"]
    commanded = thrusters["sensor"], thrusters["stamp"]
    actuated = actuation["sensor"], actuation["actuated"]
    return LatencyReport(
        stick_to_thruster=_since(actuation["pilot"], actuation["actuated"]),
        sensor_to_thruster=_since(*actuated),
        stages={
            "stick_to_reference": _since(reference["pilot"], reference["stamp"]),
            "sensor_to_state": _since(*stated),
            "state_to_reference": _between(stated, referred),
            "reference_to_command": _between(referred, commanded),
            "command_to_thruster": _between(commanded, actuated),
        },
    )


def _since(cause: Array, effect: Array) -> LatencySpread:
    """Effect − cause, once per distinct cause: the first message that carries it."""
    causes, effects = _firsts(cause, effect)
    return _spread(effects - causes)


def _between(before: tuple[Array, Array], after: tuple[Array, Array]) -> LatencySpread:
    """Time from one stage to the next, for each cause (first column) that passed through both."""
    causes, earlier = _firsts(*before)
    same, later = _firsts(*after)
    _, left, right = np.intersect1d(causes, same, assume_unique=True, return_indices=True)
    return _spread(later[right] - earlier[left])


def _firsts(cause: Array, effect: Array) -> tuple[Array, Array]:
    known = np.isfinite(cause) & np.isfinite(effect)
    causes, first = np.unique(cause[known], return_index=True)
    return causes, effect[known][first]


def _spread(latencies_ns: Array) -> LatencySpread:
    if not len(latencies_ns):
        return LatencySpread(None, None, None)
    p50, p99, longest = np.percentile(latencies_ns, [50, 99, 100]) / 1e6
    return LatencySpread(round(float(p50), 3), round(float(p99), 3), round(float(longest), 3))
