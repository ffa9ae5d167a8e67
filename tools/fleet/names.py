"""Names of drones: which one a machine's drone has, which one a pilot means, and how they are
printed; and a topside that hears nothing because its drone has another name is told so."""

import re
import time
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager

from messages import events
from services.runtime.bus.spaces import EVERY_SPACE, LONGEST, here_key
from services.runtime.bus.zenoh_bus import open_network
from services.runtime.launch.local_stack import LocalStack
from services.runtime.launch.process_plan import HOME
from tools.fleet.look import Roster

SHOWN = 8  # names in one sentence
LOOK_HZ = 1.0  # [1/s]
PATIENCE_S = 2.0  # [s] for this side's own hub
WAIT_NS = 3_000_000_000  # [ns] in which the wanted drone may be announced behind others


def own_name(vehicle: str, host: str) -> str:
    """Of a drone that was given none: its type and its computer, such as `pioneer-boat`.

    Args:
        host: name of the computer, whatever letters it has.
    """
    machine = re.sub(r"[^A-Za-z0-9_-]+", "-", host.partition(".")[0]).strip("-")
    return f"{vehicle}-{machine}"[:LONGEST].rstrip("-")


def in_words(names: Iterable[str]) -> str:
    """`a, b and 3 more`, in their order."""
    every = sorted(names)
    shown, more = every[:SHOWN], len(every) - SHOWN
    return f"{', '.join(shown)} and {more} more" if more > 0 else ", ".join(shown)


def missing(wanted: str, there: Sequence[str], endpoint: str) -> str:
    """Why a pilot who wants a drone of this name cannot have it."""
    who = f"there are {in_words(there)}" if there else "nobody is there"
    return f"no drone is called {wanted} at {endpoint}; {who}"


def other_drone(wanted: str, there: Sequence[str], *, was_there: bool = False) -> str:
    """What a topside that waits for a drone is to be told; empty: nothing is wrong. One that had
    its drone must go on waiting: it may be armed, and comes back by itself."""
    if wanted in there or not there:
        return ""
    if was_there:
        return f"{wanted} has left the network, where {in_words(there)} can be reached: waiting \
for it"
    other = sorted(there)[0]
    return (
        f"this is the topside of {wanted}, and only {in_words(there)} can be reached: end it, and "
        f"start it with --name {other}"
    )


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
        network.watch(
            lambda key, there: tokens.append((key, there)), here_key(EVERY_SPACE, "drone")
        )
        local.node.every(LOOK_HZ, look)
        yield
