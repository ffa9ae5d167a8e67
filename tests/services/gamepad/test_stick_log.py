"""Reading a stick log and a path file, and what they say at any time."""

import math
from collections import Counter
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import LinkRequest
from messages.pilot import Course, FlightMode
from messages.simulator import FaultAnswer, FaultKind, FaultRequest
from services.gamepad.io.path_file import course_named, course_of
from services.gamepad.io.sources import read_script
from services.gamepad.service import CausedIncidents
from services.gamepad.stick_log import Player, StickLog, StickLogRow, in_words, parse
from services.piloting.pilot_intents import (
    FollowIntent,
    GotoIntent,
    ModeIntent,
    OutputIntent,
    PlaceIntent,
)
from services.piloting.sticks import CENTRED, Incident, StickReading, Sticks
from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.checks import checked, pilot_of
from tools.choices import Choices

S = 1_000_000_000  # [ns]
HEAD = b"t,surge,sway,heave,yaw,event\n"
TILT_HEAD = b"t,surge,sway,heave,yaw,tilt,event\n"

sticks = st.builds(Sticks, *[st.floats(-1.0, 1.0)] * 6)
times = st.lists(st.integers(0, 80_000), min_size=1, max_size=8, unique=True).map(sorted)
events = st.sampled_from(["", "arm", "disarm", "stop", "light", "lost"])


@st.composite
def logs(draw: st.DrawFn) -> list[tuple[int, Sticks, str]]:
    """Rows of time [ms], sticks, event."""
    return [(ms, draw(sticks), draw(events)) for ms in draw(times)]


def csv(rows: list[tuple[int, Sticks, str]]) -> bytes:
    lines = [f"{ms / 1000},{','.join(map(repr, s))},{event}" for ms, s, event in rows]
    return b"t,surge,sway,heave,yaw,tilt,gripper,event\n" + "\n".join(lines).encode()


@given(logs(), st.integers(0, 90_000))
def test_each_row_holds_until_the_next(rows: list[tuple[int, Sticks, str]], ms: int):
    script = parse(csv(rows), course_named)
    begun = [row for row in rows if row[0] <= ms]
    silent = not begun or ms >= rows[-1][0] or begun[-1][2] == "lost"
    expected = CENTRED if silent else begun[-1][1]
    assert script.at(ms * 1_000_000).sticks == expected
    assert script.duration == rows[-1][0] / 1000


@given(logs(), st.lists(st.integers(0, 90_000), max_size=20).map(sorted))
def test_every_event_happens_once(rows: list[tuple[int, Sticks, str]], moments: list[int]):
    player = Player("x", parse(csv(rows), course_named), Outbox())
    heard = Counter[object]()
    for ms in [*moments, 90_000]:
        heard.update(player.read(ms * 1_000_000, 0).presses)
    written = Counter[object](event for _, _, event in rows if event not in ("", "lost"))
    assert heard == written + Counter({"disarm": 1})


@given(logs(), st.integers(0, 90_000))
def test_the_hands_are_at_rest_while_only_the_camera_moves(
    rows: list[tuple[int, Sticks, str]], ms: int
):
    reading = Player("x", parse(csv(rows), course_named), Outbox()).read(ms * 1_000_000, 0)
    assert reading.at_rest == (reading.sticks._replace(tilt=0.0, gripper=0.0) == CENTRED)


