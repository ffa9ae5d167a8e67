"""The wired service on virtual time, with a drone on the other end."""

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import pytest

from messages import topics
from messages.health import LogLine
from messages.pilot import Course, PilotAnswer, PilotCommand, PilotRequest
from messages.vehicle import Activity, VehicleStatus
from services.gamepad.io import sdl
from services.gamepad.io.path_file import course_named
from services.gamepad.service import Connected, wire
from services.gamepad.stick_log import parse
from services.piloting.pilot import Pilot, Progress
from services.piloting.pilot_intents import Intent, Press
from services.piloting.sticks import CENTRED, StickReading, Sticks
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node

MS = 1_000_000  # [ns]
S = 1000 * MS
HOME = ServiceSpec(sides=["topside"])
LOG = """t,surge,sway,heave,yaw,event
0,0,0,0,0
1.003,0,0,0.5,0
2.5071,0.25,0,0,-1,light
3,0,0,0.5,0,lost
4.2,0,0,0,0
"""


class Drone:
    """Becomes ready at 0.5 s and answers every request, unless told otherwise."""

    def __init__(self, host: VirtualHost) -> None:
        self.commands: list[PilotCommand] = []
        self.requests: list[PilotRequest] = []
        self.lines: list[LogLine] = []
        self.epoch = 0
        self.answers = True
        self.refuses = ""
        self.armed = False
        self.armed_at: int | None = None  # [ns]
        node = host.node("drone", ["topside"])
        self._status = node.publisher(topics.STATUS)
        self._answer = node.publisher(topics.PILOT_ANSWER)
        node.each(topics.PILOT_COMMAND, lambda message, _: self.commands.append(message))
        node.each(topics.LOG, lambda message, _: self.lines.append(message))
        node.each(topics.PILOT_REQUEST, self._on_request)
        node.every(topics.STATUS.hz, self._say_status)

    def since(self, start: int) -> list[PilotCommand]:
        return [c for c in self.commands if c.stamp_ns >= start]

    def kinds(self) -> list[str]:
        return [r.kind for r in self.requests]

    def texts(self) -> list[str]:
        return [line.text for line in self.lines]

    def _say_status(self, now: int) -> None:
        activity: Activity = "starting" if now < S // 2 else "piloted" if self.armed else "ready"
        self._status.put(
            VehicleStatus(stamp_ns=now, activity=activity, armed=self.armed, epoch=self.epoch)
        )

    def _on_request(self, request: PilotRequest, now: int) -> None:
        if request.kind == "lease":
            self.epoch += 1
            lease = PilotAnswer(stamp_ns=now, id=request.id, accepted=True, epoch=self.epoch)
            self._answer.put(lease)
            return
        self.requests.append(request)
        if not self.answers:
            return
        accepted = not self.refuses
        if accepted and request.kind in ("arm", "disarm"):
            self.armed = request.kind == "arm"
            self.armed_at = now if self.armed else self.armed_at
        self._answer.put(
            PilotAnswer(stamp_ns=now, id=request.id, accepted=accepted, reason=self.refuses)
        )
        self._say_status(now)


class Hands:
    """A device whose reading the test sets."""

    name = "hands"
    played = 0

    def __init__(self) -> None:
        self.sticks = CENTRED
        self.present = True
        self.presses: Sequence[Intent] = ()

    def read(self, now: int, began: int | None) -> StickReading:  # noqa: ARG002
        pressed, self.presses = tuple(self.presses), ()
        at_rest = self.present and self.sticks.at_rest
        return StickReading(self.sticks, self.present, at_rest, presses=pressed)

    def next_ns(self, now: int, began: int) -> int | None:  # noqa: ARG002
        return None


@pytest.fixture
def host() -> VirtualHost:
    return VirtualHost()


@pytest.fixture
def drone(host: VirtualHost) -> Drone:
    return Drone(host)


@pytest.fixture
def script(tmp_path: Path) -> Stack:
    path = tmp_path / "log.csv"
    path.write_text(LOG)
    return Stack(pilot=f"script:{path}")


def hold(hands: Hands, *, arms: bool) -> Callable[[Node, Stack], None]:
    """A wire function like the real one, with `hands` for a source."""

    def wired(node: Node, stack: Stack) -> None:  # noqa: ARG001
        progress = node.restore_checkpoint(Progress) or Progress()
        Connected(node, hands, Pilot(progress, node.outbox, arms))

    return wired


def sticks_of(c: PilotCommand) -> Sticks:
    return Sticks(c.surge, c.sway, c.heave, c.yaw, c.tilt, c.gripper)


def changes(commands: list[PilotCommand], began: int) -> list[tuple[int, Sticks, str]]:
    """Time since the hand-over [ns], sticks and presence of every command unlike the last."""
    told: list[tuple[int, Sticks, str]] = []
    for command in commands:
        now = (command.stamp_ns - began, sticks_of(command), command.pilot)
        if not told or told[-1][1:] != now[1:]:
            told.append(now)
    return told


