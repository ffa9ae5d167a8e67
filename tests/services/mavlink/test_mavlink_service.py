"""A ground station flies the simulated vehicle on virtual time, over links that a test holds."""

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from messages import topics
from messages.pilot import PilotCommand
from messages.vehicle import Truth, VehicleStatus
from services.mavlink.core import Settings
from services.mavlink.pilot import Addressed, GroundStation
from services.mavlink.service import GroundStations, wire
from services.mavlink_io.packet import MavlinkPacket
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node

MS = 1_000_000
S = 1000 * MS
DRONE = ("simulator", "estimation", "reference", "control", "tether")
ANN, BOB = GroundStation("udp a", 255, 190), GroundStation("tcp b", 254, 190)
NEUTRAL: dict[str, Any] = {"target": 1, "x": 0, "y": 0, "z": 500, "r": 0, "buttons": 0}


class Air:
    """Links that the test holds both ends of."""

    def __init__(self) -> None:
        self.names = [ANN.link, BOB.link]
        self.sent: list[Addressed] = []
        self.waiting: deque[MavlinkPacket] = deque()

    def receive(self) -> list[MavlinkPacket]:
        packets = list(self.waiting)
        self.waiting.clear()
        return packets

    def send(self, packet: MavlinkPacket, link: str | None) -> None:
        self.sent.append(Addressed(link, packet))

    def of(self, name: str, link: str = ANN.link) -> list[dict[str, Any]]:
        here = (None, link)
        return [
            dict(a.packet.fields) for a in self.sent if a.packet.name == name and a.link in here
        ]


class Dive:
    """The whole chain with a ground station as pilot, and perhaps a gamepad's script beside it."""

    def __init__(self, folder: Path, script: str | None = None) -> None:
        self.rows = Registry.read()
        pilot = "gamepad"
        if script is not None:
            (folder / "script.csv").write_text("t,surge,sway,heave,yaw\n" + script)
            pilot = f"script:{folder / 'script.csv'}"
        quick = ["estimation.calibration.still_time=3"]  # [s] less to wait for
        self.stack = Stack(pilot=pilot, out=str(folder), overrides=quick)
        self.host, self.air = VirtualHost(), Air()
        names = DRONE if script is None else (*DRONE, "gamepad")
        for name in names:
            self.host.add(name, self.rows[name], self.stack)
        self.notify: Callable[[], None] = lambda: None
        self.start()
        self.truth: list[Truth] = []
        self.statuses: list[VehicleStatus] = []
        self.commands: list[PilotCommand] = []
        observer = self.host.node("observer", ["drone"])
        observer.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        observer.each(topics.STATUS, lambda m, _: self.statuses.append(m))
        observer.each(topics.PILOT_COMMAND, lambda m, _: self.commands.append(m))

    def start(self) -> None:
        def wired(node: Node, _: Stack) -> None:
            self.notify = node.from_outside(GroundStations(node, Settings(), self.air).receive)

        self.host.add("mavlink", self.rows["gamepad"], self.stack, wired)

    def hear(self, name: str, sender: GroundStation = ANN, **fields: Any) -> None:
        link, system, component = sender
        self.air.waiting.append(MavlinkPacket(name, fields, system, component, link))
        self.notify()

    def command(self, number: int, *params: float, sender: GroundStation = ANN) -> None:
        padded = [*params, *[0.0] * 7][:7]
        target = {"target_system": 1, "target_component": 1}
        values = {f"param{k + 1}": value for k, value in enumerate(padded)}
        self.hear("COMMAND_LONG", sender, command=number, **target, **values)

    def steer(
        self, seconds: float, sender: GroundStation = ANN, hz: float = 25.0, **sticks: int
    ) -> "Dive":
        for _ in range(round(seconds * hz)):
            self.hear("MANUAL_CONTROL", sender, **(NEUTRAL | sticks))
            self.run(1.0 / hz)
        return self

    def run(self, seconds: float) -> "Dive":
        self.host.run(self.host.now + round(seconds * S))
        return self

    def armed(self) -> "Dive":
        for _ in range(20):
            self.steer(0.5)
            if self.status.activity == "ready":
                break
        self.command(400, 1.0)
        self.steer(0.5)
        assert self.status.armed
        return self

    @property
    def status(self) -> VehicleStatus:
        return self.statuses[-1]

    @property
    def depth(self) -> float:
        return self.truth[-1].position[2]

    @property
    def acks(self) -> list[tuple[int, int]]:
        return [(ack["command"], ack["result"]) for ack in self.air.of("COMMAND_ACK")]


