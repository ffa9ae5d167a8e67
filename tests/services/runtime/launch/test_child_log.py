"""The log of a child, also on a disk that hangs."""

import errno
import os
import stat
import threading
from pathlib import Path
from typing import IO

import pytest

from services.runtime.launch.child import ChildLog
from tests.support.patience import until


def pipe() -> tuple[int, IO[bytes]]:
    reads, writes = os.pipe()
    return writes, os.fdopen(reads, "rb")


def printed(log: ChildLog, *texts: bytes) -> None:
    """By one process that then ends."""
    writes, reads = pipe()
    log.follow(reads)
    for text in texts:
        os.write(writes, text)
    os.close(writes)


def test_what_several_processes_print_is_appended_and_the_last_line_is_the_newest_ones(
    tmp_path: Path,
) -> None:
    path = tmp_path / "logs" / "toy.log"
    log = ChildLog(path)
    assert log.last_line() == ""
    printed(log, b"first\n", b"of one\n")
    until(lambda: log.last_line() == "of one")
    printed(log, b"of another\n\n")
    until(lambda: log.last_line() == "of another")
    printed(log)
    until(lambda: log.last_line() == "")
    assert path.read_text() == "first\nof one\nof another\n\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert log.unlogged == ""
    log.close()


def test_whoever_prints_goes_on_while_the_disk_hangs(tmp_path: Path) -> None:
    path = tmp_path / "toy.log"
    os.mkfifo(path)  # whoever opens it to write waits for a reader
    log = ChildLog(path)
    printed(log, b"printed\n")  # returns
    printed(log, b"by another one\n")
    assert log.last_line() == ""
    reader = os.open(path, os.O_RDONLY)
    until(lambda: log.last_line() == "by another one")
    assert os.read(reader, 1000) == b"printed\nby another one\n"
    os.close(reader)
    log.close()


def test_a_log_that_cannot_be_written_is_said_and_the_last_line_is_known(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    log = ChildLog(tmp_path / "file" / "toy.log")
    printed(log, b"printed\n")
    until(lambda: log.last_line() == "printed")
    assert log.unlogged.startswith(f"cannot write {tmp_path}/file/toy.log: ")
    log.close()


def test_a_disk_that_takes_a_part_and_then_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, write = tmp_path / "toy.log", os.write

    def nearly_full(file: int, data: bytes) -> int:
        if path.stat().st_size >= 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(file, data[:4])

    writes, reads = pipe()
    write(writes, b"whole line\n")
    os.close(writes)
    monkeypatch.setattr(os, "write", nearly_full)
    log = ChildLog(path)
    log.follow(reads)
    until(lambda: log.last_line() == "whole line")
    assert path.read_bytes() == b"whol"
    assert log.unlogged == f"cannot write {path}: the disk is full"
    log.close()


def test_a_computer_without_room_for_a_thread_starts_a_child_without_a_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    log, (writes, reads) = ChildLog(tmp_path / "toy.log"), pipe()
    with monkeypatch.context() as patched:
        patched.setattr(threading.Thread, "start", refuse)
        log.follow(reads)
    assert log.unlogged == "this computer has no room for another thread"
    os.close(writes)
    printed(log, b"later\n")
    until(lambda: log.last_line() == "later")
    assert log.unlogged == ""
    log.close()
