"""Events of a stick log that have arguments: goto, follow and mode."""

import math
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import Course, FlightMode
from services.gamepad.io.path_file import course_named
from services.gamepad.io.sources import read_script
from services.gamepad.stick_log import Player, parse
from services.piloting.pilot_intents import FollowIntent, GotoIntent, ModeIntent, PlaceIntent
from services.piloting.sticks import CENTRED
from services.runtime.config.errors import LindyError

S = 1_000_000_000  # [ns]
HEAD = "t,surge,sway,heave,yaw,event\n"
WAY = "waypoints = [[0, 0], [9, 0]]\n"


def event(cell: str) -> object:
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
    assert event("goto " + "  ".join(words[::-1] if turned else words)) == GotoIntent(
        depth, expected
    )


def test_follow_reads_a_shipped_path_by_its_name_or_any_by_its_file(tmp_path: Path):
    file = tmp_path / "my way.toml"
    file.write_text(WAY)
    assert event(f"follow {file}") == FollowIntent(Course(waypoints=((0.0, 0.0), (9.0, 0.0))))
    shipped = event("follow inspection_box")
    assert isinstance(shipped, FollowIntent)
    assert len(shipped.course.waypoints) == 5


@pytest.mark.parametrize("hold", get_args(FlightMode))
def test_mode_reads_what_the_drone_is_to_hold(hold: str):
    assert event(f"mode {hold}") == ModeIntent(hold)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("cell", "says"),
    [
        ("goto", "goto needs a depth, a heading or both"),
        ("goto north=3", "expected north=M and east=M, each within 100000 m, and nothing else"),
        ("goto north=3 east=1 depth=2", "found 'north=3 east=1 depth=2', expected north=M and"),
        ("goto north=1e9 east=1", "each within 100000 m"),
        ("goto north=nan east=1", "each within 100000 m"),
        ("goto 3", "goto: found '3', expected depth=M, heading=DEG or both"),
        ("goto depth 3", "goto: found 'depth'|goto: depth is ''"),
        ("goto depth=", "goto: depth is '', expected a number"),
        ("goto depth=deep", "goto: depth is 'deep', expected a number"),
        ("goto depth=3 depth=4", "goto: found 'depth=4'"),
        ("goto north=3", "goto: found 'north=3'"),
        ("goto depth=nan", "goto: depth is nan, expected a number from 0 to 11000 m"),
        ("goto depth=-0.1", "goto: depth is -0.1, expected"),
        ("goto depth=1e9", "goto: depth is 1e.09, expected"),
        ("goto heading=inf", "goto: heading is inf, expected a number from -360 to 360 deg"),
        ("goto heading=361", "goto: heading is 361, expected"),
        ("gotodepth=3", "event is 'gotodepth=3', expected one of .*goto depth=M heading=DEG"),
        ("stop now", "event is 'stop now', expected one of"),
        ("follow", "follow needs a path"),
        ("mode", "mode: found '', expected one of manual, depth_hold"),
        ("mode stabilized", "mode: found 'stabilized', expected one of .*stabilised"),
        ("follow inspection_bix", "did you mean 'inspection_box'"),
        ("follow /nowhere/way.toml", "there is no file /nowhere/way.toml"),
        ("follow fernandes", "fernandes.toml: model is 'fernandes'; only"),
    ],
)
def test_a_mistake_in_an_event_is_named_with_its_line(cell: str, says: str):
    with pytest.raises(ValueError, match=f"^line 3: .*({says})"):
        event(cell)


def test_a_mistake_inside_the_path_is_found_when_the_script_is_read(tmp_path: Path):
    way, script = tmp_path / "way.toml", tmp_path / "trip.csv"
    way.write_text(WAY + "cruise = 0\n")
    script.write_text(f"{HEAD}0,0,0,0,0,follow {way}\n")
    with pytest.raises(LindyError, match=r"trip\.csv: line 2: follow: .*way\.toml:2: cruise"):
        read_script(str(script))


def test_the_player_hands_them_over_once_in_the_order_of_the_rows():
    text = f"{HEAD}0,0,0,0,0\n1,0,0,0,0,goto depth=2\n2,0,0,0,0,light\n3,0,0,0,0,goto heading=0\n"
    player = Player("x", parse(text.encode(), course_named), Outbox())
    assert player.read(S, 0).presses == (GotoIntent(2.0),)
    assert player.read(3 * S, 0).presses == ("light", GotoIntent(heading=0.0))
    assert player.read(4 * S, 0).presses == ()


def test_the_inspection_needs_no_hand_on_the_sticks():
    rows = read_script("inspection").rows
    assert all(row.sticks.at_rest for row in rows)
    asked = [row.event for row in rows if isinstance(row.event, GotoIntent | FollowIntent)]
    assert [type(event) for event in asked] == [GotoIntent, FollowIntent, GotoIntent]
    assert isinstance(asked[0], GotoIntent)
    assert isinstance(asked[1], FollowIntent)
    assert asked[0].depth == asked[1].course.waypoints[0][2]  # nothing to do before it sets off
    assert rows[-1].sticks == CENTRED


def test_a_place_is_north_and_east_in_metres() -> None:
    assert event("goto north=12.5 east=-4") == PlaceIntent(12.5, -4.0)
    assert event("home") == "home"
    assert event("unwind") == "unwind"
