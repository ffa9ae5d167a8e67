"""`lindy doctor`: what it finds at the double of a board, and that it only ever asks."""

import json
import re
import socket
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from services.ardusub.service import ONE_BOARD
from services.ardusub.settings import Settings
from services.mavlink_io.io.endpoint import FrameReader, MavlinkCodec
from services.mavlink_io.io.links import Links
from services.mavlink_io.packet import MavlinkPacket
from services.simulator.core import Settings as SimulatorSettings
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.cable import STACK, VEHICLE
from tests.support.ardusub_double.memory import MemoryLink
from tests.support.cli import complaint
from tests.support.doors import free_port
from tools.__main__ import main
from tools.doctor.board_checks import VehicleFinding, fit, of_board
from tools.doctor.command import go_through
from tools.doctor.visit import NO_BOARD_NS, BoardVisit, S

BOTH = pytest.mark.parametrize("version", ["4.5", "4.8"])
URL = "udpin:127.0.0.1:14551"
STEP_NS, NOISE_NS = 5_000_000, 50_000_000  # [ns] between two looks at the link
GROUND_STATION, PLANE, PX4 = 6, 1, 12


class Bench:
    """A board at a cable, in virtual time, with whatever else is to be heard at it."""

    def __init__(self, version: str = "4.8", **board: Any) -> None:
        place = STACK.section("simulator", SimulatorSettings)
        self.board: BoardDouble | None = BoardDouble(VEHICLE, place, version=version, **board)
        self.link, self.now = MemoryLink(), 7 * S
        self.asked: list[MavlinkPacket] = []  # by the doctor
        self.noise = b""  # [bytes] 20 times a second
        self.beside: list[tuple[int, int]] = []  # system and component of other ground stations
        self._codec = MavlinkCodec(1, 1)
        self._reader = FrameReader(self._codec)

    def wait(self) -> None:
        self.now += STEP_NS
        for frame in self.link.down:
            self.asked += self._reader.read([frame])
        heard = self.asked[-len(self.link.down) :] if self.link.down else []
        self.link.down.clear()
        if self.board is not None:
            for packet in heard:
                self.board.hear(packet, self.now)
            self.board.advance(self.now)
            self.link.up.extend(self._codec.encode(packet) for packet in self.board.sent())
        if self.now % S == 0:
            self.link.up.extend(_heartbeat(*who) for who in self.beside)
        if self.now % NOISE_NS == 0:
            self.link.up.append(self.noise)

    def visited(
        self,
        settings: Settings | None = None,
        seconds: float = 1.0,
        servos: dict[str, int] | None = None,
    ) -> list[VehicleFinding]:
        visit = BoardVisit(settings or Settings(), len(VEHICLE.thruster), seconds, servos or {})
        go_through(visit, self.link, lambda: self.now, self.wait)
        return of_board(visit, VEHICLE, URL)


def _heartbeat(system: int, component: int) -> bytes:
    fields = {
        "type": GROUND_STATION, "autopilot": 8, "base_mode": 0, "custom_mode": 0,
        "system_status": 4, "mavlink_version": 3,
    }  # fmt: skip
    return MavlinkCodec(system, component).encode(MavlinkPacket("HEARTBEAT", fields))


def one(findings: list[VehicleFinding], what: str) -> VehicleFinding:
    [found] = [finding for finding in findings if finding.what == what]
    return found


@pytest.mark.parametrize(("accepts", "why"), [(False, "refused"), (True, "closed by the other")])
def test_a_connection_that_fails_is_said(*, accepts: bool, why: str) -> None:
    server = socket.create_server(("127.0.0.1", 0))
    url = f"tcp:127.0.0.1:{server.getsockname()[1]}"
    server.settimeout(0.05)
    if not accepts:
        server.close()
    visit, now = BoardVisit(Settings(), len(VEHICLE.thruster), 1.0), 7 * S
    links = Links([url], "ardusub.url", ONE_BOARD, visit.lost)

    def wait() -> None:
        nonlocal now
        now += NO_BOARD_NS // 4
        time.sleep(0.02)  # a real socket needs a moment
        with suppress(OSError):
            server.accept()[0].close()

    go_through(visit, links, lambda: now, wait)
    [found] = of_board(visit, VEHICLE, url, trouble=links.trouble)
    links.close()
    server.close()
    assert found.verdict == "missing"
    assert why in found.text


