"""The request that ends a dive: no thruster turns any more, and the drone has said so."""

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest
from services.runtime.node import Node

REPEAT_NS = 100_000_000  # [ns] the request may be lost on the way


class Disarming:
    """Repeated with the same id until it is answered, as every request."""

    def __init__(self, node: Node) -> None:
        self.done = False  # the drone has answered
        self._id = ""
        self._next = 0  # [ns]
        self._requests = node.publisher(topics.PILOT_REQUEST)
        node.each(topics.PILOT_ANSWER, self._hear)

    def ask(self, now: int) -> None:
        """Call as often as you like from `now` [ns] on."""
        if now < self._next:
            return
        self._next = now + REPEAT_NS
        self._id = self._id or f"end-of-dive-{now}"
        self._requests.put(PilotRequest(stamp_ns=now, id=self._id, kind="disarm"))

    def _hear(self, answer: PilotAnswer, _: int) -> None:
        self.done = self.done or answer.id == self._id
