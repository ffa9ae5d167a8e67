"""A dive of real processes to which the same can happen as to one on virtual time."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec

from messages import topics
from messages.link import LinkRequest
from messages.pilot import PilotRequest
from messages.simulator import FaultKind, FaultRequest
from services.runtime.bus.zenoh_bus import open_bus
from services.runtime.config.running import RUNNING, Running
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.node import Node
from tests.support.faults.modes import VERTICAL, FlownMode
from tests.support.faults.observed import Observed
from tests.support.patience import PATIENCE_S, until

HAS_STICKS = "has the sticks"  # the pilot's line when the drone is armed
LEVELS = ("warning", "error")  # of lines that the pilot reads in a terminal
LONGEST_WAIT_S = 0.05  # [s] between two looks at the terminal
SETTINGS = ("estimation.calibration.still_time=3", "simulator.floor_depth=60")


class RealFaultDive:
    """Armed and settled when `real_dive` yields it."""

    def __init__(
        self,
        mode: FlownMode,
        folder: Path,
        exits: ExitStack,
        more: Sequence[str],
        out: Path,
        modules: Path | None,
    ) -> None:
        """
        Raises:
            RuntimeError: it ends before it is armed.
        """
        self.seen = Observed()
        self.folder, self.out, self._modules = folder, out, modules
        self.ended: float | None = None
        self._vertical = mode.vertical
        self._read = 0  # [bytes] of the terminal
        self._asked = 0
        self._screen = folder / "screen.txt"
        self.process = self._start(mode, more)
        exits.callback(self.end)
        self._wait_for(lambda: HAS_STICKS in self.screen)
        self._woken = threading.Event()
        self._nodes = [self._node(side, exits) for side in ("topside", "drone")]
        ears, board = self._nodes
        self.seen.listen_topside(ears)
        self.seen.listen_on_board(board)
        self._wishes = ears.request(
            topics.PILOT_REQUEST, topics.PILOT_ANSWER, on_answer=lambda _q, _a, _n: None
        )
        self._breaks = board.publisher(topics.FAULT_REQUEST)
        self._links = ears.publisher(topics.LINK_REQUEST)
        self.run(mode.settled)

    def _start(self, mode: FlownMode, more: Sequence[str]) -> subprocess.Popen[bytes]:
        script = self.folder / "sticks.csv"
        script.write_text(mode.script)
        command = [
            sys.executable,
            "-P",
            "-m",
            "tools",
            "dive",
            "--headless",
            "--out",
            str(self.out),
        ]
        command += ["--pilot", f"script:{script}", "--vehicle", mode.vehicle, *more]
        for setting in SETTINGS:
            command += ["--set", setting]
        environment = dict(os.environ)
        if self._modules is not None:
            environment["PYTHONPATH"] = str(self._modules)
        with self._screen.open("wb") as screen:
            return subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=screen,
                stderr=subprocess.STDOUT,
                env=environment,
            )

    def _node(self, side: str, exits: ExitStack) -> Node:
        running = self.running
        bus = exits.enter_context(open_bus(running.endpoints[side], running.vehicle))
        node = Node(f"faults_{side}", {side: bus}, time.monotonic_ns, VolatileCheckpoint())
        node.wake = self._woken.set
        return node

    @property
    def screen(self) -> str:
        return self._screen.read_text(errors="replace")

    @property
    def running(self) -> Running:
        return msgspec.json.decode((self.out / RUNNING).read_bytes(), type=Running)

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def _wait_for(self, happened: Callable[[], bool]) -> None:
        """
        Raises:
            RuntimeError: the dive ended.
        """

        def require_running() -> None:
            if not self.alive:
                raise RuntimeError(f"the dive does not get on: {self.screen[-500:]}")

        until(happened, lambda: self.screen[-500:], require_running)

    @property
    def now(self) -> int:
        """[ns] the clock of all stamps on this machine."""
        return time.monotonic_ns()

    def run(self, seconds: float) -> None:
        """Look on."""
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
        with self._screen.open("rb") as file:
            file.seek(self._read)
            data = file.read()
        whole, newline, _ = data.rpartition(b"\n")
        self._read += len(whole) + len(newline)
        for line in whole.decode(errors="replace").split("\n"):
            words = line.split(maxsplit=3)  # level, time, its unit, text
            if len(words) == 4 and words[0] in LEVELS and words[3].startswith("supervisor:"):
                self.seen.tell(self.now, words[3])
            elif line.startswith("lindy: "):  # nobody but a hub is left to say so
                self.seen.tell(self.now, line.strip())

    def wait_steady(self, seconds: float) -> None:
        """Let the drone fly undisturbed, armed, for so long."""
        self._wait_for(lambda: self._looks_armed())
        self.run(seconds)

    def _looks_armed(self) -> bool:
        self.run(0.1)
        return bool(self.seen.statuses) and self.seen.statuses[-1].armed

    # What can happen to it.

    def _signal(self, name: str, number: signal.Signals) -> None:
        os.kill(self.running.pids[name], number)

    def kill(self, name: str) -> None:
        self._signal(name, signal.SIGKILL)

    def stop(self, name: str) -> None:
        self._stopped = self.running.pids[name]
        os.kill(self._stopped, signal.SIGSTOP)

    def go_on(self, name: str) -> None:
        """Unless the supervisor has ended it meanwhile."""
        if self.running.pids.get(name) == self._stopped:
            os.kill(self._stopped, signal.SIGCONT)

    def ask(self, **wish: object) -> None:
        shown = self.seen.shown
        request = PilotRequest(
            stamp_ns=self.now, id="", source="voice",
            epoch=0 if shown is None else shown.epoch,
            **wish,  # type: ignore[arg-type]
        )  # fmt: skip
        self._wishes.ask(request, self.now)

    def part(self, part: str, fault: FaultKind, value: float | None = None) -> None:
        part = self._vertical if part == VERTICAL else part
        self._asked += 1
        name = f"fault-{self._asked}"
        request = FaultRequest(stamp_ns=self.now, id=name, part=part, fault=fault, value=value)
        self._breaks.put(request)

    def link(self, request: LinkRequest) -> None:
        self._asked += 1
        stamped = msgspec.structs.replace(request, stamp_ns=self.now, id=f"link-{self._asked}")
        self._links.put(stamped)

    def end(self) -> int:
        """As Ctrl-C does. Returns the exit status."""
        if self.alive:
            self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE_S)


@contextmanager
def real_dive(
    mode: FlownMode,
    folder: Path,
    *more: str,
    out: Path | None = None,
    modules: Path | None = None,
) -> Generator[RealFaultDive]:
    """
    Args:
        folder: an empty one, for the script, the terminal's output and the dive's folder.
        more: words for the command line.
        out: another dive's folder.
        modules: folder where Python looks for modules before its own.
    """
    with ExitStack() as exits:
        yield RealFaultDive(mode, folder, exits, more, out or folder / "dive", modules)
