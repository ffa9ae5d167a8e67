"""Who has control: commands of another authority epoch never move the drone."""

import msgspec
import pytest

from messages import topics
from messages.control import ThrusterCommand
from messages.vehicle import Truth, VehicleStatus
from services.reference.guidance.authority import SILENT_NS
from tests.support.dive import ON_BOARD, Dive, Person
from tests.support.hindered_host import HinderedHost

SECOND = 1_000_000_000


class RivalsDive(Dive):
    """The drone, and two pilots of whom the second one is silent."""

    def __init__(self) -> None:
        super().__init__(services=ON_BOARD)
        self.references = self.heard(topics.REFERENCE)
        self.first, self.second = Person(self.host, "first"), Person(self.host, "second")
        self.second.speaks = False
        self.run(6.0)


def test_control_goes_from_hand_to_hand_without_a_gap_and_the_first_hand_moves_nothing_more() -> (
    None
):
    dive = RivalsDive()
    host, references, statuses = dive.host, dive.references, dive.statuses
    first, second = dive.first, dive.second
    assert first.ask("lease") == ""
    assert (first.epoch, statuses[-1].pilot) == (1, "first")
    assert first.ask("arm") == ""
    host.run(7 * SECOND)
    assert statuses[-1].armed

    words = "first has had control for 1 s; ask for an offer, or take by force"
    assert second.ask("lease") == words
    assert (second.epoch, statuses[-1].epoch) == (0, 1)
    assert first.ask("offer", to="third") == ""
    assert second.ask("lease") == words
    assert first.ask("offer", to="second") == ""
    assert second.ask("lease") == ""
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
    assert "second has had control for" in first.ask("lease")
    assert first.ask("force") == ""
    host.run(host.now + SECOND)
    assert (statuses[-1].pilot, references[-1].epoch) == ("first", 3)
    assert {s.failsafe for s in statuses} == {"none"}


Scene = tuple[HinderedHost, list[VehicleStatus], Person, Person]


@pytest.fixture
def dive() -> RivalsDive:
    return RivalsDive()


@pytest.fixture
def hand_over(dive: RivalsDive) -> Scene:
    """The first pilot has armed, the second one has taken control by force; both still talk."""
    for pilot in (dive.first, dive.second):
        assert pilot.ask("lease" if pilot is dive.first else "force") == ""
        pilot.speaks = True
        assert pilot.ask("arm") == ""
        dive.run(1.0)
    assert dive.statuses[-1].epoch == 2
    return dive.host, dive.statuses, dive.first, dive.second


def test_an_ousted_pilot_can_stop_the_drone_but_disarm_it_only_once_nobody_has_control(
    hand_over: Scene,
) -> None:
    host, statuses, first, second = hand_over
    second.heave = 0.5
    host.run(host.now + SECOND)
    assert first.ask("disarm").startswith("second has had control for 2 s; ask for")
    assert statuses[-1].armed
    assert first.ask("stop") == ""
    assert statuses[-1].activity == "stopping"
    second.speaks = False
    host.run(host.now + SILENT_NS - SECOND)
    assert first.ask("disarm").startswith("second has had control")
    host.run(host.now + SECOND)
    assert (statuses[-1].pilot, statuses[-1].armed) == ("", True)
    assert first.ask("light", value=1.0) == "nobody has control; take it first"
    assert first.ask("disarm") == ""
    assert not statuses[-1].armed


# Memory lost, and numbers that nobody gave.


@pytest.mark.parametrize("forgets", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_after_three_leases_a_reference_may_lose_its_memory_and_the_drone_is_flown_on(
    hand_over: Scene, dive: RivalsDive, forgets: bool
) -> None:
    host, statuses, first, second = hand_over
    assert first.ask("force") == ""
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
    flier, other = (second, first) if forgets else (first, second)
    assert (flier.ask("lease"), flier.ask("arm")) == ("", "")
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
