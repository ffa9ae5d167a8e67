"""Two routers, and drones, pilots and synthetic ones on them, as processes of this machine."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.hosts.process_host import HubLaunch
from tests.support.patience import PATIENCE_S, until
from tests.support.processes import Cost, costs
from tests.support.started_dives import StartedDive, started
from tools.fleet.look import who_is_there

PYTHON = [sys.executable, "-P", "-m"]


class TwoRouters:
    """Drones are at the first one, pilots at the second, which calls the first."""

    def __init__(self, exits: ExitStack) -> None:
        self.drones, self.pilots = _free(), _free()
        self._exits = exits
        self.processes = {
            "drones": self._start(self.drones),
            "pilots": self._start(self.pilots, self.drones),
        }

    def costs(self, seconds: float) -> Cost:
        """Of both together."""
        found = costs({name: each.pid for name, each in self.processes.items()}, seconds)
        return found["drones"] + found["pilots"]

    def kill(self) -> None:
        """That of the drones, as when its computer fails."""
        self.processes["drones"].send_signal(signal.SIGKILL)
        self.processes["drones"].wait(PATIENCE_S)

    def start_again(self) -> None:
        self.processes["drones"] = self._start(self.drones)

    def _start(self, listen: str, *connect: str) -> subprocess.Popen[bytes]:
        launch = HubLaunch(listen=[listen], connect=list(connect), parent=os.getpid())
        text = msgspec.json.encode(launch).decode()
        process = subprocess.Popen([*PYTHON, "services", "hub", text])
        self._exits.callback(_end, process)
        return process


class FlownFleet(NamedTuple):
    """Drones, and a pilot for each."""

    drones: list[StartedDive]
    pilots: list[StartedDive]

    @property
    def all(self) -> list[StartedDive]:
        return [*self.drones, *self.pilots]


def start_drones(
    routers: TwoRouters, folder: Path, count: int, exits: ExitStack
) -> dict[str, StartedDive]:
    """Start grouped drones; returns them by their names when all of them are there."""
    names = [f"rov{number}" for number in range(count)]
    drones = {name: begin_drone(routers, folder, name, exits) for name in names}
    until(lambda: set(names) <= _there(routers.pilots), lambda: f"{count} drones")
    return drones


def begin_drone(routers: TwoRouters, folder: Path, name: str, exits: ExitStack) -> StartedDive:
    words = ("up", "drone", "--name", name, "--router", routers.drones, "--grouped")
    return exits.enter_context(started(folder / name, *words))


def begin_pilot(
    routers: TwoRouters, folder: Path, name: str, pilot: tuple[str, ...], exits: ExitStack
) -> StartedDive:
    words = ("fly", name, "--router", routers.pilots, "--grouped", *pilot)
    return exits.enter_context(started(folder, *words))


class SyntheticProcess:
    """A process with synthetic drones, or their pilots."""

    def __init__(
        self,
        who: str,
        router: str,
        count: int,
        exits: ExitStack,
        speed: float = 1.0,
        *more: str,
    ) -> None:
        """
        Args:
            more: options of `tests.support.synthetic_fleet`.
        """
        command = [*PYTHON, "tests.support.synthetic_fleet", who, "--router", router]
        command += ["--count", str(count), "--speed", f"{speed:g}", *more]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        exits.callback(_end, self._process)

    def until_ready(self) -> None:
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def end(self) -> dict[str, Any]:
        """What it says at its end."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        return json.loads(self._process.stdout.readline())


@contextmanager
def synthetic(
    routers: TwoRouters, count: int, speed: float = 1.0
) -> Generator[tuple[SyntheticProcess, SyntheticProcess]]:
    """Drones with their pilots."""
    with ExitStack() as exits:
        drones = SyntheticProcess("drones", routers.drones, count, exits, speed)
        pilots = SyntheticProcess("pilots", routers.pilots, count, exits, speed)
        drones.until_ready()
        pilots.until_ready()
        yield drones, pilots


def answers(endpoint: str) -> bool:
    """Does a router answer there?"""
    try:
        who_is_there(endpoint)
    except LindyError:
        return False
    return True


def _there(endpoint: str) -> set[str]:
    try:
        return set(who_is_there(endpoint))
    except LindyError:  # the router is not there yet
        return set()


def _free() -> str:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return f"tcp/127.0.0.1:{free.getsockname()[1]}"


def _end(process: subprocess.Popen[Any]) -> None:
    if process.poll() is None:
        process.terminate()
        process.wait(PATIENCE_S)
