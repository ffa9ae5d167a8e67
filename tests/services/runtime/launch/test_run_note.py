"""The note of a running dive, where the disk takes it only for a while."""

import itertools
import os
import shutil
from pathlib import Path

import msgspec
import pytest

from services.runtime.config.running import RUNNING, Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.launch.local_stack import RETRY_NS, RunNote
from services.runtime.launch.process_plan import Dive, ProcessPlan
from tests.support.patience import until


def test_a_note_that_cannot_be_written_is_said_once_and_tried_again(tmp_path: Path) -> None:
    out, said, now = tmp_path / "dive", list[str](), itertools.count(0, RETRY_NS // 10)
    note = RunNote(ProcessPlan(Dive(Stack(out=str(out)), Registry.read()), tmp_path), said.append)
    until(lambda: note.update({"control": 7}, next(now)) or said)
    for _ in range(30):
        note.update({"control": 7}, next(now))
    out.mkdir()
    until(lambda: note.update({"control": 7}, next(now)) or (out / RUNNING).exists())

    def noted() -> dict[str, int]:
        return msgspec.json.decode((out / RUNNING).read_bytes(), type=Running).pids

    assert noted() == {"control": 7}
    until(lambda: note.update({"control": 8}, next(now)) or noted() == {"control": 8})
    note.update({"control": 8}, next(now))  # the write before is known to have ended well
    (out / "run.new").write_text("of somebody else")
    shutil.move(out, tmp_path / "away")  # a second time it is said again
    until(lambda: note.update({"control": next(now)}, next(now)) or len(said) == 2)
    shutil.move(tmp_path / "away", out)
    note.remove()
    assert [path.name for path in out.iterdir()] == ["run.new"]
    assert said == [f"cannot write {out / RUNNING}: no such file or directory"] * 2


def test_a_disk_that_has_become_read_only_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[str]()
    note = RunNote(
        ProcessPlan(Dive(Stack(out=str(tmp_path)), Registry.read()), tmp_path), said.append
    )
    note.update({"control": 7}, 0)
    until(lambda: (tmp_path / RUNNING).exists())

    def refuse(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    with monkeypatch.context() as patched:
        for change in ("open", "replace", "unlink"):
            patched.setattr(Path, change, refuse)
        until(lambda: note.update({"control": 8}, 1) or said)
        note.remove()
    assert said == [f"cannot write {tmp_path / RUNNING}: read-only file system"]


def test_a_disk_that_hangs_holds_nobody_up(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / ".run.json.new")  # whoever opens it waits for a reader
    note = RunNote(ProcessPlan(Dive(Stack(out=str(tmp_path)), Registry.read()), tmp_path), print)
    now = itertools.count(0, RETRY_NS)
    for pid in range(5):
        note.update({"control": pid}, next(now))  # returns
    assert not (tmp_path / RUNNING).exists()
    reader = os.open(tmp_path / ".run.json.new", os.O_RDONLY | os.O_NONBLOCK)
    until(lambda: note.update({"control": 5}, next(now)) or (tmp_path / RUNNING).exists())
    os.close(reader)
