"""The requests that end a dive: disarm, release control; repeated until the drone answers."""

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from services.runtime.node.node import Node
from tools.live.own_pilot import OwnPilot

WHO = "end-of-dive"


class Disarming:
    """Asks in the name of this side's pilot: the drone of another pilot stays armed."""

    def __init__(
        self, node: Node, own: OwnPilot, kinds: tuple[RequestKind, ...] = ("disarm",)
    ) -> None:
        self.kinds = kinds  # not answered yet, in this order
        self._own = own
        self._asking = node.request(
            topics.PILOT_REQUEST, topics.PILOT_ANSWER, on_answer=self._hear, who=WHO
        )

    @property
    def done(self) -> bool:
        """Has the drone answered everything?"""
        return not self.kinds

    def ask(self, now: int) -> None:
        """Send what is next at `now` [ns]; later calls do nothing while it is pending or done."""
        if self.kinds and not self._asking.pending:
            request = PilotRequest(
                stamp_ns=now,
                id="",
                kind=self.kinds[0],
                source=self._own.source,
                epoch=self._own.epoch,
            )
            self._asking.ask(request, now)

    def _hear(self, _request: PilotRequest, _answer: PilotAnswer, _now: int) -> None:
        self.kinds = self.kinds[1:]
