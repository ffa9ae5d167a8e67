"""A long dive in which processes are killed and stopped and the link is cut at random: does
anything grow? Run it as a script: `python tests/long/soak.py [MINUTES] [SEED]`.

Real processes in real time, `lindy dive --grouped --headless` with random sticks. Prints how the
memory, the descriptors and the threads of every process change over its life, and the lateness of
every service in each minute; fails where one of them grows faster than `BOUNDS` says.
"""

import os
import random
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import NamedTuple

import msgspec
import numpy as np

from messages.health import Health
from services.runtime.config.running import RUNNING, Running
from tests.support.patience import PATIENCE_S, until
from tools.recordings.recording import open_recording

MINUTES, SEED = 30, 1
EVERY_S = 2.0  # [s] between two samples
PAUSE_S = 30.0  # [s] between two faults, on average
LONGEST_STOP_S, LONGEST_OUTAGE_S = 3.0, 8.0
YOUNG_S = 30.0  # [s] a process may grow after its start
LEAST_S = 90.0  # [s] of a process' life that tell whether it grows
LEAST_MINUTES = 5  # that tell whether a service becomes later and later
HAS_STICKS = "has the sticks"  # what is said when the drone is armed
PAGE = os.sysconf("SC_PAGE_SIZE")  # [B]


class Bound(NamedTuple):
    """What may grow how fast. A growth below `least` is none: it may be chance."""

    per_hour: float
    least: float


BOUNDS = {
    # A router that lived 2 to 12 minutes grew by up to 2.4 MB, one that lived 30 by 1.9 MB.
    "memory [MB]": Bound(15.0, 3.0),
    "descriptors": Bound(6.0, 3.0),
    "threads": Bound(6.0, 3.0),
    "lateness [ms]": Bound(10.0, 2.0),
}
BOUNDS_OF = {
    # Rerun's writer keeps some 27 MB an hour, and takes 5 MB in its first minutes.
    ("visualizer", "memory [MB]"): Bound(45.0, 8.0),
    # It starts processes meanwhile, and flies nothing.
    ("supervisor", "lateness [ms]"): Bound(100.0, 30.0),
}


class Growth(NamedTuple):
    """Of one quantity of one process or service, by its regression line."""

    who: str
    what: str
    per_hour: float
    whole: float  # over the time that was looked at

    @property
    def too_fast(self) -> bool:
        bound = BOUNDS_OF.get((self.who, self.what), BOUNDS[self.what])
        return self.per_hour > bound.per_hour and self.whole > bound.least


def growth(who: str, what: str, times_s: Sequence[float], values: Sequence[float]) -> Growth:
    """How a quantity grows.

    Args:
        times_s: [s] of each value; two different ones at least.
    """
    times = np.asarray(times_s) - np.mean(times_s)
    per_s = float(np.sum(times * (np.asarray(values) - np.mean(values))) / np.sum(times**2))
    return Growth(who, what, per_s * 3600.0, per_s * (max(times_s) - min(times_s)))


class Sample(NamedTuple):
    """Of a process."""

    at_s: float
    rss_mb: float
    descriptors: int
    threads: int


def sample(pid: int, at_s: float) -> Sample | None:
    """None: it has just ended."""
    folder = Path(f"/proc/{pid}")
    try:
        rss_mb = int((folder / "statm").read_text().split()[1]) * PAGE / 1e6
        counts = (sum(1 for _ in (folder / kind).iterdir()) for kind in ("fd", "task"))
        return Sample(at_s, rss_mb, *counts)
    except OSError:
        return None


class Life(NamedTuple):
    """One process, from its start to its end."""

    name: str
    pid: int


def growths(lives: Mapping[Life, Sequence[Sample]]) -> Iterator[Growth]:
    """Of every process that lived long enough."""
    for life, samples in lives.items():
        grown = [one for one in samples if one.at_s - samples[0].at_s >= YOUNG_S]
        if not grown or grown[-1].at_s - grown[0].at_s < LEAST_S:
            continue
        times = [one.at_s for one in grown]
        yield growth(life.name, "memory [MB]", times, [one.rss_mb for one in grown])
        yield growth(life.name, "descriptors", times, [one.descriptors for one in grown])
        yield growth(life.name, "threads", times, [one.threads for one in grown])