SAID = [  # what LOG says
    (0, CENTRED, "present"),
    (1003 * MS, Sticks(heave=0.5), "present"),
    (2_507_100_000, Sticks(surge=0.25, yaw=-1.0), "present"),
    (3000 * MS, CENTRED, "lost"),
    (4200 * MS, CENTRED, "present"),
]


def test_a_script_waits_for_arming_and_speaks_at_its_exact_times(
    host: VirtualHost, drone: Drone, script: Stack
):
    """And commands come at 50 Hz whatever happens."""
    host.add("gamepad", HOME, script, wire)
    host.run(20 * S)
    began = drone.armed_at
    assert began is not None
    assert began >= S // 2
    before = [c for c in drone.commands if c.stamp_ns < began]
    assert len(before) >= 20
    assert all(sticks_of(c) == CENTRED and c.pilot == "present" for c in before)
    assert changes(drone.since(began), began) == SAID
    stamps = {c.stamp_ns for c in drone.commands}
    assert {n * 20 * MS for n in range(1, 1000)} <= stamps
    assert len(stamps) <= 1010
    asked = [(r.kind, r.value, r.stamp_ns - began) for r in drone.requests]
    assert asked == [
        ("arm", None, 0),
        ("light", 1.0, 2_507_100_000),
        ("disarm", None, 7_200 * MS),
    ]
    assert drone.texts().count("the script has ended") == 1
    assert not drone.armed


def test_an_unanswered_request_is_repeated_then_given_up(
    host: VirtualHost, drone: Drone, script: Stack
):
    drone.answers = False
    node = host.add("gamepad", HOME, script, wire)
    host.run(5 * S)
    assert len({r.id for r in drone.requests}) == 1
    stamps = [r.stamp_ns for r in drone.requests]
    assert {b - a for a, b in pairwise(stamps)} == {200 * MS}
    host.run(6 * S)
    assert node.counts["unanswered:arm"] == 1
    assert "the drone did not answer a request (arm)" in drone.texts()
    drone.answers = True
    host.run(7 * S)
    assert drone.armed  # it asks anew while the drone is ready
    assert len({r.id for r in drone.requests}) == 2


def test_a_refusal_is_told_and_not_hammered(host: VirtualHost, drone: Drone, script: Stack):
    drone.refuses = "the hatch is open"
    node = host.add("gamepad", HOME, script, wire)
    host.run(5 * S)
    assert "the drone refuses a request (arm): the hatch is open" in drone.texts()
    assert 2 <= len(drone.requests) <= 3
    assert node.counts["refused:arm"] == len(drone.requests)


@pytest.mark.parametrize("crash_after", [2_400 * MS, 3_500 * MS, 7_100 * MS])
def test_a_restart_in_mid_dive_goes_on_with_the_script_as_if_nothing_had_happened(
    host: VirtualHost, drone: Drone, script: Stack, crash_after: int
):
    host.add("gamepad", HOME, script, wire)
    host.run(S)
    began, log = drone.armed_at, parse(LOG.encode(), course_named)
    assert began is not None
    host.run(began + crash_after)
    host.kill("gamepad")
    host.run(began + crash_after + 200 * MS)  # an event falls into one of these gaps
    restart = host.now
    host.add("gamepad", HOME, script, wire)
    host.run(20 * S)
    assert drone.kinds() == ["arm", "light", "disarm"]
    assert drone.armed_at == began
    after = drone.since(restart)
    assert all(sticks_of(c) == log.at(c.stamp_ns - began).sticks for c in after)
    assert {began + at for at, _, _ in SAID if began + at > restart} <= {c.stamp_ns for c in after}
    planned = began + log.duration_ns + 3 * S
    missed = restart - 200 * MS < planned <= restart  # then it is made up for at once
    assert drone.requests[-1].stamp_ns == (restart + 20 * MS if missed else planned)


def test_a_last_row_with_a_stick_out_is_pointed_at(host: VirtualHost, drone: Drone, tmp_path: Path):
    path = tmp_path / "open_end.csv"
    path.write_text("t,surge,sway,heave,yaw\n0,0,0,0,0\n1,1,0,0,0\n")
    host.add("gamepad", HOME, Stack(pilot=f"script:{path}"), wire)
    host.run(5 * S)
    assert any("last row" in text for text in drone.texts())
    assert all(sticks_of(c) == CENTRED for c in drone.commands)


def test_a_device_with_a_stick_out_is_not_armed_until_it_is_let_go(host: VirtualHost, drone: Drone):
    hands = Hands()
    hands.sticks = Sticks(heave=1.0)
    host.add("gamepad", HOME, Stack(), hold(hands, arms=True))
    host.run(3 * S)
    assert drone.requests == []
    assert drone.texts().count("ready: let go of the sticks to arm") == 1
    assert all(sticks_of(c) == CENTRED for c in drone.commands)
    hands.sticks = CENTRED
    host.run(4 * S)
    assert drone.armed
    hands.sticks = Sticks(heave=1.0)
    host.run(5 * S)
    assert sticks_of(drone.commands[-1]) == Sticks(heave=1.0)


