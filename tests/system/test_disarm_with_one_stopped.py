"""With any one process of the chain stopped the pilot can disarm, and it stays disarmed when that
process wakes again. On virtual time; a stopped process handles nothing and keeps what arrives."""

from typing import Self

import pytest

from messages import topics
from messages.reference import Reference
from messages.vehicle import Actuation
from services.vehicle_view import words
from services.vehicle_view.io.ports import VehiclePorts
from services.vehicle_view.view import VehicleView, vehicle_view
from tests.support.dive import ON_BOARD, Dive, Person
from tests.support.hindered_host import Hindrance

S = 10**9  # [ns]


class StoppedDive(Dive):
    """The drone, armed and diving, and a pilot."""

    def __init__(self) -> None:
        self.processes = {name: Hindrance(lambda: self.host.now) for name in ON_BOARD}
        super().__init__(services=ON_BOARD, lateness=self.processes)
        self.actuations = self.heard(topics.ACTUATION)
        self.commands = self.heard(topics.THRUSTERS)
        self.pilot = Person(self.host)
        self.references = self.heard(topics.REFERENCE)
        self._ports = VehiclePorts(self.host.node("screen", ["drone"]))

    @property
    def reference(self) -> Reference:
        return self.references[-1]

    def arm_and_dive(self) -> Self:
        self.run(6.0)
        assert self.pilot.ask("arm") == ""
        self.pilot.heave = 0.8
        self.run(2.0)
        assert self.turning
        return self

    @property
    def turning(self) -> bool:
        return turns(self.actuations[-1])

    @property
    def shown(self) -> VehicleView:
        """What every screen says."""
        return vehicle_view(self._ports.newest(self.host.now), self.host.now)

    def stop(self, name: str, seconds: float) -> None:
        self.processes[name].stop(self.host.now + round(seconds * S))

    def armed_since(self, ns: int) -> bool:
        return any(c.armed and any(c.thrust) for c in self.commands if c.stamp_ns > ns)


def turns(actuation: Actuation) -> bool:
    """A thruster with a lag comes to rest, but never wholly."""
    return any(abs(newtons) > 0.01 for newtons in actuation.thrust)


@pytest.fixture
def dive() -> StoppedDive:
    return StoppedDive().arm_and_dive()


ELSE = pytest.param("reference", marks=pytest.mark.slow)


@pytest.mark.parametrize(
    "stopped", ["control", ELSE, pytest.param("estimation", marks=pytest.mark.slow)]
)
def test_a_disarm_stops_the_thrusters_and_they_stay_stopped(
    dive: StoppedDive, stopped: str
) -> None:
    dive.stop(stopped, 3.0)
    dive.run(0.15)
    asked, name = dive.host.now, dive.pilot.say("disarm")
    dive.run(1.0)
    assert not dive.turning
    assert [answer.accepted for answer in dive.pilot.answered(name)] == [True]
    began = len(dive.actuations)
    dive.run(6.0)  # awake again since three seconds
    assert not any(turns(a) for a in dive.actuations[began:])
    assert not dive.reference.armed
    assert dive.reference.stamp_ns > asked + 3 * S


@pytest.mark.parametrize("stopped", ["control", ELSE])
def test_an_arm_after_the_disarm_arms_again(dive: StoppedDive, stopped: str) -> None:
    dive.pilot.heave = 0.0
    dive.stop(stopped, 1.0)
    dive.run(0.3)
    dive.pilot.say("disarm")
    dive.run(2.0)
    assert not dive.turning
    assert dive.pilot.ask("arm") == ""
    dive.pilot.heave = 0.8
    dive.run(1.0)
    assert dive.turning


@pytest.mark.parametrize("stopped", ["reference", pytest.param("control", marks=pytest.mark.slow)])
def test_a_disarm_and_a_later_arm_in_one_silence(dive: StoppedDive, stopped: str) -> None:
    dive.pilot.heave = 0.0
    dive.stop(stopped, 1.0)
    dive.run(0.05)
    dive.pilot.say("disarm")
    dive.run(0.3)
    dive.pilot.say("arm")
    dive.run(2.0)
    dive.pilot.heave = 0.8
    dive.run(1.0)
    assert dive.turning


@pytest.mark.slow
def test_screens_say_disarmed_while_the_reference_that_says_armed_hangs(dive: StoppedDive) -> None:
    assert dive.shown.armed
    dive.stop("reference", 3.0)
    dive.run(0.15)
    dive.pilot.say("disarm")
    dive.run(1.0)
    assert not dive.shown.armed
    assert dive.shown.last_known
    assert words.armed(dive.shown) == "DISARMED"
    dive.run(4.0)
    assert not dive.shown.armed
    assert not dive.shown.last_known


def test_a_reference_that_lost_the_request_is_told_of_it(dive: StoppedDive) -> None:
    """Killed while it was silent, it starts again with its checkpoint: armed."""
    dive.host.kill("reference")
    dive.run(0.15)
    name = dive.pilot.say("disarm")
    dive.run(0.3)
    assert [answer.accepted for answer in dive.pilot.answered(name)] == [True]
    woken = dive.host.now
    dive.start("reference")
    dive.run(1.0)
    assert dive.reference.stamp_ns > woken
    assert not dive.reference.armed
    assert not dive.armed_since(woken)
    assert dive.host.nodes["control"].counts["overruled:reference"] == 1
    assert not dive.turning


def test_a_stop_is_answered_while_reference_is_silent_and_done_when_it_wakes(
    dive: StoppedDive,
) -> None:
    dive.pilot.heave = 0.0
    dive.run(3.0)
    dive.pilot.say("goto", depth=8.0)
    dive.run(1.0)
    dive.host.kill("reference")
    dive.run(0.15)
    name = dive.pilot.say("stop", epoch=99)  # by anybody
    dive.run(0.3)
    assert [answer.accepted for answer in dive.pilot.answered(name)] == [True]
    dive.stop("reference", 0.0)
    dive.start("reference")
    dive.run(5.0)
    assert dive.reference.armed
    assert abs(dive.reference.depth.velocity) < 0.01
    assert dive.reference.depth.position < 6.0
