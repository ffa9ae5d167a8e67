"""`lindy ask`: what is asked, of whom, until when, and how the answer reads."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.pilot import FlightMode, PilotAnswer, PilotCommand, PilotRequest, StopDistance
from messages.vehicle import VehicleStatus
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running, running_in
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.patience import PATIENCE_S, until
from tools.ask import (
    OneRequest,
    ask,
    dive_in,
    dives_here,
    for_the_pilot,
    in_json,
    in_words,
    wanted_of,
)

S = 1_000_000_000  # [ns]
GIVEN: dict[str, Any] = dict.fromkeys(("name", "depth", "heading", "force"))


def wanted(kind: Any, **more: Any) -> PilotRequest:
    return PilotRequest(stamp_ns=0, id="", kind=kind, **more)


def asking_for(host: VirtualHost, request: PilotRequest) -> OneRequest[PilotRequest, PilotAnswer]:
    return for_the_pilot(host.node("ask", ["topside"]), request)


@pytest.mark.parametrize("kind", ["arm", "disarm", "stop", "release", "offer"])
def test_a_word_alone_asks_for_nothing_else(kind: str):
    assert wanted_of(kind, **GIVEN) == wanted(kind)


def test_control_is_taken_by_force_only_when_asked_and_offered_to_one_or_to_all():
    assert wanted_of("take", **GIVEN) == wanted("lease")
    assert wanted_of("take", **GIVEN | {"force": True}) == wanted("force")
    assert wanted_of("offer", **GIVEN | {"name": "bob"}) == wanted("offer", to="bob")


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 11_000.0), st.floats(-360.0, 360.0))
def test_a_heading_is_given_in_degrees_and_asked_in_radians(depth: float, degrees: float):
    wanted = wanted_of("goto", **GIVEN | {"depth": depth, "heading": degrees})
    assert wanted.depth == depth
    assert wanted.heading is not None
    assert math.degrees(wanted.heading) == pytest.approx(degrees)


def test_a_followed_path_is_asked_whole():
    course = wanted_of("follow", **GIVEN | {"name": "inspection_box"}).course
    assert course is not None
    assert course.waypoints[-1] == (0.0, 0.0, 3.5)
    assert course.kind == "interpolating"


@pytest.mark.parametrize(("word", "value"), [("on", 1.0), ("off", 0.0), ("0.25", 0.25)])
def test_an_output_is_asked_for_by_its_name(word: str, value: float):
    wanted = wanted_of("output", **GIVEN | {"name": "lasers", "setting": word})
    assert (wanted.kind, wanted.output, wanted.value) == ("output", "lasers", value)


@pytest.mark.parametrize("hold", get_args(FlightMode))
def test_every_mode_can_be_asked_for_and_reaches_the_drone(hold: str):
    host = VirtualHost()
    drone = Drone(host, 1)
    wanted = wanted_of("mode", **GIVEN | {"name": hold})
    asking = asking_for(host, wanted)
    host.run(10 * S, lambda: asking.answer is not None)
    assert [(r.kind, r.flight_mode) for r in drone.heard] == [("mode", hold)]


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        ("jump", {}, "unknown request 'jump'; known: arm, disarm"),
        ("gotto", {}, "did you mean 'goto'?"),
        ("goto", {}, "goto needs a depth, a heading or both"),
        ("goto", {"depth": -1.0}, "depth is -1, expected a number from 0"),
        ("goto", {"depth": math.nan}, "depth is nan, expected"),
        ("goto", {"heading": math.inf}, "heading is inf, expected"),
        ("goto", {"depth": 1.0, "name": "1"}, "goto takes no second word, found '1'"),
        ("arm", {"depth": 0.0}, "arm takes no --depth"),
        ("light", {}, "light needs a brightness from 0 to 1"),
        ("light", {"name": "1.5"}, "from 0 to 1, such as light 0.5, found '1.5'"),
        ("light", {"name": "nan"}, "found 'nan'"),
        ("output", {}, "output needs its name and on, off or a number"),
        ("output", {"name": "lasers"}, "output needs its name and on, off or a number"),
        ("output", {"name": "lasers", "setting": "yes"}, "from 0 to 1, found 'yes'"),
        ("output", {"name": "lasers", "setting": "nan"}, "from 0 to 1, found 'nan'"),
        ("output", {"name": "lasers", "setting": "-1"}, "from 0 to 1, found '-1'"),
        (
            "output",
            {"name": 129 * "l", "setting": "on"},
            "the name has 129 letters, expected at most 128",
        ),
        ("light", {"name": "1", "setting": "on"}, "light takes no third word, found 'on'"),
        ("follow", {}, "follow needs a path"),
        ("follow", {"name": "inspection_bix"}, "did you mean 'inspection_box'?"),
        ("follow", {"name": "fernandes"}, "only a path with model = 'mjvr'"),
        ("mode", {}, "mode needs its name: manual, depth_hold"),
        ("mode", {"name": "stabilized"}, "did you mean 'stabilised'?"),
        ("mode", {"name": "manual", "depth": 1.0}, "mode takes no --depth"),
        ("stop", {"name": "manual"}, "stop takes no second word, found 'manual'"),
        ("stop", {"force": True}, "stop takes no --force"),
        ("take", {"name": "bob"}, "take takes no second word"),
        ("offer", {"name": 129 * "b"}, "the name has 129 letters, expected at most 128"),
    ],
)
def test_a_wrong_argument_is_explained_before_anybody_is_asked(
    tmp_path: Path, kind: str, given: dict[str, Any], says: str
):
    rest = {name: value for name, value in given.items() if name not in ("name", "setting")}
    words = given.get("name"), given.get("setting")
    with pytest.raises(LindyError) as caught:
        ask(kind, *words, **rest, dive=tmp_path)  # where no dive is: this would be said next
    assert says in str(caught.value)


# Whom to ask.


def write(folder: Path, vehicle: str, pid: int, age_s: float = 0.0) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / RUNNING
    file.write_bytes(msgspec.json.encode(Running(vehicle, {"topside": "tcp/x"}, pid, {})))
    os.utime(file, (1e9 - age_s, 1e9 - age_s))


@pytest.fixture
def ended() -> int:
    """Process id of somebody who is gone."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_without_a_folder_the_newest_dive_that_goes_on_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ended: int
):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "dives/one", "rov1", os.getpid(), 2.0)
    write(tmp_path / "dives/two", "rov1", os.getpid(), 1.0)
    write(tmp_path / "dives/three", "crashed", ended)
    (tmp_path / "dives/four").mkdir()
    newest = (tmp_path / "dives/two" / RUNNING).read_bytes()
    assert dive_in(None) == msgspec.json.decode(newest, type=Running)
    assert dive_in(Path("dives/one")).vehicle == "rov1"


