"""Answers to requests that set or clear faults."""

from collections.abc import Callable, Sequence

from messages.simulator import FaultAnswer, FaultRequest
from messages.units import Ns
from services.simulator.core import Simulator
from services.simulator.faults import ALL

Nearest = Callable[[str, Sequence[str]], str]  # (wrong name, known ones) → words that help


def decide(
    simulator: Simulator, request: FaultRequest, now: Ns, nearest: Nearest
) -> tuple[FaultAnswer, list[str]]:
    """Set or clear a fault, or refuse; returns the answer and the names to count."""
    parts = [*simulator.thrusters, *simulator.sensors, ALL]
    if request.part in parts:
        reason = simulator.refusal(request)
    else:
        reason = f"there is no part {request.part!r}{nearest(request.part, parts)}"
    counts = ["refused:simulator/request"] if reason else simulator.break_or_mend(request, now)
    answer = FaultAnswer(
        stamp_ns=now,
        id=request.id,
        accepted=not reason,
        reason=reason,
        cause_ns=request.stamp_ns,
    )
    return answer, counts


def in_words(request: FaultRequest) -> str:
    """A fault that is in force now, for the log."""
    value = "" if request.value is None else f" {request.value:g}"
    return f"simulated fault: {request.part} {request.fault}{value}"
