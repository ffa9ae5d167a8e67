"""The log of a child, also on a disk that hangs or is full."""

import errno
import os
import stat
import sys
import threading
from pathlib import Path
from typing import Any, cast

import pytest

from services.runtime.launch.child import OsChild, Task
from tests.support.patience import until


def printed(path: Path, text: str) -> OsChild:
    """By a process that has ended."""
    code = f"import sys; sys.stdout.write({text!r})"
    child = OsChild(Task("toy", [sys.executable, "-S", "-c", code], path))
    until(lambda: child.ended() is not None)
    return child


def test_what_several_processes_print_is_appended_and_the_last_line_is_the_newest_ones(
    tmp_path: Path,
) -> None:
    path = tmp_path / "logs" / "toy.log"
    for text, last in (("first\nof one\n", "of one"), ("of another\n\n", "of another"), ("", "")):
        child = printed(path, text)
        until(lambda child=child, last=last: child.last_line() == last)
        assert child.unlogged == ""
    assert path.read_text() == "first\nof one\nof another\n\n"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_whoever_prints_goes_on_while_the_disk_hangs(tmp_path: Path) -> None:
    path = tmp_path / "toy.log"
    os.mkfifo(path)  # whoever opens it to write waits for a reader
    child = printed(path, "printed\n")
    assert child.last_line() == ""
    reader = os.open(path, os.O_RDONLY)
    until(lambda: child.last_line() == "printed")
    assert os.read(reader, 1000) == b"printed\n"
    os.close(reader)


def test_a_log_that_cannot_be_written_is_said_and_the_last_line_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    child = printed(tmp_path / "file" / "toy.log", "printed\n")
    until(lambda: child.last_line() == "printed")
    assert child.unlogged.startswith(f"cannot write {tmp_path}/file/toy.log: ")

    class NearlyFull:
        def write(self, data: bytes) -> int:
            if path.stat().st_size >= 4:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return path.write_bytes(data[:4])

        def close(self) -> None: ...

    path, opened = tmp_path / "toy.log", cast(Any, os.fdopen)

    def nearly_full(file: int, *how: Any) -> Any:
        if how[0] != "ab":
            return opened(file, *how)
        os.close(file)
        return NearlyFull()

    monkeypatch.setattr(os, "fdopen", nearly_full)
    child = printed(path, "whole line\n")
    until(lambda: child.last_line() == "whole line")
    assert path.read_bytes() == b"whol"
    assert child.unlogged == f"cannot write {path}: the disk is full"


def test_a_computer_without_room_for_a_thread_starts_a_child_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(OSError, match="no room for another thread"):
        printed(tmp_path / "toy.log", "")