def test_of_several_drones_one_is_named_and_a_stop_is_for_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "dives/one", "rov1", os.getpid(), 2.0)
    write(tmp_path / "dives/two", "rov2", os.getpid(), 1.0)
    with pytest.raises(LindyError, match=r"^dives of rov1, rov2 are going on here: name .* --dive"):
        ask("disarm")
    stopped: list[str] = []

    def answer(_: object, running: Running, who: str) -> PilotAnswer:
        del who
        stopped.append(running.vehicle)
        return PilotAnswer(stamp_ns=0, id="", accepted=True)

    monkeypatch.setattr("tools.ask.answer_to", answer)
    assert ask("stop") == 0
    assert sorted(stopped) == ["rov1", "rov2"]
    assert {line.partition(":")[0] for line in capsys.readouterr().out.splitlines()} == {
        "rov1", "rov2"
    }  # fmt: skip
    assert ask("disarm", dive=tmp_path / "dives/two") == 0
    assert capsys.readouterr().out == "rov2: disarm: accepted\n"


def test_where_nobody_dives_one_sentence_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ended: int
):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "dives/crashed", "x", ended)
    with pytest.raises(
        LindyError, match=r"^no dive is going on here or in dives/; name .* with --dive"
    ):
        dive_in(None)
    with pytest.raises(LindyError, match="no dive is going on in dives/crashed"):
        dive_in(Path("dives/crashed"))


def test_a_dead_dive_whose_process_id_another_program_has_now_is_not_found(tmp_path: Path):
    running = Running("rov1", {"topside": "tcp/x"}, os.getpid(), {}, began=1.0)
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(running))
    with pytest.raises(LindyError, match="no dive is going on in"):
        dive_in(tmp_path)


