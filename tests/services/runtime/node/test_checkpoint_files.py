"""Checkpoints on disk: whole, the newest, off the handlers' thread, and never somebody else's."""

import threading
from pathlib import Path

import msgspec
import pytest

from messages import events, topics
from messages.health import Health, LogLine
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node import checkpoint as checkpoints
from services.runtime.node.checkpoint import CheckpointFile, VolatileCheckpoint, write_safely
from services.runtime.node.node import FORGETS, Node
from tests.support.patience import PATIENCE_S

S = 1_000_000_000  # [ns]


class Note(msgspec.Struct):
    depth: float


class SlowDisk:
    """Takes what is written only when the test lets it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun, self.may_go_on = threading.Semaphore(0), threading.Semaphore(0)
        self.written: list[bytes] = []
        monkeypatch.setattr(checkpoints, "write_safely", self._write)

    def _write(self, path: Path, data: bytes) -> None:
        self.begun.release()
        assert self.may_go_on.acquire(timeout=PATIENCE_S)
        self.written.append(data)
        write_safely(path, data)


def test_a_checkpoint_is_there_for_the_next_run(tmp_path: Path):
    path = tmp_path / "worker.json"
    before = CheckpointFile(path)
    assert before.restore_checkpoint() is None
    for depth in range(20):
        before.save_checkpoint(f"{depth}".encode())
    before.close()
    after = CheckpointFile(path)
    assert after.restore_checkpoint() == b"19"
    after.close()
    assert [file.name for file in tmp_path.iterdir()] == ["worker.json"]


def test_while_the_disk_is_busy_nobody_waits_and_only_the_newest_is_written_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    disk, checkpoint = SlowDisk(monkeypatch), CheckpointFile(tmp_path / "worker.json")
    checkpoint.save_checkpoint(b"first")
    assert disk.begun.acquire(timeout=PATIENCE_S)
    for number in range(100):  # would never come to an end if any of them waited
        checkpoint.save_checkpoint(f"{number}".encode())
    disk.may_go_on.release(2)
    checkpoint.close()
    assert disk.written == [b"first", b"99"]


def test_a_write_that_is_cut_short_leaves_the_checkpoint_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = tmp_path / "worker.json"
    write_safely(path, b"whole")

    def power_cut(_: int) -> None:
        raise OSError("no power")

    monkeypatch.setattr(checkpoints.os, "fsync", power_cut)
    with pytest.raises(OSError, match="no power"):
        write_safely(path, b"half of it")
    assert path.read_bytes() == b"whole"
    assert list(tmp_path.iterdir()) == [path]


def test_a_disk_that_takes_nothing_costs_the_checkpoints_and_is_counted_in_the_health(
    tmp_path: Path,
):
    host, now = VirtualHost(), [0]
    checkpoint = CheckpointFile(tmp_path / "missing" / "worker.json")
    port = host.side("drone")
    told: list[Health] = []
    port.hear(
        topics.HEALTH.of("worker").key,
        lambda e: told.append(msgspec.msgpack.decode(e.payload, type=Health)),
    )
    node = Node("worker", {"drone": host.side("drone")}, lambda: now[0], checkpoint)
    node.save_checkpoint(Note(1.0))
    checkpoint.close()
    now[0] = 2 * S
    node.step()
    assert told[-1].counts == {"not_remembered:disk": 1}
    assert node.restore_checkpoint(Note) is None


@pytest.mark.parametrize("failure", [OSError(30, "Read-only file system"), MemoryError()])
def test_after_a_checkpoint_that_failed_the_next_one_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: Exception
) -> None:
    checkpoint, tried = CheckpointFile(tmp_path / "worker.json"), threading.Semaphore(0)

    def refuse(_: Path, __: bytes) -> None:
        tried.release()
        raise failure

    with monkeypatch.context() as full:
        full.setattr(checkpoints, "write_safely", refuse)
        checkpoint.save_checkpoint(b"first")
        assert tried.acquire(timeout=PATIENCE_S)
    checkpoint.save_checkpoint(b"second")
    checkpoint.close()
    assert checkpoint.failures() == 1
    assert (tmp_path / "worker.json").read_bytes() == b"second"


def test_checkpoints_that_fail_are_said_once_for_as_long_as_that_lasts() -> None:
    """Seconds 1 to 20, and once more long after."""
    now, lines = [0], list[LogLine]()

    class Failing(VolatileCheckpoint):
        def failures(self) -> int:
            return 2 if now[0] <= 20 * S or now[0] == 40 * S else 0

    node = Node("worker", {"drone": VirtualHost().side("drone")}, lambda: now[0], Failing())
    node.show = lines.append
    for second in range(1, 51):
        now[0] = second * S
        node.step()
    said = [(line.level, line.text, line.stamp_ns // S) for line in lines]
    assert said == [("warning", FORGETS, 1), ("warning", FORGETS, 40)]
    assert node.counts[events.NOT_REMEMBERED.name] == 2 * 21
