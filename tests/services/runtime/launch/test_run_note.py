"""The note of a running dive, where the disk takes it only for a while."""

from pathlib import Path

import msgspec
import pytest

from services.runtime.config.running import RUNNING, Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.launch.process_plan import ProcessPlan
from services.runtime.launch.run_note import RETRY_NS, RunNote


def test_a_note_that_cannot_be_written_is_said_once_and_tried_again(tmp_path: Path) -> None:
    out, said = tmp_path / "dive", list[str]()
    note = RunNote(ProcessPlan(Stack(out=str(out)), Registry.read(), tmp_path), said.append)
    for now in range(0, 3 * RETRY_NS, RETRY_NS // 10):
        note.update({"control": 7}, now)
    assert said == [f"cannot write {out / RUNNING}: no such file or directory"]
    out.mkdir()
    note.update({"control": 7}, 3 * RETRY_NS)
    found = msgspec.json.decode((out / RUNNING).read_bytes(), type=Running)
    assert found.pids == {"control": 7}
    note.remove()
    assert list(out.iterdir()) == []
    assert len(said) == 1


def test_a_disk_that_has_become_read_only_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[str]()
    note = RunNote(ProcessPlan(Stack(out=str(tmp_path)), Registry.read(), tmp_path), said.append)
    note.update({"control": 7}, 0)

    def refuse(*_: object, **__: object) -> None:
        raise OSError(30, "Read-only file system")

    for change in ("write_bytes", "replace", "unlink"):
        monkeypatch.setattr(Path, change, refuse)
    note.update({"control": 8}, 1)
    note.remove()
    assert said == [f"cannot write {tmp_path / RUNNING}: read-only file system"]
