"""A dive as it is settled before anything of it is started on this machine, and which processes it
needs here, with which commands, endpoints and files."""

import os
import secrets
import shutil
import sys
import tempfile
from collections.abc import Callable, Collection, Generator
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

import services
from messages.topic import Side
from services.runtime.bus.access_control import Credentials, HubSide
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.bus.zenoh_bus import UNIX
from services.runtime.config.disk import fresh_folder, reason
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.process_host import HubLaunch, Launch
from services.runtime.hosts.registry import PILOTS, Registry
from services.runtime.hosts.stack_file import code_of
from services.runtime.launch.child import Task
from services.runtime.launch.supervisor import NAME
from services.runtime.node.checkpoint import write_safely
from services.runtime.os import system

PYTHON = [sys.executable, "-P", "-m", services.__name__]  # -P: nothing of the user's folder
CHECKPOINTS = "checkpoints"  # folder in the dive's folder; DIVE/checkpoints/<service>.json
HOME = "topside"  # the side this process's own node is on: it sees what the pilot sees
LAST = ("recorder", "visualizer")  # stopped after the others, so that they receive everything
LONGEST = 56  # [bytes] of the runtime folder's place; a socket's path must stay below 107
PREFIX = "lindy-run-"


class Dive(msgspec.Struct, frozen=True):
    """The part of a dive that is on this machine, checked."""

    stack: Stack  # what every service of the dive is told
    services: Registry  # of this machine
    side: Side | None = None  # of this machine; None: both sides are on it
    elsewhere: tuple[str, ...] = ()  # services of the other machine
    # Endpoints at which the other side reaches this hub; without another side, other programs.
    listen: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()  # … or at which this hub reaches the other side's
    gateway: str | None = None  # endpoint of the drone's hub, for a tether process between them
    credentials: Credentials | None = None  # for endpoints of and for other machines
    begin_with: dict[str, bytes] = {}  # files that the folder of the checkpoints begins with

    @property
    def supervisor(self) -> str:
        """Its name on the bus. Two machines have two, and each receives the other's health."""
        return NAME if self.side is None else f"{NAME}_{self.side}"


class ProcessPlan:
    """The hubs and processes of a dive."""

    def __init__(self, dive: Dive, folder: Path) -> None:
        """
        Args:
            folder: for sockets, heartbeats and copies, which end with this program.
        """
        self.dive, self.stack, self.services = dive, dive.stack, dive.services
        self.processes = dive.services.processes
        self._folder = folder
        # With keys, programs of other machines come in as they would at the drone's hub; the
        # services keep a private socket.
        self._border: dict[str, Side] = {}  # hub that other machines reach → side that it takes
        if dive.side is None and dive.credentials is not None and dive.listen:
            self._border = {HOME: "drone"}
        # A hub for each side; with two machines, only for sides that are a service's home here.
        homes_only = None if dive.side is None else 1
        specs = dive.services.values()
        sides = dict.fromkeys(s for spec in specs for s in spec.sides[:homes_only])
        self.endpoints = {side: f"{UNIX}{folder}/{side}.sock" for side in sides}
        self.home = HOME if HOME in sides else next(iter(sides))
        if dive.side is not None:
            self._border = dict.fromkeys(sides, dive.side)
        elif dive.listen and not self._border:
            self.endpoints[self.home] = dive.listen[0]
        self._reach = {**self.endpoints}  # what services connect to
        if dive.gateway is not None:
            self._reach["drone"] = dive.gateway
        self.checkpoints = dive.stack.out_dir / CHECKPOINTS  # numbered by `keep_files`
        self._copies: dict[str, str] = {}  # file → its copy in `folder`
        self._start = secrets.token_hex(8)  # tells this start from one of another drone of the name

    def keep_files(self, warn: Callable[[str], None]) -> None:
        """Make the folder of the checkpoints, and copies of the files that services read when they
        start, so that one that starts again in mid-dive finds what the others have found.

        Raises:
            LindyError: the folder cannot be made.
        """
        self._copy_files(warn)
        try:  # those of another dive must neither be restored in this one nor be overwritten
            self.checkpoints = fresh_folder(self.checkpoints)
        except OSError as error:
            why = f"cannot make the folder {self.checkpoints}: {reason(error)}"
            raise LindyError(why) from None
        for name, data in self.dive.begin_with.items():
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
        border = self._border.get(side)
        own = (*self.services, f"hub_{border}", self.dive.supervisor)
        launch = HubLaunch(
            listen=[self.endpoints[side], *(self.dive.listen if border else ())],
            connect=[*self.dive.connect] if border else [],
            hub_side=HubSide(border, space, self.dive.credentials, own) if border else None,
            here=here_key(space, self.dive.side or "drone", self._start)
            if side == self.home
            else "",
            heartbeat=str(self.heartbeat(name)),
            supervised=True,
        )
        command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
        return Task(name, command, self._log(name), stop_order=2)

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
            supervised=True,
            keys=None if self.dive.credentials is None else self.dive.credentials.keys,
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


@contextmanager
def runtime_folder() -> Generator[Path]:
    """A new folder for what the processes of one start share: sockets, heartbeats, copies of files.
    It is removed at the end; those of starts that were killed are removed now."""
    place = tempfile.gettempdir()
    place = place if len(place) <= LONGEST else "/tmp"
    sweep(Path(place))
    with tempfile.TemporaryDirectory(  # whose disk may have become read-only meanwhile
        prefix=PREFIX, dir=place, ignore_cleanup_errors=True
    ) as name:
        lock = system.lock(Path(name))  # ends with this process, however that ends
        try:
            yield Path(name)
        finally:
            if lock is not None:
                lock.release()


def sweep(place: Path) -> None:
    """Remove the folders whose start has ended without removing them: nobody holds their locks.
    An empty one may be new, and not locked yet; where a disk has no locks, nothing is known."""
    for folder in place.glob(f"{PREFIX}*"):
        with suppress(OSError):  # somebody else's
            if folder.is_symlink() or not any(folder.iterdir()):
                continue
            if (lock := system.lock(folder)) is None:
                continue
            if lock.descriptor is not None:
                shutil.rmtree(folder, ignore_errors=True)
            lock.release()
