"""A dive at depth with the stick forward, in which the way to the board breaks and comes back."""

import os
import select
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

import msgspec

from lindy_research.ardusub_comparison.firmware import firmware, free_port
from lindy_research.ardusub_kills.dive import (
    AGAIN_S,
    FORWARD_S,
    PATIENCE_S,
    REST,
    STEADY_S,
    OutputObserver,
    dive_on,
    goes,
)
from services.mavlink_io.packet import MavCommand, command
from services.runtime.config.running import RUNNING, Running

FAULTS = ("killed", "hung", "pulled", "rebooted")
FOR_S = 2.0  # [s] that it hangs, or that the cable is pulled
FORCED = 20190226.0  # of a reboot while armed
ALONE_S = AGAIN_S - FORWARD_S - STEADY_S - 4.0  # [s] after the fault: the pilot has done nothing
BACK_S = 30.0  # [s] after that in which the stick must act again
LEVELS = ("warning ", "error ")  # what the pilot is told


class BoardFault(NamedTuple):
    """Times by our clock [s] since the fault: 20 ms uncertain."""

    stopped: float | None  # all outputs are at rest; none: they never were
    alone: float | None  # the stick acts again, and the pilot did nothing; none: it did not
    again: bool  # it does at the latest after he disarmed and armed
    said: list[str]  # what he reads, from the fault on


class Cable:
    """Passes datagrams on between the board and Lindy, while it is plugged in."""

    def __init__(self, to: int) -> None:
        self.plugged = True
        self.port = free_port()
        self._to, self._ended = to, threading.Event()
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._ended.set()
        self._thread.join()

    def _pass_on(self) -> None:
        board = None
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as outer,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inner,
        ):
            outer.bind(("127.0.0.1", self.port))
            inner.connect(("127.0.0.1", self._to))
            outer.setblocking(False)
            inner.setblocking(False)
            while not self._ended.is_set():
                for end in select.select([outer, inner], [], [], 0.1)[0]:
                    with suppress(ConnectionRefusedError, BlockingIOError):  # Lindy is not up
                        data, sender = end.recvfrom(4096)
                        board = sender if end is outer else board
                        if self.plugged and end is outer:
                            inner.send(data)
                        elif self.plugged and board is not None:
                            outer.sendto(data, board)


def fault_in_a_dive(path: str, fault: str, folder: Path) -> BoardFault:
    """
    Args:
        path: of the firmware.
        fault: one of FAULTS.
        folder: a new one.

    Raises:
        RuntimeError: it does not fly.
    """
    folder.mkdir(parents=True)
    port, second = free_port(), free_port()
    with ExitStack() as stack:
        cable, observer = Cable(port), OutputObserver(second)
        stack.callback(cable.close)
        stack.callback(observer.close)
        stack.enter_context(firmware(path, cable.port, second, folder / "board"))
        stack.enter_context(dive_on(port, folder))
        if not observer.until(lambda: goes(observer), PATIENCE_S):
            raise RuntimeError(f"it does not fly:\n{(folder / 'dive.log').read_text()}")
        observer.run(STEADY_S)
        before, began = _told(folder), time.monotonic()
        mend = _break(fault, folder, observer, cable)
        observer.seen.clear()  # of before
        stopped = _until(observer, lambda: _rests(observer), FOR_S, began)
        observer.run(began + FOR_S - time.monotonic())
        observer.seen.clear()
        mend()
        alone = _until(observer, lambda: goes(observer), ALONE_S, began)
        again = alone or _until(observer, lambda: goes(observer), BACK_S, began)
        return BoardFault(stopped, alone, again is not None, _said_since(folder, before))


def _rests(observer: OutputObserver) -> bool:
    return bool(observer.seen) and observer.seen[-1].pulses == REST


def _break(fault: str, folder: Path, observer: OutputObserver, cable: Cable) -> Callable[[], None]:
    """What mends it, too."""
    running = msgspec.json.decode((folder / "out" / RUNNING).read_bytes(), type=Running)
    pid = running.pids["ardusub"]
    if fault == "killed":
        os.kill(pid, signal.SIGKILL)
    elif fault == "hung":
        os.kill(pid, signal.SIGSTOP)
        return lambda: _go_on(pid)
    elif fault == "pulled":
        cable.plugged = False
        return lambda: setattr(cable, "plugged", True)
    else:
        observer.say(command(1, MavCommand.PREFLIGHT_REBOOT_SHUTDOWN, 1, 0, 0, 0, 0, FORCED))
    return lambda: None


def _go_on(pid: int) -> None:
    with suppress(ProcessLookupError):  # the supervisor replaced it
        os.kill(pid, signal.SIGCONT)


def _until(
    observer: OutputObserver, condition: Callable[[], bool], seconds: float, began: float
) -> float | None:
    """[s] Since `began`; None: not within these seconds."""
    happened = observer.until(condition, seconds)
    return time.monotonic() - began if happened else None


def _told(folder: Path) -> dict[str, list[str]]:
    """What each service has said so far."""
    return {
        path.stem: [line for line in path.read_text().splitlines() if line.startswith(LEVELS)]
        for path in sorted((folder / "out" / "logs").glob("*.log"))
    }


def _said_since(folder: Path, before: dict[str, list[str]]) -> list[str]:
    now = _told(folder)
    return [line for name, lines in now.items() for line in lines[len(before.get(name, [])) :]]
