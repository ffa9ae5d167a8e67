"""Two pilots and one drone: whatever they do in whatever order, only one of them has a say."""

from typing import get_args

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from messages.pilot import FOR_ANYBODY, PilotCommand, PilotRequest, RequestKind
from services.reference.core import ReferenceGenerator, Settings
from services.runtime.node.gate import Authority

PILOTS = st.sampled_from(["ada", "bob"])
NO_SAY = "(lease)"  # ends every refusal for an epoch


class TwoPilots(RuleBasedStateMachine):
    """Wired as in the service: the gate's authority and the state machine of the drone."""

    def __init__(self) -> None:
        super().__init__()
        self.generator = ReferenceGenerator(Settings())
        self.authority = Authority()
        self.epochs = {"ada": 0, "bob": 0}  # as the drone's answers have told them
        self.has_moved = 0  # epoch of the newest pilot whose command was let in
        self.asked = 0

    def ask(self, pilot: str, kind: RequestKind) -> tuple[bool, str]:
        self.asked += 1
        request = PilotRequest(
            stamp_ns=0, id=f"{self.asked}", kind=kind, epoch=self.epochs[pilot], value=0.5
        )
        centred = PilotCommand(stamp_ns=0, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
        answer = self.generator.answer(request, centred, 0)
        self.authority.granted = self.generator.epoch
        if answer.epoch is not None:
            self.epochs[pilot] = answer.epoch
        return answer.accepted, answer.reason

    @rule(pilot=PILOTS)
    def takes_the_sticks(self, pilot: str) -> None:
        accepted, _ = self.ask(pilot, "lease")
        assert accepted
        assert self.epochs[pilot] == max(self.epochs.values())

    @rule(pilot=PILOTS)
    def moves_a_stick(self, pilot: str) -> None:
        if self.authority.admits(self.epochs[pilot]):
            self.authority.heard(self.epochs[pilot])
            self.has_moved = self.epochs[pilot]

    @rule(pilot=PILOTS, kind=st.sampled_from(get_args(RequestKind)))
    def asks(self, pilot: str, kind: RequestKind) -> None:
        if kind == "lease":
            return
        _, reason = self.ask(pilot, kind)
        ousted = self.epochs[pilot] < self.has_moved
        assert reason.endswith(NO_SAY) == (ousted and kind not in FOR_ANYBODY)


TwoPilots.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
test_only_who_has_the_sticks_has_a_say = TwoPilots.TestCase
