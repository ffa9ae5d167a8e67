"""The pilot's state machine: arming, the hand-over and the sticks that another pilot has taken."""

from itertools import pairwise
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from msgspec.structs import replace

from messages.events import Outbox
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from messages.vehicle import Activity, VehicleStatus
from services.marine.outputs import Output
from services.piloting.pilot import Effects, Pilot, Progress
from services.piloting.pilot_intents import GotoIntent, Held, Intent, OutputIntent, Press, overrules
from services.piloting.sticks import CENTRED, StickReading, Sticks
from tests.support.told import told

S = 1_000_000_000  # [ns]


def status(
    epoch: int, *, pilot: str = "", armed: bool = False, activity: Activity = "ready"
) -> VehicleStatus:
    return VehicleStatus(stamp_ns=0, activity=activity, armed=armed, pilot=pilot, epoch=epoch)


def answer(accepted: bool, epoch: int | None = None) -> PilotAnswer:
    return PilotAnswer(stamp_ns=0, id="", accepted=accepted, epoch=epoch)


def press(pilot: Pilot, intent: Intent, now: int = 0) -> Effects:
    return pilot.read(StickReading(presses=(intent,)), "hands", 0, now)


def kinds(effects: Effects) -> list[str]:
    return [request.kind for request in effects.requests]


def outdone() -> Pilot:
    """Had the sticks with epoch 1, until another one took them with epoch 2."""
    pilot = Pilot(Progress(epoch=1), Outbox(), arms=False)
    pilot.status(status(2, pilot="bob"), 0)
    assert told(pilot.outbox) == ["outdone:lease"]
    return pilot


def test_whoever_was_outdone_and_wants_to_arm_takes_the_sticks_first():
    pilot = outdone()
    (lease,) = press(pilot, "arm").requests
    assert (lease.kind, lease.epoch) == ("lease", 1)
    (arm,) = pilot.answered(lease, answer(True, epoch=3), 1).requests
    assert (arm.kind, arm.epoch) == ("arm", 3)
    assert kinds(pilot.status(status(3), 2)) == []


def test_a_script_arms_behind_its_first_command_with_the_granted_epoch():
    """A drone that was flown before hears no other sticks, and would refuse to arm."""
    pilot = Pilot(Progress(), Outbox(), arms=True)
    pilot.read(StickReading(), "script", 0, 0)
    (lease,) = pilot.status(status(6), 1).requests
    pilot.answered(lease, answer(True, epoch=7), 2)
    assert kinds(pilot.status(status(7, pilot="script"), 3)) == []
    effects = pilot.read(StickReading(), "script", 0, 4)
    assert effects.command is not None
    assert effects.command.epoch == 7
    assert kinds(effects) == ["arm"]
    assert kinds(pilot.read(StickReading(), "script", 0, 5)) == []


@pytest.mark.parametrize("then", ["refused", "given up", "stop", "disarm"])
def test_sticks_that_were_not_given_arm_nothing_later_on(then: str):
    pilot = outdone()
    (lease,) = press(pilot, "arm").requests
    if then == "refused":
        assert kinds(pilot.answered(lease, answer(False), 1)) == []
    elif then == "given up":
        pilot.given_up(lease, 1)
    else:
        press(pilot, "stop" if then == "stop" else "disarm")
    assert kinds(pilot.answered(lease, answer(True, epoch=3), 2)) == []


@pytest.mark.parametrize("intent", ["stop", "disarm", "light"])
def test_whoever_was_outdone_still_asks_and_leaves_the_answer_to_the_drone(intent: Press):
    (asked,) = press(outdone(), intent).requests
    assert (asked.kind, asked.epoch) == (intent, 1)


def test_a_restarted_drone_that_has_forgotten_the_epoch_is_asked_again():
    pilot = Pilot(Progress(epoch=3), Outbox(), arms=False)
    assert kinds(pilot.status(status(0), 0)) == ["lease"]
    pilot.asked = lambda: {"lease"}
    assert kinds(pilot.status(status(0), 1)) == []


