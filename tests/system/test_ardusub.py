"""The whole stack, and the contract of every vehicle side, with a board under ArduSub: the double
of tests/support/ardusub_double, on virtual time, over a link that encodes and decodes every
frame."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random
from statistics import fmean
from typing import Any, Self

import pytest

from messages import topics
from messages.vehicle import Truth
from services.ardusub.service import wire_to
from services.marine.vehicle import Vehicle
from services.mavlink_io.io.links import Received
from services.mavlink_io.packet import MavlinkPacket, command
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.memory import BoardOnHost
from tests.support.dive import Dive
from tools.driver.bench import Bench, alone, on_virtual_time
from tools.driver.rules import RULES, Rule

CHAIN = ("ardusub", "estimation", "reference", "control", "tether", "gamepad")
BOTH = pytest.mark.parametrize("version", ["4.5", "4.8"])
# At the surface the verticals are half in the air: down first.
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n4,0,0,0,0\n99,0,0,0,0\n"


class Flight(Dive):
    """The chain on a board, with a pilot's script, and an observer on board."""

    board: BoardOnHost

    def __init__(
        self, version: str = "4.8", script: str = SCRIPT, overrides: Sequence[str] = (), **more: Any
    ) -> None:
        self._board: dict[str, Any] = {"version": version, **more}
        super().__init__(
            script, CHAIN, stack="ardusub", overrides=overrides, wires={"ardusub": self._wire},
            vehicle="bluerov2_heavy",
        )  # fmt: skip
        self.lines = self.heard(topics.LOG)
        self.states, self.reports = self.heard(topics.STATE), self.heard(topics.ACTUATION)

    def _wire(self, node: Node, stack: Stack) -> None:
        """To the board, which is there before the service and after it."""
        if not hasattr(self, "board"):
            vehicle, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
            self.double = BoardDouble(vehicle, place, **self._board)
            self.board = BoardOnHost(self.host, self.double)
        wire_to(self.board.link, node, stack)

    def until_armed(self) -> Self:
        self.host.run(self.host.now + 60_000_000_000, done=lambda: self.double.armed)
        assert self.double.armed, [line.text for line in self.lines]
        return self

    def said(self, words: str) -> list[str]:
        return [m.text for m in self.lines if m.service == "ardusub" and words in m.text]

    def another(self, number: int, *params: float) -> None:
        """A command of another ground station."""
        self.board.other_station(command(1, number, *params), self.host.now)

    @property
    def depth(self) -> float:
        return self.double.hull.simulator.truth().position[2]

    @property
    def sticks(self) -> list[MavlinkPacket]:
        return [p for p in self.board.heard if p.name == "RC_CHANNELS_OVERRIDE"]


@pytest.mark.slow
@BOTH
def test_it_dives_and_holds_its_depth(version: str) -> None:
    flight = Flight(version).until_armed().run(9.0)
    depth = flight.depth
    assert depth > 0.6
    depths = list[float]()
    for _ in range(16):
        flight.run(0.5)
        depths.append(flight.depth)
    assert max(depths) - min(depths) < 0.1
    assert abs(flight.states[-1].depth.value - flight.depth) < 0.1


RELEASES = (
    "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,1,0\n6,0,0,0,0\n"
    "9,{surge},0,0,{yaw}\n13,0,0,0,0\n99,0,0,0,0\n"
)


def after_the_release(flight: Flight) -> list[Truth]:
    """Five seconds, 20 times a second."""
    flight.until_armed().run(13.0)
    return [flight.run(0.05).double.hull.simulator.truth() for _ in range(100)]


def beyond_rest(found: Sequence[float]) -> float:
    rest = fmean(found[-20:])
    return max(abs(one - rest) for one in found)


@pytest.mark.slow
def test_a_drone_that_pitches_in_surge_keeps_its_depth_when_surge_is_let_go() -> None:
    """Its bow is heavy, so that it lies pitched and its surge thrust pushes it down; and the flow
    lifts its hull no more than that of ArduSub's own simulator."""
    hull = (
        "simulator.hull.gravity_shift=[0.012,0,0]",
        "simulator.hull.added_mass=[6.36, 7.12, 6.36, 0.189, 0.135, 0.222]",
        "simulator.wake_share=0.0",
    )
    script, off = RELEASES.format(surge=1, yaw=0), list[float]()
    for more in ((), ("control.coupling.heave=false",)):
        flight = Flight(script=script, overrides=(*hull, *more))
        off.append(beyond_rest([truth.position[2] for truth in after_the_release(flight)]))
    assert off[0] < 0.05 < 0.7 * off[1], off


@pytest.mark.slow
def test_a_turn_of_a_hull_with_more_drag_than_its_file_ends_where_it_should() -> None:
    """The drag that was learnt in the turn ends with it."""
    script = RELEASES.format(surge=0, yaw=0.9)
    drag = "simulator.hull.quadratic_damping=[141.0, 217.0, 190.0, 1.19, 0.47, 8.0]"
    beyond = list[float]()
    for more in ((), ("control.heading.drag_speed=0.0",)):
        flight = Flight(script=script, overrides=(drag, *more))
        headings = [truth.heading for truth in after_the_release(flight)]
        beyond.append(max(headings) - fmean(headings[-20:]))
    assert beyond[0] < 0.03 < 0.8 * beyond[1], beyond


def test_silence_makes_neutral_at_once_and_disarms_after_a_while() -> None:
    flight = Flight().until_armed().run(3.0)
    assert flight.double.servo[4] > 1550
    flight.host.kill("control")
    flight.run(0.35)
    assert flight.double.servo == [1500] * 8
    assert flight.double.armed
    flight.run(2.5)
    assert not flight.double.armed
    assert flight.double.texts[-1] == "Disarming motors"  # not by a failsafe of the board
    assert flight.host.nodes["ardusub"].counts["stale:control/thrusters"] == 1
    flight.start("control")
    flight.run(3.0)
    assert flight.double.armed, "the pilot still wants it armed"


