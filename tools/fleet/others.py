"""A topside that hears nothing because its drone has another name is told so."""

import time
from collections import deque
from collections.abc import Generator
from contextlib import contextmanager

from messages import events
from services.runtime.bus.network import open_network
from services.runtime.launch.local_stack import LocalStack
from services.runtime.launch.process_plan import HOME
from tools.fleet.names import other_drone
from tools.fleet.roster import Roster

LOOK_HZ = 1.0  # [1/s]
PATIENCE_S = 2.0  # [s] for this side's own hub
WAIT_NS = 3_000_000_000  # [ns] in which the wanted drone may be announced behind others


class Others:
    """Which drones are there besides the wanted one. Pure."""

    def __init__(self, wanted: str, now: int) -> None:
        self._wanted, self._since = wanted, now
        self._was_there = False
        self.roster = Roster(wanted)

    def words(self, now: int) -> str:
        """What the pilot is to be told; empty: nothing."""
        wanted = self.roster.drones.get(self._wanted)
        if wanted is not None and len(wanted.starts) > 1:
            return f"two drones call themselves {self._wanted}: give one of them another --name"
        self._was_there = self._was_there or wanted is not None
        wrong = other_drone(self._wanted, self.roster.names, was_there=self._was_there)
        if not wrong:
            self._since = now
        return wrong if now - self._since >= WAIT_NS else ""


@contextmanager
def others_named(local: LocalStack) -> Generator[None]:
    """Watch who is there by way of this side's own hub, for as long as the dive goes on."""
    tokens: deque[tuple[str, bool]] = deque(maxlen=4096)  # filled on Zenoh's thread
    others, said = Others(local.stack.drone_name, time.monotonic_ns()), ""

    def look(now: int) -> None:
        nonlocal said
        while tokens:
            others.roster.token(*tokens.popleft())
        was, said = said, others.words(now)
        if said and said != was:
            local.node.tell(events.ALARM_OTHER_DRONE(detail=said))

    with open_network(local.plan.endpoints[HOME], PATIENCE_S) as network:
        network.watch(lambda key, there: tokens.append((key, there)))
        local.node.every(LOOK_HZ, look)
        yield
