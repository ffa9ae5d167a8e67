"""Who is there: whatever strangers say, the list stays small, true and readable."""

import json

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages import topics
from messages.identity import SideIdentity
from messages.message import Message
from messages.sensors import BatterySample
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.runtime.bus.spaces import here_key, namespace
from tools.fleet.drones import as_row, table
from tools.fleet.network import ROWS, Roster

IDENTITY = topics.IDENTITY.of("drone")
NAME = st.sampled_from(["a", "b", "c"])
TOKEN = st.tuples(NAME, st.sampled_from("123"))


def token(name: str, instance: str = "1", side: str = "drone") -> str:
    return here_key(namespace(name), side, instance)


def say(roster: Roster, name: str, topic: AnyTopic, message: Message) -> None:
    roster.row(f"{namespace(name)}/{topic.key}", msgspec.msgpack.encode(message))


def status(pilot: str = "", *, armed: bool = False) -> VehicleStatus:
    return VehicleStatus(stamp_ns=0, activity="ready", armed=armed, pilot=pilot)


def whole(name: str = "rov1") -> Roster:
    roster = Roster()
    roster.token(token(name))
    say(roster, name, IDENTITY, SideIdentity(vehicle="pioneer", version="1.0", messages="same"))
    say(roster, name, topics.STATUS, status("ann", armed=True))
    battery = BatterySample(stamp_ns=0, voltage=15.87, current=1.0, used_wh=20.0, capacity_wh=96.0)
    say(roster, name, topics.BATTERY, battery)
    return roster


def test_a_drone_that_speaks_is_a_line_with_everything_and_a_row_for_programs() -> None:
    roster = whole()
    assert roster.complete
    heading, line = table(roster, "E", "same").splitlines()
    assert heading.split("  ")[0] == "name"
    assert [word.strip() for word in line.split("  ") if word] == [
        "rov1", "pioneer", "1.0", "ready, armed", "15.9 V, 79 %", "ann",
    ]  # fmt: skip
    row = as_row(roster.drones["rov1"], "same")
    assert json.loads(json.dumps(row)) == row
    assert (row["type"], row["pilot"], row["armed"], row["same_messages"]) == (
        "pioneer", "ann", True, True,
    )  # fmt: skip
    assert round(row["charge"], 3) == 0.792


def test_nothing_that_a_stranger_says_acts_on_the_terminal() -> None:
    roster = whole()
    say(roster, "rov1", IDENTITY, SideIdentity(vehicle="a\x1b[2Jb", version="\r1", messages="same"))
    say(roster, "rov1", topics.STATUS, status("ann\x07\nrov9", armed=True))
    printed = table(roster, "E", "same")
    assert len(printed.splitlines()) == 2
    assert all(letter.isprintable() or letter == "\n" for letter in printed)


def test_the_mode_says_which_failsafe_acts() -> None:
    roster = whole()
    acts = msgspec.structs.replace(status("ann", armed=True), activity="stopping", failsafe="leak")
    say(roster, "rov1", topics.STATUS, acts)
    assert "  FAILSAFE leak: stopping, armed  " in table(roster, "E", "same")
    assert as_row(roster.drones["rov1"], "same")["failsafe"] == "leak"


def test_a_drone_is_waited_for_until_its_battery_is_known_else_it_is_a_dash() -> None:
    roster = Roster()
    roster.token(token("rov1"))
    say(roster, "rov1", IDENTITY, SideIdentity(vehicle="pioneer", version="1.0", messages="same"))
    say(roster, "rov1", topics.STATUS, status("ann"))
    assert not roster.complete
    assert table(roster, "E", "same").splitlines()[1].split() == [
        "rov1", "pioneer", "1.0", "ready", "–", "ann",
    ]  # fmt: skip
    say(roster, "rov1", topics.BATTERY, BatterySample(stamp_ns=0, voltage=1, current=1, used_wh=1))
    assert roster.complete


def test_other_messages_two_of_a_name_and_silence_are_said() -> None:
    roster = whole()
    assert "cannot be flown from here" in table(roster, "E", "others")
    roster.token(token("rov1", "2"))
    assert "two drones of this name" in table(roster, "E", "same")
    roster.token(token("mute"))
    assert not roster.complete
    assert "mute" in table(roster, "E", "same")
    assert "is announced, but says nothing" in table(roster, "E", "same")


@given(st.sampled_from(ROWS), st.binary(max_size=60))
def test_whatever_a_row_carries_the_list_goes_on(topic: AnyTopic, payload: bytes) -> None:
    roster = whole()
    roster.row(f"{namespace('rov1')}/{topic.key}", payload)
    roster.row(f"{namespace('nobody')}/{topic.key}", payload)
    assert roster.names == ["rov1"]
    assert roster.complete
    table(roster, "E", "same")


@pytest.mark.parametrize("payload", [b"\xc1", b"\x81\xa4note\xa1\xff", b"\x91" * 100_000])
def test_what_cannot_be_read_changes_nothing(payload: bytes) -> None:
    roster = whole()
    before = table(roster, "E", "same")
    roster.row(f"{namespace('rov1')}/{topics.STATUS.key}", payload)
    assert table(roster, "E", "same") == before
