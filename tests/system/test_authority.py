"""Who has control: commands of another authority epoch never move the drone."""

from typing import Any

import msgspec
import pytest

from messages import topics
from messages.control import ThrusterCommand
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.vehicle import Truth, VehicleStatus
from services.reference.guidance.authority import SILENT_NS
from tests.support.dive import ON_BOARD, Dive
from tests.support.hindered_host import HinderedHost

SECOND = 1_000_000_000


class Rival:
    """A second pilot in the same realm, who says what the test wants."""

    def __init__(self, host: HinderedHost, name: str, heave: float) -> None:
        node = host.node(name, ["drone"])
        self.epoch, self.heave, self.name = 0, heave, name
        self.speaks = True
        self.answers: list[PilotAnswer] = []
        self._commands = node.publisher(topics.PILOT_COMMAND)
        self._requests = node.publisher(topics.PILOT_REQUEST)
        node.every(topics.PILOT_COMMAND.hz, self._speak)
        node.each(topics.PILOT_ANSWER, self._hear)

    def ask(self, kind: str, now: int, **more: Any) -> None:
        request = PilotRequest(stamp_ns=now, id=f"{self.name}-{kind}-{now}", kind=kind)  # type: ignore[arg-type]
        named = msgspec.structs.replace(request, source=self.name, epoch=self.epoch)
        self._requests.put(msgspec.structs.replace(named, **more))

    def _hear(self, answer: PilotAnswer, _: int) -> None:
        if answer.id.startswith(self.name):
            self.answers.append(answer)
            if answer.epoch is not None:
                self.epoch = answer.epoch

    def _speak(self, now: int) -> None:
        if self.speaks:
            self._commands.put(
                PilotCommand(
                    stamp_ns=now, surge=0.0, sway=0.0, heave=self.heave, yaw=0.0,
                    source=self.name, epoch=self.epoch,
                )
            )  # fmt: skip


class RivalsDive(Dive):
    """The drone, and two pilots of whom the second one is silent."""

    def __init__(self) -> None:
        super().__init__(services=ON_BOARD)
        self.references = self.heard(topics.REFERENCE)
        self.first, self.second = Rival(self.host, "first", 0.0), Rival(self.host, "second", 0.0)
        self.second.speaks = False
        self.run(6.0)