@pytest.mark.parametrize("armed", [False, True])
def test_a_starting_pilot_waits_while_another_has_control(armed: bool):
    pilot = Pilot(Progress(), Outbox(), arms=True)
    heard = pilot.status(status(3, pilot="ann", armed=armed), 0)
    assert (heard.requests, heard.hand_over) == ([], False)
    said = ("info", "ann has control; waiting until nobody has it", "")
    assert [*pilot.outbox.said] == [said]
    again = pilot.status(status(3, pilot="ann", armed=armed), 1)
    assert again.requests == []
    assert [*pilot.outbox.said] == [said]
    assert kinds(pilot.status(status(3, armed=armed), 2)) == ["lease"]


def test_what_comes_of_a_request_that_was_granted_is_said():
    pilot = Pilot(Progress(epoch=1), outbox := Outbox(), arms=False)
    request = PilotRequest(stamp_ns=0, id="1", kind="goto", depth=30.0)
    pilot.answered(request, replace(answer(True), note="the drone will land"), 0)
    assert ("warning", "goto: the drone will land", "") in outbox.said


def test_refused_requests_for_control_come_later_and_later():
    pilot, now, asked = Pilot(Progress(), Outbox(), arms=False), 0, list[int]()
    while now < 60 * S:
        for lease in pilot.status(status(3), now).requests:
            asked.append(now)
            pilot.answered(lease, answer(False), now)
        now += S // 10
    gaps = [(after - before) / S for before, after in pairwise(asked)]
    assert gaps[:5] == [2.0, 4.0, 8.0, 10.0, 10.0]
    assert set(gaps[3:]) == {10.0}


@pytest.mark.parametrize("ended", ["released", "outdone"])
def test_control_given_up_or_lost_is_not_taken_back_unasked(ended: str):
    pilot = Pilot(Progress(epoch=1), Outbox(), arms=True)
    pilot.read(StickReading(), "ann", 0, 0)
    pilot.status(status(1, pilot="ann"), 0)
    given = 1
    if ended == "released":
        request = PilotRequest(stamp_ns=0, id="ask-1", kind="release", source="ann", epoch=1)
        pilot.overheard(request, answer(True))
    else:
        given = 2
        pilot.status(status(2, pilot="bob"), 1)
        assert told(pilot.outbox) == ["outdone:lease"]
    for now in range(0, 60 * S, S):
        assert kinds(pilot.status(status(given), now)) == []
    assert kinds(press(pilot, "arm")) == ["lease"]


def test_a_pilot_who_gives_control_back_and_takes_it_is_no_other_pilot():
    waiting = set[str]()
    pilot = Pilot(Progress(epoch=1), Outbox(), arms=False, asked=lambda: frozenset(waiting))  # type: ignore[arg-type]
    pilot.read(StickReading(), "ann", 0, 0)
    release = PilotRequest(stamp_ns=0, id="1", kind="release", source="ann", epoch=1)
    pilot.answered(release, answer(True), 1)
    pilot.status(status(1, pilot="ann"), 2)  # said before it was heard
    waiting.add("lease")
    pilot.status(status(2, pilot="ann"), 3)  # said before the answer came
    assert told(pilot.outbox) == []
    waiting.clear()
    pilot.answered(replace(release, kind="lease"), answer(True, epoch=2), 4)
    pilot.status(status(3, pilot="ann"), 5)  # another one of the same name
    assert told(pilot.outbox) == ["outdone:lease"]


def test_what_lindy_ask_got_for_this_pilot_is_its_own_and_what_others_got_is_not():
    pilot = Pilot(Progress(), Outbox(), arms=False)
    pilot.read(StickReading(), "ann", 0, 0)
    for source, epoch in (("bob", 0), ("ann", 4)):
        foreign = PilotRequest(stamp_ns=0, id="x", kind="force", source=source, epoch=epoch)
        pilot.overheard(foreign, answer(True, epoch=9))
        assert pilot.progress.epoch is None
    own = PilotRequest(stamp_ns=0, id="y", kind="force", source="ann", epoch=0)
    pilot.overheard(own, answer(True, epoch=9))
    assert pilot.progress.epoch == 9


def in_failsafe(epoch: int, *, resumable: bool) -> VehicleStatus:
    common = status(epoch, pilot="hands", armed=True, activity="piloted")
    return replace(common, failsafe="pilot_lost", reaction="stop", resumable=resumable)


