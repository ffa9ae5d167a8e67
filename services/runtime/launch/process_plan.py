"""Which processes a stack needs on this machine, and with which commands, endpoints and files."""

import os
import secrets
import sys
from collections.abc import Callable, Collection, Mapping
from itertools import count
from pathlib import Path
from typing import NamedTuple

import msgspec

import services
from messages.topic import Side
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.key_files import Credentials
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.bus.zenoh_bus import UNIX
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.process_host import HubLaunch, Launch
from services.runtime.hosts.registry import PILOTS, Registry
from services.runtime.hosts.stack_file import code_of
from services.runtime.launch.child import Task
from services.runtime.launch.supervisor import NAME
from services.runtime.node.checkpoint import write_safely

PYTHON = [sys.executable, "-P", "-m", services.__name__]  # -P: nothing of the user's folder
CHECKPOINTS = "checkpoints"  # folder in the dive's folder; DIVE/checkpoints/<service>.json
HOME = "topside"  # the side this process's own node is on: it sees what the pilot sees
LAST = ("recorder", "visualizer")  # stopped after the others, so that they receive everything


class OtherSide(NamedTuple):
    """The other side, where it is another machine."""

    side: Side  # of this machine
    listen: tuple[str, ...] = ()  # endpoints at which the other side reaches this hub
    connect: tuple[str, ...] = ()  # … or at which this hub reaches the other's
    gateway: str | None = None  # endpoint of the drone's hub, for a tether process between them


def supervisor_of(other_side: OtherSide | None) -> str:
    """Its name on the bus. Two machines have two, and each receives the other's health."""
    return NAME if other_side is None else f"{NAME}_{other_side.side}"


class ProcessPlan:
    """The hubs and processes of one stack."""

    def __init__(
        self,
        stack: Stack,
        services: Registry,
        folder: Path,
        listen: str | None = None,
        other_side: OtherSide | None = None,
        begin_with: Mapping[str, bytes] | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        """
        Args:
            folder: for sockets, heartbeats and copies, which end with this program.
            listen, other_side, begin_with, credentials: as `local_stack` has them.
        """
        self.stack, self.services, self.other_side = stack, services, other_side
        self.processes = services.processes
        # With keys, programs of other machines come in as they would at the drone's hub; the
        # services keep a private socket.
        outside = credentials is not None and listen is not None
        self._programs = OtherSide("drone", (listen,)) if outside and listen else None
        self._credentials, self._folder = credentials, folder
        # A hub for each side; with two machines, only for sides that are a service's home here.
        homes_only = 1 if other_side is not None else None
        sides = dict.fromkeys(s for spec in services.values() for s in spec.sides[:homes_only])
        self.endpoints = {side: f"{UNIX}{folder}/{side}.sock" for side in sides}
        self.home = HOME if HOME in sides else next(iter(sides))
        if listen is not None and not outside:
            self.endpoints[self.home] = listen
        self._reach = {**self.endpoints}  # what services connect to
        if other_side is not None and other_side.gateway is not None:
            self._reach["drone"] = other_side.gateway
        self.checkpoints = stack.out_dir / CHECKPOINTS  # numbered by `keep_files` if it exists
        self._begin_with = begin_with or {}
        self._copies: dict[str, str] = {}  # file → its copy in `folder`
        self._start = secrets.token_hex(8)  # tells this start from one of another drone of the name

    def keep_files(self, warn: Callable[[str], None]) -> None:
        """Make the folder of the checkpoints, and copies of the files that services read when they
        start, so that one that starts again in mid-dive finds what the others have found.

        Raises:
            LindyError: the folder cannot be made.
        """
        self._copy_files(warn)
        self.checkpoints = unused_folder(self.checkpoints)
        for name, data in self._begin_with.items():
            write_safely(self.checkpoints / f"{name}.json", data)

    def _copy_files(self, warn: Callable[[str], None]) -> None:
        for number, path in enumerate(self.stack.files):
            copy = self._folder / f"{number}-{path.name}"
            try:
                copy.write_bytes(path.read_bytes())
                written_ns = path.stat().st_mtime_ns  # which a recording says
                os.utime(copy, ns=(written_ns, written_ns))
            except OSError as error:
                warn(f"cannot keep a copy of {path}: {reason(error)}")
            else:
                self._copies[str(path)] = str(copy)

    def heartbeat(self, process: str) -> Path:
        """The file with the sign of life of a process."""
        return self._folder / f"{process}.beat"

    def services_of(self, processes: Collection[str]) -> set[str]:
        return {name for process in processes for name in self.processes[process]}

    @property
    def hubs(self) -> list[Task]:
        return [self._hub(side) for side in self.endpoints]

    def _hub(self, side: str) -> Task:
        name, space = f"hub_{side}", namespace(self.stack.space)
        launch = HubLaunch(
            listen=[self.endpoints[side]],
            heartbeat=str(self.heartbeat(name)),
            parent=os.getpid(),
            tells=side == self.home,
        )
        if side == self.home:
            what = "drone" if self.other_side is None else self.other_side.side
            launch = msgspec.structs.replace(launch, here=here_key(space, what, self._start))
        border = self.other_side or (self._programs if side == HOME else None)
        if border is not None:
            launch = msgspec.structs.replace(
                launch,
                listen=[*launch.listen, *border.listen],
                connect=list(border.connect),
                hub_side=HubSide(
                    border.side, space, self._credentials, self._own_names(border.side)
                ),
            )
        command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
        return Task(name, command, self._log(name), stop_order=2)

    def _own_names(self, side: Side) -> tuple[str, ...]:
        """Under which only this machine's own health and log lines are believed."""
        return (*self.services, f"hub_{side}", supervisor_of(self.other_side))

    def process(self, process: str) -> Task:
        names = self.processes[process]
        last = [name for name in names if name in LAST]  # first in the list, to be closed last
        specs = {name: self.services[name] for name in dict.fromkeys([*last, *names])}
        launch = Launch(
            process=process,
            services=specs,
            stack=self.stack,
            stack_file=str(self.services.file),
            endpoints={side: self._reach[side] for spec in specs.values() for side in spec.sides},
            checkpoint=str(self.checkpoints),
            heartbeat=str(self.heartbeat(process)),
            parent=os.getpid(),
            keys=None if self._credentials is None else self._credentials.keys,
            copies=self._copies,
        )
        command = [*PYTHON, msgspec.json.encode(launch).decode()]
        return Task(
            process,
            command,
            self._log(process),
            stop_order=1 if last else 0,
            parts=() if names == [process] else tuple(names),
        )

    def carries_stop(self, process: str) -> bool:
        """Has a pilot his stop button in it, or does what it says go through it?"""
        specs = [(name, self.services[name]) for name in self.processes.get(process, ())]
        return not specs or any(s.gateway or code_of(n, s) in PILOTS for n, s in specs)

    def _log(self, name: str) -> Path:
        return self.stack.out_dir / "logs" / f"{name}.log"


def unused_folder(wanted: Path) -> Path:
    """A new folder of this name, or with a number where an earlier dive has left one: checkpoints
    of another dive must neither be restored in this one nor be overwritten.

    Raises:
        LindyError: it cannot be made.
    """
    for number in count(1):
        folder = wanted if number == 1 else wanted.with_name(f"{wanted.name}-{number}")
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError as error:
            raise LindyError(f"cannot make the folder {folder}: {reason(error)}") from None
        return folder
    raise AssertionError("numbers do not end")
