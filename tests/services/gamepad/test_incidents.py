"""Incidents of a stick log: the requests of `lindy fault` and `lindy link`, once, at their time."""

from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import pytest

from messages import topics
from messages.events import Outbox
from messages.link import LinkAnswer, LinkRequest
from messages.pilot import Course
from messages.simulator import FaultAnswer, FaultKind, FaultRequest
from services.gamepad.service import CausedIncidents
from services.gamepad.stick_log import Player, in_words, parse
from services.piloting.sticks import CENTRED, Incident, StickReading
from services.runtime.config.errors import LindyError
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tools.checks import checked, pilot_of
from tools.choices import Choices

S = 1_000_000_000  # [ns]
HEAD = "t,surge,sway,heave,yaw,event\n"


def no_courses(name: str) -> Course:
    raise ValueError(name)


def event(cell: str) -> object:
    return parse(f"{HEAD}0,0,0,0,0\n1,0,0,0,0,{cell}\n".encode(), no_courses).rows[1].event


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
    found = event(cell)
    assert isinstance(found, Incident)
    assert in_words(found) == cell


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("fault", "expected fault PART KIND"),
        ("fault port", "expected fault PART KIND"),
        ("fault port dead 1 2", "expected fault PART KIND"),
        ("fault port deaf", "KIND is 'deaf', expected one of none, dead"),
        ("fault port weak half", "VALUE is 'half', expected a finite number"),
        ("fault port weak nan", "VALUE is 'nan', expected a finite number"),
        ("fault port weak inf", "VALUE is 'inf', expected a finite number"),
        ("link", "expected link down, link up, link profile NAME"),
        ("link left", "expected link down"),
        ("link down now", "expected link down"),
        ("link profile", "expected link down"),
        ("link set", "expected link down"),
    ],
)
def test_a_mistake_is_named_with_its_line(cell: str, says: str):
    with pytest.raises(ValueError, match=f"^line 3: .*{says}"):
        event(cell)


def test_the_player_gives_each_once_and_apart_from_the_pilots_requests():
    text = f"{HEAD}0,0,0,0,0\n1,0,0,0,0,fault port dead\n2,0,0,0,0,light\n3,0,0,0,0,link down\n"
    script = parse(text.encode(), no_courses)
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
    """A host with the sender, and what it sends."""

    def __init__(self, answers: bool) -> None:
        self.host = VirtualHost()
        self.requests: list[Incident] = []
        self.node = self.host.node("gamepad", ["topside"])
        self.causing = CausedIncidents(self.node)
        other = self.host.node("other", ["topside"])
        faults, links = other.publisher(topics.FAULT_ANSWER), other.publisher(topics.LINK_ANSWER)

        def on_fault(request: FaultRequest, now: int) -> None:
            self.requests.append(request)
            if answers:
                faults.put(
                    FaultAnswer(stamp_ns=now, id=request.id, accepted=False, reason="no such part")
                )

        def on_link(request: LinkRequest, now: int) -> None:
            self.requests.append(request)
            if answers:
                links.put(LinkAnswer(stamp_ns=now, id=request.id, accepted=True, kind=request.kind))

        other.each(topics.FAULT_REQUEST, on_fault)
        other.each(topics.LINK_REQUEST, on_link)

    def cause(self, incidents: Sequence[Incident]) -> None:
        def go(now: int) -> None:
            for incident in incidents:
                self.causing.cause(incident, now)

        self.node.alarm(go).set(S)
        self.host.run(10 * S)


FAULT = FaultRequest(stamp_ns=0, id="", part="port", fault="dead")
LINK = LinkRequest(stamp_ns=0, id="", kind="down")


def test_it_is_asked_until_answered_and_a_refusal_is_counted():
    asked = Asked(answers=True)
    asked.cause([FAULT, LINK])
    assert [type(request) for request in asked.requests] == [FaultRequest, LinkRequest]
    assert asked.node.counts == {"refused:incident": 1}


def test_what_nobody_answers_is_repeated_with_its_id_and_then_counted():
    asked = Asked(answers=False)
    asked.cause([FAULT])
    assert len(asked.requests) > 5
    assert len({request.id for request in asked.requests}) == 1
    assert asked.node.counts == {"unanswered:incident": 1}


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("fault prot dead", "there is no part 'prot'; did you mean 'port'?"),
        ("fault port silent", "port cannot be silent; possible: none, dead"),
        ("fault port weak", "weak needs a value from 0 to 1"),
        ("fault port dead 1", "dead takes no value"),
        ("fault sensor/dvl silent", "there is no part 'sensor/dvl'"),
        ("link profile tehter", "did you mean 'tether'?"),
        ("link profile acoustic", "acoustic cannot be flown: a command needs "),
        ("link set up.delay_ms=-1", "up.delay_ms"),
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


def test_a_vehicle_that_has_the_sensor_may_lose_it(tmp_path: Path):
    script = tmp_path / "x.csv"
    script.write_text(f"{HEAD}0,0,0,0,0\n1,0,0,0,0,fault sensor/dvl silent\n2,0,0,0,0\n")
    checked(Choices(vehicle="minerva"), pilot_of(f"script:{script}"), Registry.read())


def test_a_stack_without_a_simulator_cannot_have_faults(tmp_path: Path):
    script = tmp_path / "x.csv"
    script.write_text(f"{HEAD}0,0,0,0,0\n1,0,0,0,0,fault port dead\n2,0,0,0,0\n")
    services = Registry.read()
    real = services.only({name: row for name, row in services.items() if name != "simulator"})
    with pytest.raises(LindyError, match="has no simulator"):
        checked(Choices(), pilot_of(f"script:{script}"), real)
