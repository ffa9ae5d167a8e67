"""The requests that end a dive: disarm, release control; repeated until the drone answers."""

from messages import topics
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from services.runtime.node.node import Node
from tools.live.own_pilot import OwnPilot

WHO = "end-of-dive"
REFUSALS = 5  # of one request, until it is given up


class Disarming:
    """Asks in the name of this side's pilot: the drone of another pilot stays armed."""

    def __init__(
        self, node: Node, own: OwnPilot, kinds: tuple[RequestKind, ...] = ("disarm",)
    ) -> None:
        self.kinds = kinds  # not answered yet, in this order
        self._own = own
        self._refusals = 0
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

    def _hear(self, _request: PilotRequest, answer: PilotAnswer, _now: int) -> None:
        """A refusal may be due to an epoch that has just been replaced: then ask with the new."""
        self._refusals = 0 if answer.accepted else self._refusals + 1
        if answer.accepted or self._refusals >= REFUSALS:
            self.kinds = self.kinds[1:]
            self._refusals = 0
