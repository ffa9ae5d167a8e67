"""One service, or several, as one OS process: one Zenoh session per side, real time, a clean end.

The process ends on SIGINT or SIGTERM, when its parent dies (within two seconds, even if a handler
hangs), or with one sentence and status 1 when a setting is wrong.
"""

import contextlib
import os
import secrets
import signal
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from threading import Thread

import msgspec

from messages.health import LogLine
from services.runtime.bus.access_control import HubSide, KeyFiles
from services.runtime.bus.envelope import Bus
from services.runtime.bus.shared_bus import SharedBus, SharedBusPort
from services.runtime.bus.zenoh_bus import (
    announce_here,
    close_without_waiting,
    listening,
    open_bus,
    watch_callers,
)
from services.runtime.config.errors import LindyError
from services.runtime.config.settings import reading_copies
from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import POLL_S, Heartbeat, Loop, rare_collections
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.node.checkpoint import CheckpointFile
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.loop_stats import Instance, Usage
from services.runtime.node.node import Node
from services.runtime.os import system

EXIT_S = 5.0  # [s] for the interpreter, when everything is closed
GRACE_S = 1.0  # after the parent's death: time to close files before the process is ended


class Launch(msgspec.Struct, frozen=True, kw_only=True):
    """Everything a process with services needs, as one JSON argument."""

    process: str  # its name
    services: dict[str, ServiceSpec]  # in the order of their turns; the first is closed last
    stack: Stack
    stack_file: str
    endpoints: dict[str, str]  # side → hub's endpoint, for every side of these services
    checkpoint: str  # folder of the checkpoints, for a restart after a crash
    heartbeat: str | None = None  # file for the sign of life; None: nobody watches
    supervised: bool = False  # it ends when its parent, at the other end of its stdin, wants it
    keys: KeyFiles | None = None  # for hubs of other machines
    copies: dict[str, str] = {}  # file → copy made when the dive was started, to be read instead


class StopFlag:
    """Set by SIGINT, SIGTERM and the parent's death."""

    def __init__(self) -> None:
        self.asked = False

    def ask(self, *_: object) -> None:
        self.asked = True


def run_services(launch: Launch) -> int:
    """Run the services of a process until it is asked to stop. Returns the exit status."""
    with (
        _stoppable(supervised=launch.supervised) as stop,
        _sentences(launch.process),
        ExitStack() as exits,
    ):
        copies = exits.enter_context(ExitStack())
        copies.enter_context(reading_copies(launch.copies))
        registry = Registry(Path(launch.stack_file), launch.services)
        # Imports take long: all of them are done before the first node hears anything.
        wires = {name: registry.wire(name) for name in launch.services}
        sessions = {
            side: exits.enter_context(open_bus(endpoint, launch.stack.space, launch.keys))
            for side, endpoint in launch.endpoints.items()
        }
        shared = {s: SharedBus(own) for s, own in sessions.items()} if len(wires) > 1 else {}

        def end(side: str) -> Bus:
            """A service that is alone has the session itself."""
            return SharedBusPort(shared[side]) if shared else sessions[side]

        nodes: list[Node] = []
        for name, wire in wires.items():
            node = _node(name, launch, end, exits)
            wire(node, launch.stack)
            exits.enter_context(_blaming(registry, lambda name=name: name))
            exits.callback(node.close)
            nodes.append(node)
        copies.close()  # what is asked for from now on is read as it is then
        # What writes files, or is somebody else's, may hold up the thread that it runs on.
        own = all(spec.module is None for spec in launch.services.values())
        quick = own and not any(node.collects for node in nodes)
        loop = Loop(nodes, usage, on_arrival=quick)
        exits.enter_context(_blaming(registry, lambda: loop.running))
        for name, spec in launch.services.items():
            for side in spec.sides:
                sessions[side].announce(name)
        exits.enter_context(rare_collections())
        heartbeat = Heartbeat(None if launch.heartbeat is None else Path(launch.heartbeat))
        if heartbeat.unwatched:
            nodes[0].log("warning", heartbeat.unwatched)
        while not stop.asked:
            heartbeat.beat(time.monotonic_ns())
            loop.step_and_wait()
        loop.finish()  # messages that arrived with the signal are still handled
        return 0
    return 1


def _node(name: str, launch: Launch, end: Callable[[str], Bus], exits: ExitStack) -> Node:
    """The node of a service, not yet wired."""
    spec, home = launch.services[name], launch.services[name].sides[0]
    checkpoint = CheckpointFile(Path(launch.checkpoint) / f"{name}.json")
    exits.callback(checkpoint.close)
    clock_offset = (
        ClockOffset("topside" if home == "topside" else "drone") if launch.stack.apart else None
    )
    node = Node(
        name,
        {side: end(side) for side in spec.sides},
        time.monotonic_ns,
        checkpoint,
        gateway=spec.gateway,
        clock_offset=clock_offset,
        replay=launch.stack.replay,
    )
    node.show, node.instance = _show, instance()
    node.wall_offset_ns = time.time_ns() - time.monotonic_ns()
    return node