def test_a_dive_that_ends_while_it_is_looked_for_is_no_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "dives/one", "rov1", os.getpid())

    def then_it_ends(folder: Path) -> Running | None:
        found = running_in(folder)
        (folder / RUNNING).unlink(missing_ok=True)
        return found

    monkeypatch.setattr("tools.ask.running_in", then_it_ends)
    assert [running.vehicle for running in dives_here()] == ["rov1"]


# Until when.


def pilot(host: VirtualHost, epoch: int) -> None:
    """The pilot of this side, whose commands are heard here."""
    node = host.node("gamepad", ["topside"])
    commands = node.publisher(topics.PILOT_COMMAND)

    def speak(now: int) -> None:
        centred = PilotCommand(
            stamp_ns=now, surge=0, sway=0, heave=0, yaw=0, source="ann", epoch=epoch
        )
        commands.put(centred)

    node.every(topics.PILOT_COMMAND.hz, speak)


class Drone:
    """Answers from a certain repetition on."""

    def __init__(self, host: VirtualHost, answers_from: int, epoch: int = 0) -> None:
        self.heard: list[PilotRequest] = []
        self._from = answers_from
        node = host.node("drone", ["topside"])
        self._answer = node.publisher(topics.PILOT_ANSWER)
        node.each(topics.PILOT_REQUEST, self._hear)
        status = node.publisher(topics.STATUS)
        node.every(
            topics.STATUS.hz,
            lambda now: status.put(
                VehicleStatus(stamp_ns=now, activity="piloted", armed=True, epoch=epoch)
            ),
        )

    def _hear(self, request: PilotRequest, now: int) -> None:
        self.heard.append(request)
        self._answer.put(PilotAnswer(stamp_ns=now, id="somebody-else", accepted=False))
        if len(self.heard) >= self._from:
            self._answer.put(PilotAnswer(stamp_ns=now, id=request.id, accepted=True))


@pytest.mark.parametrize("kind", ["arm", "light", "disarm", "lease", "offer"])
def test_it_asks_in_the_name_of_the_pilot_of_this_side_and_not_of_the_one_in_control(kind: str):
    host = VirtualHost()
    drone = Drone(host, 3, epoch=5)
    pilot(host, epoch=4)
    asking = asking_for(host, wanted(kind))
    host.run(5 * S, lambda: asking.answer is not None)
    assert [(r.kind, r.source, r.epoch) for r in drone.heard] == [(kind, "ann", 4)] * 3


def test_a_stop_waits_for_nobodys_name():
    host = VirtualHost()
    drone = Drone(host, 1, epoch=5)
    asking = asking_for(host, wanted("stop"))
    host.run(S, lambda: asking.answer is not None)
    assert drone.heard[0].stamp_ns == 0


def test_without_a_pilot_on_this_side_it_asks_in_nobodys_name():
    host = VirtualHost()
    drone = Drone(host, 1, epoch=5)
    asking = asking_for(host, wanted("disarm"))
    host.run(5 * S, lambda: asking.answer is not None)
    assert [(r.source, r.epoch, r.stamp_ns) for r in drone.heard] == [("", 0, S)]


@pytest.mark.parametrize("kind", ["lease", "force", "offer", "release"])
def test_without_a_pilot_on_this_side_nobody_is_given_control(kind: str):
    host = VirtualHost()
    drone = Drone(host, 1)
    asking = asking_for(host, wanted(kind))
    host.run(20 * S, lambda: asking.given_up)
    assert host.now == 5 * S
    assert drone.heard == []
    assert not asking.asked


def test_on_the_drones_side_there_is_no_pilot(tmp_path: Path):
    running = Running("older", {"drone": "tcp/x"}, os.getpid(), {})
    (tmp_path / RUNNING).write_bytes(msgspec.json.encode(running))
    with pytest.raises(LindyError, match=r"^take: there is no pilot on this side"):
        ask("take", dive=tmp_path)


# How it reads.


