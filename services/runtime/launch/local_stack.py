"""A whole stack as processes on this machine: a hub for each side and every service; and what
systemd is told of it (Type=notify): that it is ready, works, or ends. The protocol is that of
sd_notify(3): a datagram of text to a unix socket. Without systemd there is no `NOTIFY_SOCKET`, and
nobody is told.
"""

import os
import socket
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from typing import Literal

import msgspec

from messages import events
from services.runtime.bus.access_control import Credentials, HubSide
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import ZenohBus, connected, listening
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import last_beat
from services.runtime.hosts.process_host import instance, usage
from services.runtime.launch.child import is_stuck
from services.runtime.launch.process_plan import LAST, Dive, ProcessPlan, runtime_folder
from services.runtime.launch.supervisor import HangDetector, Supervisor
from services.runtime.node.checkpoint import CheckpointFile, VolatileCheckpoint
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.node import Node
from services.runtime.os import system

SOCKET, PERIOD, PROCESS = "NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"


class Systemd:
    """Nothing here raises or waits, whatever has become of systemd."""

    def __init__(self, environment: Mapping[str, str], pid: int) -> None:
        """
        Args:
            pid: of this process; the watchdog may be meant for another one.
        """
        address = environment.get(SOCKET, "")
        self._address = f"\0{address[1:]}" if address.startswith("@") else address
        period_us = environment.get(PERIOD, "")
        watched = period_us.isdecimal() and environment.get(PROCESS, str(pid)) == str(pid)
        # Twice as often as it must be, as sd_watchdog_enabled(3) recommends; None: no watchdog.
        self._every_ns = int(period_us) * 1000 // 2 if watched else None
        self._due = 0  # [ns] next sign of life

    def ready(self) -> None:
        """Everything has started."""
        self._send("READY=1")

    def stopping(self) -> None:
        """The end was asked for."""
        self._send("STOPPING=1")

    def works(self, now: int) -> None:
        """Every process answers at `now` [ns]. Call it often. If it is not called for the time of
        the watchdog, systemd ends the whole side and starts it again."""
        if self._every_ns is not None and now >= self._due:
            self._due = now + self._every_ns
            self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        if not self._address or sys.platform == "win32":
            return
        with suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            sender.sendto(text.encode(), self._address)


SLOW = ("visualizer",)  # started when the others are alive: its libraries take a second to load
WATCH_NS = 100_000_000  # [ns] between two looks at the heartbeats
DISK_PATIENCE_S = 10.0  # [s] a slow disk may stop those of LAST before they are started again
PERIOD_S = 0.04  # [s] between two steps: ports that keep the newest 16 must not fill at 100 Hz
HUB_TIMEOUT_S = 20.0
RETRY_NS = 5_000_000_000  # [ns] until a note that could not be written is tried again


class RunNote:
    """`run.json` in a dive's folder, by which other programs find the dive that is going on. Goes
    at its end. Written by a thread of its own: a disk that hangs must not hold up whoever
    supervises."""

    def __init__(self, plan: ProcessPlan, warn: Callable[[str], None]) -> None:
        self._plan, self._warn = plan, warn
        self._path = plan.stack.out_dir / RUNNING
        self._file = CheckpointFile(self._path)
        self._pids: dict[str, int] = {}
        self._again_ns: int | None = None  # [ns] when a write that failed is tried again
        self._said = False

    def update(self, pids: dict[str, int], now: int) -> None:
        """Written atomically: on a full disk the older one stays, which is said once, and it is
        tried again.

        Args:
            pids: of the processes, by the names of their services and of the hubs.
            now: [ns] by any clock.
        """
        self._said = self._said and bool(self._file.why)
        if self._file.failures():
            self._again_ns = now + RETRY_NS
            if not self._said:
                self._said = True
                self._warn(f"cannot write {self._path}: {self._file.why}")
        due = self._again_ns is not None and now >= self._again_ns
        if pids == self._pids and not due:
            return
        self._pids, self._again_ns = pids, None
        running = Running(
            vehicle=self._plan.stack.space,
            endpoints=self._plan.endpoints,
            supervisor=os.getpid(),
            began=system.began(os.getpid()),
            pids=pids,
            stack_file=str(self._plan.services.file),
            vehicle_file=str(self._plan.stack.vehicle_path.resolve()),
            overrides=tuple(self._plan.stack.overrides),
        )
        self._file.save_checkpoint(msgspec.json.format(msgspec.json.encode(running)))

    def remove(self) -> None:
        self._file.close()
        with suppress(OSError):  # the disk may be read-only by now
            self._path.unlink(missing_ok=True)


