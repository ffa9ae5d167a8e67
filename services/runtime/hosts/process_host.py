"""One service as one OS process: one Zenoh session per side, real time, a clean end.

The process ends on SIGINT or SIGTERM, when its parent dies (within two seconds, even if a handler
hangs), or with one sentence and status 1 when a setting is wrong.
"""

import contextlib
import ctypes
import os
import resource
import signal
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec

from messages.health import LogLine
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.key_files import KeyFiles
from services.runtime.bus.zenoh_bus import listening, open_bus, watch_callers
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.garbage_collection import rare_collections
from services.runtime.hosts.registry import Registry, ServiceSpec
from services.runtime.node.checkpoint import CheckpointFile
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.loop_stats import Usage
from services.runtime.node.node import Node

POLL_S = 0.1  # longest wait between two looks at the stop flag
GRACE_S = 1.0  # after the parent's death: time to close files before the process is ended


class Launch(msgspec.Struct, frozen=True, kw_only=True):
    """Everything a service process needs, as one JSON argument."""

    service: str
    stack: Stack
    spec: ServiceSpec  # its table in the stack file
    stack_file: str
    endpoints: dict[str, str]  # side → hub's endpoint; the first side is home
    checkpoint: str  # folder of the checkpoints, for a restart after a crash
    parent: int | None = None  # pid; the process ends when this is no longer its parent
    keys: KeyFiles | None = None  # for hubs of other machines


class StopFlag:
    """Set by SIGINT, SIGTERM and the parent's death."""

    def __init__(self) -> None:
        self.asked = False

    def ask(self, *_: object) -> None:
        self.asked = True


def run_service(launch: Launch) -> int:
    """Run a service until it is asked to stop. Returns the exit status."""
    with _stoppable(launch.parent) as stop, _sentences(launch.service), ExitStack() as exits:
        vehicle = launch.stack.vehicle_name
        buses = {
            side: exits.enter_context(open_bus(endpoint, vehicle, launch.keys))
            for side, endpoint in launch.endpoints.items()
        }
        checkpoint = CheckpointFile(Path(launch.checkpoint) / f"{launch.service}.json")
        exits.callback(checkpoint.close)
        home = next(iter(launch.endpoints))
        clock_offset = (
            ClockOffset("topside" if home == "topside" else "drone") if launch.stack.apart else None
        )
        node = Node(
            launch.service,
            buses,
            time.monotonic_ns,
            checkpoint,
            gateway=launch.spec.gateway,
            clock_offset=clock_offset,
        )
        node.show, node.usage = _show, usage
        node.wall_offset_ns = time.time_ns() - time.monotonic_ns()
        event = threading.Event()
        node.wake = event.set
        registry = Registry(Path(launch.stack_file), {launch.service: launch.spec})
        registry.wire(launch.service)(node, launch.stack)
        exits.enter_context(_blaming(registry, launch.service))
        exits.callback(node.close)
        for bus in buses.values():
            bus.announce(launch.service)
        exits.enter_context(rare_collections())
        while not stop.asked:
            node.step()
            _wait(node, event)
        node.step()  # messages that arrived with the signal are still handled
        return 0
    return 1


class HubLaunch(msgspec.Struct, frozen=True, kw_only=True):
    """Everything a hub process needs, as one JSON argument."""

    listen: list[str]  # endpoints
    connect: list[str] = []  # endpoints of other machines' hubs
    hub_side: HubSide | None = None  # for access control, where other machines can reach it
    parent: int | None = None


def run_hub(launch: HubLaunch) -> int:
    """Run a side's hub, which is a Zenoh router, until it is asked to stop."""
    with (
        _stoppable(launch.parent) as stop,
        _sentences("hub"),
        listening(*launch.listen, connect=launch.connect, hub_side=launch.hub_side) as session,
    ):
        door = None if launch.hub_side is None else launch.hub_side.door
        if door is not None:
            _watching = watch_callers(session, Callers(door.admitted).see)
        while not stop.asked:
            time.sleep(POLL_S)  # the router works on its own threads
        return 0
    return 1


class Callers:
    """Says in the hub's log who connects and who leaves: for each, the first, tenth, hundredth …
    time, because who is not admitted may try for hours."""

    def __init__(self, admitted: Sequence[str]) -> None:
        self._admitted = frozenset(admitted)
        self._times: Counter[tuple[str, bool]] = Counter()

    def see(self, name: str, connected: bool) -> None:
        self._times[name, connected] += 1
        times = self._times[name, connected]
        if str(times).rstrip("0") == "1":
            with contextlib.suppress(OSError):  # a full disk under the log
                print(self._in_words(name, connected, times), file=sys.stderr, flush=True)

    def _in_words(self, name: str, connected: bool, times: int) -> str:
        again = "" if times == 1 else f" ({times} times)"
        if name in self._admitted:
            return f"info hub: {name} {'connected' if connected else 'left'}{again}"
        return (
            f"warning hub: {name} {'connected' if connected else 'left'}{again}; it is not admitted"
            f", and can neither hear nor say anything"
        )


def _wait(node: Node, event: threading.Event) -> None:
    """Wait until a message arrives, a timer is due, or it is time to check the stop flag."""
    seconds = min(POLL_S, (node.deadline() - time.monotonic_ns()) / 1e9)
    if seconds > 0:
        event.wait(seconds)
    event.clear()


@contextmanager
def _stoppable(parent: int | None) -> Generator[StopFlag]:
    stop = StopFlag()
    signal.signal(signal.SIGINT, stop.ask)
    signal.signal(signal.SIGTERM, stop.ask)
    _exact_timers()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent, stop), daemon=True).start()
    yield stop


@contextmanager
def _blaming(registry: Registry, service: str) -> Generator[None]:
    """Name the line where a handler failed. One that calls `sys.exit` fails as well, whatever
    status it asks for."""
    try:
        yield
    except LindyError:
        raise
    except (Exception, SystemExit) as error:
        raise registry.failure(service, error) from error


@contextmanager
def _sentences(who: str) -> Generator[None]:
    """Print a user error as one sentence on stderr; the caller then returns 1."""
    try:
        yield
    except LindyError as error:
        if error.__cause__ is not None:  # an error in a user's module: details for the log
            traceback.print_exception(error.__cause__)
        print(f"lindy {who}: {error}", file=sys.stderr, flush=True)


def _follow(parent: int, stop: StopFlag) -> None:
    """Set the flag when the parent has ended; end the process if that does not stop it."""
    while os.getppid() == parent:
        time.sleep(0.2)  # the kernel does not tell a process that its parent died
    stop.ask()
    time.sleep(GRACE_S)  # for the main thread to close files
    os._exit(2)


def _exact_timers() -> None:
    """Timer slack of 1 ns instead of 50 µs, where Linux offers it: half the lateness."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(29, 1, 0, 0, 0)  # PR_SET_TIMERSLACK


def _show(line: LogLine) -> None:
    with contextlib.suppress(OSError):  # a full disk under the log; the bus has the line as well
        print(f"{line.level} {line.service}: {line.text}", file=sys.stderr, flush=True)


def usage() -> Usage:
    """CPU time and memory of this process."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        rss_mb = pages * resource.getpagesize() / 1e6
    except OSError:  # not Linux: only the peak is known
        rss_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return Usage(cpu_s=time.process_time(), rss_mb=rss_mb)