def wrong(findings: list[VehicleFinding]) -> list[VehicleFinding]:
    return [finding for finding in findings if finding.verdict != "ok"]


@BOTH
def test_a_board_that_fits_is_found_fit(version: str) -> None:
    found = Bench(version).visited()
    assert wrong(found) == []
    assert one(found, "version").text.startswith(f"ArduSub {version}.0")
    assert one(found, "FRAME_CONFIG").text == "2 (VECTORED_6DOF)"
    assert one(found, "RC1 to RC6").text == "all 24 fit"
    assert one(found, "armed").text == "no, in mode MANUAL"
    assert one(found, "clock").text.startswith("known to ")
    imu = "HIGHRES_IMU" if version == "4.8" else "RAW_IMU"
    assert one(found, imu).text.startswith(("100", "99"))
    assert one(found, "battery").text.startswith("16.")
    assert "is 3 s" in one(found, "FS_PILOT_TIMEOUT").text
    assert "recommended: at most 1 s" in one(found, "FS_PILOT_TIMEOUT").text


@BOTH
@pytest.mark.parametrize("armed", [False, True])
def test_it_only_asks_and_leaves_the_board_as_it_was(version: str, armed: bool) -> None:
    bench = Bench(version)
    assert bench.board is not None
    bench.board.armed = armed
    before = dict(bench.board.params)
    found = bench.visited()
    bench.wait()
    names = Counter(packet.name for packet in bench.asked)
    assert set(names) == {"COMMAND_LONG", "PARAM_REQUEST_READ", "TIMESYNC"}
    commands = {packet.fields["command"] for packet in bench.asked if "command" in packet.fields}
    assert commands == ({512} if armed else {512, 511}), "a version; rates, of a board at rest"
    assert bench.board.params == before
    assert bench.board.armed == armed
    assert bench.board.streams == {}
    assert {packet.system for packet in bench.asked} == {247}, "neither Lindy nor its stranger"
    assert fit(found) != armed
    assert (one(found, "armed").verdict == "change") == armed


@pytest.mark.parametrize(
    ("version", "name", "value", "told"),
    [
        ("4.8", "FS_PILOT_INPUT", 0.0, "is 0; allowed: 2 (disarm when the sticks are silent)"),
        ("4.8", "MAV_GCS_SYSID", 245.0, "is 245; allowed: 255, the system of ardusub.system"),
        ("4.5", "RC3_TRIM", 1500.0, "allowed: RC3_MIN, 1100"),
        ("4.8", "FRAME_CONFIG", inf, "is inf; allowed: 0 to 7"),
        ("4.8", "FRAME_CONFIG", nan, "is nan; allowed: 0 to 7"),
    ],
)
def test_a_parameter_that_is_wrong_is_named_with_what_is_allowed(
    version: str, name: str, value: float, told: str
) -> None:
    [found] = wrong(Bench(version, params={name: value}).visited())
    assert (found.verdict, found.what) == ("change", name)
    assert told in found.text


def test_a_parameter_without_an_answer_is_missing() -> None:
    bench = Bench()
    assert bench.board is not None
    del bench.board.params["FS_LEAK_ENABLE"]
    assert wrong(bench.visited()) == [
        VehicleFinding("missing", "FS_LEAK_ENABLE", "is not answered")
    ]


@pytest.mark.parametrize(
    ("board", "told"),
    [
        ({"kind": PLANE}, "flies a vehicle of type 1; allowed: 12 (a submarine)"),
        ({"autopilot": PX4}, "is 12; allowed: 3 (ArduPilot)"),
        ({"version": "4.1"}, "ArduSub 4.1.0 dev; allowed: 4.5 and newer"),
    ],
)
def test_another_autopilot_is_named_and_asked_no_more(board: dict[str, Any], told: str) -> None:
    bench = Bench(**board)
    found = bench.visited()
    assert [finding.text for finding in wrong(found)] == [told]
    assert found[-1].verdict == "change"
    assert {packet.name for packet in bench.asked} <= {"COMMAND_LONG"}


