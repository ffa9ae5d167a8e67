"""A ground station flies the simulated vehicle on virtual time. See also
tests/contract/test_any_pilot.py."""

from pathlib import Path

import pytest

from services.mavlink.service import wire
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.pilots import STATIONS, GroundStationDive

S = 1_000_000_000  # [ns]
ANN, BOB = 0, 1


def test_a_ground_station_sees_the_depth_the_mode_and_a_failsafe(tmp_path: Path) -> None:
    dive = GroundStationDive(tmp_path).armed()
    dive.steer(1.5, heave=1.0).steer(2.0)
    height = dive.air.of("GLOBAL_POSITION_INT")[-1]["relative_alt"]
    assert height == pytest.approx(-1000 * dive.depth, abs=150)
    dive.command(176, 1.0, 19.0)
    dive.steer(0.5)
    assert dive.status.flight_mode == "manual"
    assert dive.air.of("HEARTBEAT")[-1]["custom_mode"] == 2  # a second old at most …
    dive.steer(1.0)
    assert dive.air.of("HEARTBEAT")[-1]["custom_mode"] == 19
    dive.run(2.0)
    assert dive.air.of("HEARTBEAT")[-1]["system_status"] == 5
    dive.steer(0.3).disarm()
    dive.steer(1.2)
    assert dive.acks == [(400, 0), (176, 0), (400, 0)]
    assert not dive.air.of("HEARTBEAT")[-1]["base_mode"] & 128


def test_beside_a_script_that_flies_the_ground_station_watches(tmp_path: Path) -> None:
    dive = GroundStationDive(tmp_path, "0,0,0,0,0\n1,0,0,0.5,0\n20,0,0,0,0\n")
    dive.host.run(40 * S, done=lambda: bool(dive.statuses) and dive.status.armed)
    dive.steer(2.0, heave=-1.0, surge=1.0)
    dive.command(400, 0.0)
    dive.command(176, 1.0, 19.0)
    dive.steer(2.0, heave=-1.0)
    assert dive.status.armed
    assert dive.status.flight_mode == "stabilised"
    assert {command.source for command in dive.commands} == {"script script"}
    assert [result for _, result in dive.acks] == [4, 4]
    assert "script script has control" in str(dive.air.of("STATUSTEXT"))
    assert dive.air.of("ATTITUDE")
    assert dive.air.of("ATTITUDE", STATIONS[BOB].link)


def test_a_mode_chosen_while_the_drone_comes_to_rest_is_taken_up_then_and_that_is_said(
    tmp_path: Path,
) -> None:
    dive = GroundStationDive(tmp_path).armed()
    dive.steer(2.0, heave=1.0)
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
    dive = GroundStationDive(tmp_path).armed()
    epoch = dive.status.epoch
    dive.host.kill("mavlink")
    dive.run(1.0)
    dive.start()
    dive.steer(1.0)
    dive.command(400, 1.0)
    dive.steer(1.0, heave=1.0)
    assert dive.status.epoch == epoch
    assert dive.status.failsafe == "none"
    assert dive.commands[-1].heave > 0.0


def test_a_silent_drone_has_no_heartbeat(tmp_path: Path) -> None:
    dive = GroundStationDive(tmp_path).run(2.0)
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