class HubLaunch(msgspec.Struct, frozen=True, kw_only=True):
    """Everything a hub process needs, as one JSON argument."""

    listen: list[str]  # endpoints
    connect: list[str] = []  # endpoints of other machines' hubs
    hub_side: HubSide | None = None  # for access control, where other machines can reach it
    here: str = ""  # key of the liveliness token that says that this side is there
    heartbeat: str | None = None  # file for the sign of life; None: nobody watches
    supervised: bool = False  # as of a `Launch`


class CallerLog:
    """Who comes to a hub from another machine, and who leaves: each the first, tenth, hundredth …
    time, because who is not admitted may try for hours."""

    def __init__(self, admitted: Sequence[str]) -> None:
        self._admitted = frozenset(admitted)
        self._times: Counter[tuple[str, bool]] = Counter()

    def see(self, name: str, connected: bool) -> None:
        """Somebody has connected or left. Called on Zenoh's thread."""
        self._times[name, connected] += 1
        times = self._times[name, connected]
        if str(times).rstrip("0") != "1":
            return
        again = "" if times == 1 else f" ({times} times)"
        text = f"{name} {'connected' if connected else 'left'}{again}"
        if name in self._admitted:
            line = f"info hub: {text}"
        else:
            line = f"warning hub: {text}; it is not admitted, and can neither hear nor say anything"
        with contextlib.suppress(OSError):  # a full disk under the log
            print(line, file=sys.stderr, flush=True)


def run_hub(launch: HubLaunch) -> int:
    """Run a side's hub, which is a Zenoh router, until it is asked to stop."""
    with (
        _stoppable(supervised=launch.supervised) as stop,
        _sentences("hub"),
        listening(*launch.listen, connect=launch.connect, hub_side=launch.hub_side) as session,
    ):
        _closing = close_without_waiting(session)
        border = launch.hub_side
        if border is not None and border.credentials is not None:
            _watching = watch_callers(session, CallerLog(border.credentials.admitted).see)
        if launch.here:
            _here = announce_here(session, launch.here)
        heartbeat = Heartbeat(None if launch.heartbeat is None else Path(launch.heartbeat))
        while not stop.asked:
            heartbeat.beat(time.monotonic_ns())
            time.sleep(POLL_S)  # the router works on its own threads
        return 0
    return 1


@contextmanager
def _stoppable(*, supervised: bool) -> Generator[StopFlag]:
    stop = StopFlag()
    signal.signal(signal.SIGINT, stop.ask)
    signal.signal(signal.SIGTERM, stop.ask)
    system.exact_timers()
    if supervised:
        Thread(target=_follow, args=(stop,), daemon=True).start()
    try:
        yield stop
    finally:  # the process ends: a further signal must not change its status
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        # Zenoh waits for ever for a thread that it could not start, and so would the supervisor.
        system.end_within(EXIT_S)


@contextmanager
def _blaming(registry: Registry, service: Callable[[], str]) -> Generator[None]:
    """Name the service and the line where a handler failed. One that calls `sys.exit` fails as
    well, whatever status it asks for."""
    try:
        yield
    except LindyError:
        raise
    except (Exception, SystemExit) as error:
        raise registry.failure(service(), error) from error


@contextmanager
def _sentences(who: str) -> Generator[None]:
    """Print a user error as one sentence on stderr; the caller then returns 1."""
    try:
        yield
    except LindyError as error:
        if error.__cause__ is not None:  # an error in a user's module: details for the log
            traceback.print_exception(error.__cause__)
        print(f"lindy {who}: {error}", file=sys.stderr, flush=True)


def _follow(stop: StopFlag) -> None:
    """Set the flag when the parent wants it or has ended; then end the process, if the flag does
    not."""
    asked = system.wait_until_unwanted()
    stop.ask()
    if not asked:  # nobody watches how it ends
        time.sleep(GRACE_S)  # for the main thread to close files
        os._exit(2)


def _show(line: LogLine) -> None:
    with contextlib.suppress(OSError):  # a full disk under the log; the bus has the line as well
        print(f"{line.level} {line.service}: {line.text}", file=sys.stderr, flush=True)


@cache
def instance() -> Instance:
    """This process, told apart from every other one, on any machine."""
    return Instance(number=1 + secrets.randbits(52), pid=os.getpid())


def usage() -> Usage:
    """CPU time and memory of this process."""
    return Usage(cpu_s=time.process_time(), rss_mb=system.memory_mb())
