"""Prewarmed processes: what they are told is what they run, and one of no use costs nothing."""

import os
from collections.abc import Generator
from pathlib import Path

import msgspec
import pytest

from services.runtime.hosts.prewarmed_process import Prewarming
from services.runtime.hosts.process_host import HubLaunch
from services.runtime.launch.child import Child, Task
from services.runtime.launch.process_pool import LONGEST, PYTHON, ProcessPool
from tests.support.patience import until

SENTENCE = "lindy hub: endpoint tcp/nowhere:x cannot be listened on"


@pytest.fixture
def pool() -> Generator[ProcessPool]:
    kept = ProcessPool()
    yield kept
    kept.end()


def ready(pool: ProcessPool) -> int:
    """Pid of a prewarmed hub that has imported everything."""
    until(lambda: pool.keep({"hub": Prewarming()}) or pool.has("hub"))
    return pool.pids["hub"]


def mistaken(folder: Path, padding: str = "") -> Task:
    """A hub that says in one sentence why it cannot start."""
    launch = HubLaunch(listen=["tcp/nowhere:x"], parent=os.getpid(), here=padding)
    command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
    return Task("hub", command, folder / "logs" / "hub.log")


def status(child: Child) -> int | None:
    until(lambda: child.ended() is not None)
    return child.ended()


def words(child: Child) -> str:
    assert child.printed is not None
    with child.printed as printed:
        return printed.read().decode().strip().rpartition("\n")[2]


def test_a_prewarmed_process_does_what_it_is_told_and_writes_to_that_log(
    pool: ProcessPool, tmp_path: Path
):
    pid = ready(pool)
    child = pool.child(mistaken(tmp_path))
    assert child.pid == pid
    assert status(child) == 1
    assert words(child).startswith(SENTENCE)
    assert pool.pids == {}


def test_where_a_prewarmed_process_is_of_no_use_a_new_process_is_started(
    pool: ProcessPool, tmp_path: Path
):
    """… because there is none, it has ended, or it cannot be told so much."""
    without = pool.child(mistaken(tmp_path))
    os.kill(gone := ready(pool), 9)
    os.waitid(os.P_PID, gone, os.WEXITED | os.WNOWAIT)
    after = pool.child(mistaken(tmp_path))
    unused = ready(pool)
    long = pool.child(mistaken(tmp_path, "x" * LONGEST))
    assert {gone, unused}.isdisjoint({without.pid, after.pid, long.pid})
    for child in (without, after, long):
        assert status(child) == 1
        assert words(child).startswith(SENTENCE)
    assert not Path(f"/proc/{unused}").exists()


def test_one_imports_after_the_other_and_all_end(pool: ProcessPool):
    wanted = {"hub_topside": Prewarming(), "hub_drone": Prewarming()}
    pool.keep(wanted)
    pool.keep(wanted)
    assert len(pool.pids) == 1
    until(lambda: pool.keep(wanted) or all(map(pool.has, wanted)))
    pids = [*pool.pids.values()]
    pool.end()
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)
