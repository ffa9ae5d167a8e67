"""What a process group is, and what a process has spent, by /proc (Linux only)."""

import os
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")  # [1/s] unit of CPU times in /proc/PID/stat


def spent_s(pid: int) -> float:
    """[s] Processor time of a process since its start; 0 where there is none."""
    try:
        # The name, in brackets, may hold anything; `state` is the first field behind it.
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except (FileNotFoundError, ProcessLookupError):
        return 0.0
    return (int(fields[11]) + int(fields[12])) / TICKS


def in_group(leader: int) -> list[int]:
    """Process ids of a process group."""

    def group(pid: int) -> int | None:
        try:
            return os.getpgid(pid)
        except ProcessLookupError:  # it has just ended
            return None

    pids = [int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit()]
    return [pid for pid in pids if group(pid) == leader]
