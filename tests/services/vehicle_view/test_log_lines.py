"""What a pilot reads of the log: plain words, a time, and no flood."""

import math
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.health import LogLine
from services.vehicle_view.log_lines import KEPT, MOST, LogLines, brief, full
from tools.live.screen import LineDisplay


def said(text: str, service: str = "reference") -> LogLine:
    return LogLine(stamp_ns=0, service=service, level="warning", text=text)


@given(st.lists(st.sampled_from("abc"), max_size=60))
def test_no_line_is_ever_left_out(texts: list[str]):
    lines = LogLines()
    said_last: dict[str, int] = {}
    for text in texts:
        if (told := lines.add(said(text), 1.0)) is not None:
            said_last[text] = told.times
    said_last |= {told.line.text: told.times for told in lines.unprinted()}
    assert said_last == {text: texts.count(text) for text in texts}


def test_lines_that_differ_in_numbers_alone_are_one_and_the_newest_numbers_are_shown():
    lines = LogLines()
    lines.add(said("round trip has risen from 381 to 2190.5 ms"), 2.0)
    lines.add(said("round trip has risen from 40 to 99 ms"), 41.34)
    (told,) = lines.newest(6)
    assert full(told) == (
        "warning    2.0 s  reference: round trip has risen from 40 to 99 ms"
        " (2 times, last at 41.3 s)"
    )
    assert brief(told) == "  41.3 s  2 × reference: round trip has risen from 40 to 99 ms"


@pytest.mark.parametrize("at", [None, -0.5])
def test_before_arming_there_is_no_time(at: float | None):
    told = LogLines().add(said("x"), at)
    assert told is not None
    assert full(told) == "warning    start  reference: x"


def test_the_line_that_came_last_is_the_newest_and_a_flood_of_different_ones_is_bounded():
    lines = LogLines()
    lines.add(said("old"), 0.0)
    for n in range(2 * MOST):
        lines.add(said("x" * (n + 1)), 1.0)
        lines.add(said("old"), 2.0)
    assert lines.newest(1)[0].line.text == "old"
    assert lines.newest(1)[0].times == 2 * MOST + 1
    assert len(lines.newest(10 * MOST)) == MOST


def test_a_pipe_gets_the_first_line_at_once_and_the_count_at_the_end(
    capsys: pytest.CaptureFixture[str],
):
    shown = LineDisplay()
    for second in range(12):
        shown.line(said("failsafe:pilot_lost"), float(second))
    shown.finish()
    printed = capsys.readouterr().out.splitlines()
    assert [line.partition("(")[2] for line in printed] == [
        "", "10 times, last at 9.0 s)", "12 times, last at 11.0 s)",
    ]  # fmt: skip


@given(st.text(max_size=40))
def test_nothing_that_a_terminal_would_obey_is_printed(text: str):
    """Anybody on the bus can send a line."""
    lines = LogLines()
    entry = lines.add(said(f"\x1b[2J{text}\n", service=f"a\x07{text}"), 1.0)
    assert entry is not None
    assert full(entry).isprintable()
    assert brief(entry).isprintable()


def said_at(seconds: float, level: Literal["info", "warning", "error"] = "error") -> LogLine:
    text = "no heartbeat of ArduSub arrives"
    return LogLine(stamp_ns=round(seconds * 1e9), service="ardusub", level=level, text=text)


@pytest.mark.parametrize("level", ["warning", "error"])
def test_a_warning_that_comes_back_is_printed_with_its_own_time(
    level: Literal["warning", "error"],
):
    lines = LogLines()
    lines.add(said_at(1.0, level), None)
    assert lines.add(said_at(2.0, level), None) is None
    back = lines.add(said_at(50.0, level), 43.7)
    assert back is not None
    assert full(back) == (
        f"{level:<7}   43.7 s  ardusub: no heartbeat of ArduSub arrives (again, 3 times in all)"
    )
    assert lines.unprinted() == []


@given(st.lists(st.floats(0.0, 60.0), max_size=400))
def test_what_comes_back_again_and_again_is_printed_a_few_times_in_a_dive(pauses: list[float]):
    lines, now, told = LogLines(), 0.0, 0
    for pause in pauses:
        now += pause
        told += lines.add(said_at(now), now) is not None
    assert told <= 4 + math.log2(1.0 + now / 10.0)


@given(st.lists(st.sampled_from(["info", "warning", "error"]), max_size=30), st.integers(0, 8))
def test_information_never_pushes_the_last_warnings_out(
    levels: list[Literal["info", "warning", "error"]], most: int
):
    lines = LogLines()
    for n, level in enumerate(levels):
        lines.add(LogLine(stamp_ns=n, service=f"toy{n}", level=level, text="x"), float(n))
    shown = [entry.line.stamp_ns for entry in lines.newest(most)]
    warnings = [n for n, level in enumerate(levels) if level != "info"]
    assert shown == sorted(shown)
    assert len(shown) == min(most, len(levels))
    assert set(warnings[-KEPT:] if most >= KEPT else []) <= set(shown)
    assert most == 0 or not levels or len(levels) - 1 in shown or most <= KEPT
