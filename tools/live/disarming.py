"""The request that ends a dive: disarm, repeated until the drone answers."""

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
        """Send the request at `now` [ns]; later calls do nothing while it is pending or done."""
        if not self.done and not self._asking.pending:
            self._asking.ask(PilotRequest(stamp_ns=now, id="", kind="disarm"), now)

    def _hear(self, _request: PilotRequest, _answer: PilotAnswer, _now: int) -> None:
        self.done = True
