"""`lindy fleet`: who is there, how well each is heard, what is wrong; whatever strangers say."""

import json
from io import StringIO
from math import pi

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console

from messages import topics
from messages.identity import SideIdentity
from messages.message import Message
from messages.sensors import BatterySample
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.runtime.bus.spaces import here_key, namespace
from services.vehicle_view import ages
from tools.fleet.fleet_screen import as_json, line, news, screen, title_of
from tools.fleet.hearing import SPAN, Hearing
from tools.fleet.names import clean
from tools.fleet.roster import MOST
from tools.fleet.watching import GONE_NS, FleetRow, FleetWatch

SECOND = 1_000_000_000
IDENTITY = topics.IDENTITY.of("drone")
TEXT = st.text(max_size=200)


def token(name: str, instance: str = "1") -> str:
    return here_key(namespace(name), "drone", instance)


def say(watch: FleetWatch, name: str, topic: AnyTopic, message: Message, now: int = 0) -> None:
    watch.row(f"{namespace(name)}/{topic.key}", msgspec.msgpack.encode(message), now)


def flying(seq: int = 0, **more: object) -> VehicleStatus:
    status = VehicleStatus(
        seq=seq,
        stamp_ns=0,
        activity="piloted",
        armed=True,
        pilot="ann",
        depth=4.25,
        heading=-pi / 2,
    )
    return msgspec.structs.replace(status, **more)


def watching(*names: str) -> FleetWatch:
    watch = FleetWatch("same")
    for name in names:
        watch.token(token(name), True, 0)
        say(watch, name, IDENTITY, SideIdentity(vehicle="pioneer", messages="same"))
        say(watch, name, topics.STATUS, flying())
        battery = BatterySample(stamp_ns=0, voltage=15.9, current=1.0, used_wh=1.0)
        say(watch, name, topics.BATTERY, battery)
    return watch


def shown(rows: list[FleetRow], remarks: list[str], height: int, width: int = 200) -> list[str]:
    console = Console(width=width, height=height, record=True, file=StringIO())
    console.print(screen(rows, remarks, title_of(rows, "E", True), width, height))
    return console.export_text().splitlines()


