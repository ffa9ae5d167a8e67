"""A whole stack as processes on this machine: a hub for each side and every service."""

import os
import secrets
import sys
import tempfile
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from messages.topic import Side
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.key_files import Door
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.bus.zenoh_bus import ZenohBus, connected, listening
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.heartbeat import last_beat
from services.runtime.hosts.process_host import HubLaunch, Launch, instance, usage
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.spare import Spare
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.answering import Answering
from services.runtime.launch.child import Child, OsChild, Task
from services.runtime.launch.supervisor import NAME, Supervisor
from services.runtime.launch.systemd import Systemd
from services.runtime.node.checkpoint import VolatileCheckpoint, write_safely
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.node import Node

CHECKPOINTS = "checkpoints"  # folder in the dive's folder; DIVE/checkpoints/<service>.json
HOME = "topside"  # the side this process's own node is on: it sees what the pilot sees
LAST = ("recorder", "visualizer")  # stopped after the others, so that they receive everything
SLOW = ("visualizer",)  # started when the others are alive: its libraries take a second to load
WATCH_NS = 100_000_000  # [ns] between two looks at the heartbeats
DISK_PATIENCE_S = 10.0  # [s] a slow disk may stop those of LAST before they are started again
PYTHON = [sys.executable, "-P", "-m", "services"]  # -P: nothing in the user's folder is imported
PERIOD_S = 0.04  # [s] between two steps: ports that keep the newest 16 must not fill at 100 Hz
HUB_TIMEOUT_S = 20.0
LONGEST_FOLDER = 60  # [bytes] a socket's path must stay below 107


class OtherSide(NamedTuple):
    """The other side, where it is another machine."""

    side: Side  # of this machine
    listen: tuple[str, ...] = ()  # endpoints at which the other side reaches this hub
    connect: tuple[str, ...] = ()  # … or at which this hub reaches the other's
    gateway: str | None = None  # endpoint of the drone's hub, for a tether process between them


