"""Any set of services in one process on virtual time.

Messages are encoded, sent over an in-memory bus and decoded, as on a network. Nothing depends on
real time or on the order of threads, so the same stack and seed give the same bytes. Computing
takes no virtual time: latencies come from the link and the scheduling only.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from math import ceil

import msgspec

from messages.health import LogLine
from services.runtime.bus.memory_bus import MemoryBus, MemoryBusPort
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry, Wire, wire_of
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.node.checkpoint import CheckpointStore, VolatileCheckpoint
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.node import Node

ROUNDS = 1000  # steps at one instant before it counts as an endless loop


@dataclass(frozen=True, slots=True)
class Skew:
    """A machine's clock relative to the host's."""

    ahead_ns: int = 0  # [ns] at the beginning
    drift: float = 0.0  # [-] seconds gained per second

    def shows(self, host_ns: int) -> int:
        return host_ns + self.ahead_ns + round(self.drift * host_ns)

    def first_shows(self, local_ns: int) -> int:
        """[ns] Host time at which the clock reaches `local_ns`."""
        return ceil((local_ns - self.ahead_ns) / (1.0 + self.drift))


SAME = Skew()


class VirtualHost:
    """Owns virtual time, the bus of each side and the nodes."""

    def __init__(self, clocks: Mapping[str, Skew] | None = None) -> None:
        """
        Args:
            clocks: clock of each side, where they are two machines; None: one clock.
        """
        self.now = 0  # [ns]
        self._clocks = clocks
        self.nodes: dict[str, Node] = {}
        self._buses: dict[str, MemoryBus] = {}
        self._checkpoints: dict[str, CheckpointStore] = {}
        self._woken: dict[str, None] = {}  # an ordered set of names
        self._services: Registry | None = None  # of `add_all`; they say whose an error is
        self._failed: set[str] = set()
        self._due: dict[str, int] = {}  # [ns] next timer of each node, while running

    def side(self, name: str) -> MemoryBusPort:
        """A new port on the bus of a side, for a test that subscribes or publishes."""
        return MemoryBusPort(self.hub(name))

    def hub(self, side: str) -> MemoryBus:
        """The bus of a side."""
        return self._buses.setdefault(side, MemoryBus())

    def node(self, name: str, sides: list[str], *, gateway: bool = False) -> Node:
        """A node without a service; the caller wires it."""
        ports = {side: self.side(side) for side in sides}
        checkpoint = self._checkpoints.setdefault(name, VolatileCheckpoint())
        skew, clock_offset = self._skew(sides[0]), self._clock_offset(sides[0])
        clock = (lambda: self.now) if skew is SAME else (lambda: skew.shows(self.now))
        node = Node(name, ports, clock, checkpoint, gateway=gateway, clock_offset=clock_offset)
        node.wake = partial(self._woken.setdefault, name)
        self.nodes[name] = node
        return node

    def add(self, name: str, spec: ServiceSpec, stack: Stack, wire: Wire | None = None) -> Node:
        """Start a service now: one of Lindy's own, unless its `wire` is given."""
        if not stack.watched:  # a test that adds one by one
            watched = Registry.read(stack.services).watched
            stack = msgspec.structs.replace(stack, watched=watched)
        node = self.node(name, spec.sides, gateway=spec.gateway)
        (wire or wire_of(spec.service or name))(node, stack)
        return node

    def add_all(
        self, services: Registry, stack: Stack, instead: Mapping[str, Wire] | None = None
    ) -> None:
        """Start a whole stack now.

        Raises:
            LindyError: a service cannot start.
        """
        self._services = services
        for name, spec in services.items():
            self.add(name, spec, stack, (instead or {}).get(name) or services.wire(name))

    def kill(self, name: str) -> None:
        """End a service as a crash would: it publishes nothing more and closes nothing."""
        for port in self.nodes.pop(name).sides.values():
            assert isinstance(port, MemoryBusPort)
            port.close()
        self._woken.pop(name, None)

    def show(self, line: Callable[[LogLine], None]) -> None:
        """Show every node's log lines."""
        for node in self.nodes.values():
            node.show = line

    def run(self, until: int, done: Callable[[], bool] | None = None) -> None:
        """Advance to `until` [ns], or to the first instant at which `done()` is true.

        Raises:
            LindyError: a handler of a service of `add_all` raised; names it, its module and line.
        """
        self._due = {}
        for name in self.nodes:
            self._due[name] = self._deadline(name)
        while done is None or not done():
            due = min(self._due.values())
            if due > until:
                self.now = until
                return
            self.now = max(self.now, due)
            self._settle([name for name, at in self._due.items() if at <= due])

    def settle(self) -> None:
        """Step now those for whom something was published from outside since, and those whose timer
        is due. Whoever publishes from outside sets `now` first."""
        due = [name for name in self.nodes if self._deadline(name) <= self.now]
        self._settle(due)

    def close(self) -> None:
        """End all services in order, as a clean stop would. One that fails to end does not keep the
        others, such as the recorder, from ending.

        Raises:
            LindyError: a service of `add_all` failed to end.
        """
        with ExitStack() as exits:
            for name in reversed(self.nodes):
                if name not in self._failed:  # its next error would hide the first one
                    exits.callback(self._close, name)

    def _settle(self, names: list[str]) -> None:
        """Step these nodes, then those they woke, until no node is woken at this instant."""
        woken, due, nodes = self._woken, self._due, self.nodes
        name = ""
        try:
            for _ in range(ROUNDS):
                for name in names:
                    woken.pop(name, None)
                    nodes[name].step()
                    due[name] = self._deadline(name)
                if not woken:
                    return
                names = list(woken)
        except (Exception, SystemExit) as error:
            self._blame(name, error)
            raise
        raise RuntimeError(f"services keep waking each other at {self.now} ns: {names}")

    def _close(self, name: str) -> None:
        try:
            self.nodes[name].close()
        except (Exception, SystemExit) as error:
            self._blame(name, error)
            raise

    def _blame(self, name: str, error: BaseException) -> None:
        """Say whose code raised this. In a process of its own it could end nothing but itself."""
        if isinstance(error, LindyError) or self._services is None or name not in self._services:
            return  # it says what it is of, or it is somebody else's node
        self._failed.add(name)
        raise self._services.failure(name, error) from error

    def _deadline(self, name: str) -> int:
        """[ns] When a node is stepped next if nothing else wakes it, by the host's clock."""
        node = self.nodes[name]
        return node.deadline() if self._clocks is None else self._timer(node)

    def _timer(self, node: Node) -> int:
        """[ns] When a node's next timer falls due, by the host's clock."""
        return max(self.now, self._skew(next(iter(node.sides))).first_shows(node.deadline()))

    def _skew(self, side: str) -> Skew:
        return SAME if self._clocks is None else self._clocks.get(side, SAME)

    def _clock_offset(self, side: str) -> ClockOffset | None:
        if self._clocks is None:
            return None
        return ClockOffset("topside" if side == "topside" else "drone")