def test_a_ground_station_dives_a_metre_lets_go_and_the_drone_holds(tmp_path: Path) -> None:
    dive = Dive(tmp_path).armed()
    assert dive.status.pilot == "ground station 255/190"
    start = dive.depth
    while dive.depth < start + 1.0:
        dive.steer(0.2, z=0)
    dive.steer(3.0)
    held = dive.depth
    for _ in range(10):
        dive.steer(0.5)
        assert abs(dive.depth - held) < 0.1
    assert dive.air.of("GLOBAL_POSITION_INT")[-1]["relative_alt"] == pytest.approx(
        -1000 * dive.depth, abs=150
    )
    dive.command(176, 1.0, 19.0)
    dive.steer(0.5)
    assert dive.status.flight_mode == "manual"
    assert dive.air.of("HEARTBEAT")[-1]["custom_mode"] == 2  # a second old at most …
    dive.steer(1.0)
    assert dive.air.of("HEARTBEAT")[-1]["custom_mode"] == 19
    dive.command(400, 0.0)
    dive.steer(1.2)
    assert not dive.status.armed
    assert dive.acks == [(400, 0), (176, 0), (400, 0)]
    assert not dive.air.of("HEARTBEAT")[-1]["base_mode"] & 128


def test_the_first_sticks_are_enough_to_arm(tmp_path: Path) -> None:
    dive = Dive(tmp_path)
    dive.host.run(20 * S, done=lambda: bool(dive.statuses) and dive.status.activity == "ready")
    dive.run(1.0)
    dive.hear("MANUAL_CONTROL", **NEUTRAL)
    dive.command(400, 1.0)
    dive.run(0.25)
    assert dive.acks == [(400, 0)]


@pytest.mark.parametrize("hz", [10.0, 25.0, 50.0])
def test_sticks_at_any_usual_rate_are_one_pilot(tmp_path: Path, hz: float) -> None:
    dive = Dive(tmp_path).armed()
    dive.steer(3.0, hz=hz, z=400)
    assert {status.failsafe for status in dive.statuses} == {"none"}


@pytest.mark.slow
def test_a_ground_station_that_falls_silent_is_a_lost_pilot_within_its_time_to_live(
    tmp_path: Path,
) -> None:
    dive = Dive(tmp_path).armed().steer(2.0, z=0)
    silent = dive.host.now - 40 * MS  # the last sticks
    dive.run(4.0)
    lost = next(s for s in dive.statuses if s.failsafe == "pilot_lost")
    assert lost.stamp_ns - silent <= 330 * MS  # 300 ms, a state's period and the link
    assert max(c.stamp_ns for c in dive.commands) - silent <= 330 * MS
    held = dive.depth
    dive.run(5.0)
    assert abs(dive.depth - held) < 0.1
    assert dive.air.of("HEARTBEAT")[-1]["system_status"] == 5
    dive.steer(1.0, z=0)
    assert abs(dive.depth - held) < 0.1
    assert dive.status.failsafe == "pilot_lost", "sticks that move do not end a failsafe"
    dive.command(176, 1.0, 19.0)
    dive.steer(0.5)
    assert dive.status.failsafe == "none"
    assert dive.status.flight_mode == "manual"


def test_who_arms_while_a_failsafe_acts_resumes(tmp_path: Path) -> None:
    dive = Dive(tmp_path).armed().run(3.0).steer(1.0)
    assert dive.status.failsafe == "pilot_lost"
    before = len(dive.acks)
    dive.command(400, 1.0)
    dive.steer(1.0, z=0)
    assert dive.acks[before:] == [(400, 0)]
    assert (dive.status.failsafe, dive.status.armed) == ("none", True)
    assert dive.commands[-1].heave > 0.0


