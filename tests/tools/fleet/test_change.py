"""A change of drone: in which order it is done, when it is refused, and what is said of the drone
that is left."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.vehicle import VehicleStatus
from tools.fleet.change import (
    RELEASE_NS,
    SILENCE_NS,
    START_NS,
    Act,
    ChangeOfDrone,
    ChangeSeen,
    left_behind,
)

THERE = ["rov1", "rov2", "rov3"]
ORDER: list[Act] = ["open", "release", "silence", "begin", "go_over"]
seen = st.builds(
    ChangeSeen,
    opened=st.booleans(),
    failed=st.sampled_from(["", "", "", "the port is taken"]),
    released=st.booleans(),
    silent=st.booleans(),
    alive=st.booleans(),
)


def status(**more: Any) -> VehicleStatus:
    given: dict[str, Any] = {"stamp_ns": 0, "activity": "piloted", "armed": True, "depth": 4.12}
    return VehicleStatus(**(given | more))


def begun() -> ChangeOfDrone:
    change = ChangeOfDrone("rov1")
    assert change.refusal("rov2", THERE) == ""
    assert change.order("rov2", 0) == "open"
    return change


def test_a_change_is_done_in_one_order():
    change = begun()
    assert change.step(ChangeSeen(), 1) is None
    assert change.step(ChangeSeen(opened=True), 2) == "release"
    assert change.step(ChangeSeen(), 3) is None
    assert change.step(ChangeSeen(released=True), 4) == "silence"
    assert change.step(ChangeSeen(), 5) is None
    assert change.step(ChangeSeen(silent=True), 6) == "begin"
    assert change.step(ChangeSeen(silent=True), 7) is None
    assert (change.drone, change.wanted) == ("rov1", "rov2")
    assert change.step(ChangeSeen(silent=True, alive=True), 8) == "go_over"
    assert (change.drone, change.wanted, change.phase) == ("rov2", "", "flying")


@given(st.lists(st.tuples(seen, st.integers(0, START_NS)), max_size=40))
def test_whatever_happens_a_pilot_begins_only_after_the_other_one_has_ended(
    steps: list[tuple[ChangeSeen, int]],
):
    """… and the drone is the new one exactly when it was gone over to."""
    change, done, now = begun(), list[Act](["open"]), 0
    for what, later in steps:
        now += later
        act = change.step(what, now)
        if act is None:
            continue
        done.append(act)
        if act == "begin":
            assert what.silent
        if act == "go_over":
            assert what.alive
            assert not what.failed
    acts = [act for act in done if act != "kill"]
    ends = [act for act in acts if act not in ORDER]
    assert len(ends) <= 1
    assert acts == [*ORDER[: len(acts) - len(ends)], *ends]
    if "give_up" in acts:
        assert acts == ["open", "give_up"]
    if "go_back" in acts:
        assert acts[:-1] == ORDER[:-1]
    assert (change.drone == "rov2") == ("go_over" in acts)
    assert (change.failed != "") == bool(ends)
    assert (change.wanted == "") == (change.phase == "flying")


def test_a_drone_that_does_not_answer_is_left_all_the_same():
    change = begun()
    change.step(ChangeSeen(opened=True), 0)
    assert change.step(ChangeSeen(), RELEASE_NS - 1) is None
    assert change.step(ChangeSeen(), RELEASE_NS) == "silence"


def test_a_pilot_that_does_not_end_is_killed_once():
    change = begun()
    change.step(ChangeSeen(opened=True), 0)
    change.step(ChangeSeen(released=True), 0)
    assert change.step(ChangeSeen(), SILENCE_NS) == "kill"
    assert change.step(ChangeSeen(), 10 * SILENCE_NS) is None
    assert change.step(ChangeSeen(silent=True), 11 * SILENCE_NS) == "begin"


@pytest.mark.parametrize("failed", ["the port is taken", ""])
def test_without_its_pilot_the_first_drone_gets_its_own_back(failed: str):
    change = begun()
    for what in (ChangeSeen(opened=True), ChangeSeen(released=True), ChangeSeen(silent=True)):
        change.step(what, 0)
    assert change.step(ChangeSeen(silent=True, failed=failed), START_NS) == "go_back"
    assert change.drone == "rov1"
    assert change.failed == (failed or "its pilot was not alive after 10 s")
    assert change.refusal("rov2", THERE) == ""  # it can be tried again


def test_what_cannot_be_opened_changes_nothing():
    change = begun()
    assert change.step(ChangeSeen(failed="a full disk"), 1) == "give_up"
    assert (change.drone, change.wanted, change.failed) == ("rov1", "", "a full disk")


@pytest.mark.parametrize(
    ("wanted", "there", "said"),
    [
        ("rov1", THERE, "rov1 is flown already"),
        ("rov9", THERE, "no drone is called rov9; there are rov1, rov2, rov3"),
        ("rov9", [], "no drone is called rov9; none can be reached"),
        ("..", THERE, "fly '..': a drone's name is a part of every key"),
        ("rov\x1b[2J", THERE, "letters without accents"),
        ("x" * 500, THERE, "1 to 55 of them"),
    ],
)
def test_what_is_refused_is_refused_in_one_sentence(wanted: str, there: list[str], said: str):
    reason = ChangeOfDrone("rov1").refusal(wanted, there)
    assert said in reason
    assert reason.isprintable()
    assert len(reason) <= 400


def test_one_change_goes_on_at_a_time():
    assert begun().refusal("rov3", THERE) == "the change to rov2 is going on"


@pytest.mark.parametrize(
    ("heard", "released", "said"),
    [
        (status(), True, "rov1 holds at 4.1 m, armed, nobody flies it; it rises after 60 s"),
        (status(armed=False), True, "rov1 is left at 4.1 m, disarmed, nobody flies it"),
        (status(pilot="ann"), True, "rov1 is left to ann, who has control"),
        (
            status(failsafe="leak", reaction="ascend", words="the drone rises slowly"),
            True,
            "rov1 is left at 4.1 m, armed, nobody flies it: the drone rises slowly",
        ),
        (
            status(failsafe="pilot_lost", reaction="stop", words="pilot lost; resume"),
            True,
            "rov1 holds at 4.1 m, armed, nobody flies it; it rises after 60 s",
        ),
        (
            status(),
            False,
            "rov1 does not answer, armed at 4.1 m when it was last heard: an armed drone that "
            "hears no pilot stops and holds, and rises after 60 s",
        ),
        (
            None,
            True,
            "rov1 does not answer: an armed drone that hears no pilot stops and holds, and rises "
            "after 60 s",
        ),
    ],
)
def test_the_drone_that_is_left_is_said_in_one_sentence(
    heard: VehicleStatus | None, released: bool, said: str
):
    assert left_behind("rov1", heard, 60.0, released=released) == said