class LocalStack:
    """The processes of a plan, kept running; made by `local_stack`, which also ends it."""

    def __init__(self, plan: ProcessPlan) -> None:
        self.plan = plan
        self.node: Node  # this process's own, on the pilot's side; set when the hubs are up
        self.shown: set[tuple[str, str]] = set()  # (side, service) whose token is there …
        self._ever_shown: set[tuple[str, str]] = set()  # … or was
        self.note = RunNote(plan, partial(self._tell, "warning"))
        self.supervisor = Supervisor(self._tell)
        self.hang_detector = HangDetector(dict.fromkeys(LAST, DISK_PATIENCE_S))
        self._systemd = Systemd(os.environ, os.getpid())
        self._watch_at = 0  # [ns] next look at the heartbeats
        self._tokens: deque[tuple[str, str, bool]] = deque()  # filled on the bus's thread
        self._wake = threading.Event()
        self._has_node = False
        self._later: list[str] = []  # processes that are not started yet

    @property
    def stack(self) -> Stack:
        return self.plan.stack

    def start_hubs(self, exits: ExitStack) -> None:
        """Start the hubs and connect to them.

        Raises:
            LindyError: a hub cannot listen on its endpoint.
        """
        plan, buses = self.plan, dict[str, ZenohBus]()
        self.supervisor.add(plan.hubs)
        deadline = time.monotonic() + HUB_TIMEOUT_S
        for side, endpoint in plan.endpoints.items():
            while side not in buses:
                self.pump()
                try:
                    session = connected(endpoint, namespace(plan.stack.space), 0.0)
                except LindyError:
                    if time.monotonic() > deadline:
                        raise
                    continue
                buses[side] = ZenohBus(exits.enter_context(session))
                buses[side].watch(partial(self._token, side))
                self.supervisor.seen(f"hub_{side}")  # one that cannot listen later is tried again
        here = plan.dive.side
        self.node = Node(
            plan.dive.supervisor,
            {plan.home: buses[plan.home]},
            time.monotonic_ns,
            VolatileCheckpoint(),
            clock_offset=None if here is None else ClockOffset(here),
        )
        self.node.wake, self.node.usage = self._wake.set, usage
        self.node.instance = instance()
        self._has_node = True

    def start_services(self) -> None:
        self.plan.keep_files(partial(self._tell, "warning"))
        every = self.plan.processes
        self._later = [name for name in every if self.plan.services_of([name]) <= set(SLOW)]
        self.supervisor.add(self.plan.process(name) for name in every if name not in self._later)

    def missing(self) -> list[str]:
        """Services that are not alive on all of their sides."""
        return self._without_a_token(self.shown)

    def wait_alive(self, timeout_s: float, look: Callable[[], bool]) -> None:
        """Wait until every service is alive. `look` is called repeatedly and must call `pump`; it
        ends the wait by returning False. A slow service is waited for as long, but the dive goes on
        without it: a viewer must not cost the pilot the sticks. So it does without one that was
        alive before: by now the drone may be armed, and the service is started again.

        Raises:
            LindyError: names those that were never alive after `timeout_s`.
        """
        deadline = time.monotonic() + timeout_s
        while (missing := self.missing()) and look():
            if time.monotonic() > deadline:
                late = f"not alive after {timeout_s:g} s: {', '.join(missing)}"
                if never := [n for n in self._without_a_token(self._ever_shown) if n not in SLOW]:
                    late = f"not alive after {timeout_s:g} s: {', '.join(never)}"
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
        self.note.update(self._each(self.supervisor.pids), time.monotonic_ns())
        if self._has_node:
            self._step_node()
        # Until a message arrives or a timer is due.
        due = self.node.deadline() if self._has_node else None
        seconds = PERIOD_S if due is None else (due - time.monotonic_ns()) / 1e9
        if seconds > 0:
            self._wake.wait(min(PERIOD_S, seconds))
        self._wake.clear()

    def _step_node(self) -> None:
        """Whatever a message does to the screen or to the summary: the services go on."""
        try:
            self.node.step()
        except LindyError:
            raise
        except Exception:
            self.node.tell(events.MISTAKE())
            if self.node.counts[events.MISTAKE.name] == 1:  # the others are most likely the same
                with suppress(OSError):  # whoever reads what this process prints may be gone
                    traceback.print_exc()

    def _token(self, side: str, key: str, alive: bool) -> None:
        self._tokens.append((side, key.rpartition("/")[2], alive))
        self._wake.set()

    def _hear_tokens(self) -> None:
        while self._tokens:
            side, service, alive = self._tokens.popleft()
            if not alive:
                self.shown.discard((side, service))
                continue
            self.shown.add((side, service))
            self._ever_shown.add((side, service))
            missing, processes = self.missing(), self.plan.processes
            for process, names in processes.items():
                if service in names and not set(names) & set(missing):  # it is whole with this one
                    self.supervisor.seen(process)

    def _without_a_token(self, tokens: set[tuple[str, str]]) -> list[str]:
        """Services that lack one on a side that has its hub on this machine."""
        sides = self.plan.endpoints
        return [
            name
            for name, spec in self.plan.services.items()
            if any((side, name) not in tokens for side in spec.sides if side in sides)
        ]

    def _start_slow(self) -> None:
        """Start the slow services, once they keep no other from the processor."""
        slow = self.plan.services_of(self._later)
        if slow and slow >= set(self.missing()):
            later = [self.plan.process(name) for name in self._later]
            self.supervisor.add(replace(task, needed=False) for task in later)
            self._later = []

    @property
    def restarts(self) -> dict[str, int]:
        """How often each hub and service was started again, by itself or with its process."""
        return self._each(self.supervisor.restarts)

    def _each(self, of_tasks: Mapping[str, int]) -> dict[str, int]:
        """What is known of each process, by the names of its services, and of each hub."""
        return {
            name: value
            for task, value in of_tasks.items()
            for name in self.plan.processes.get(task, [task])
        }

    def _watch(self) -> None:
        """Name what does not answer, and start it again where waiting longer is of no use."""
        now = time.monotonic_ns()
        if now < self._watch_at:
            return  # messages wake this process more often than a look is of use
        self._watch_at = now + WATCH_NS
        lives = self.supervisor.lives
        beats = {name: last_beat(self.plan.heartbeat(name)) for name in lives}
        for name, what in self.hang_detector.look(beats, lives, now, self._stuck):
            if what == "silent":
                self._tell("error", f"{name} does not answer any more")
            elif what == "again":
                self._tell("warning", f"{name} answers again")
            else:
                self.supervisor.kill(name)
        # One that waits for a dead disk must not cost the vehicle those that hold it.
        if all(
            set(self.plan.processes.get(name, ())) & set(LAST) for name in self.hang_detector.silent
        ):
            self._systemd.works(now)

    def _stuck(self, process: str) -> bool:
        """One on the way of the pilot's disarm that does nothing now."""
        pid = self.supervisor.pids.get(process)
        return pid is not None and self.plan.carries_stop(process) and is_stuck(pid)

    def end(self) -> None:
        """End all processes."""
        self._systemd.stopping()
        self.supervisor.stop()

    def _tell(self, level: Literal["info", "warning", "error"], text: str) -> None:
        if self._has_node:
            self.node.log(level, text)


@contextmanager
def local_stack(dive: Dive) -> Generator[LocalStack]:
    """Running hubs, without services yet; everything is ended when the block is left.

    Raises:
        LindyError: an endpoint is taken or malformed.
    """
    for endpoint in dive.listen:
        require_free(endpoint, dive.stack, dive.credentials)
    watched = dive.stack.watched or dive.services.watched
    if dive.side == "drone":  # nobody on board is above it
        watched = {**watched, dive.supervisor: "keeper"}
    dive = msgspec.structs.replace(dive, stack=msgspec.structs.replace(dive.stack, watched=watched))
    with runtime_folder() as folder:
        local = LocalStack(ProcessPlan(dive, folder))
        with ExitStack() as exits:
            exits.callback(local.note.remove)
            exits.callback(local.supervisor.stop)
            local.start_hubs(exits)
            try:
                yield local
            finally:
                local.end()  # the bus is still open, for the last log lines


def require_free(endpoint: str, stack: Stack, credentials: Credentials | None) -> None:
    """Check that a hub can listen there. The hub would fail too, but later and less clearly.

    Raises:
        LindyError: the endpoint is taken or malformed.
    """
    with listening(endpoint, hub_side=HubSide("drone", namespace(stack.space), credentials)):
        pass
