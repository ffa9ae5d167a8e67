"""The request that ends a dive: no thruster turns any more, and the drone has said so."""

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest
from services.runtime.node.node import Node

WHO = "end-of-dive"


class Disarming:
    def __init__(self, node: Node) -> None:
        self.done = False  # the drone has answered
        self._asking = node.request(
            topics.PILOT_REQUEST, topics.PILOT_ANSWER, on_answer=self._hear, who=WHO
        )

    def ask(self, now: int) -> None:
        """Call as often as you like from `now` [ns] on; it is asked once, until it is answered."""
        if not self.done and not self._asking.pending:
            self._asking.ask(PilotRequest(stamp_ns=now, id="", kind="disarm"), now)

    def _hear(self, _request: PilotRequest, _answer: PilotAnswer, _now: int) -> None:
        self.done = True
