"""Answers to requests that set or clear faults."""

from collections.abc import Callable, Sequence
from typing import Literal

import msgspec

from messages import events
from messages.events import Outbox
from messages.simulator import FaultAnswer, FaultRequest
from messages.units import Ns
from services.simulator import faults
from services.simulator.core import Simulator

Nearest = Callable[[str, Sequence[str]], str]  # (wrong name, known ones) → words that help


def decide(
    simulator: Simulator, request: FaultRequest, now: Ns, nearest: Nearest, outbox: Outbox
) -> FaultAnswer:
    """Set or clear a fault, or refuse."""
    request = by_key(request, simulator.sensors)
    reason = refusal(request, simulator.thrusters, simulator.sensors, nearest)
    if reason:
        outbox.tell(events.REFUSED_FAULT())
    else:
        simulator.break_or_mend(request, now)
    return FaultAnswer(
        stamp_ns=now,
        id=request.id,
        accepted=not reason,
        reason=reason,
        cause_ns=request.stamp_ns,
    )


def refusal(
    request: FaultRequest, thrusters: Sequence[str], sensors: Sequence[str], nearest: Nearest
) -> str:
    """Why a vehicle with these parts cannot grant a request; empty when it can."""
    request = by_key(request, sensors)
    parts = [*thrusters, *sensors, faults.ALL]
    if request.part not in parts:
        return f"there is no part {request.part!r}{nearest(request.part, parts)}"
    return faults.refusal(request, thrusters)


def by_key(request: FaultRequest, sensors: Sequence[str]) -> FaultRequest:
    """A sensor may be called without `sensor/`: leak is sensor/leak."""
    key = f"sensor/{request.part}"
    return msgspec.structs.replace(request, part=key) if key in sensors else request


def in_words(request: FaultRequest) -> tuple[Literal["info", "warning"], str]:
    """What was done, for the log."""
    if request.fault == "none":
        return "info", f"mended: {request.part}"
    value = "" if request.value is None else f" {request.value:g}"
    return "warning", f"simulated fault: {request.part} {request.fault}{value}"
