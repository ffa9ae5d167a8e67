"""Virtual time on which services are late, hubs hang or end, and checkpoints are lost."""

from collections.abc import Mapping
from functools import partial

from services.runtime.bus.envelope import Envelope
from services.runtime.bus.memory_bus import MemoryBus
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.node import Node
from tests.support.jitter import Lateness


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
        if name in self._lateness:
            node.wake = partial(self._wake, name)
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

    def _step(self, name: str) -> None:
        if (late := self._lateness.get(name)) is not None:
            late.stepped()
        super()._step(name)

    def _deadline(self, name: str) -> int:
        due, late = super()._deadline(name), self._lateness.get(name)
        return due if late is None else late.next_step(due)
