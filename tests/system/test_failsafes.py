"""Failsafes in the whole chain on virtual time: what the drone does, and what gives it back."""

from itertools import pairwise
from typing import Self

import pytest

from messages import topics
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.vehicle import VehicleStatus
from services.reference.settings import Settings
from tests.support.dive import ON_BOARD, Dive

SECOND = 1_000_000_000
LIMITS = ("reference.failsafe.depth_limit=4", "reference.failsafe.pilot_patience=20")


class PersonsDive(Dive):
    """The chain, and a person topside who arms, moves the sticks and asks."""

    def __init__(self) -> None:
        super().__init__(services=(*ON_BOARD, "tether", "link_monitor"), overrides=LIMITS)
        self.limits = self.stack.section("reference", Settings)
        self.truth, self.references = self.heard(topics.TRUTH), self.heard(topics.REFERENCE)
        pilot = self.host.node("gamepad", ["topside"])
        self.heave, self.yaw, self.there = 0.0, 0.0, True
        self._asked, self._answers = 0, dict[str, PilotAnswer]()
        self._commands = pilot.publisher(topics.PILOT_COMMAND)
        self._requests = pilot.publisher(topics.PILOT_REQUEST)
        pilot.each(topics.PILOT_ANSWER, self._hear)
        pilot.every(topics.PILOT_COMMAND.hz, self._speak)

    def ready(self) -> Self:
        self.run(6.0)
        assert self.ask("arm") == ""
        return self

    def armed_at(self, depth: float) -> Self:
        self.ready()
        assert self.ask("goto", depth=depth) == ""
        return self.run(15.0)

    def ask(self, kind: str, **more: float) -> str:
        """Why the drone refuses; empty: it does not."""
        self._asked += 1
        request = PilotRequest(stamp_ns=self.host.now, id=f"{self._asked}", kind=kind, **more)  # type: ignore[arg-type]
        self._requests.put(request)
        self.run(0.3)
        return self._answers[request.id].reason

    def seconds_until(self, reaction: str | None, since: int, patience: float = 120.0) -> float:
        self.host.run(
            self.host.now + round(patience * SECOND), done=lambda: self.status.reaction == reaction
        )
        assert self.status.reaction == reaction, self.status
        return (self.host.now - since) / SECOND

    @property
    def status(self) -> VehicleStatus:
        return self.statuses[-1]

    @property
    def depth(self) -> float:
        return self.truth[-1].position[2]

    def check(self) -> None:
        """The reference has no step in depth or its derivatives, and stays above the limit."""
        heave, begun = self.limits.heave, [r for r in self.references if r.armed]
        for before, after in pairwise(begun):
            assert abs(after.depth.jerk) <= heave.jerk * (1 + 1e-9)
            assert abs(after.depth.acceleration - before.depth.acceleration) <= heave.jerk * 0.011
            assert abs(after.depth.velocity - before.depth.velocity) <= 0.011 * 0.5
            assert after.depth.position <= self.limits.failsafe.depth_limit + 1e-6

    def _speak(self, now: int) -> None:
        if self.there:
            self._commands.put(
                PilotCommand(stamp_ns=now, surge=0.0, sway=0.0, heave=self.heave, yaw=self.yaw)
            )

    def _hear(self, answer: PilotAnswer, _: int) -> None:
        self._answers[answer.id] = answer


@pytest.mark.slow
def test_without_a_pilot_it_stops_holds_rises_and_stays_at_the_surface() -> None:
    dive = PersonsDive().armed_at(3.0)
    dive.heave = 0.5
    dive.run(1.5)
    dive.there, gone = False, dive.host.now
    assert dive.seconds_until("stop", gone) <= 0.33
    assert dive.status.failsafe == "pilot_lost"
    dive.run(8.0)
    depth = dive.depth
    dive.run(5.0)
    assert abs(dive.depth - depth) < 0.1
    assert 20.0 <= dive.seconds_until("ascend", gone) <= 20.4
    rising = dive.host.now
    distance = dive.depth - dive.limits.failsafe.surface_depth
    assert dive.seconds_until("surface", rising) >= distance / dive.limits.failsafe.ascent_speed
    dive.run(10.0)
    assert abs(dive.depth - dive.limits.failsafe.surface_depth) < 0.15
    dive.check()


@pytest.mark.slow
def test_moving_sticks_do_nothing_and_resume_hands_back() -> None:
    dive = PersonsDive().armed_at(2.0)
    dive.there = False
    dive.run(3.0)
    assert dive.ask("resume") == "pilot lost: no stick positions arrive, still"
    dive.there, dive.heave, dive.yaw = True, 1.0, 1.0
    dive.run(4.0)
    assert abs(dive.depth - 2.0) < 0.15
    assert dive.status.reaction == "stop"
    assert dive.status.resumable
    assert [each.code for each in dive.status.acting] == ["failsafe:pilot_lost"]
    assert "pilot_lost" not in dive.status.conditions  # it has ended
    assert dive.ask("goto", depth=1.0) == "a failsafe acts; first resume"
    assert dive.ask("resume") == ""
    assert (dive.status.failsafe, dive.status.acting) == ("none", ())
    dive.run(2.0)
    assert dive.depth > 2.3
    dive.check()


def test_a_link_that_is_cut_is_told_from_a_pilot_who_is_silent() -> None:
    dive = PersonsDive().ready()
    dive.host.kill("tether")
    dive.run(0.6)
    assert dive.status.conditions == ("pilot_lost",)
    dive.run(1.0)
    assert dive.status.conditions == ("link_lost", "pilot_lost")
    assert dive.status.failsafe == "link_lost"
    dive.there = False
    dive.start("tether")
    dive.run(1.0)
    assert dive.status.conditions == ("pilot_lost",)
    assert dive.status.failsafe == "pilot_lost"  # the link is there again, he is not
    assert dive.ask("resume") == "pilot lost: no stick positions arrive, still"
