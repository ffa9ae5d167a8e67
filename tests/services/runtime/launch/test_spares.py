"""Spare processes: what they are told is what they run, and one that is of no use costs nothing."""

import os
import time
from collections.abc import Callable, Generator
from pathlib import Path

import msgspec
import pytest

from services.runtime.hosts.process_host import HubLaunch
from services.runtime.hosts.spare import Spare
from services.runtime.launch.child import Child, Task
from services.runtime.launch.spares import LONGEST, PYTHON, Spares

PATIENCE_S = 60.0  # never reached unless something is broken
SENTENCE = "lindy hub: endpoint tcp/nowhere:x cannot be listened on"


def until(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.02)  # another process does it, and nothing announces it


@pytest.fixture
def spares() -> Generator[Spares]:
    kept = Spares()
    yield kept
    kept.end()


def ready(spares: Spares) -> int:
    """Pid of a spare hub that has imported everything."""
    until(lambda: spares.keep({"hub": Spare()}) or spares.ready == {"hub"})
    return spares.pids["hub"]


def mistaken(folder: Path, padding: str = "") -> Task:
    """A hub that says in one sentence why it cannot start."""
    launch = HubLaunch(listen=["tcp/nowhere:x"], parent=os.getpid(), here=padding)
    command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
    return Task("hub", command, folder / "logs" / "hub.log")


def status(child: Child) -> int | None:
    until(lambda: child.ended() is not None)
    return child.ended()


def test_a_spare_does_what_it_is_told_and_writes_to_that_log(spares: Spares, tmp_path: Path):
    pid = ready(spares)
    child = spares.child(mistaken(tmp_path))
    assert child.pid == pid
    assert status(child) == 1
    assert child.last_words().startswith(SENTENCE)
    assert spares.pids == {}


def test_where_a_spare_is_of_no_use_a_new_process_is_started(spares: Spares, tmp_path: Path):
    """… because there is none, it has ended, or it cannot be told so much."""
    without = spares.child(mistaken(tmp_path))
    os.kill(gone := ready(spares), 9)
    until(lambda: not Path(f"/proc/{gone}/cmdline").read_bytes())
    after = spares.child(mistaken(tmp_path))
    unused = ready(spares)
    long = spares.child(mistaken(tmp_path, "x" * LONGEST))
    assert {gone, unused}.isdisjoint({without.pid, after.pid, long.pid})
    for child in (without, after, long):
        assert status(child) == 1
        assert child.last_words().startswith(SENTENCE)
    assert not Path(f"/proc/{unused}").exists()


def test_one_imports_after_the_other_and_all_end(spares: Spares):
    wanted = {"hub_topside": Spare(), "hub_drone": Spare()}
    spares.keep(wanted)
    spares.keep(wanted)
    assert len(spares.pids) == 1
    until(lambda: spares.keep(wanted) or len(spares.ready) == 2)
    pids = [*spares.pids.values()]
    spares.end()
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)