class LocalStack:
    """Made by `local_stack`, which also ends it."""

    def __init__(
        self,
        stack: Stack,
        services: Registry,
        folder: Path,
        listen: str | None,
        other_side: "OtherSide | None",
        begin_with: Mapping[str, bytes],
        door: Door | None,
        spawn: Callable[[Task], Child] = OsChild,
    ) -> None:
        self._other_side = other_side
        self._begin_with = begin_with
        self._door = door
        # Behind a door, programs of other machines come in as they would at the drone's hub; the
        # services keep a private socket.
        self._programs = None if door is None or listen is None else OtherSide("drone", (listen,))
        listen = None if self._programs is not None else listen
        self.stack = stack
        self.services = services
        self.endpoints = _endpoints(services, folder, listen, only_homes=other_side is not None)
        self._reach = {**self.endpoints}  # what services connect to
        if other_side is not None and other_side.gateway is not None:
            self._reach["drone"] = other_side.gateway
        self.processes = services.processes
        self.supervisor = Supervisor(self._tell, spawn)
        self.node: Node  # this process's own, on the pilot's side; set when the hubs are up
        self.alive: set[tuple[str, str]] = set()  # (side, service)
        self.replaced = False  # by another one of this program, which goes on
        self.announced = True  # in run.json
        self.changes = False  # … where its pilot may take another drone
        self.answering = Answering(dict.fromkeys(LAST, DISK_PATIENCE_S))
        self._systemd = Systemd(os.environ, os.getpid())
        self._folder = folder
        self._watch_at = 0  # [ns] next look at the heartbeats
        self.checkpoints = stack.out_dir / CHECKPOINTS  # numbered by start_services if it exists
        self._tokens: deque[tuple[str, str, bool]] = deque()  # filled on the bus's thread
        self._buses: dict[str, ZenohBus] = {}
        self._wake = threading.Event()
        self._start = secrets.token_hex(8)  # tells this start from one of another drone of the name
        self._pids: dict[str, int] = {}
        self._has_node = False
        self._copies: dict[str, str] = {}  # file → its copy in `folder`
        self._later: list[str] = []  # processes that are not started yet
        self._resting: set[str] = set()  # services that are not to run now

    def start_hubs(self, exits: ExitStack) -> None:
        """Start the hubs and connect to them.

        Raises:
            LindyError: a hub cannot listen on its endpoint.
        """
        self.supervisor.add(self._hub(side) for side in self.endpoints)
        deadline = time.monotonic() + HUB_TIMEOUT_S
        for side, endpoint in self.endpoints.items():
            while side not in self._buses:
                self.pump()
                try:
                    session = connected(endpoint, namespace(self.stack.space), 0.0)
                except LindyError:
                    if time.monotonic() > deadline:
                        raise
                    continue
                bus = ZenohBus(exits.enter_context(session))
                bus.watch(partial(self._token, side))
                self._buses[side] = bus
        home = HOME if HOME in self._buses else next(iter(self._buses))
        offset = None if self._other_side is None else ClockOffset(self._other_side.side)
        bus = {home: self._buses[home]}
        # Two machines have two supervisors, and each receives the other's health messages.
        name = NAME if self._other_side is None else f"{NAME}_{self._other_side.side}"
        self.node = Node(name, bus, time.monotonic_ns, VolatileCheckpoint(), clock_offset=offset)
        self.node.wake, self.node.usage = self._wake.set, usage
        self.node.instance = instance()
        self._has_node = True

    def start_services(self, resting: Collection[str] = ()) -> None:
        """
        Args:
            resting: processes that wait for `begin`.
        """
        self._resting = self._services_of(resting)
        self._copies = self._copied()
        self.checkpoints = _unused_folder(self.checkpoints)
        for name, data in self._begin_with.items():
            write_safely(self.checkpoints / f"{name}.json", data)
        begun = [name for name in self.processes if name not in resting]
        self._later = [name for name in begun if set(self.processes[name]) <= set(SLOW)]
        self.supervisor.add(self._process(name) for name in begun if name not in self._later)

    def begin(self, processes: Collection[str]) -> None:
        """Start processes that rest."""
        self._resting -= self._services_of(processes)
        self.supervisor.add(self._process(name) for name in processes)

    def rest(self, processes: Collection[str]) -> None:
        """Ask these to end, while the others go on."""
        self._resting |= self._services_of(processes)
        self.supervisor.ask_to_end(processes)

    def has_ended(self, processes: Collection[str]) -> bool:
        return not any(name in self.supervisor.pids for name in processes)

    def _services_of(self, processes: Collection[str]) -> set[str]:
        return {name for process in processes for name in self.processes[process]}

    @property
    def spares(self) -> dict[str, Spare]:
        """What a process of each name may import before it is known what it will work for; of the
        hubs, too."""
        hubs = {f"hub_{side}": Spare() for side in self.endpoints}
        return hubs | {
            process: Spare({n: self.services[n] for n in names}, str(self.services.file))
            for process, names in self.processes.items()
        }

    def _copied(self) -> dict[str, str]:
        """Copies of the files that services read when they start, so that one that starts again in
        mid-dive finds what the others have found."""
        copies: dict[str, str] = {}
        for number, path in enumerate(self.stack.files):
            copy = self._folder / f"{number}-{path.name}"
            try:
                copy.write_bytes(path.read_bytes())
                written_ns = path.stat().st_mtime_ns  # which a recording says
                os.utime(copy, ns=(written_ns, written_ns))
            except OSError as error:
                self._tell("warning", f"cannot keep a copy of {path}: {reason(error)}")
            else:
                copies[str(path)] = str(copy)
        return copies

    def _start_slow(self) -> None:
        """Start the slow services, once they keep no other from the processor."""
        slow = {name for process in self._later for name in self.processes[process]}
        if slow and slow >= set(self.missing()):
            self.supervisor.add(self._process(name) for name in self._later)
            self._later = []

    def missing(self) -> list[str]:
        """Services that are to run and are not alive on all of their sides."""
        return [
            name
            for name, spec in self.services.items()
            if name not in self._resting
            if any((side, name) not in self.alive for side in spec.sides if side in self._buses)
        ]

    def wait_alive(self, timeout_s: float, look: Callable[[], bool]) -> None:
        """Wait until every service is alive. `look` is called repeatedly and must call `pump`; it
        ends the wait by returning False. A slow service is waited for as long, but the dive goes on
        without it: a viewer must not cost the pilot the sticks.

        Raises:
            LindyError: names those that are missing after `timeout_s`.
        """
        deadline = time.monotonic() + timeout_s
        while (missing := self.missing()) and look():
            if time.monotonic() > deadline:
                late = f"not alive after {timeout_s:g} s: {', '.join(missing)}"
                if not set(missing) <= set(SLOW):
                    raise LindyError(f"{late} (see {self.stack.out_dir / 'logs'})")
                self._tell("warning", f"{late}; the dive goes on")
                break
        if set(missing) <= set(SLOW):
            self._systemd.ready()

    def pump(self) -> None:
        """Handle whatever is due, then wait for a short time. Call it in a loop.

        Raises:
            LindyError: a service cannot start; the sentence is the service's own.
        """
        self._hear_tokens()
        self._start_slow()
        self.supervisor.step()
        if self.supervisor.failure is not None:
            raise LindyError(self.supervisor.failure)
        self._watch()
        self._note_pids()
        if self._has_node:
            self._step_node()
        self._wait()

    def _step_node(self) -> None:
        """Whatever a message does to the screen or to the summary: the services go on."""
        try:
            self.node.step()
        except LindyError:
            raise
        except Exception:
            self.node.count("mistake")
            if self.node.counts["mistake"] == 1:  # the others are most likely the same
                with suppress(OSError):  # whoever reads what this process prints may be gone
                    traceback.print_exc()

    def _wait(self) -> None:
        """Wait until a message arrives or a timer is due, at most `PERIOD_S`."""
        due = self.node.deadline() if self._has_node else None
        seconds = PERIOD_S if due is None else (due - time.monotonic_ns()) / 1e9
        if seconds > 0:
            self._wake.wait(min(PERIOD_S, seconds))
        self._wake.clear()

    def _token(self, side: str, service: str, alive: bool) -> None:
        self._tokens.append((side, service, alive))
        self._wake.set()

    def _hear_tokens(self) -> None:
        while self._tokens:
            side, service, alive = self._tokens.popleft()
            if not alive:
                self.alive.discard((side, service))
                continue
            self.alive.add((side, service))
            spec, missing = self.services.get(service), self.missing()
            process = service if spec is None else spec.process or service
            if not any(name in missing for name in self.processes.get(process, ())):
                self.supervisor.seen(process)

    @property
    def restarts(self) -> dict[str, int]:
        """How often each hub and service was started again, by itself or with its process."""
        return self._each(self.supervisor.restarts)

    def _each(self, of_tasks: Mapping[str, int]) -> dict[str, int]:
        """What is known of each process, by the names of its services, and of each hub."""
        return {
            name: value
            for task, value in of_tasks.items()
            for name in self.processes.get(task, [task])
        }

    def _watch(self) -> None:
        """Name what does not answer, and start it again where waiting longer is of no use."""
        now = time.monotonic_ns()
        if now < self._watch_at:
            return  # messages wake this process more often than a look is of use
        self._watch_at = now + WATCH_NS
        beats = {name: last_beat(self.heartbeat(name)) for name in self.supervisor.lives}
        for name, what in self.answering.look(beats, self.supervisor.lives, now):
            if what == "silent":
                self._tell("error", f"{name} does not answer any more")
            elif what == "again":
                self._tell("warning", f"{name} answers again")
            else:
                self.supervisor.kill(name)
        # One that waits for a dead disk must not cost the vehicle those that hold it.
        if all(set(self.processes.get(name, ())) & set(LAST) for name in self.answering.silent):
            self._systemd.works(now)

    def end(self) -> None:
        """End all processes."""
        if not self.replaced:
            self._systemd.stopping()
        self.supervisor.stop()

    def heartbeat(self, process: str) -> Path:
        """The file with the sign of life of a process."""
        return self._folder / f"{process}.beat"

    def _note_pids(self) -> None:
        if self.announced and (pids := self._each(self.supervisor.pids)) != self._pids:
            self._pids = pids
            running = Running(
                self.stack.space,
                self.endpoints,
                os.getpid(),
                pids,
                str(self.services.file),
                self.changes,
            )
            self._publish(msgspec.json.format(msgspec.json.encode(running)))

    def _publish(self, data: bytes) -> None:
        """Write `run.json` atomically: on a full disk the older one stays."""
        path = self.stack.out_dir / RUNNING
        fresh = path.with_name(f".{RUNNING}-{os.getpid()}")
        try:
            fresh.write_bytes(data)
            fresh.replace(path)
        except OSError as error:
            fresh.unlink(missing_ok=True)
            self._tell("warning", f"cannot write {path}: {reason(error)}")

    def _hub(self, side: str) -> Task:
        name = f"hub_{side}"
        beat = str(self.heartbeat(name))
        launch = HubLaunch(
            listen=[self.endpoints[side]],
            heartbeat=beat,
            parent=os.getpid(),
            tells=side == (HOME if HOME in self.endpoints else next(iter(self.endpoints))),
        )
        if side == (HOME if HOME in self.endpoints else next(iter(self.endpoints))):
            what = "drone" if self._other_side is None else self._other_side.side
            here = here_key(namespace(self.stack.space), what, self._start)
            launch = msgspec.structs.replace(launch, here=here)
        border = self._other_side or (self._programs if side == HOME else None)
        if border is not None:
            hub_side = HubSide(border.side, namespace(self.stack.space), self._door)
            launch = msgspec.structs.replace(
                launch,
                listen=[*launch.listen, *border.listen],
                connect=list(border.connect),
                hub_side=hub_side,
            )
        command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
        return Task(name, command, self._log(name), stop_order=2)

    def _process(self, process: str) -> Task:
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
            keys=None if self._door is None else self._door.keys,
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

    def _log(self, name: str) -> Path:
        return self.stack.out_dir / "logs" / f"{name}.log"

    def _tell(self, level: Literal["info", "warning", "error"], text: str) -> None:
        if self._has_node:
            self.node.log(level, text)