def test_comments_blank_lines_spaces_and_a_spreadsheets_mark_are_allowed():
    text = (
        "\ufeff# a dive\r\n\r\n t, surge, sway, heave, yaw, event # heading\r\n"
        "0, 0, 0, 0.5, 0 # down\r\n\r\n1.5, 0, 0, 0, 0, stop\r\n"
    )
    down, end = StickLogRow(0, Sticks(heave=0.5)), StickLogRow(3 * S // 2, CENTRED, "stop")
    assert parse(text.encode(), course_named) == StickLog((down, end))


@pytest.mark.parametrize(
    ("text", "row"),
    [
        (
            b"t,surge,sway,heave,yaw,event,tilt\n1,0,0,0,0,stop,1\n",
            StickLogRow(S, Sticks(tilt=1), "stop"),
        ),
        (b"t,surge,sway,heave,yaw,gripper\n1,0,0,0,0,-1\n", StickLogRow(S, Sticks(gripper=-1.0))),
        (
            b"t,surge,sway,heave,yaw,event\n1,0,0,0,0,output lasers 1\n",
            StickLogRow(S, CENTRED, OutputIntent("lasers", 1.0)),
        ),
        (b"t,surge,sway,heave,yaw\n2,0,0,0,1\n", StickLogRow(2 * S, Sticks(yaw=1.0))),
    ],
)
def test_tilt_and_event_come_in_any_order_and_may_be_left_empty(text: bytes, row: StickLogRow):
    assert parse(text, course_named).rows == (row,)


@pytest.mark.parametrize(
    ("text", "line", "found", "allowed"),
    [
        (b"", 1, "empty", "heading"),
        (b"0,0,0,0,0\n", 1, "0,0,0,0,0", "heading"),
        (b"\x89PNG\r\n\x1a\n", 1, "0x89", "text"),
        (HEAD + b"0,0,0,0\n", 2, "4 columns", "5 or 6"),
        (HEAD + b"# c\n\n0,0,0,fast,0\n", 4, "heave is 'fast'", "-1 to 1"),
        (HEAD + b"1,0,0,0,0\n1,0,0,0,0\n", 3, "t is 1", "more than the 1 before"),
        (b"t,surge,tilt,sway,heave,yaw\n", 1, "surge,tilt", "tilt and gripper and event"),
        (HEAD + b"0,0,0,0,0,output lasers 2\n", 2, "'lasers 2'", "a number from 0 to 1"),
        (
            HEAD + b"0,0,0,0,0,jump\n",
            2,
            "'jump'",
            "light, light_2, laser, resume, home, unwind, lost",
        ),
    ],
)
def test_a_mistake_is_named_with_its_line_what_was_found_and_what_is_allowed(
    text: bytes, line: int, found: str, allowed: str
):
    with pytest.raises(ValueError, match=f"^line {line}: ") as caught:
        parse(text, course_named)
    assert found in str(caught.value)
    assert allowed in str(caught.value)


def test_a_dive_that_is_not_there_is_named_with_those_that_are():
    with pytest.raises(LindyError, match=r"unknown dive 'first_dvie'.*first_dive"):
        read_script("first_dvie")


# Events that have arguments; and incidents: the requests of `lindy fault` and `lindy link`.


TEXT_HEAD = "t,surge,sway,heave,yaw,event\n"
WAY = "waypoints = [[0, 0], [9, 0]]\n"


def event_of(cell: str) -> object:
    return parse(f"{TEXT_HEAD}0,0,0,0,0\n1,0,0,0,0,{cell}\n".encode(), course_named).rows[1].event


@given(
    st.none() | st.floats(0.0, 11_000.0),
    st.none() | st.floats(-360.0, 360.0),
    st.booleans(),
)
def test_goto_takes_metres_and_degrees_in_any_order_and_becomes_radians(
    depth: float | None, degrees: float | None, turned: bool
):
    words = [f"{n}={v!r}" for n, v in (("depth", depth), ("heading", degrees)) if v is not None]
    if not words:
        return
    expected = None if degrees is None else math.radians(degrees)
    assert event_of("goto " + "  ".join(words[::-1] if turned else words)) == GotoIntent(
        depth, expected
    )


def test_follow_reads_a_shipped_path_by_its_name_or_any_by_its_file(tmp_path: Path):
    file = tmp_path / "my way.toml"
    file.write_text(WAY)
    assert event_of(f"follow {file}") == FollowIntent(Course(waypoints=((0.0, 0.0), (9.0, 0.0))))
    shipped = event_of("follow inspection_box")
    assert isinstance(shipped, FollowIntent)
    assert len(shipped.course.waypoints) == 5


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("goto", "goto needs a depth, a heading or both"),
        ("goto north=3", "expected north=M and east=M, each within 100000 m, and nothing else"),
        ("goto depth=nan", "goto: depth is nan, expected a number from 0 to 11000 m"),
        ("goto heading=inf", "goto: heading is inf, expected a number from -360 to 360 deg"),
        ("gotodepth=3", "event is 'gotodepth=3', expected one of .*goto depth=M heading=DEG"),
        ("mode", "mode: found '', expected one of manual, depth_hold"),
        ("follow inspection_bix", "did you mean 'inspection_box'"),
        ("fault port deaf", "KIND is 'deaf', expected one of none, dead"),
        ("fault port weak half", "VALUE is 'half', expected a finite number"),
        ("link set", "expected link set down"),
    ],
)
def test_a_mistake_in_an_event_is_named_with_its_line(cell: str, says: str):
    with pytest.raises(ValueError, match=f"^line 3: .*({says})"):
        event_of(cell)


