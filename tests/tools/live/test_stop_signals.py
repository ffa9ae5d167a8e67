"""Ctrl-C, SIGTERM, a closed terminal: the first ends the dive; no report is lost by accident."""

import io
import os
import signal
import subprocess
import sys
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import msgspec
import pytest

from messages import topics
from messages.link import LinkRequest
from services.recorder.foxglove.channel import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from services.runtime.config.stack import Stack
from tests.support.patience import PATIENCE_S
from tools.exit_status import INTERRUPTED
from tools.live.outcome import Outcome
from tools.live.stop_signals import SIGNALS, WRITING, StopSignals

HERE = Path(__file__).parents[3]
BOTH = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])


def record(path: Path) -> None:
    """A small recording."""
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer", "link": "tether"})
    file.metadata("hash", {"sha256": "0"})
    file.open_channel(topics.LINK_REQUEST.key, "LinkRequest", foxglove_schema(LinkRequest))
    for stamp in range(1, 40):
        message = LinkRequest(stamp_ns=stamp, id="x", kind="up")
        file.write(topics.LINK_REQUEST.key, msgspec.json.encode(message), stamp, stamp, stamp)
    file.finish()


def press(number: int) -> None:
    os.kill(os.getpid(), number)


def at_terminal(monkeypatch: pytest.MonkeyPatch, there: bool) -> None:
    def isatty(_: int) -> bool:
        return there

    monkeypatch.setattr(os, "isatty", isatty)


def test_ctrl_c_at_a_terminal_asks_once_whether_an_armed_drone_is_to_be_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    at_terminal(monkeypatch, True)
    now = 100.0
    with StopSignals(lambda: now) as stop:
        stop.armed = lambda: "armed at 2.0 m"
        for later_s, question in ((0.0, True), (0.1, False), (11.0, True)):
            stop.question, now = "", now + later_s
            press(signal.SIGINT)
            assert not stop.asked
            assert stop.question == ("armed at 2.0 m: Ctrl-C again to disarm and end" * question)
        now += 1.0
        press(signal.SIGINT)
        assert stop.asked


@pytest.mark.parametrize(
    ("number", "terminal", "armed"),
    [(signal.SIGTERM, True, True), (signal.SIGINT, False, True), (signal.SIGINT, True, False)],
)
def test_who_is_nobody_at_a_terminal_or_has_nothing_armed_is_not_asked(
    monkeypatch: pytest.MonkeyPatch, number: int, terminal: bool, armed: bool
) -> None:
    at_terminal(monkeypatch, terminal)
    with StopSignals() as stop:
        stop.armed = lambda: "armed" * armed
        press(number)
        assert stop.asked


@BOTH
@pytest.mark.parametrize("before", [0, 1], ids=["the script is over", "it was stopped"])
def test_a_signal_during_the_report_is_answered_and_costs_nothing(
    number: int, before: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    record(tmp_path / "dive.mcap")
    outcome = Outcome(Stack(out=str(tmp_path)))

    def sum_up() -> int:
        press(number)
        return outcome.sum_up()

    with StopSignals() as stop:
        for _ in range(before):
            press(number)
        assert stop.asked == bool(before)
        assert stop.report(sum_up) == 0
        press(number)  # everything is written
    out, err = capfd.readouterr()
    assert err.count(WRITING) == 1
    assert "written" in out
    assert (tmp_path / "report.json").stat().st_size > 0


@BOTH
def test_a_signal_that_arrives_twice_at_once_breaks_nothing_off(
    number: int, capfd: pytest.CaptureFixture[str]
):
    def write() -> int:
        press(number)
        press(number)
        return 0

    with StopSignals(lambda: 7.0) as stop:
        assert stop.report(write) == 0
    assert capfd.readouterr().err == f"lindy: {WRITING}\n"


@BOTH
def test_one_more_breaks_the_report_off_and_leaves_no_half_of_it(
    number: int,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
):
    record(tmp_path / "dive.mcap")
    outcome = Outcome(Stack(out=str(tmp_path)))

    class Pressing(io.FileIO):
        """A file during whose writing the signal arrives."""

        def write(self, b: Any, /) -> int:
            super().write(bytes(b)[:10])
            press(number)
            press(number)
            return len(bytes(b))

    as_ever = Path.open

    def opened(path: Path, mode: str) -> object:
        return Pressing(path, mode) if mode == "xb" else as_ever(path, mode)

    monkeypatch.setattr(Path, "open", opened)
    with StopSignals(partial(next, count())) as stop:  # a second passes at every look
        for _ in range(5):  # while the dive is being ended
            press(number)
        assert stop.report(outcome.sum_up) == INTERRUPTED
    sentence = "lindy: the report was broken off; the recording is whole"
    assert capfd.readouterr().err.splitlines() == [f"lindy: {WRITING}", sentence]
    assert [path.name for path in tmp_path.iterdir()] == ["dive.mcap"]


@BOTH
def test_the_end_of_the_program_keeps_the_status_of_the_dive(number: int):
    program = f"""
import atexit, os
from tools.exit_status import INTERRUPTED
from tools.live.stop_signals import StopSignals
atexit.register(lambda: os.kill(os.getpid(), {int(number)}))
with StopSignals() as stop:
    status = stop.report(lambda: 3)
raise SystemExit(status)
"""
    ran = subprocess.run([sys.executable, "-c", program], cwd=HERE, check=False)
    assert ran.returncode == 3


def test_afterwards_the_signals_have_their_former_effect():
    before = [signal.getsignal(number) for number in SIGNALS]
    with StopSignals() as stop:
        stop.report(lambda: 0)
    assert [signal.getsignal(number) for number in SIGNALS] == before


def test_a_closed_terminal_ends_the_dive_and_its_report_is_written(tmp_path: Path):
    """On a terminal of its own, which is closed in the middle of the dive and again while the
    report is being written: prints go nowhere, and none of them fails."""
    record(tmp_path / "dive.mcap")
    program = f"""
import os, signal, time
from services.runtime.config.stack import Stack
from tools.live.outcome import Outcome
from tools.exit_status import INTERRUPTED
from tools.live.stop_signals import StopSignals
outcome = Outcome(Stack(out={str(tmp_path)!r}))
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whatever these tests were started by
def write():
    os.kill(os.getpid(), signal.SIGHUP)
    return outcome.sum_up()
with StopSignals() as stop:
    print("diving", flush=True)
    while not stop.asked:
        time.sleep(0.01)  # pause() would wait for ever for a signal that came just before it
    status = stop.report(write)
print("never read", flush=True)
raise SystemExit(status)
"""
    ours, theirs = os.openpty()
    words = [sys.executable, "-c", program]
    ran = subprocess.Popen(
        words, cwd=HERE, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True
    )
    os.close(theirs)
    assert os.read(ours, 6) == b"diving"
    ran.send_signal(signal.SIGHUP)  # as the terminal's end does to the group in its foreground
    os.close(ours)
    assert ran.wait(PATIENCE_S) == 0
    assert (tmp_path / "report.json").exists()


def test_what_nohup_started_goes_on_without_its_terminal():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSignals() as stop:
            press(signal.SIGHUP)
            assert not stop.asked
    finally:
        signal.signal(signal.SIGHUP, before)


@BOTH
def test_a_dive_in_this_process_that_hangs_ends_by_a_second_one(number: int):
    at = iter((0.0, 0.1, 5.0))  # [s] by the clock: the first, one close behind it, one later
    with StopSignals(lambda: next(at), in_process=True) as stop:
        press(number)
        press(number)
        assert stop.asked
        with pytest.raises(KeyboardInterrupt):
            press(number)