def test_beside_a_script_that_flies_the_ground_station_watches(tmp_path: Path) -> None:
    dive = Dive(tmp_path, "0,0,0,0,0\n1,0,0,0.5,0\n20,0,0,0,0\n")
    dive.host.run(40 * S, done=lambda: bool(dive.statuses) and dive.status.armed)
    dive.steer(2.0, z=1000, x=1000)
    dive.command(400, 0.0)
    dive.command(176, 1.0, 19.0)
    dive.steer(2.0, z=1000)
    assert dive.status.armed
    assert dive.status.flight_mode == "stabilised"
    assert {command.source for command in dive.commands} == {"script script"}
    assert [result for _, result in dive.acks] == [4, 4]
    assert "script script has control" in str(dive.air.of("STATUSTEXT"))
    assert dive.air.of("ATTITUDE")
    assert dive.air.of("ATTITUDE", BOB.link)


@pytest.mark.slow
def test_a_second_ground_station_moves_nothing_until_the_first_is_silent_for_long(
    tmp_path: Path,
) -> None:
    dive = Dive(tmp_path).armed()
    for _ in range(50):
        dive.hear("MANUAL_CONTROL", BOB, **(NEUTRAL | {"z": 0}))
        dive.steer(0.04)
    assert all(command.heave == 0.0 for command in dive.commands)
    assert dive.host.nodes["mavlink"].counts["not_the_holder:sticks"] == 50
    dive.steer(9.0, BOB)
    assert dive.status.failsafe == "pilot_lost"
    dive.steer(2.0, BOB)
    dive.command(400, 1.0, sender=BOB)
    dive.steer(1.0, BOB)
    assert dive.status.failsafe == "none"
    dive.steer(1.0, BOB, z=0)
    assert dive.commands[-1].heave > 0.0
    assert dive.commands[-1].source == "ground station 254/190"


def test_a_mode_chosen_while_the_drone_comes_to_rest_is_taken_up_then_and_that_is_said(
    tmp_path: Path,
) -> None:
    dive = Dive(tmp_path).armed()
    dive.steer(2.0, z=0)
    dive.command(193, 0.0)  # DO_PAUSE_CONTINUE: stop
    dive.steer(0.1)
    dive.command(176, 1.0, 0.0)  # STABILIZE
    dive.steer(0.3)
    assert dive.acks[-1] == (176, 0)
    assert dive.status.activity == "stopping"
    assert "it changes when it is at rest" in str(
        b"".join(m["text"] for m in dive.air.of("STATUSTEXT"))
    )
    dive.steer(4.0)
    assert (dive.status.activity, dive.status.flight_mode) == ("piloted", "heading_hold")


def test_a_restarted_service_goes_on_with_control(tmp_path: Path) -> None:
    dive = Dive(tmp_path).armed()
    epoch = dive.status.epoch
    dive.host.kill("mavlink")
    dive.run(1.0)
    dive.start()
    dive.steer(1.0)
    dive.command(400, 1.0)
    dive.steer(1.0, z=0)
    assert dive.status.epoch == epoch
    assert dive.status.failsafe == "none"
    assert dive.commands[-1].heave > 0.0


def test_a_silent_drone_has_no_heartbeat(tmp_path: Path) -> None:
    dive = Dive(tmp_path).run(2.0)
    assert dive.air.of("HEARTBEAT")
    dive.host.kill("reference")
    dive.host.kill("estimation")
    dive.run(3.0)
    dive.air.sent.clear()
    dive.run(5.0)
    assert dive.air.of("HEARTBEAT") == []
    assert dive.air.of("ATTITUDE") == []
    dive.command(400, 1.0)
    dive.run(7.0)
    assert dive.acks == [(400, 4)]


def test_on_virtual_time_the_service_itself_refuses_to_start(tmp_path: Path) -> None:
    host = VirtualHost()
    with pytest.raises(LindyError, match="mavlink needs real time"):
        host.add("mavlink", Registry.read("mavlink")["mavlink"], Stack(virtual=True), wire)
    assert list(tmp_path.iterdir()) == []