@pytest.mark.parametrize(
    ("noise", "told"),
    [
        (b"", "nothing heard at udpin:127.0.0.1:14551 in 4 s: is the board on"),
        (bytes(range(60)) * 40, "was no MAVLink: is it the speed of the serial port?"),
    ],
)
def test_without_a_board_it_ends_in_seconds(noise: bytes, told: str) -> None:
    bench = Bench()
    bench.board, bench.noise = None, noise
    began = bench.now
    [found] = bench.visited()
    assert bench.now - began <= NO_BOARD_NS + 2 * STEP_NS
    assert found.verdict == "missing"
    assert told in found.text


def test_a_flood_of_garbage_hides_no_board_and_is_counted() -> None:
    bench = Bench()
    bench.noise = b"\x00garbage, and more of it" * 50
    [found] = wrong(bench.visited())
    assert found.what == "link"
    assert "times what came was no MAVLink" in found.text


def test_a_flood_of_others_ends_and_is_counted() -> None:
    bench = Bench()
    bench.noise = b"".join(_heartbeat(2 + n % 200, n % 250) for n in range(300))
    found = bench.visited(seconds=0.5)
    assert "too much" in one(found, "link").text
    assert len(found) < 60


def test_other_ground_stations_are_named_and_only_our_own_number_is_wrong() -> None:
    bench = Bench()
    bench.beside = [(254, 190)]
    found = bench.visited()
    assert wrong(found) == []
    assert one(found, "ground station").text == "system 254 component 190; Lindy is 255"
    bench = Bench()
    bench.beside = [(254, 190), (255, 190)]
    [stranger] = wrong(bench.visited())
    assert stranger.text.startswith("system 255 component 190 speaks as Lindy would")


def test_a_board_of_another_number_is_said() -> None:
    [found] = Bench(system=1).visited(Settings(board=7))
    assert found.text.startswith("no heartbeat of system 7 in 4 s, only of system 1 component 1")


def test_a_sensor_that_is_missing_and_one_that_is_slow() -> None:
    bench = Bench()
    assert bench.board is not None
    bench.board.missing = {"SCALED_PRESSURE2"}
    bench.board.slowest_us = {"HIGHRES_IMU": 50_000}
    found = wrong(bench.visited(seconds=2.0))
    assert [(f.verdict, f.what) for f in found] == [
        ("change", "HIGHRES_IMU"),
        ("missing", "SCALED_PRESSURE2"),
    ]
    assert found[0].text.startswith("20.0 a second, asked for 100")


def test_an_imu_that_repeats_itself_is_said_with_the_setting() -> None:
    bench = Bench("4.5")
    assert bench.board is not None
    first = bench.board.hull.message("RAW_IMU", 0, bench.now)
    message = bench.board.hull.message

    def still(name: str, boot_us: int, now: int) -> MavlinkPacket | None:
        """Its noise is less than its steps."""
        if name != "RAW_IMU" or first is None:
            return message(name, boot_us, now)
        return first._replace(fields={**first.fields, "time_usec": boot_us})

    bench.board.hull.message = still
    [found] = wrong(bench.visited())
    assert found.what == "IMU"
    assert "after 0.2 s at rest" in found.text
    assert "estimation.watch.imu_frozen_at_rest to 1" in found.text


def test_a_leak_is_heard_within_25_seconds() -> None:
    bench = Bench()
    assert bench.board is not None
    bench.board.leaking = True
    [found] = wrong(bench.visited(seconds=25.0))
    assert found == VehicleFinding("change", "leak", "the board says that it has water inside")


# The verb.