def test_a_stop_tells_in_words_and_in_json_how_far_it_still_goes():
    stop = StopDistance(depth=-0.25, heading=math.pi / 2, seconds=1.5)
    answer = PilotAnswer(stamp_ns=0, id="i", accepted=True, stop=stop)
    assert in_words("stop", answer) == (
        "stop: accepted; still goes 0.250 m up and 90.00 deg clockwise, at rest after 1.50 s; how "
        "far surge and sway carry it is not known, without a position"
    )
    measured = msgspec.structs.replace(stop, over_ground=0.125)
    assert in_words("stop", msgspec.structs.replace(answer, stop=measured)) == (
        "stop: accepted; still goes 0.125 m over the ground, 0.250 m up and 90.00 deg clockwise, "
        "at rest after 1.50 s"
    )
    assert json.loads(in_json("stop", answer)) == {
        "id": "i",
        "kind": "stop",
        "accepted": True,
        "reason": "",
        "note": "",
        "stop": {"depth_m": -0.25, "heading_deg": 90.0, "seconds": 1.5, "over_ground_m": None},
    }
    granted = PilotAnswer(stamp_ns=0, id="i", accepted=True)
    assert in_words("arm", granted) == "arm: accepted"
    noted = msgspec.structs.replace(granted, note="the drone will land")
    assert in_words("goto", noted) == "goto: accepted; the drone will land"
    assert json.loads(in_json("goto", noted))["note"] == "the drone will land"


# All of it.


@contextmanager
def dive(folder: Path) -> Generator[Path]:
    """A dive that waits for somebody to ask something; its folder, once the drone is armed."""
    script, log, out = folder / "wait.csv", folder / "screen.txt", folder / "out"
    script.write_text("t,surge,sway,heave,yaw\n0,0,0,0,0\n60,0,0,0,0\n")
    command = [sys.executable, "-P", "-m", "tools", "dive", "--headless", "--out", str(out)]
    command += ["--set", "estimation.calibration.still_time=3"]  # [s] less to wait for
    with log.open("w") as screen:
        process = subprocess.Popen(
            [*command, "--pilot", f"script:{script}"],
            stdin=subprocess.DEVNULL,
            stdout=screen,
            stderr=subprocess.STDOUT,
        )
    try:

        def require_running() -> None:
            assert process.poll() is None, log.read_text()

        until(lambda: "has the sticks" in log.read_text(), log.read_text, require_running)
        yield out
    finally:
        process.terminate()
        process.wait(PATIENCE_S)


def still_goes(out: Path, heading: float, capsys: pytest.CaptureFixture[str]) -> bool:
    """Does a stop right after a goto say that the drone still moves?"""
    assert ask("goto", heading=heading, dive=out) == 0
    capsys.readouterr()
    assert ask("stop", dive=out, as_json=True) == 0
    return json.loads(capsys.readouterr().out)["stop"]["seconds"] > 0.0


@pytest.mark.slow
@pytest.mark.system
def test_a_real_drone_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    with dive(tmp_path) as out:
        assert ask("light", "0.5", dive=out) == 0
        assert capsys.readouterr().out.endswith(": light: accepted\n")
        assert ask("output", "light", "0.25", dive=out) == 0
        assert capsys.readouterr().out.endswith(": output: accepted\n")
        with pytest.raises(LindyError, match=r"no output 'lasers'; there are: light"):
            ask("output", "lasers", "on", dive=out)
        # A stop that is decided before the first step of the goto finds nothing that moves.
        assert any(still_goes(out, heading, capsys) for heading in (30.0, 90.0) * 10)
        assert ask("disarm", dive=out) == 0
        capsys.readouterr()
        with pytest.raises(LindyError, match=r"refuses \(goto\): the drone is not armed"):
            ask("goto", depth=2.0, dive=out, as_json=True)
        assert not json.loads(capsys.readouterr().out)["accepted"]


@pytest.mark.parametrize(
    "given", [{"north": 1.0}, {"north": 1.0, "east": float("nan")}, {"east": 2.0, "heading": 3.0}]
)
def test_half_a_place_or_none_is_refused(given: dict[str, float]) -> None:
    nothing = dict.fromkeys(("depth", "heading", "north", "east", "path", "value"))
    with pytest.raises(LindyError, match="goto"):
        wanted_of("goto", **(nothing | given))
    place = wanted_of("goto", **(nothing | {"north": 1.0, "east": -2.0}))
    assert (place.north, place.east) == (1.0, -2.0)