@pytest.mark.parametrize("pilot", ["gamepad", "keyboard"])
def test_a_persons_pad_or_keyboard_arms_nothing_until_its_button_is_held(
    host: VirtualHost, drone: Drone, monkeypatch: pytest.MonkeyPatch, pilot: str
):
    hands = Hands()

    def opened(node: Node, stack: Stack, played: int) -> Hands:  # noqa: ARG001
        return hands

    monkeypatch.setattr("services.gamepad.service.open_source", opened)
    host.add("gamepad", HOME, Stack(pilot=pilot), wire)
    host.run(10 * S)
    assert drone.requests == []
    assert not drone.armed
    hands.sticks = Sticks(yaw=0.1)
    hands.presses = ["arm"]
    host.run(host.now + S // 2)
    assert drone.requests == []
    hands.sticks = CENTRED
    hands.presses = ["arm"]
    host.run(11 * S)
    assert drone.armed


@pytest.mark.parametrize("kind", ["stop", "disarm"])
def test_after_a_stop_or_disarm_nothing_arms_by_itself(
    host: VirtualHost, drone: Drone, kind: Press
):
    hands = Hands()
    hands.presses = [kind]
    host.add("gamepad", HOME, Stack(), hold(hands, arms=True))
    host.run(3 * S)
    host.kill("gamepad")
    host.add("gamepad", HOME, Stack(), hold(hands, arms=True))
    host.run(6 * S)
    assert drone.kinds() == [kind]


def test_a_real_pad_service_without_a_pad_runs_and_says_so(
    host: VirtualHost, drone: Drone, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    host.add("gamepad", HOME, Stack(pilot="gamepad"), wire)
    host.run(2 * S)
    assert len(drone.commands) >= 99
    assert all(c.pilot == "lost" for c in drone.commands)
    assert drone.requests == []
    assert drone.texts() == ["no pad is plugged in; waiting for one"]
    host.close()


def test_goto_and_follow_of_a_script_reach_the_drone_at_their_time_in_si_units(
    host: VirtualHost, drone: Drone, tmp_path: Path
):
    way = tmp_path / "way.toml"
    way.write_text("waypoints = [[0, 0, 2], [9, 0, 3]]\nmin_radius = 3\ncruise = 0.2\n")
    path = tmp_path / "trip.csv"
    path.write_text(
        "t,surge,sway,heave,yaw,tilt,event\n"
        "0.5,0,0,0,0,0.75\n"
        "1.001,0,0,0,0,0,goto depth=3 heading=-45\n"
        "2,0,0,0,0,,goto depth=1\n"
        f"3,0,0,0,0,,follow {way}\n"
        "4,0,0,0,0\n"
    )
    host.add("gamepad", HOME, Stack(pilot=f"script:{path}"), wire)
    host.run(9 * S)
    began = drone.armed_at
    assert began is not None
    asked = [r for r in drone.requests if r.kind in ("goto", "follow")]
    assert [(r.kind, r.depth, r.heading, r.stamp_ns - began) for r in asked] == [
        ("goto", 3.0, -math.pi / 4, 1001 * MS),
        ("goto", 1.0, None, 2 * S),
        ("follow", None, None, 3 * S),
    ]
    course = Course(waypoints=((0.0, 0.0, 2.0), (9.0, 0.0, 3.0)), min_radius=3.0, cruise=0.2)
    assert [r.course for r in asked] == [None, None, course]
    assert changes(drone.since(began), began) == [
        (0, CENTRED, "present"),
        (500 * MS, Sticks(tilt=0.75), "present"),
        (1001 * MS, CENTRED, "present"),
    ]


@pytest.mark.parametrize("pilot", ["joystick", "script:", ""])
def test_an_unknown_pilot_is_one_sentence(host: VirtualHost, pilot: str):
    with pytest.raises(LindyError, match="expected gamepad, keyboard or script:FILE"):
        host.add("gamepad", HOME, Stack(pilot=pilot), wire)


def test_a_mistake_in_a_script_names_file_and_line(host: VirtualHost, tmp_path: Path):
    path = tmp_path / "wrong.csv"
    path.write_text("t,surge,sway,heave,yaw\n0,0,0,2,0\n")
    with pytest.raises(LindyError, match=r"wrong\.csv: line 2: heave is '2'"):
        host.add("gamepad", HOME, Stack(pilot=f"script:{path}"), wire)


@pytest.mark.parametrize("pilot", ["gamepad", "keyboard"])
def test_without_pygame_it_says_how_to_install_it(
    host: VirtualHost, pilot: str, monkeypatch: pytest.MonkeyPatch
):
    def missing(name: str) -> None:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(sdl.importlib, "import_module", missing)
    with pytest.raises(LindyError, match="--extra pilot"):
        host.add("gamepad", HOME, Stack(pilot=pilot), wire)
