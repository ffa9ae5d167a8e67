"""Two routers, and drones and pilots on them, as processes of this machine."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec

from services.runtime.config.errors import LindyError
from services.runtime.hosts.process_host import HubLaunch
from tests.support.patience import PATIENCE_S, until
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