def test_a_drone_is_a_line_with_everything_that_matters() -> None:
    (row,) = watching("rov1").rows(SECOND // 5)
    assert line(row) == "rov1  piloted, armed  4.2 m  270°  15.9 V, 1.0 Wh used  0.2 s  ann"
    assert json.loads(as_json([row], ["x"], True)) == {
        "drones": [json.loads(json.dumps(row._asdict()))],
        "not_listed": ["x"],
        "router_answers": True,
    }


@pytest.mark.parametrize(
    ("said", "alarm"),
    [
        (flying(failsafe="leak", reaction="ascend"), "FAILSAFE leak: rising"),
        (flying(note="not ready: calibrating"), "not ready: calibrating"),
    ],
)
def test_what_a_drone_complains_of_is_an_alarm(said: VehicleStatus, alarm: str) -> None:
    watch = watching("rov1")
    say(watch, "rov1", topics.STATUS, said)
    assert watch.rows(0)[0].alarms == (alarm,)


def test_a_battery_that_falls_silent_is_not_shown_as_if_it_were_heard() -> None:
    watch = watching("rov1")
    say(watch, "rov1", topics.STATUS, flying(), ages.BATTERY.grey_ns)
    (row,) = watch.rows(ages.BATTERY.grey_ns)
    assert (row.battery, row.alarms) == ("15.9 V, 1.0 Wh used", ())
    say(watch, "rov1", topics.STATUS, flying(failsafe="leak"), 130 * SECOND)
    (row,) = watch.rows(130 * SECOND)
    assert (row.battery, row.alarms) == ("", ("FAILSAFE leak: piloted", "battery silent for 130 s"))
    assert "  –  " in " ".join(shown([row], [], 30))
    (row,) = watch.rows(140 * SECOND)
    assert row.alarms == (
        "not heard for 10 s",
        "FAILSAFE leak: piloted",
    )  # of which silence is a part
    say(watch, "rov1", topics.STATUS, flying(), 150 * SECOND)
    battery = BatterySample(stamp_ns=0, voltage=14.0, current=1.0, used_wh=1.0)
    say(watch, "rov1", topics.BATTERY, battery, 150 * SECOND)
    (row,) = watch.rows(151 * SECOND)
    assert (row.battery, row.alarms) == ("14.0 V, 1.0 Wh used", ())


def test_a_battery_that_was_never_heard_is_silent_since_its_drone_was_heard_first() -> None:
    watch = FleetWatch("same")
    watch.token(token("rov1"), True, 0)
    for second in range(10, 20):
        say(watch, "rov1", topics.STATUS, flying(), second * SECOND)
        alarms = watch.rows(second * SECOND)[0].alarms
        silent = (f"battery silent for {second - 10} s",)
        assert alarms == (silent if second > 15 else ())
    watch.token(token("rov1"), False, 20 * SECOND)
    watch.token(token("rov1"), True, 30 * SECOND)
    say(watch, "rov1", topics.STATUS, flying(), 30 * SECOND)
    assert watch.rows(31 * SECOND)[0].alarms == ()  # it has had no time yet


def test_silence_two_of_a_name_other_messages_and_departure_are_alarms() -> None:
    watch = watching("rov1")
    assert watch.rows(ages.STATUS.grey_ns)[0].alarms == ()
    assert watch.rows(ages.STATUS.grey_ns + 1)[0].alarms == ("not heard for 1 s",)
    watch.token(token("rov1", "2"), True, 0)
    say(watch, "rov1", IDENTITY, SideIdentity(vehicle="pioneer", messages="others"))
    assert [alarm.split(":")[0] for alarm in watch.rows(0)[0].alarms] == [
        "two drones of this name", "other messages than here",
    ]  # fmt: skip
    for instance in "12":
        watch.token(token("rov1", instance), False, SECOND)
    (gone,) = watch.rows(5 * SECOND)
    assert gone.alarms == ("gone for 4 s",)
    watch.token(token("rov1", "3"), True, 6 * SECOND)
    assert [row.alarms for row in watch.rows(6 * SECOND)] == [
        ("is announced, but says nothing",)
    ]  # nothing of before its departure is believed
    watch.token(token("rov1", "3"), False, 6 * SECOND)
    assert watch.rows(7 * SECOND + GONE_NS) == []


def test_who_is_gone_counts_no_more_as_armed_or_flown_and_programs_are_told() -> None:
    watch = watching("rov1", "rov2")
    watch.token(token("rov2"), False, SECOND)
    rows = watch.rows(SECOND)
    assert title_of(rows, "E", True) == "1 drones at E: 1 armed, 1 flown, 0 with an alarm; 1 gone"
    printed = json.loads(as_json(rows, [], True))
    assert [row["gone"] for row in printed["drones"]] == [False, True]


def test_without_its_router_the_screen_says_so_and_calls_no_drone_gone() -> None:
    watch = watching("early", "rov1", "rov2")
    watch.token(token("early"), False, SECOND)
    for name in ("rov1", "rov2"):  # by the end of the link, which is noticed a moment later
        watch.token(token(name), False, 10 * SECOND)
    watch.router(False, 11 * SECOND)
    watch.router(False, 12 * SECOND)
    rows = watch.rows(40 * SECOND)
    assert [(row.name, row.gone) for row in rows] == [
        ("early", True), ("rov1", False), ("rov2", False),
    ]  # fmt: skip
    assert [row.alarms for row in rows][1:] == [("not heard for 40 s",)] * 2
    assert not watch.router_answers
    assert title_of(rows, "E", False).startswith("the router at E does not answer; ")
    assert title_of([], "E", False) == "the router at E does not answer"
    assert json.loads(as_json(rows, [], False))["router_answers"] is False
    watch.router(True, 50 * SECOND)
    watch.token(token("rov1"), True, 50 * SECOND)  # the other one did not come back
    assert [row.gone for row in watch.rows(51 * SECOND)] == [True, False, True]


def test_a_thousand_names_of_a_stranger_are_one_sentence_and_hide_no_drone_that_speaks() -> None:
    watch = FleetWatch("same")
    for k in range(1000):
        watch.token(token(f"ghost{k}"), True, 0)
        watch.token(token(f"gh\x1b[2Jst{k}"), True, 0)
    for k in range(20):  # behind all of them
        watch.token(token(f"rov{k:02}"), True, 0)
        say(watch, f"rov{k:02}", topics.STATUS, flying())
    rows = watch.rows(0)
    assert len(rows) == MOST
    assert {f"rov{k:02}" for k in range(20)} <= {row.name for row in rows if row.activity}
    assert watch.roster.remarks == [
        f"{1020 - MOST} announced beyond the first {MOST}, and not listed",
        "1000 announced with names that no drone may have, and not listed",
    ]
    for k in range(1000):
        watch.token(token(f"ghost{k}"), False, 0)
        watch.token(token(f"gh\x1b[2Jst{k}"), False, 0)
    assert [row.name for row in watch.rows(0)] == [f"rov{k:02}" for k in range(20)]
    assert watch.roster.remarks == []


def test_drones_that_speak_are_no_more_than_the_list_is_long() -> None:
    watch = FleetWatch("same")
    for k in range(3 * MOST):
        watch.token(token(f"rov{k}"), True, 0)
        say(watch, f"rov{k}", topics.STATUS, flying())
    assert len(watch.rows(0)) == MOST
    for k in range(3 * MOST):
        watch.token(token(f"rov{k}"), False, 0)
    assert len(watch.rows(0)) <= MOST


@given(
    st.lists(st.tuples(st.sampled_from("abc"), TEXT, TEXT), min_size=1, max_size=6),
    st.integers(1, 60),
)
def test_the_screen_fits_and_nothing_on_it_acts_on_the_terminal(
    said: list[tuple[str, str, str]], height: int
) -> None:
    watch = watching("a", "b", "c", *(f"rov{k}" for k in range(30)))
    for name, pilot, note in said:
        say(watch, name, topics.STATUS, flying(pilot=pilot[:128], note=note))
    rows = watch.rows(0)
    lines = shown(rows, ["5 announced beyond"], height)
    assert len(lines) <= max(height, 6)
    assert all(letter.isprintable() for each in lines for letter in each)
    for row in rows:
        assert all(letter.isprintable() for letter in line(row))


def test_where_the_window_is_too_low_alarms_come_first_and_the_rest_is_counted() -> None:
    watch = watching(*(f"rov{k:02}" for k in range(20)))
    say(watch, "rov17", topics.STATUS, flying(failsafe="leak"))
    lines = shown(watch.rows(0), [], 10)
    assert "rov17" in lines[2]
    assert lines[-1] == "and 15 more, 0 of them with an alarm: the window is too low"


SENTENCE = "not ready: calibrating the compass: turn the drone slowly through a whole circle, level"


@pytest.mark.parametrize("width", [80, 100, 120, 160])
def test_no_sentence_takes_the_name_of_a_drone(width: int) -> None:
    names = ["rov1", "a-drone-of-a-long-name", "rov3"]
    watch = watching(*names)
    say(watch, "rov1", topics.STATUS, flying(failsafe="pilot_lost", reaction="stop"))
    say(watch, names[1], topics.STATUS, flying(note=SENTENCE, pilot="cockpit-of-the-mate"))
    lines = shown(watch.rows(0), [], 24, width)
    assert lines[0].startswith("3 drones at E: ")
    assert [name for each in lines for name in names if each.startswith(f"{name} ")] == sorted(
        names
    )
    assert all(len(each) <= width for each in lines)
    said = " ".join(lines)
    assert "FAILSAFE pilot lost: " in said
    assert SENTENCE[:70] in said
    assert "piloted, armed" in said
    for column in ("battery", "heading"):  # shown, or said to be left out
        assert column in said


@given(
    st.lists(st.tuples(TEXT, TEXT, st.booleans()), min_size=1, max_size=12),
    st.integers(24, 200),
    st.integers(7, 60),
)
def test_at_every_size_a_drone_is_there_with_its_name_or_is_counted(
    said: list[tuple[str, str, bool]], width: int, height: int
) -> None:
    names = [f"rov{k:02}" for k in range(len(said))]
    watch = watching(*names)
    for name, (pilot, note, leaks) in zip(names, said, strict=True):
        failsafe = "leak" if leaks else "none"
        said_now = flying(pilot=pilot[:128], note=note, failsafe=failsafe)
        say(watch, name, topics.STATUS, said_now)
    lines = shown(watch.rows(0), [], height, width)
    assert len(lines) < height
    assert all(cell_len(each) <= width for each in lines)
    there = sum(each.startswith("rov") for each in lines)
    hidden = next((int(each.split()[1]) for each in lines if each.startswith("and ")), 0)
    assert there + hidden == len(names)


def test_no_name_that_was_only_announced_and_no_drone_that_is_gone_hides_one_in_need() -> None:
    watch = watching("gone", "ready", "armed", "noting", "unsafe", "unsafe_and_gone")
    for k in range(50):
        watch.token(token(f"a{k}"), True, 0)
    say(watch, "ready", topics.STATUS, flying(armed=False))
    say(watch, "noting", topics.STATUS, flying(armed=False, note="not ready: calibrating"))
    say(watch, "armed", topics.STATUS, flying(note="the light is hot"))
    for name in ("unsafe", "unsafe_and_gone"):
        say(watch, name, topics.STATUS, flying(failsafe="leak"))
    for name in ("gone", "unsafe_and_gone"):
        watch.token(token(name), False, 0)
    lines = shown(watch.rows(SECOND), [], 12)
    assert [each.split()[0] for each in lines[2:-1]] == [
        "unsafe", "armed", "noting", "ready", "gone", "unsafe_and_gone", "a0",
    ]  # fmt: skip
    assert lines[-1].startswith("and 49 more")


def test_a_drone_gets_another_line_for_news_and_not_for_passing_seconds() -> None:
    watch = watching("rov1")
    old, older = watch.rows(3 * SECOND)[0], watch.rows(9 * SECOND)[0]
    assert news(watch.rows(0)[0]) != news(old) == news(older)
    say(watch, "rov1", topics.STATUS, flying(pilot="bob"), 9 * SECOND)
    assert news(watch.rows(9 * SECOND)[0]) not in (news(old), ("piloted", True, "ann", ()))


@given(st.lists(st.booleans(), min_size=1, max_size=80))
def test_the_loss_is_the_share_that_did_not_come(came: list[bool]) -> None:
    hearing, seen = Hearing(), [True, *came, True]
    for seq, heard in enumerate(seen):
        if heard:
            hearing.hear(seq, seq * SPAN // 100)
    assert hearing.loss(0) == pytest.approx(1.0 - sum(seen) / len(seen))
    assert hearing.loss(10 * SPAN) is None  # long ago


def test_a_service_that_starts_again_has_lost_nothing() -> None:
    hearing = Hearing()
    for seq in (500, 501, 0, 1, 2, 10**9):
        hearing.hear(seq, SECOND)
    assert hearing.loss(SECOND) == 0.0


@given(TEXT, st.integers(2, 40))
def test_cleaned_text_is_short_and_printable(text: str, longest: int) -> None:
    cleaned = clean(text, longest)
    assert len(cleaned) <= longest
    assert cleaned.isprintable()
