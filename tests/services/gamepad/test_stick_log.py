"""Reading a stick log, and what it says at any time."""

from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from services.gamepad.io.path_file import course_named
from services.gamepad.io.sources import read_script
from services.gamepad.stick_log import QUIET_NS, Player, StickLog, StickLogRow, parse
from services.piloting.pilot_intents import OutputIntent
from services.piloting.sticks import CENTRED, Sticks
from services.runtime.config.errors import LindyError

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


@settings(max_examples=100, deadline=None)
@given(logs(), st.integers(0, 90_000))
def test_each_row_holds_until_the_next_and_the_last_one_ends_it(
    rows: list[tuple[int, Sticks, str]], ms: int
):
    script = parse(csv(rows), course_named)
    begun = [row for row in rows if row[0] <= ms]
    silent = not begun or ms >= rows[-1][0] or begun[-1][2] == "lost"
    expected = CENTRED if silent else begun[-1][1]
    assert script.at(ms * 1_000_000).sticks == expected
    assert script.duration == rows[-1][0] / 1000


@settings(max_examples=50, deadline=None)
@given(logs(), st.lists(st.integers(0, 90_000), max_size=20).map(sorted))
def test_every_event_happens_once_whenever_the_player_is_asked(
    rows: list[tuple[int, Sticks, str]], moments: list[int]
):
    player = Player("x", parse(csv(rows), course_named), Outbox())
    heard = Counter[object]()
    for ms in [*moments, 90_000]:
        heard.update(player.read(ms * 1_000_000, 0).presses)
    written = Counter[object](event for _, _, event in rows if event not in ("", "lost"))
    assert heard == written + Counter({"disarm": 1})


@settings(max_examples=50, deadline=None)
@given(logs())
def test_the_player_names_every_instant_at_which_it_changes(rows: list[tuple[int, Sticks, str]]):
    player, began = Player("x", parse(csv(rows), course_named), Outbox()), 5 * S
    named, now = list[int](), began - 1
    while (following := player.next_ns(now, began)) is not None:
        assert following > now
        named.append(following - began)
        now = following
    assert named == [ms * 1_000_000 for ms, _, _ in rows] + [rows[-1][0] * 1_000_000 + QUIET_NS]


@settings(max_examples=50, deadline=None)
@given(logs(), st.integers(0, 90_000))
def test_the_hands_are_at_rest_while_the_script_moves_nothing_but_the_camera(
    rows: list[tuple[int, Sticks, str]], ms: int
):
    reading = Player("x", parse(csv(rows), course_named), Outbox()).read(ms * 1_000_000, 0)
    assert reading.at_rest == (reading.sticks._replace(tilt=0.0, gripper=0.0) == CENTRED)


def parsed_or_error(data: bytes) -> StickLog | ValueError:
    try:
        return parse(data, course_named)
    except ValueError as error:
        return error


@settings(max_examples=100, deadline=None)
@given(st.binary(max_size=200) | st.binary(max_size=60).map(lambda tail: HEAD + tail))
def test_whatever_bytes_a_file_holds_the_error_names_a_line(data: bytes):
    parsed = parsed_or_error(data)
    if isinstance(parsed, StickLog):
        assert all(abs(x) <= 1.0 for row in parsed.rows for x in row.sticks)
    else:
        assert type(parsed) is ValueError
        assert str(parsed).startswith("line ")


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
        (TILT_HEAD + b"1,0,0,0,0,,stop\n", StickLogRow(S, CENTRED, "stop")),
        (b"t,surge,sway,heave,yaw,gripper\n1,0,0,0,0,-1\n", StickLogRow(S, Sticks(gripper=-1.0))),
        (
            b"t,surge,sway,heave,yaw,event\n1,0,0,0,0,output lasers 1\n",
            StickLogRow(S, CENTRED, OutputIntent("lasers", 1.0)),
        ),
        (TILT_HEAD + b"1,0,0,0,1\n", StickLogRow(S, Sticks(yaw=1.0))),
        (b"t,surge,sway,heave,yaw\n2,0,0,0,1\n", StickLogRow(2 * S, Sticks(yaw=1.0))),
    ],
)
def test_tilt_and_event_come_in_any_order_and_may_be_left_empty(text: bytes, row: StickLogRow):
    assert parse(text, course_named).rows == (row,)


@pytest.mark.parametrize(
    ("text", "line", "found", "allowed"),
    [
        (b"", 1, "empty", "heading"),
        (HEAD, 1, "no row", "at least one"),
        (b"0,0,0,0,0\n", 1, "0,0,0,0,0", "heading"),
        (b"\x89PNG\r\n\x1a\n", 1, "0x89", "text"),
        (HEAD + b"0,0,0,0,0\n1,\xff,0,0,0\n", 3, "0xff", "text"),
        (HEAD + b"0,0,0,0\n", 2, "4 columns", "5 or 6"),
        (HEAD + b"# c\n\n0,0,0,fast,0\n", 4, "heave is 'fast'", "-1 to 1"),
        (HEAD + b"-1,0,0,0,0\n", 2, "t is '-1'", "0 to 86400"),
        (HEAD + b"1,0,0,0,0\n1,0,0,0,0\n", 3, "t is 1", "more than the 1 before"),
        (b"t,surge,sway,heave,yaw,event,tilt,event\n", 1, "event,tilt,event", "heading"),
        (b"t,surge,tilt,sway,heave,yaw\n", 1, "surge,tilt", "tilt and gripper and event"),
        (HEAD + b"0,0,0,0,0,output lasers 2\n", 2, "'lasers 2'", "a number from 0 to 1"),
        (HEAD + b"0,0,0,0,0,output\n", 2, "''", "a name of the vehicle file"),
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