def asked(host: HinderedHost, pilot: Rival, kind: str, **more: Any) -> str:
    """Ask, and wait for the answer. Returns why it was refused; empty: it was granted."""
    pilot.ask(kind, host.now, **more)
    host.run(host.now + SECOND // 5)
    answer = pilot.answers[-1]
    assert answer.id.startswith(f"{pilot.name}-{kind}")
    return answer.reason


def test_control_goes_from_hand_to_hand_without_a_gap_and_the_first_hand_moves_nothing_more() -> (
    None
):
    dive = RivalsDive()
    host, references, statuses = dive.host, dive.references, dive.statuses
    first, second = dive.first, dive.second
    assert asked(host, first, "lease") == ""
    assert (first.epoch, statuses[-1].pilot) == (1, "first")
    assert asked(host, first, "arm") == ""
    host.run(7 * SECOND)
    assert statuses[-1].armed

    words = "first has control since 1 s; ask for an offer, or take by force"
    assert asked(host, second, "lease") == words
    assert (second.epoch, statuses[-1].epoch) == (0, 1)
    assert asked(host, first, "offer", to="third") == ""
    assert asked(host, second, "lease") == words
    assert asked(host, first, "offer", to="second") == ""
    assert asked(host, second, "lease") == ""
    assert (second.epoch, statuses[-1].epoch, statuses[-1].pilot) == (2, 2, "second")
    assert statuses[-1].failsafe == "none", "the first goes on until the second speaks"
    assert references[-1].epoch == 1
    second.speaks = True
    host.run(host.now + SECOND)
    first.heave = 1.0  # and nothing happens
    host.run(host.now + 2 * SECOND)
    assert all(abs(r.depth.velocity) < 1e-9 for r in references[-100:])
    assert references[-1].epoch == 2
    assert host.nodes["reference"].counts["wrong_epoch:pilot/command"] > 50
    assert {s.failsafe for s in statuses} == {"none"}

    second.heave = 0.5
    host.run(host.now + 2 * SECOND)
    assert references[-1].depth.velocity > 0.2
    assert "second has control since" in asked(host, first, "lease")
    assert asked(host, first, "force") == ""
    host.run(host.now + SECOND)
    assert (statuses[-1].pilot, references[-1].epoch) == ("first", 3)
    assert {s.failsafe for s in statuses} == {"none"}


Scene = tuple[HinderedHost, list[VehicleStatus], Rival, Rival]


@pytest.fixture
def dive() -> RivalsDive:
    return RivalsDive()


@pytest.fixture
def hand_over(dive: RivalsDive) -> Scene:
    """The first pilot has armed, the second one has taken control by force; both still talk."""
    for pilot, kind in ((dive.first, "lease"), (dive.second, "force")):
        assert asked(dive.host, pilot, kind) == ""
        pilot.speaks = True
        assert asked(dive.host, pilot, "arm") == ""
        dive.run(1.0)
    assert dive.statuses[-1].epoch == 2
    return dive.host, dive.statuses, dive.first, dive.second


def test_an_ousted_pilot_can_stop_the_drone_but_disarm_it_only_once_nobody_has_control(
    hand_over: Scene,
) -> None:
    host, statuses, first, second = hand_over
    second.heave = 0.5
    host.run(host.now + SECOND)
    assert asked(host, first, "disarm").startswith("second has control since 2 s; ask for")
    assert statuses[-1].armed
    assert asked(host, first, "stop") == ""
    assert statuses[-1].activity == "stopping"
    second.speaks = False
    host.run(host.now + SILENT_NS - SECOND)
    assert asked(host, first, "disarm").startswith("second has control")
    host.run(host.now + SECOND)
    assert (statuses[-1].pilot, statuses[-1].armed) == ("", True)
    assert asked(host, first, "light", value=1.0) == "nobody has control; take it first"
    assert asked(host, first, "disarm") == ""
    assert not statuses[-1].armed


# Memory lost, and numbers that nobody gave.


@pytest.mark.parametrize("forgets", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_after_three_leases_a_reference_may_lose_its_memory_and_the_drone_is_flown_on(
    hand_over: Scene, dive: RivalsDive, forgets: bool
) -> None:
    host, statuses, first, second = hand_over
    assert asked(host, first, "force") == ""
    host.run(host.now + SECOND)
    assert first.epoch == 3
    gate_counts = host.nodes["simulator"].counts
    host.kill("reference")
    if forgets:
        host.forget("reference")
    host.run(host.now + SECOND // 2)
    dive.start("reference")
    host.run(host.now + SECOND)
    assert statuses[-1].armed is not forgets
    for kind in ("lease", "arm"):
        assert asked(host, second if forgets else first, kind) == ""
    flier, other = (second, first) if forgets else (first, second)
    assert (flier.epoch > 3) is forgets, "an old epoch is nobody's number again"
    flier.heave, other.heave = 0.5, -1.0
    refused = gate_counts["wrong_epoch:control/thrusters"]
    truth: list[Truth] = []
    host.node("eye", ["drone"]).each(topics.TRUTH, lambda m, _: truth.append(m))
    host.run(host.now + 4 * SECOND)
    assert gate_counts["wrong_epoch:control/thrusters"] == refused
    assert truth[-1].position[2] > truth[0].position[2] + 0.3, "down, as the one in control says"


@pytest.mark.slow
def test_one_thruster_command_with_a_huge_epoch_locks_nobody_out_for_good(
    hand_over: Scene,
) -> None:
    host, statuses, _, second = hand_over
    thief = host.node("thief", ["drone"]).publisher(topics.THRUSTERS)
    newest = list[ThrusterCommand]()
    host.node("eye", ["drone"]).each(topics.THRUSTERS, lambda m, _: newest.append(m))
    host.run(host.now + SECOND)
    counts = host.nodes["simulator"].counts
    thief.put(msgspec.structs.replace(newest[-1], stamp_ns=host.now, epoch=10**9))
    host.run(host.now + SECOND // 2)
    assert counts["wrong_epoch:control/thrusters"] > 40, "for a moment"
    host.run(host.now + SECOND)
    refused = counts["wrong_epoch:control/thrusters"]
    second.heave = 0.5
    truth: list[Truth] = []
    host.node("second eye", ["drone"]).each(topics.TRUTH, lambda m, _: truth.append(m))
    host.run(host.now + 4 * SECOND)
    assert counts["wrong_epoch:control/thrusters"] == refused
    assert truth[-1].position[2] > truth[0].position[2] + 0.3
    assert statuses[-1].armed
