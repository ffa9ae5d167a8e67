"""With and without POSIX the seam to the operating system does the same, as far as it can."""

import os
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from services.runtime.os import system as posix
from tests.support.no_posix import portable
from tests.support.patience import PATIENCE_S, until

Started = subprocess.Popen[bytes]
LONG = "import time; time.sleep(1000)"


@pytest.fixture(params=["posix", "portable"])
def system(request: pytest.FixtureRequest) -> ModuleType:
    return posix if request.param == "posix" else portable()


def head(system: ModuleType) -> str:
    """`system` is known in the code of a child."""
    without = "del os.fork\n" if system.WINDOWS else ""
    return f"import os, sys\n{without}from services.runtime.os import system\n"


@contextmanager
def started(system: ModuleType, code: str) -> Generator[Started]:
    """A child as the runtime starts it."""
    apart: dict[str, Any] = system.APART
    command = [sys.executable, "-c", f"{head(system)}{code}"]
    opened: Any = subprocess.Popen(command, stdin=system.STDIN, stdout=subprocess.PIPE, **apart)
    child: Started = opened
    with child:
        try:
            yield child
        finally:
            child.kill()


def first_line(child: Started) -> str:
    assert child.stdout is not None
    return child.stdout.readline().decode().strip()


# Processes.


def test_a_process_exists_until_it_has_ended(system: ModuleType) -> None:
    with started(system, LONG) as child:
        assert system.exists(child.pid)
        assert system.exists(os.getpid())
        if sys.platform != "darwin":
            own, other = system.began(os.getpid()), system.began(child.pid)
            assert own is not None
            assert other is not None
            assert own <= other
    assert system.began(child.pid) is None
    assert not system.exists(child.pid)


def test_a_child_ends_when_it_is_asked_to(system: ModuleType) -> None:
    asked = "print('here', flush=True); sys.exit(7 if system.wait_until_unwanted() else 8)"
    with started(system, asked) as child:
        assert first_line(child) == "here"
        assert child.poll() is None
        system.ask_to_end(child)
        assert child.wait(PATIENCE_S) == (7 if system.WINDOWS else -signal.SIGTERM)
        system.ask_to_end(child)  # nobody is left to be asked


def test_a_child_notices_that_its_parent_was_killed(system: ModuleType, tmp_path: Path) -> None:
    said = tmp_path / "said"
    inner = (
        f"{head(system)}print(os.getpid(), flush=True)\nasked = system.wait_until_unwanted()\n"
        f"open({str(said)!r}, 'w').write(str(asked))"
    )
    outer = (
        f"import subprocess\nsubprocess.Popen([sys.executable, '-c', {inner!r}], "
        "stdin=system.STDIN, **system.APART).wait()"
    )
    with started(system, outer) as parent:
        assert system.exists(int(first_line(parent)))
        parent.kill()
    assert until(lambda: said.exists() and said.read_text(encoding="utf-8")) == "False"


def test_what_a_child_has_started_is_ended_with_it(system: ModuleType) -> None:
    code = f"import subprocess\np = subprocess.Popen([sys.executable, '-c', {LONG!r}])\n"
    with started(system, f"{code}print(p.pid, flush=True)\np.wait()") as child:
        below = int(first_line(child))
        system.kill_all(child)
        assert child.wait(PATIENCE_S) != 0
        until(lambda: not posix.exists(below) or "Z" in state(below))
        system.kill_all(child)  # nobody is left


def state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0]


def test_a_process_that_hangs_is_ended(system: ModuleType) -> None:
    with started(system, f"system.end_within(0.05)\n{LONG}") as child:
        assert child.wait(PATIENCE_S) != 0
    with started(system, "import time\nsystem.end_within(30)\nsystem.end_within(0)") as child:
        assert child.wait(PATIENCE_S) == 0


def test_memory_is_counted(system: ModuleType) -> None:
    before = system.memory_mb()
    held = bytearray(os.urandom(1)) * 50_000_000
    assert 40 < system.memory_mb() - before < 400
    assert len(held) == 50_000_000
    assert 1 <= system.cores() <= 4096


# Whoever started the tests may have it ignored.
HEARS_CTRL_C = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_DFL)\n"


def test_signals_wait_where_they_can(system: ModuleType) -> None:
    code = (
        f"{HEARS_CTRL_C}system.exact_timers()\nlet_go = system.hold_back([signal.SIGINT])\n"
        "if system.WINDOWS: let_go()\n"
        "else: signal.raise_signal(signal.SIGINT)\n"
        "print('waits', flush=True)\nlet_go()\nsignal.raise_signal(signal.SIGINT)"
    )
    with started(system, code) as child:
        assert first_line(child) == "waits"
        assert child.wait(PATIENCE_S) == -signal.SIGINT


# Terminals and cables.


def test_an_output_that_nobody_reads_is_known(system: ModuleType) -> None:
    read, written = os.pipe()
    here, there = os.openpty()
    assert not system.is_unread(there)
    os.close(read)
    assert system.is_unread(written)
    for each in (written, here, there):
        os.close(each)


# Files and folders.


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_one_program_has_a_lock(system: ModuleType, tmp_path: Path, kind: str) -> None:
    path = tmp_path / kind
    path.mkdir() if kind == "folder" else path.touch()
    held = system.lock(path)
    assert held is not None
    assert system.lock(path) is None
    other = f"sys.exit(3 if system.lock(__import__('pathlib').Path({str(path)!r})) is None else 4)"
    with started(system, other) as child:
        assert child.wait(PATIENCE_S) == 3
    held.release()
    again = system.lock(path)
    assert again is not None
    again.release()
    assert [*tmp_path.iterdir()] == [path]
    with pytest.raises(FileNotFoundError):
        system.lock(tmp_path / "none")


def test_the_names_in_a_folder_are_on_the_disk(system: ModuleType, tmp_path: Path) -> None:
    system.sync_folder(tmp_path)