def test_a_vehicle_without_a_board_is_checked_as_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--vehicle", "pioneer"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ok       vehicle file    Pioneer")
    assert "none: the vehicle file has no table [ardusub]" in lines[-2]
    assert main(["doctor", "--json", "--set", "estimation.depth.pressure_std=100"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["fit"] is False
    assert [f["what"] for f in told["findings"] if f["verdict"] == "change"] == ["pressure noise"]


def nothing(name: str) -> None:
    """As `find_spec` where the package is not installed."""


def no_findings(*_: object) -> list[VehicleFinding]:
    return []


def test_without_pymavlink_the_vehicle_file_is_checked_all_the_same(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tools.packages.find_spec", nothing)
    assert main(["doctor", "--vehicle", "bluerov2_heavy"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("ok       vehicle file")
    assert lines[-2].startswith("missing  board")
    assert "needs pymavlink" in lines[-2]


def test_a_stack_that_does_not_go_with_the_vehicle_file_is_said(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["doctor", "--vehicle", "bluerov2_heavy", "--stack", "simulated"]) == 0
    assert "not asked: the stack simulated has no ardusub" in capsys.readouterr().out
    monkeypatch.setattr("tools.doctor.command._of_board", no_findings)
    assert main(["doctor", "--vehicle", "pioneer", "--stack", "ardusub"]) == 1
    said = capsys.readouterr().out
    assert f"no table [ardusub]: asked at {Settings().url}, as by default" in said


def test_a_vehicle_that_nothing_drives_down_is_said_by_its_thrusters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own, text = tmp_path / "flat.toml", Path("deploy/vehicles/pioneer.toml").read_text()
    own.write_text(re.sub(r"direction = \[0\.0, 0\.0, [-0-9.]+\]", "direction = [1, 0, 0]", text))
    for words in (["doctor"], ["simulate", "--no-files"]):
        said = complaint(capsys, *words, "--vehicle", str(own))
        assert "vehicle.thruster: no thruster drives heave" in said


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--vehicle", "bluerov"], "unknown vehicle 'bluerov'"),
        (["--set", "control.depth.kp=1e5"], "control.depth"),
        (["--seconds", "0"], "--seconds is 0, expected 0.5 to 600"),
        (["--vehicle", "bluerov2_heavy", "--set", "ardusub.url=serial:/dev/nothing:115200"],
         "ardusub.url serial:/dev/nothing:115200: No such file"),
        (["--vehicle", "bluerov2_heavy", "--set", "ardusub.url=radio"], "found 'radio'; allowed:"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_sentence(
    capsys: pytest.CaptureFixture[str], words: list[str], says: str
) -> None:
    assert says in complaint(capsys, "doctor", *words)


@pytest.mark.system
@pytest.mark.parametrize("version", ["4.5", pytest.param("4.8", marks=pytest.mark.slow)])
def test_over_udp_with_a_board_that_is_a_process(
    capsys: pytest.CaptureFixture[str], version: str
) -> None:
    port = free_port(socket.SOCK_DGRAM)
    words = [sys.executable, "-P", "-m", "tests.support.ardusub_double.udp", "--to", str(port)]
    url = f"ardusub.url=udpin:127.0.0.1:{port}"
    said = ["doctor", "--vehicle", "bluerov2_heavy", "--seconds", "1", "--set", url, "--json"]
    with subprocess.Popen([*words, "--version", version, "--set", "FS_GCS_ENABLE=0"]) as board:
        try:
            status = main(said)
            if "nothing heard" in (out := capsys.readouterr().out):  # it was not up yet
                status, out = main(said), capsys.readouterr().out
        finally:
            board.kill()
    assert status == 1
    findings = json.loads(out)["findings"]
    assert {f["what"] for f in findings if f["what"].startswith("FS_GCS")} == {"FS_GCS_ENABLE"}
    by_name = {f["what"]: f["verdict"] for f in findings}
    assert by_name["FS_GCS_ENABLE"] == "change"
    assert by_name["clock"] == by_name["battery"] == by_name["SCALED_PRESSURE2"] == "ok"


def test_an_output_that_would_move_a_motor_is_found() -> None:
    bench = Bench()
    assert bench.board is not None
    bench.board.params["SERVO14_FUNCTION"] = 36.0
    found = one(bench.visited(servos={"light": 13, "lasers": 14}), "SERVO14_FUNCTION")
    assert found.verdict == "change"
    assert "a motor, and output lasers" in found.text
    fits = one(Bench().visited(servos={"lasers": 14}), "SERVO14_FUNCTION")
    assert (fits.verdict, fits.text) == ("ok", "0")
