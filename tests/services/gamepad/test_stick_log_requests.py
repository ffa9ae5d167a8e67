"""Events of a stick log that have arguments: goto, follow and mode; and incidents, which are the
requests of `lindy fault` and `lindy link`, once, at their time.
"""

import math
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages import topics
from messages.events import Outbox
from messages.link import LinkRequest
from messages.pilot import Course, FlightMode
from messages.simulator import FaultAnswer, FaultKind, FaultRequest
from services.gamepad.io.path_file import course_named
from services.gamepad.io.sources import read_script
from services.gamepad.service import CausedIncidents
from services.gamepad.stick_log import Player, in_words, parse
from services.piloting.pilot_intents import FollowIntent, GotoIntent, ModeIntent, PlaceIntent
from services.piloting.sticks import CENTRED, Incident, StickReading
from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.checks import checked, pilot_of
from tools.choices import Choices

S = 1_000_000_000  # [ns]
HEAD = "t,surge,sway,heave,yaw,event\n"
WAY = "waypoints = [[0, 0], [9, 0]]\n"


def event_of(cell: str) -> object:
    return parse(f"{HEAD}0,0,0,0,0\n1,0,0,0,0,{cell}\n".encode(), course_named).rows[1].event


@settings(max_examples=100, deadline=None)
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
        ("goto north=1e9 east=1", "each within 100000 m"),
        ("goto depth=deep", "goto: depth is 'deep', expected a number"),
        ("goto depth=nan", "goto: depth is nan, expected a number from 0 to 11000 m"),
        ("goto heading=inf", "goto: heading is inf, expected a number from -360 to 360 deg"),
        ("gotodepth=3", "event is 'gotodepth=3', expected one of .*goto depth=M heading=DEG"),
        ("follow", "follow needs a path"),
        ("mode", "mode: found '', expected one of manual, depth_hold"),
        ("follow inspection_bix", "did you mean 'inspection_box'"),
        ("follow fernandes", "fernandes.toml: model is 'fernandes'; only"),
        ("fault port", "expected fault PART KIND"),
        ("fault port deaf", "KIND is 'deaf', expected one of none, dead"),
        ("fault port weak half", "VALUE is 'half', expected a finite number"),
        ("link set", "expected link down"),
    ],
)
def test_a_mistake_in_an_event_is_named_with_its_line(cell: str, says: str):
    with pytest.raises(ValueError, match=f"^line 3: .*({says})"):
        event_of(cell)


def test_a_mistake_inside_the_path_is_found_when_the_script_is_read(tmp_path: Path):
    way, script = tmp_path / "way.toml", tmp_path / "trip.csv"
    way.write_text(WAY + "cruise = 0\n")
    script.write_text(f"{HEAD}0,0,0,0,0,follow {way}\n")
    with pytest.raises(LindyError, match=r"trip\.csv: line 2: follow: .*way\.toml:2: cruise"):
        read_script(str(script))


@pytest.mark.parametrize(
    ("cell", "event"),
    [
        ("goto north=12.5 east=-4", PlaceIntent(12.5, -4.0)), ("home", "home"), ("unwind", "unwind"),
        *((f"mode {hold}", ModeIntent(hold)) for hold in get_args(FlightMode)),
    ],
)  # fmt: skip
def test_a_place_is_in_metres_and_a_mode_is_what_to_hold(cell: str, event: object) -> None:
    assert event_of(cell) == event


@pytest.mark.parametrize(
    "cell",
    [
        *(f"fault port {kind}" for kind in get_args(FaultKind)),
        "fault sensor/pressure biased -300",
        "fault all none",
        "link down",
        "link up",
        "link profile severe",
        "link set up.delay_ms=80 down.rate_kbit=256",
    ],
)
def test_an_incident_reads_as_it_is_written(cell: str):
    found = event_of(cell)
    assert isinstance(found, Incident)
    assert in_words(found) == cell


def test_the_player_gives_each_once_and_apart_from_the_pilots_requests():
    text = f"{HEAD}0,0,0,0,0\n1,0,0,0,0,fault port dead\n2,0,0,0,0,light\n3,0,0,0,0,link down\n"
    script = parse(text.encode(), course_named)
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
    """A host with the sender, and what it sends. Faults are refused, and of the link nobody hears."""

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
        ("link profile acoustic", "acoustic cannot be flown: a command needs "),
        ("link set up.dealy_ms=1", "did you mean 'delay_ms'?"),
    ],
)
def test_what_would_be_refused_is_refused_before_the_dive(cell: str, says: str, tmp_path: Path):
    script = tmp_path / "x.csv"
    script.write_text(f"{HEAD}0,0,0,0,0\n1,0,0,0,0,{cell}\n2,0,0,0,0\n")
    with pytest.raises(LindyError) as error:
        checked(Choices(), pilot_of(f"script:{script}"), Registry.read())
    assert f"script:{script}: {cell}: " in str(error.value)
    assert says in str(error.value)


def test_a_vehicle_that_has_the_sensor_may_lose_it_but_not_without_a_simulator(tmp_path: Path):
    script, services = tmp_path / "x.csv", Registry.read()
    script.write_text(f"{HEAD}0,0,0,0,0\n1,0,0,0,0,fault sensor/dvl silent\n2,0,0,0,0\n")
    checked(Choices(vehicle="minerva"), pilot_of(f"script:{script}"), services)
    real = services.only({name: row for name, row in services.items() if name != "simulator"})
    with pytest.raises(LindyError, match="has no simulator"):
        checked(Choices(vehicle="minerva"), pilot_of(f"script:{script}"), real)