def test_a_mistake_inside_the_path_is_found_when_the_script_is_read(tmp_path: Path):
    way, script = tmp_path / "way.toml", tmp_path / "trip.csv"
    way.write_text(WAY + "cruise = 0\n")
    script.write_text(f"{TEXT_HEAD}0,0,0,0,0,follow {way}\n")
    with pytest.raises(LindyError, match=r"trip\.csv: line 2: follow: .*way\.toml:2: cruise"):
        read_script(str(script))


@pytest.mark.parametrize(
    ("cell", "event"),
    [
        ("goto north=12.5 east=-4", PlaceIntent(12.5, -4.0)),
        *((word, word) for word in ("home", "unwind")),
        *((f"mode {hold}", ModeIntent(hold)) for hold in get_args(FlightMode)),
    ],
)
def test_a_place_is_in_metres_and_a_mode_is_what_to_hold(cell: str, event: object) -> None:
    assert event_of(cell) == event


@pytest.mark.parametrize(
    "cell",
    [
        *(f"fault port {kind}" for kind in get_args(FaultKind)),
        "fault sensor/pressure biased -300",
        "fault all none",
        "link set down",
        "link set up",
        "link set severe",
        "link set up.delay_ms=80 down.rate_kbit=256",
    ],
)
def test_an_incident_reads_as_it_is_written(cell: str):
    found = event_of(cell)
    assert isinstance(found, Incident)
    assert in_words(found) == cell
    assert (
        event_of(cell.replace("set severe", "profile severe").replace("set down", "down")) == found
    )


def test_the_player_gives_each_once_and_apart_from_the_pilots_requests():
    cells = ("", "fault port dead", "light", "link down")
    rows = "".join(f"{second},0,0,0,0,{cell}\n" for second, cell in enumerate(cells))
    script = parse(f"{TEXT_HEAD}{rows}".encode(), course_named)
    player = Player("x", script, Outbox())
    first = player.read(S, 0)
    assert first == StickReading(
        sticks=CENTRED,
        incidents=(FaultRequest(stamp_ns=0, id="", part="port", fault="dead"),),
    )
    later = player.read(3 * S, 0)
    assert later.presses == ("light",)
    assert later.incidents == (LinkRequest(stamp_ns=0, id="", kind="down"),)
    assert player.read(4 * S, 0).incidents == ()
    restarted = Player("x", script, Outbox(), player.played)
    assert restarted.read(4 * S, 0).incidents == ()


class Asked:
    """A host with the sender, and what it sends. Faults are refused, the link is silent."""

    def __init__(self) -> None:
        self.host = VirtualHost()
        self.requests: list[Incident] = []
        self.node = self.host.node("gamepad", ["topside"])
        self.causing = CausedIncidents(self.node)
        other = self.host.node("other", ["topside"])

        def refuse(request: FaultRequest, now: int) -> FaultAnswer:
            self.requests.append(request)
            return FaultAnswer(stamp_ns=now, id=request.id, accepted=False, reason="no such part")

        other.answers(topics.FAULT_REQUEST, topics.FAULT_ANSWER, refuse)
        other.each(topics.LINK_REQUEST, lambda request, _: self.requests.append(request))