@contextmanager
def local_stack(
    stack: Stack,
    services: Registry,
    listen: str | None = None,
    other_side: OtherSide | None = None,
    begin_with: Mapping[str, bytes] | None = None,
    door: Door | None = None,
    spawn: Callable[[Task], Child] = OsChild,
) -> Generator[LocalStack]:
    """Running hubs, without services yet; everything is ended when the block is left.

    Args:
        listen: endpoint on which the pilot's hub listens instead of a private socket, so that
            programs outside the stack can connect.
        other_side: where it is another machine; `services` are then those of this one.
        begin_with: checkpoints by service, of an earlier start.
        door: for endpoints of and for other machines.
        spawn: starts a process.

    Raises:
        LindyError: the endpoint is taken or malformed.
    """
    for endpoint in filter(None, (listen, *(other_side.listen if other_side is not None else ()))):
        require_free(endpoint, stack, door)
    with tempfile.TemporaryDirectory(prefix="lindy-", dir=_socket_folder()) as folder:
        local = LocalStack(
            stack, services, Path(folder), listen, other_side, begin_with or {}, door, spawn
        )
        with ExitStack() as exits:
            exits.callback((stack.out_dir / RUNNING).unlink, missing_ok=True)
            exits.callback(local.supervisor.stop)
            local.start_hubs(exits)
            try:
                yield local
            finally:
                local.end()  # the bus is still open, for the last log lines


def require_free(endpoint: str, stack: Stack, door: Door | None) -> None:
    """Check that a hub can listen there. The hub would fail too, but later and less clearly.

    Raises:
        LindyError: the endpoint is taken or malformed.
    """
    with listening(endpoint, hub_side=HubSide("drone", namespace(stack.space), door)):
        pass


def _endpoints(
    services: Mapping[str, ServiceSpec], folder: Path, listen: str | None, *, only_homes: bool
) -> dict[str, str]:
    """A hub for each side; with two machines, only for sides that are a service's home here."""
    sides = dict.fromkeys(
        side for spec in services.values() for side in spec.sides[: 1 if only_homes else None]
    )
    endpoints = {side: f"unixsock-stream/{folder}/{side}.sock" for side in sides}
    if listen is not None:
        endpoints[HOME if HOME in endpoints else next(iter(endpoints))] = listen
    return endpoints


def _unused_folder(wanted: Path) -> Path:
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
            raise LindyError(f"cannot make the folder {folder}: {error.strerror}") from None
        return folder
    raise AssertionError("numbers do not end")


def _socket_folder() -> str:
    folder = tempfile.gettempdir()
    return folder if len(folder) <= LONGEST_FOLDER else "/tmp"