def test_when_the_service_dies_the_boards_own_failsafe_acts() -> None:
    flight = Flight().until_armed().run(2.0)
    assert flight.double.servo[4] > 1550
    flight.host.kill("ardusub")
    flight.run(3.2)
    assert flight.double.servo == [1500] * 8
    assert not flight.double.armed
    assert flight.double.texts[-2:] == ["Lost manual control", "Disarming motors"]


@pytest.mark.parametrize("number", ["disarm", pytest.param("mode", marks=pytest.mark.slow)])
def test_another_ground_station_is_obeyed_without_a_fight(number: str) -> None:
    flight = Flight().until_armed().run(2.0)
    flight.another(*((400, 0) if number == "disarm" else (176, 1, 2)))
    flight.run(1.1)  # a change of mode is seen with the next heartbeat
    sent = len(flight.sticks)
    flight.run(1.5)
    assert len(flight.sticks) == sent, "its sticks are theirs"
    assert flight.statuses[-1].armed, "Lindy's own pilot has done nothing"
    assert flight.double.armed == (number == "mode")
    assert flight.double.mode == (2 if number == "mode" else 19)
    assert len(flight.said("somebody else has the vehicle")) == 1
    assert flight.host.nodes["ardusub"].counts["outdone:ardusub"] == 1


def test_a_wrong_parameter_is_named_and_nothing_starts() -> None:
    flight = Flight(params={"FS_PILOT_INPUT": 0.0})
    flight.run(20.0)
    assert not flight.double.armed
    assert not flight.states
    [sentence] = flight.said("FS_PILOT_INPUT")
    assert sentence.endswith("FS_PILOT_INPUT is 0; allowed: 2 (disarm when the sticks are silent)")
    flight.double.params["FS_PILOT_INPUT"] = 2.0  # put right, it is checked again
    flight.until_armed()


def test_a_packet_that_arrives_while_the_service_is_held_up_is_no_jump_of_the_clock() -> None:
    """A busy computer stops the service between its timer and its look at the link."""
    flight = Flight()
    for name in CHAIN[1:]:
        flight.host.kill(name)
    link, host = flight.board.link, flight.host
    receive, looks = link.receive, [0]

    def held_up() -> list[Received]:
        looks[0] += 1
        if looks[0] % 40 == 0:
            host.now += 30_000_000  # [ns]

            flight.board.step(host.now)
        return receive()

    link.receive = held_up
    flight.run(10.0)
    assert flight.host.nodes["ardusub"].counts["jumped:board_clock"] == 0
    assert not flight.said("jumped")


@pytest.mark.slow
def test_a_flood_of_garbage_in_mid_dive_is_counted_and_the_vehicle_holds_its_depth() -> None:
    """On the cable itself, between the frames of the board."""
    flight = Flight().until_armed().run(9.0)
    depth, draw, receive = flight.depth, Random(1), flight.board.link.receive

    def noisy() -> list[Received]:
        return [
            arrival._replace(
                pieces=[part for good in arrival.pieces for part in (good, draw.randbytes(400))]
            )
            for arrival in receive()
        ]

    flight.board.link.receive = noisy
    flight.run(5.0)
    assert flight.double.armed
    assert abs(flight.depth - depth) < 0.15
    assert flight.host.nodes["ardusub"].counts["malformed:mavlink"] > 400
    assert flight.host.nodes["ardusub"].counts["jumped:board_clock"] == 0


@pytest.mark.slow
def test_an_imu_quieter_than_its_steps_is_believed_until_the_thrust_changes() -> None:
    """4.5 sends whole mg and mrad/s; what repeats itself is at rest, or frozen."""
    quiet = ("simulator.gyro_noise=0", "simulator.gyro_drift=0", "simulator.accelerometer_noise=0")
    flight = Flight("4.5", overrides=quiet).until_armed().run(12.0)
    said = flight.host.nodes["estimation"].counts
    assert not [name for name in said if name.startswith("frozen")], said
    assert flight.depth > 0.6
    message, last = flight.double.hull.message, dict[str, dict[str, Any]]()

    def frozen(name: str, boot_us: int, now: int) -> MavlinkPacket | None:
        packet = message(name, boot_us, now)
        if packet is None or name != "RAW_IMU":
            return packet
        fields = last.setdefault(name, packet.fields)
        return packet._replace(fields={**fields, "time_usec": packet.fields["time_usec"]})

    flight.double.hull.message = frozen
    flight.run(3.0)
    assert said["frozen:sensor/imu"] == 1


def bench_on_a_board(folder: Path, version: str) -> Bench:
    """The bench of the contract, with this vehicle side alone."""
    services, stack = alone("ardusub", "bluerov2_heavy", folder, virtual=True)
    host = VirtualHost()
    vehicle, place = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    board = BoardOnHost(host, BoardDouble(vehicle, place, version=version))
    node, say = host.node("contract", ["drone"]), host.side("drone").say(topics.THRUSTERS)
    bench = on_virtual_time(host, node, say, stack)
    host.add_all(services, stack, {"ardusub": partial(wire_to, board.link)})
    bench.settle()
    return bench


@pytest.mark.slow
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
@pytest.mark.parametrize("version", ["4.5", "4.8"])
def test_it_is_kept(tmp_path: Path, rule: Rule, version: str) -> None:
    rule(bench_on_a_board(tmp_path, version))