FAULT = FaultRequest(stamp_ns=0, id="", part="port", fault="dead")
LINK = LinkRequest(stamp_ns=0, id="", kind="down")


def test_each_is_asked_until_answered_or_given_up_and_both_failures_are_counted():
    asked = Asked()

    def cause(now: int) -> None:
        for incident in (FAULT, LINK):
            asked.causing.cause(incident, now)

    asked.node.alarm(cause).set(S)
    asked.host.run(10 * S)
    faults = [request for request in asked.requests if isinstance(request, FaultRequest)]
    links = [request for request in asked.requests if isinstance(request, LinkRequest)]
    assert len(faults) == len({request.id for request in links}) == 1
    assert len(links) > 5
    assert asked.node.counts == {"refused:incident": 1, "unanswered:incident": 1}


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("fault prot dead", "there is no part 'prot'; did you mean 'port'?"),
        ("fault port weak", "weak needs a value from 0 to 1"),
        ("fault sensor/dvl silent", "there is no part 'sensor/dvl'"),
        ("link set acoustic", "acoustic cannot be flown: a command needs "),
        ("link set up.dealy_ms=1", "did you mean 'delay_ms'?"),
    ],
)
def test_what_would_be_refused_is_refused_before_the_dive(cell: str, says: str, tmp_path: Path):
    script = tmp_path / "x.csv"
    script.write_text(f"{TEXT_HEAD}0,0,0,0,0\n1,0,0,0,0,{cell}\n2,0,0,0,0\n")
    with pytest.raises(LindyError) as error:
        checked(Choices(), pilot_of(f"script:{script}"), Registry.read())
    assert f"script:{script}: {cell}: " in str(error.value)
    assert says in str(error.value)


def test_a_vehicle_that_has_the_sensor_may_lose_it_but_not_without_a_simulator(tmp_path: Path):
    script, services = tmp_path / "x.csv", Registry.read()
    script.write_text(f"{TEXT_HEAD}0,0,0,0,0\n1,0,0,0,0,fault sensor/dvl silent\n2,0,0,0,0\n")
    checked(Choices(vehicle="minerva"), pilot_of(f"script:{script}"), services)
    real = services.only({name: row for name, row in services.items() if name != "simulator"})
    with pytest.raises(LindyError, match="has no simulator"):
        checked(Choices(vehicle="minerva"), pilot_of(f"script:{script}"), real)


# A path file as a course.


LONG_WAY = "waypoints = [[0, 0, 2], [9, 0, 2], [9, 9, 3]]\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "way.toml"


def test_every_key_reaches_its_own_field_and_what_a_file_leaves_out_is_the_courses_own(file: Path):
    points = ((0.0, 0.0, 2.0), (9.0, 0.0, 2.0), (9.0, 9.0, 3.0))
    file.write_text(LONG_WAY)
    assert course_of(file) == Course(waypoints=points)
    file.write_text(
        LONG_WAY + 'min_radius = 2\nkind = "interpolating"\ncruise = 0.4\nacceleration = 0.1\n'
        'jerk = 0.6\nmodel = "mjvr"\nsmooth_yaw = true\naccel_time = 7.0\n'
    )
    assert course_of(file) == Course(
        waypoints=points,
        min_radius=2.0,
        kind="interpolating",
        cruise=0.4,
        acceleration=0.1,
        jerk=0.6,
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("waypoints = [[0, 0]]\n", "way.toml:1: waypoints: expected an array of length >= 2"),
        (LONG_WAY + "cruse = 0.3\n", "way.toml:2: cruse: unknown key; did you mean 'cruise'"),
        (LONG_WAY + 'kind = "round"\n', "kind: invalid enum value 'round'"),
        (LONG_WAY + 'model = "fernandes"\n', "only a path with model = 'mjvr' can be followed"),
        (LONG_WAY + "speeds = [0.1]\n", "has one speed; use cruise instead"),
    ],
)
def test_a_mistake_in_a_path_is_one_sentence(file: Path, text: str, says: str):
    file.write_text(text)
    with pytest.raises(LindyError) as caught:
        course_of(file)
    assert str(file) in str(caught.value)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