def test_a_person_resumes_with_the_arm_button_and_with_deflected_sticks_too():
    pilot = Pilot(Progress(began_ns=0, epoch=1), Outbox(), arms=True)
    assert kinds(pilot.status(in_failsafe(1, resumable=True), 0)) == []
    deflected = StickReading(Sticks(heave=1.0), at_rest=False, presses=("arm",))
    assert kinds(pilot.read(deflected, "hands", 0, 1)) == ["resume"]
    pilot.status(status(1, pilot="hands", armed=True), 2)
    assert kinds(press(pilot, "arm")) == ["arm"]


def test_what_was_held_since_before_its_meaning_changed_is_void():
    """Arming becomes resuming, and the other way round."""
    pilot = Pilot(Progress(began_ns=0, epoch=1), Outbox(), arms=False)
    acting = replace(status(1, pilot="hands", armed=True), failsafe="pilot_lost")
    for now, failsafe in ((10, True), (20, False), (30, True)):
        began = now - 1
        pilot.status(acting if failsafe else status(1, pilot="hands", armed=True), now)
        assert kinds(press(pilot, Held("arm", began), now + 1)) == []
        asked = "resume" if failsafe else "arm"
        assert kinds(press(pilot, Held("arm", now), now + 1)) == [asked]
        assert kinds(press(pilot, Held("disarm", began), now + 1)) == ["disarm"]
    assert pilot.outbox.counts["void:hold"] == 3


def test_who_takes_over_a_drone_in_a_failsafe_resumes_with_the_arm_button():
    pilot = outdone()
    pilot.status(in_failsafe(2, resumable=True), 0)
    (lease,) = press(pilot, "arm").requests
    assert lease.kind == "lease"
    assert kinds(pilot.answered(lease, answer(True, epoch=3), 1)) == ["resume"]


def test_a_script_resumes_by_itself_once_the_conditions_have_ended_and_not_before():
    pilot = Pilot(Progress(began_ns=0, epoch=1), Outbox(), arms=True, resumes=True)
    pilot.read(StickReading(present=False), "script", 0, 0)
    assert kinds(pilot.status(in_failsafe(1, resumable=True), 0)) == []  # the pilot is absent
    pilot.read(StickReading(), "script", 0, 0)
    assert kinds(pilot.status(in_failsafe(1, resumable=False), 0)) == []
    (resume,) = pilot.status(in_failsafe(1, resumable=True), 0).requests
    assert (resume.kind, resume.epoch) == ("resume", 1)
    pilot.asked = lambda: {"resume"}
    assert kinds(pilot.status(in_failsafe(1, resumable=True), S)) == []
    pilot.asked = frozenset
    pilot.answered(resume, answer(True), S)
    assert kinds(pilot.status(in_failsafe(1, resumable=True), S)) == []  # an older status
    assert kinds(pilot.status(in_failsafe(1, resumable=True), 2 * S)) == ["resume"]


@given(
    sticks=st.builds(Sticks, *[st.floats(-1.0, 1.0)] * 6),
    present=st.booleans(),
    began=st.none() | st.just(0),
)
def test_before_the_hand_over_the_sticks_say_nothing(
    sticks: Sticks, present: bool, began: int | None
):
    pilot = Pilot(Progress(began_ns=began), Outbox(), arms=False)
    command = pilot.read(StickReading(sticks, present), "hands", 0, 5).command
    assert command is not None
    c = command
    said = Sticks(c.surge, c.sway, c.heave, c.yaw, c.tilt, c.gripper)
    assert said == (sticks if present and began is not None else CENTRED)
    assert command.pilot == ("present" if present else "lost")


