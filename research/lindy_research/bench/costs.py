"""What processes cost over a window of time, as /proc counts it (Linux only)."""

import os
import re
import time
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")  # [1/s] unit of CPU times in /proc/PID/stat
PAGE = os.sysconf("SC_PAGE_SIZE")  # [B]


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one process or, added up, of several."""

    user: float  # [% of one core]
    system: float  # [% of one core]
    switches: float  # [1/s] voluntary context switches of all threads: waits
    rss_mb: float  # [MB] resident at the end of the window
    threads: int  # at the end of the window

    @property
    def cpu(self) -> float:
        """[% of one core]"""
        return self.user + self.system

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(
            self.user + other.user,
            self.system + other.system,
            self.switches + other.switches,
            self.rss_mb + other.rss_mb,
            self.threads + other.threads,
        )


NOTHING = Cost(0.0, 0.0, 0.0, 0.0, 0)


@dataclass(frozen=True, slots=True)
class _Count:
    at: float  # [s]
    user: float  # [s]
    system: float  # [s]
    switches: dict[str, int]  # by thread
    rss_mb: float


def costs(pids: Mapping[str, int], seconds: float) -> dict[str, Cost]:
    """Cost of each process over the next `seconds`; a process that has ended is left out."""
    before = {name: _count(pid) for name, pid in pids.items()}
    time.sleep(seconds)
    after = {name: _count(pid) for name, pid in pids.items()}
    return {
        name: _between(begin, end)
        for name in pids
        if (begin := before[name]) is not None and (end := after[name]) is not None
    }


def memory_mb(pids: Collection[int]) -> float:
    """[MB] What these processes would take if they were alone on this computer: what is each one's
    own, and once what several of them have mapped, such as code."""
    own, shared = 0, dict[tuple[str, str], int]()  # [kB]; by file and place in it
    for pid in pids:
        for file, place, kb in _mappings(pid):
            own += kb["Private_Clean"] + kb["Private_Dirty"]
            held = kb["Shared_Clean"] + kb["Shared_Dirty"]
            shared[file, place] = max(held, shared.get((file, place), 0))
    return (own + sum(shared.values())) * 1024 / 1e6


def total(costs: Mapping[str, Cost]) -> Cost:
    return sum(costs.values(), NOTHING)


def _mappings(pid: int) -> Iterator[tuple[str, str, dict[str, int]]]:
    """File, place in it, and sizes [kB] of each part of a process's memory."""
    try:
        text = Path(f"/proc/{pid}/smaps").read_text()
    except (FileNotFoundError, ProcessLookupError):  # it has just ended
        return
    for part in re.split(r"(?m)^(?=[0-9a-f]+-[0-9a-f]+ )", text)[1:]:
        head, *lines = part.splitlines()
        words = head.split(maxsplit=5)  # addresses, rights, place, device, inode, file
        sizes = (line.split() for line in lines if line.endswith(" kB"))
        yield words[5] if len(words) > 5 else "", words[2], {w[0][:-1]: int(w[1]) for w in sizes}


def _between(begin: _Count, end: _Count) -> Cost:
    seconds = end.at - begin.at
    switches = sum(n - begin.switches.get(thread, 0) for thread, n in end.switches.items())
    return Cost(
        user=100.0 * (end.user - begin.user) / seconds,
        system=100.0 * (end.system - begin.system) / seconds,
        switches=switches / seconds,
        rss_mb=end.rss_mb,
        threads=len(end.switches),
    )


def _count(pid: int) -> _Count | None:
    """All that /proc has counted until now; None: there is no such process."""
    folder = Path(f"/proc/{pid}")
    try:
        # The name, in brackets, may hold anything; `state` is the first field behind it.
        fields = (folder / "stat").read_text().rsplit(")", 1)[1].split()
        threads = [path.name for path in (folder / "task").iterdir()]
        switches = {thread: _switches(folder / "task" / thread) for thread in threads}
        return _Count(
            at=time.monotonic(),
            user=int(fields[11]) / TICKS,
            system=int(fields[12]) / TICKS,
            switches={thread: n for thread, n in switches.items() if n is not None},
            rss_mb=int(fields[21]) * PAGE / 1e6,
        )
    except (FileNotFoundError, ProcessLookupError):
        return None


def _switches(thread: Path) -> int | None:
    try:
        lines = (thread / "status").read_text().splitlines()
    except (FileNotFoundError, ProcessLookupError):  # it has just ended
        return None
    return next(int(s.split()[1]) for s in lines if s.startswith("voluntary_ctxt_switches"))
