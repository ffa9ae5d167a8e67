"""A dive of real processes to which the same can happen as to one on virtual time."""

import os
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from signal import SIGCONT, SIGKILL, SIGSTOP
from tempfile import TemporaryDirectory

from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from tests.support.faults.modes import FlownMode
from tests.support.faults.observed import FaultDive
from tests.support.started import Started, exists
from tools.recordings.recording import open_recording

LEVELS = ("warning", "error")  # of lines that the pilot reads in a terminal
LONGEST_WAIT_S = 0.05  # [s] between two looks at the terminal
STEADY_S = 2.0  # [s] of undisturbed flight between two cells
GONE_S = 3.0  # [s] for all to end without their supervisor
SMALL = 24 * 2**20  # [bytes] of a disk that fills
DEEP = ("--set", "simulator.floor_depth=60")


class RealFaultDive(FaultDive):
    """Armed and settled when the constructor returns."""

    def __init__(
        self, mode: FlownMode, folder: Path, exits: ExitStack, more: Sequence[str]
    ) -> None:
        """
        Args:
            folder: an empty one, for the script, the terminal's output and the dive's folder.
            more: words for the command line.
        """
        super().__init__(mode.vertical)
        self._folder, self._read = folder, 0  # [bytes] of the terminal
        self._stopped: dict[str, int] = {}  # process ids
        self._hogs: list[subprocess.Popen[bytes]] = []
        self.status, self.lasted, self.gone = 0, True, "some processes are left"
        words = ("dive", "--headless", "--vehicle", mode.vehicle, *DEEP, *more)
        self.lindy = Started(folder / "dive", *words, script=mode.script)
        exits.callback(self.end)
        self.lindy.until_armed()
        self._woken = threading.Event()
        self._nodes = [self._node(side, exits) for side in ("topside", "drone")]
        self._connect(*self._nodes)
        self.run(mode.settled)

    def _node(self, side: str, exits: ExitStack) -> Node:
        running = self.lindy.running
        bus = exits.enter_context(open_bus(running.endpoints[side], running.vehicle))
        node = Node(f"faults_{side}", {side: bus}, time.monotonic_ns, VolatileCheckpoint())
        node.wake = self._woken.set
        return node

    @property
    def now(self) -> int:
        return time.monotonic_ns()

    def run(self, seconds: float) -> None:
        end = self.now + round(seconds * 1e9)
        while (now := self.now) < end:
            due = min([end, *(node.deadline() for node in self._nodes)])
            self._woken.wait(min(LONGEST_WAIT_S, max(0.0, (due - now) / 1e9)))
            self._woken.clear()
            for node in self._nodes:
                node.step()
            self._read_screen()

    def _read_screen(self) -> None:
        """Lines that only the terminal has: while a hub is gone nobody else hears them."""
        whole, newline, _ = self.lindy.said[self._read :].rpartition("\n")
        self._read += len(whole) + len(newline)
        for line in whole.split("\n"):
            words = line.split(maxsplit=3)  # level, time, its unit, text
            if len(words) == 4 and words[0] in LEVELS and words[3].startswith("supervisor:"):
                self.seen.tell(self.now, words[3])
            elif line.startswith("lindy: "):  # nobody but a hub is left to say so
                self.seen.tell(self.now, line.strip())

    def wait_steady(self) -> None:
        """Let the drone fly undisturbed, armed, for a while."""
        self.lindy.until(self._looks_armed)
        self.run(STEADY_S)

    def _looks_armed(self) -> bool:
        self.run(0.1)
        return self.seen.armed

    def end(self) -> None:
        """As Ctrl-C does."""
        self.rest()
        self.lasted = self.lasted and self.lindy.alive
        self.status = self.lindy.end()

    # What can happen to it.

    def kill(self, name: str) -> None:
        self.lindy.signal(name, SIGKILL)

    def stop(self, name: str) -> None:
        self._stopped[name] = self.lindy.running.pids[name]
        self.lindy.signal(name, SIGSTOP)

    def go_on(self, name: str) -> None:
        """Unless the supervisor has ended it meanwhile."""
        if self.lindy.pid(name) == self._stopped.pop(name):
            self.lindy.signal(name, SIGCONT)

    def hog(self, count: int) -> None:
        """So many processes that never rest."""
        forever = [sys.executable, "-c", "while True: pass"]
        self._hogs = [subprocess.Popen(forever) for _ in range(count)]

    def rest(self) -> None:
        for hog in self._hogs:
            hog.kill()
            hog.wait()
        self._hogs = []

    def fill_disk(self) -> None:
        filler = self._folder / "filler"
        with suppress(OSError), filler.open("wb", buffering=0) as file:
            while True:
                file.write(bytes(1 << 16))

    def free_disk(self) -> None:
        (self._folder / "filler").unlink()

    def lose_folder(self) -> None:
        """Somebody removes the dive's folder; then a service dies."""
        pid = self.lindy.running.pids["control"]
        shutil.rmtree(self.lindy.out)
        os.kill(pid, SIGKILL)

    def kill_supervisor(self) -> None:
        """Everybody ends; a real vehicle's driver then stops its thrusters by itself."""
        pids, began = {*self.lindy.running.pids.values()}, time.monotonic()
        self.lindy.process.kill()
        while (passed := time.monotonic() - began) < GONE_S:
            if not any(map(exists, pids)):
                self.gone = f"all gone after {passed:.2f} s"
                return
            time.sleep(0.01)  # other processes do it

    def lost(self, killed_ns: int) -> str:
        """How much of what was before the recorder's end is not in the file."""
        told = open_recording(self.lindy.out)
        stamps = [e.message.stamp_ns for e in told if e.key == "state"]
        before = max((stamp for stamp in stamps if stamp <= killed_ns), default=0)
        after = min((stamp for stamp in stamps if stamp > killed_ns), default=killed_ns)
        lost, gap = (killed_ns - before) / 1e9, (after - before) / 1e9
        return f"the last {lost:.2f} s before it are lost; nothing recorded for {gap:.2f} s"


@contextmanager
def real_dive(mode: FlownMode, *more: str, small: bool = False) -> Generator[RealFaultDive]:
    """
    Args:
        small: on a disk of its own, which is small.

    Raises:
        CalledProcessError: this computer allows no such disk.
    """
    with TemporaryDirectory(prefix="lindy-faults-") as folder, ExitStack() as exits:
        if small:
            options = ["-t", "tmpfs", "-o", f"size={SMALL}", "tmpfs", folder]
            subprocess.run(["mount", *options], check=True)
            exits.callback(subprocess.run, ["umount", "-l", folder], check=True)
        yield RealFaultDive(mode, Path(folder), exits, more)
