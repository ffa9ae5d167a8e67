"""What processes cost, as Linux counts it: processor time, thread switches, memory."""

import os
import time
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK")  # [1/s] of processor time
PAGE = os.sysconf("SC_PAGE_SIZE")  # [B]


@dataclass(frozen=True, slots=True)
class Load:
    """Of several processes together, over a while."""

    user: float  # [cores]
    system: float  # [cores]
    switches_hz: float  # [1/s] times a thread stopped by itself, to wait for something
    rss_mb: float  # [MB] resident memory at the end; what processes share is counted in each
    private_mb: float  # [MB] of it what no other process has

    @property
    def cores(self) -> float:
        return self.user + self.system


def load(pids: Collection[int], seconds: float) -> Load:
    """Watch these processes for `seconds`. One that ends meanwhile raises FileNotFoundError."""
    began, before = time.monotonic(), [_counted(pid) for pid in pids]
    time.sleep(seconds)
    took, after = time.monotonic() - began, [_counted(pid) for pid in pids]
    user, system, switches = (
        (sum(later[n] for later in after) - sum(earlier[n] for earlier in before)) / took
        for n in range(3)
    )
    return Load(
        user,
        system,
        switches,
        rss_mb=sum(rss_mb(pid) for pid in pids),
        private_mb=sum(_private_mb(pid) for pid in pids),
    )


def _counted(pid: int) -> tuple[float, float, int]:
    """[s] of processor time, user and system, and voluntary thread switches since its start."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    threads = Path(f"/proc/{pid}/task").glob("*/status")
    switches = sum(_number(path.read_text(), "voluntary_ctxt_switches:") for path in threads)
    return int(fields[11]) / TICKS, int(fields[12]) / TICKS, switches


def rss_mb(pid: int) -> float:
    """[MB] Resident memory of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 1e6


def _private_mb(pid: int) -> float:
    text = Path(f"/proc/{pid}/smaps_rollup").read_text()
    return sum(_number(text, f"Private_{kind}:") for kind in ("Clean", "Dirty")) * 1024 / 1e6


def _number(text: str, name: str) -> int:
    """The number behind a name at the beginning of a line."""
    return next(int(row.split()[1]) for row in text.splitlines() if row.startswith(name))
