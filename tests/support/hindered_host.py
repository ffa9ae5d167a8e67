"""Virtual time on which services are late, hubs hang or end, checkpoints are lost, and a service
has a twin. On a busy computer every wake-up is handled after a random delay, and sometimes it
stalls."""

from bisect import bisect_right
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

from numpy.random import Generator, default_rng

from messages import topics
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.node import Node


@dataclass(frozen=True, slots=True)
class Jitter:
    """Delays and stalls of a node. All zero: it is stepped at the instant it is woken."""

    delay: float = 0.0  # [s] of a wake-up, uniform between 0 and this
    stall: float = 0.0  # [s] for which a stalled node is not stepped
    stall_every: float = 1.0  # [s] mean time from the end of a stall to the next, exponential


class Lateness:
    """When one node is stepped. All draws are from `generator`, in the order of the wake-ups."""

    def __init__(self, jitter: Jitter, generator: Generator) -> None:
        self._jitter = jitter
        self._generator = generator
        self._stalls: list[int] = []  # [ns] begin of each stall that was drawn
        self._drawn_ns = 0  # [ns] all stalls before this are drawn
        self._arrival_ns: int | None = None  # [ns] when what arrived is handled
        self._deadline = -1  # [ns] timer for which a delay was drawn …
        self._timer_ns = 0  # [ns] … and when it is handled

    def arrived(self, now: int) -> None:
        """Something arrived at `now` [ns]. What arrives until the step is handled with it."""
        if self._arrival_ns is None:
            self._arrival_ns = self._handled(now)

    def next_step(self, deadline: int) -> int:
        """[ns] When the node is stepped next, whose next timer falls due at `deadline` [ns]."""
        if deadline != self._deadline:
            self._deadline, self._timer_ns = deadline, self._handled(deadline)
        return self._timer_ns if self._arrival_ns is None else min(self._timer_ns, self._arrival_ns)

    def stepped(self) -> None:
        """All that had arrived is handled."""
        self._arrival_ns = None

    def _handled(self, woken: int) -> int:
        """[ns] When a wake-up at `woken` [ns] is handled."""
        delay = self._jitter.delay
        late = woken + round(1e9 * delay * self._generator.random()) if delay > 0.0 else woken
        return self._after_stall(late) if self._jitter.stall > 0.0 else late

    def _after_stall(self, at: int) -> int:
        """[ns] `at`, or the end of the stall that it falls into."""
        stall = round(1e9 * self._jitter.stall)
        while self._drawn_ns <= at:
            pause = 1e9 * self._jitter.stall_every * self._generator.standard_exponential()
            self._stalls.append(self._drawn_ns + round(pause))
            self._drawn_ns = self._stalls[-1] + stall
        before = bisect_right(self._stalls, at)
        return at if before == 0 else max(at, self._stalls[before - 1] + stall)


FOR_EVER = 10**18  # [ns]


class Hindrance(Lateness):
    """Of one service: it is stopped, slow, or has too little of a busy processor. Without any it is
    stepped at the instant it is woken."""

    def __init__(self, clock: Callable[[], int], seed: int = 0) -> None:
        """
        Args:
            clock: [ns] virtual time.
            seed: [-] of the delays of a busy processor.
        """
        super().__init__(Jitter(), default_rng(seed))
        self._clock = clock
        self._free_ns = 0  # [ns] not stepped before
        self._pause_ns = 0  # [ns] taken by every step

    def stop(self, until: int = FOR_EVER) -> None:
        """As SIGSTOP does, up to `until` [ns]; arrivals wait in the ports."""
        self._free_ns = until

    def go_on(self) -> None:
        """As SIGCONT does, and as a new process begins."""
        self._free_ns = self._pause_ns = 0
        self.share(Jitter())

    def slow(self, pause_s: float) -> None:
        """Every step takes so long [s]: what it publishes comes at its beginning, but nothing else
        is handled until its end."""
        self._pause_ns = round(1e9 * pause_s)

    def share(self, jitter: Jitter) -> None:
        """Delays and stalls from now on."""
        self._jitter = jitter

    def stepped(self) -> None:
        super().stepped()
        if self._pause_ns:
            self._free_ns = self._clock() + self._pause_ns

    def next_step(self, deadline: int) -> int:
        return max(super().next_step(deadline), self._free_ns)


class HinderedBus(MemoryBus):
    """A hub that can be stopped."""

    def __init__(self) -> None:
        super().__init__()
        self._kept: list[tuple[Envelope, object]] | None = None  # while nothing is delivered
        self._keeps = False

    def stop(self, *, keeps: bool) -> None:
        """Deliver nothing until `go_on`, as when the hub of this side is gone.

        Args:
            keeps: what is sent meanwhile is delivered afterwards, as by a hub that only hangs;
                False: it is lost, with all that was kept before.
        """
        self._keeps = keeps
        self._kept = self._kept if keeps and self._kept is not None else []

    def go_on(self) -> None:
        """Deliver again, first what was kept, in order."""
        kept, self._kept = self._kept or [], None
        for envelope, sender in kept:
            self.deliver(envelope, sender)

    def deliver(self, envelope: Envelope, sender: object) -> None:
        if self._kept is None:
            super().deliver(envelope, sender)
        elif self._keeps:
            self._kept.append((envelope, sender))


class HinderedHost(VirtualHost):
    """A node with a `Lateness` is stepped late, as on a busy computer; until then messages wait in
    its ports."""

    def __init__(
        self,
        clocks: Mapping[str, Skew] | None = None,
        lateness: Mapping[str, Lateness] | None = None,
    ) -> None:
        """
        Args:
            lateness: of nodes by name; the others are punctual.
        """
        super().__init__(clocks)
        self._lateness = lateness or {}
        self._hubs: dict[str, HinderedBus] = {}

    def hub(self, side: str) -> HinderedBus:
        return self._hubs.setdefault(side, HinderedBus())

    def node(self, name: str, sides: list[str], *, gateway: bool = False) -> Node:
        node = super().node(name, sides, gateway=gateway)
        if (late := self._lateness.get(name)) is not None:
            node.wake, step = partial(self._wake, name), node.step

            def stepped() -> None:
                late.stepped()
                step()

            node.step = stepped  # type: ignore[method-assign]
        return node

    def forget(self, name: str) -> None:
        """Lose a service's checkpoint."""
        self._checkpoints.pop(name, None)

    def _wake(self, name: str) -> None:
        """A message arrived for a node with lateness: step it now or later. The others are stepped
        at this instant."""
        self._lateness[name].arrived(self.now)
        self._due[name] = self._deadline(name)
        if self._due[name] <= self.now:
            self._woken.setdefault(name)

    def _deadline(self, name: str) -> int:
        due, late = super()._deadline(name), self._lateness.get(name)
        return due if late is None else late.next_step(due)


def take_name(node: Node, name: str) -> None:
    node.name = name
    node._health = node.publisher(topics.HEALTH.of(name))  # pyright: ignore[reportPrivateUsage]
    node._log = node.publisher(topics.LOG.of(name))  # pyright: ignore[reportPrivateUsage]
