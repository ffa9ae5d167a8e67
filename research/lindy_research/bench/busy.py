"""What a busy computer costs: a real dive beside a process that never rests, with one Zenoh thread
per process and, beside it, with Zenoh's own threads."""

import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from lindy_research.bench.costs import Cost, total
from lindy_research.bench.real_dive import PILOT, started, watched
from lindy_research.bench.table import Figure
from lindy_research.bench.transport import DEFAULT_THREADS
from services.runtime.bus.zenoh_bus import ONE_THREAD, VARIABLE
from tools.report.report import Report

WATCH_S = 28.0
HOG = "while True: pass"
# What is counted where a computer is too busy: kind, as in `KIND:TOPIC`, and what it means.
KINDS = {
    "missed_deadline": "missed ticks",
    "skipped": "skipped steps",
    "silent": "steps made without news",
    "failsafe": "failsafes",
    "overflowed": "messages overflowed",
}
CHAIN = ("simulator", "estimation", "reference", "control")


def figures() -> list[Figure]:
    ours, theirs = _flown({VARIABLE: ONE_THREAD}), _flown(DEFAULT_THREADS)
    return list(_beside(*ours, *theirs))


def _flown(environment: Mapping[str, str]) -> tuple[Report, Cost]:
    """The dive's report, and what it costs, beside one process that never rests."""
    hog = subprocess.Popen([sys.executable, "-c", HOG])
    try:
        with (
            TemporaryDirectory(prefix="lindy-bench-") as folder,
            started(
                Path(folder) / "dive", "dive", "--headless", *PILOT, environment=environment
            ) as dive,
        ):
            cost = total(watched([dive], [dive], WATCH_S))
            return dive.report(), cost
    finally:
        hog.kill()
        hog.wait()


def _beside(ours: Report, our_cost: Cost, theirs: Report, their_cost: Cost) -> Iterator[Figure]:
    our_counts, their_counts = _counts(ours), _counts(theirs)
    rows = [(name, "", our_counts[kind], their_counts[kind]) for kind, name in KINDS.items()]
    rows += [(f"lateness p99, {s}", "ms", _late(ours, s), _late(theirs, s)) for s in CHAIN]
    rows += [
        (f"sensor to thruster {part}", "ms", _latency(ours, part), _latency(theirs, part))
        for part in ("p50", "p99", "max")
    ]
    rows.append(("CPU of the dive", "%", our_cost.cpu, their_cost.cpu))
    for name, unit, our_value, their_value in rows:
        yield Figure(
            section="busy", name=name, unit=unit, ours=our_value,
            baseline_name="default threads", baseline=their_value or None,
            note="" if their_value else f"there {their_value:g}",
        )  # fmt: skip


def _counts(report: Report) -> Counter[str]:
    counts = Counter[str]()
    for name, count in report.losses.items():
        counts[name.partition(":")[0]] += count
    return counts


def _late(report: Report, service: str) -> float:
    return report.services[service].lateness_p99_ms or 0.0


def _latency(report: Report, part: str) -> float:
    return getattr(report.latency_ms.sensor_to_thruster, part) or 0.0
