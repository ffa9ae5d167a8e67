"""A long recording read by two processes gives the report that one gives."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from messages import topics
from services.recorder.foxglove_schema import foxglove_schema
from services.recorder.io.mcap_file import McapFile
from tests.golden.dives import golden
from tools.recordings.recording import Recording, open_recording
from tools.report import Extras, encode, read_dive, report_on
from tools.report import second_reader as module
from tools.report.second_reader import SecondReader


@pytest.fixture
def readers(monkeypatch: pytest.MonkeyPatch) -> list[SecondReader]:
    """Every recording is a long one here. Those that were started are in the list."""
    found: list[SecondReader] = []

    def started(files: list[Path]) -> SecondReader:
        found.append(SecondReader(files))
        return found[-1]

    monkeypatch.setattr(module, "LONG", 0)
    monkeypatch.setattr(module.system, "cores", lambda: 2)
    monkeypatch.setattr(module, "SecondReader", started)
    return found


def report_of(recording: Recording) -> bytes:
    return encode(report_on(read_dive(recording), Extras()))


def alone(path: Path) -> bytes:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module.system, "cores", lambda: 1)
        return report_of(open_recording(path))


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["pioneer", "bluerov2_heavy"])
def test_two_processes_report_the_same(readers: list[SecondReader], vehicle: str) -> None:
    assert report_of(open_recording(golden(vehicle))) == alone(golden(vehicle))
    assert len(readers) == 1


@pytest.mark.slow
def test_what_cannot_be_read_is_counted_by_both(
    readers: list[SecondReader], tmp_path: Path
) -> None:
    path = tmp_path / "dive.mcap"
    file = McapFile(path)
    file.metadata("dive", {"vehicle": "pioneer", "link": "tether"})
    for topic in (topics.TRUTH, topics.PILOT_COMMAND):  # one of each process
        file.open_channel(topic.key, topic.message.__name__, foxglove_schema(topic.message))
    for key in (topics.TRUTH.key, topics.TRUTH.key, topics.PILOT_COMMAND.key):
        file.write(key, b"{}", 2, 2, 1)
    file.finish()
    recording = open_recording(path)
    assert report_of(recording) == alone(path)
    assert recording.unreadable == {topics.TRUTH.key: 2, topics.PILOT_COMMAND.key: 1}
    assert len(readers) == 1


@pytest.mark.slow
def test_where_the_second_process_is_killed_the_first_one_reads_all(
    readers: list[SecondReader],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    start: Callable[[list[Path]], Any] = module.SecondReader

    def killed(files: list[Path]) -> SecondReader:
        reader = start(files)
        pid = reader._process.pid  # pyright: ignore[reportPrivateUsage]
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        return reader

    monkeypatch.setattr(module, "SecondReader", killed)
    assert report_of(open_recording(golden("pioneer"))) == alone(golden("pioneer"))
    assert "ended early" in capsys.readouterr().err
    assert len(readers) == 1


def test_one_core_or_a_short_recording_needs_no_second_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(_: list[Path]) -> SecondReader:
        raise AssertionError("a second process")

    monkeypatch.setattr(module, "SecondReader", none)
    read_dive(open_recording(golden("pioneer")))
    monkeypatch.setattr(module, "LONG", 0)
    alone(golden("pioneer"))


@pytest.mark.parametrize("error", [OSError("no process"), RuntimeError("no thread")])
def test_without_room_for_a_process_one_reads_all(
    monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def no_room(_: list[Path]) -> SecondReader:
        raise error

    monkeypatch.setattr(module, "LONG", 0)
    monkeypatch.setattr(module.system, "cores", lambda: 2)
    monkeypatch.setattr(module, "SecondReader", no_room)
    assert report_of(open_recording(golden("pioneer"))) == alone(golden("pioneer"))
