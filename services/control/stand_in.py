"""What control does with the pilot's requests: it obeys a disarm at once, and answers disarm and
stop in the place of `reference` while that is silent. The requests it has answered are handed on
when `reference` speaks again, so that it neither stays armed nor goes on with what it was doing.
"""

from messages.pilot import PilotAnswer, PilotRequest
from messages.reference import Reference
from messages.units import Ns
from services.vehicle.disarm_latch import DisarmLatch

PATIENCE_NS = 100_000_000  # [ns] in which `reference` goes disarmed by itself; several of its steps
AGAIN_NS = 200_000_000  # [ns] between two times that a disarm is handed on


class StandIn:
    """`events` collects names to count."""

    def __init__(self, latch: DisarmLatch) -> None:
        self.events: list[str] = []
        self._latch = latch
        self._silent = True  # `reference`
        self._stop: PilotRequest | None = None  # answered here, not handed on yet
        self._again_ns: Ns = 0  # [ns] a disarm is not handed on before

    def hear(self, request: PilotRequest, now: Ns) -> tuple[bool, PilotAnswer | None]:
        """A request of a pilot. Returns whether it is a disarm obeyed just now, and the answer if
        `reference` is silent."""
        repeated = self._latch.obeyed(request)
        self.events.extend(self._latch.hear(request, now))
        obeyed = self._latch.obeyed(request)
        disarms = obeyed and not repeated
        if disarms:
            self._again_ns = now + PATIENCE_NS
        stops = request.kind == "stop" and self._latch.epoch is not None  # anybody may
        if not self._silent or not (obeyed or stops):
            return disarms, None
        if stops:
            self._stop = request
        answer = PilotAnswer(stamp_ns=now, id=request.id, accepted=True, cause_ns=request.stamp_ns)
        return disarms, answer

    def heard(self, reference: Reference | None, now: Ns) -> list[PilotRequest]:
        """A reference has arrived; None: it is silent. Returns the requests to hand on."""
        self._silent = reference is None
        if reference is None:
            return []
        stop, self._stop = self._stop, None
        due = [] if stop is None else [stop]
        disarm = self._latch.request
        if disarm is None or not reference.armed or not self._latch.forbids(reference.armed_ns):
            return due
        if now >= self._again_ns:
            self._again_ns = now + AGAIN_NS
            self.events.append("overruled:reference")
            due.append(disarm)
        return due