class AnyOrder(RuleBasedStateMachine):
    """Whatever happens in whatever order."""

    def __init__(self) -> None:
        super().__init__()
        self.pilot = Pilot(Progress(), Outbox(), arms=True)
        self.pending: list[PilotRequest] = []
        self.new: list[PilotRequest] = []
        self.at_rest = False
        self.ended = False  # by the pilot's own stop or disarm

    def take(self, effects: Effects) -> None:
        self.new = effects.requests
        self.pending += effects.requests

    @property
    def waiting(self) -> set[RequestKind]:
        return {request.kind for request in self.pending}

    @rule(
        heave=st.sampled_from([0.0, 0.5]),
        intent=st.none() | st.sampled_from([*get_args(Press), GotoIntent(depth=1.0)]),
    )
    def reads(self, heave: float, intent: Press | GotoIntent | None) -> None:
        self.at_rest = heave == 0.0
        presses = () if intent is None else (intent,)
        self.ended = self.ended or intent in ("stop", "disarm")
        reading = StickReading(Sticks(heave=heave), at_rest=self.at_rest, presses=presses)
        self.take(self.pilot.read(reading, "hands", 0, 0))

    @rule(epoch=st.integers(0, 4), armed=st.booleans())
    def hears_a_status(self, epoch: int, armed: bool) -> None:
        by_itself = self.pilot.status(status(epoch, armed=armed), 10**12)
        assert not (self.ended and "arm" in kinds(by_itself))
        self.take(by_itself)

    @rule(data=st.data(), accepted=st.booleans(), epoch=st.integers(1, 4))
    def hears_an_answer(self, data: st.DataObject, accepted: bool, epoch: int) -> None:
        if self.pending:
            request = data.draw(st.sampled_from(self.pending))
            self.pending.remove(request)
            given = epoch if request.kind == "lease" and accepted else None
            self.take(self.pilot.answered(request, answer(accepted, given), 0))

    @invariant()
    def every_request_carries_the_epoch_we_have(self) -> None:
        assert all(r.epoch == (self.pilot.progress.epoch or 0) for r in self.new)

    @invariant()
    def nothing_arms_without_the_sticks(self) -> None:
        asked = [r.kind for r in self.new]
        assert "arm" not in asked or self.pilot.progress.epoch is not None


AnyOrder.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
test_whatever_happens_in_whatever_order = AnyOrder.TestCase


HAS = (
    Output("light", "dimmer"), Output("bow_light", "dimmer"), Output("scale", "switch"),
    Output("jaw", "gripper"),
)  # fmt: skip


def asked(effects: Effects) -> list[tuple[str, str, float | None]]:
    return [(r.kind, r.output, r.value) for r in effects.requests]


def test_a_button_switches_what_it_means_on_this_vehicle_to_what_it_is_not():
    pilot = Pilot(Progress(epoch=1), Outbox(), arms=False, has=HAS)
    assert asked(press(pilot, "laser")) == [("output", "scale", 1.0)]
    assert asked(press(pilot, "laser")) == [("output", "scale", 0.0)]  # before any answer
    assert asked(press(pilot, "light_2")) == [("output", "bow_light", 1.0)]
    assert asked(press(pilot, "light")) == [("light", "", 1.0)]
    known = replace(status(1), outputs={"light": 0.5, "bow_light": 0.0, "scale": 1.0})
    pilot.asked = lambda: {"output"}
    pilot.status(known, 1)  # it may be older than what was asked for
    assert asked(press(pilot, "light_2")) == [("output", "bow_light", 0.0)]
    pilot.asked = frozenset
    pilot.status(known, 2)
    assert asked(press(pilot, "laser")) == [("output", "scale", 0.0)]
    assert asked(press(pilot, "light")) == [("light", "", 0.0)]
    assert asked(press(pilot, OutputIntent("bow_light", 0.25))) == [("output", "bow_light", 0.25)]


def test_a_button_for_what_the_vehicle_has_not_is_refused_here():
    pilot = Pilot(Progress(epoch=1), Outbox(), arms=False)
    buttons: tuple[Press, ...] = ("laser", "light_2")
    for button in buttons:
        assert press(pilot, button).requests == []
    assert pilot.outbox.counts["refused_here:output"] == 2


def test_a_newer_request_withdraws_an_older_one_of_the_same_output_and_no_other():
    def request(kind: RequestKind, output: str = "", value: float = 1.0) -> PilotRequest:
        return PilotRequest(stamp_ns=0, id="1", kind=kind, output=output, value=value)

    assert overrules(request("output", "scale", 0.0), request("output", "scale"))
    assert not overrules(request("output", "scale"), request("output", "bow_light"))
    assert not overrules(request("output", "scale"), request("arm"))
    assert overrules(request("light"), request("light"))
    for older in ("arm", "resume", "goto", "follow", "home"):
        for newer in ("stop", "disarm"):
            assert overrules(request(newer), request(older))
        assert overrules(request("goto"), request(older)) == (older not in ("arm", "resume"))
        assert not overrules(request("arm"), request(older))
        assert not overrules(request("light"), request(older))
    assert overrules(request("stop"), request("mode"))