def lateness(folder: Path) -> dict[str, dict[int, float]]:
    """[ms] In each minute of a recording, the median of what each service says every second of the
    99th percentile; by service."""
    said: defaultdict[str, defaultdict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    began_ns: int | None = None
    for entry in open_recording(folder):
        began_ns = entry.log_ns if began_ns is None else began_ns
        if isinstance(entry.message, Health) and entry.message.lateness_p99_ms is not None:
            minute = (entry.log_ns - began_ns) // 60_000_000_000
            said[entry.message.service][minute].append(entry.message.lateness_p99_ms)
    return {
        service: {minute: median(values) for minute, values in minutes.items()}
        for service, minutes in sorted(said.items())
    }


class Soak:
    """A dive that is going on."""

    def __init__(self, folder: Path, minutes: float, seed: int) -> None:
        self.lives: defaultdict[Life, list[Sample]] = defaultdict(list)
        self.faults: defaultdict[str, int] = defaultdict(int)
        self._random, self._minutes = random.Random(seed), minutes
        self._out, self._said = folder / "dive", folder / "said.txt"
        script = folder / "sticks.csv"
        script.write_text("\n".join(self._sticks(60.0 * minutes + PATIENCE_S)) + "\n")
        self._lindy = [sys.executable, "-P", "-m", "tools"]
        words = ("dive", "--grouped", "--headless", "--seed", str(seed))
        words = (*words, "--pilot", f"script:{script}", "--out", str(self._out))
        with self._said.open("w") as said:
            self._process = subprocess.Popen(
                [*self._lindy, *words],
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
            )

    def run(self) -> Path:
        """Returns the folder of the dive.

        Raises:
            SystemExit: the dive ended by itself, or not at all.
        """
        try:
            until(
                lambda: HAS_STICKS in self._said.read_text(), self._last_line, self._require_running
            )
            began = time.monotonic()
            next_fault = began + self._random.expovariate(1.0 / PAUSE_S)
            while (now := time.monotonic()) - began < 60.0 * self._minutes:
                self._require_running()
                self._look(now - began)
                if now >= next_fault:
                    self._fault()
                    next_fault = time.monotonic() + self._random.expovariate(1.0 / PAUSE_S)
                time.sleep(EVERY_S)
        finally:
            if self._process.poll() is None:
                self._process.terminate()
        status = self._process.wait(PATIENCE_S)
        if status not in (0, 3):
            raise SystemExit(f"the dive ended with status {status}: {self._last_line()}")
        return self._out

    def _look(self, at_s: float) -> None:
        running = self._running()
        by_pid = {pid: name for name, pid in running.pids.items()} if running else {}
        if running:
            by_pid[running.supervisor] = "supervisor"
        for pid, name in by_pid.items():
            if (one := sample(pid, at_s)) is not None:
                self.lives[Life(name, pid)].append(one)

    def _fault(self) -> None:
        running, kind = self._running(), self._random.choice(["kill", "stop", "outage"])
        if running is None:
            return
        self.faults[kind] += 1
        if kind == "outage":
            self._link("down")
            time.sleep(self._random.uniform(0.5, LONGEST_OUTAGE_S))
            self._link("up")
            return
        pid = self._random.choice(sorted(set(running.pids.values())))
        with suppress(ProcessLookupError):
            if kind == "kill":
                os.kill(pid, signal.SIGKILL)
                return
            os.kill(pid, signal.SIGSTOP)
            time.sleep(self._random.uniform(0.2, LONGEST_STOP_S))
            os.kill(pid, signal.SIGCONT)

    def _link(self, verb: str) -> None:
        subprocess.run(
            [*self._lindy, "link", "set", verb, "--dive", str(self._out)],
            check=False,
            capture_output=True,
        )

    def _running(self) -> Running | None:
        try:
            return msgspec.json.decode((self._out / RUNNING).read_bytes(), type=Running)
        except (OSError, msgspec.DecodeError):
            return None

    def _sticks(self, seconds: float) -> Iterator[str]:
        """A stick log with another position every three seconds."""
        yield "t,surge,sway,heave,yaw"
        yield "0,0,0,0,0"
        yield "2,0,0,0.8,0"
        for second in range(8, round(seconds), 3):
            sticks = (self._random.choice([0.0, self._random.uniform(-1, 1)]) for _ in range(4))
            yield ",".join([str(second), *(f"{stick:.2f}" for stick in sticks)])

    def _require_running(self) -> None:
        if self._process.poll() is not None:
            raise SystemExit(f"the dive ended by itself: {self._last_line()}")

    def _last_line(self) -> str:
        return (self._said.read_text().strip().splitlines() or ["it printed nothing"])[-1]


def show(growths: Iterable[Growth]) -> bool:
    """Print them. Returns whether one is too fast."""
    failed = False
    for one in growths:
        failed = failed or one.too_fast
        print(
            f"{one.who:20s} {one.what:14s} {one.per_hour:+8.1f} per hour, {one.whole:+6.1f} in all"
            + ("  TOO FAST" if one.too_fast else "")
        )
    return failed


def show_lateness(minutes: Mapping[str, Mapping[int, float]]) -> bool:
    """Print it, a column a minute. Returns whether one grows too fast."""
    print("lateness, 99th percentile [ms], minute by minute")
    for service, by_minute in minutes.items():
        print(f"{service:20s}", *(f"{by_minute[minute]:6.1f}" for minute in sorted(by_minute)))
    # The first minute has the start of the dive in it, the last one its end.
    inner = {name: sorted(by_minute.items())[1:-1] for name, by_minute in minutes.items()}
    return show(
        growth(name, "lateness [ms]", [60.0 * at for at, _ in kept], [value for _, value in kept])
        for name, kept in inner.items()
        if len(kept) >= LEAST_MINUTES
    )


def main(minutes: float, seed: int) -> int:
    with TemporaryDirectory(prefix="lindy-soak-") as folder:
        soak = Soak(Path(folder), minutes, seed)
        dive = soak.run()
        print(f"{minutes:g} minutes, seed {seed}; faults: {dict(soak.faults)}")
        grown = show(growths(soak.lives))
        late = show_lateness(lateness(dive))
    return int(grown or late)


if __name__ == "__main__":
    given = sys.argv[1:]
    sys.exit(main(float(given[0]) if given else MINUTES, int(given[1]) if given[1:] else SEED))
