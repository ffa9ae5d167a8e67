"""Where drone and topside meet, and by which name: what is settled before a side starts; and a
topside that hears nothing because its drone has another name is told so."""

import re
import time
from collections import deque
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from pathlib import Path
from socket import gethostname
from typing import NamedTuple

from messages import events
from services.runtime.bus.key_files import Credentials, KeyFiles
from services.runtime.bus.spaces import EVERY_SPACE, LONGEST, checked_name, here_key
from services.runtime.bus.zenoh_bus import NobodyThereError, open_network
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.launch.local_stack import LocalStack
from services.runtime.launch.process_plan import HOME
from tools.fleet.look import Roster, who_is_there
from tools.keys.credentials import credentials, is_local

AGAIN_S = 0.5  # [s] between two questions who is there
GONE_S = 3.0  # [s] in which an earlier start of this drone, cut off, is forgotten by the network


class Meeting(NamedTuple):
    """Where a drone can be reached: at its own endpoint, by way of a router, or both."""

    listen: str | None
    router: str | None
    credentials: Credentials | None

    @property
    def link(self) -> str:
        """In words."""
        return " and ".join(filter(None, (self.listen, self.router)))

    @property
    def keys(self) -> KeyFiles | None:
        return None if self.credentials is None else self.credentials.keys


def drones_credentials(
    listen: str | None, router: str | None, keys: Path | None, *, insecure: bool
) -> Credentials | None:
    """The keys of a drone, for its own endpoint and for a router.

    Raises:
        LindyError: an endpoint needs keys, only one of both does, or the keys are no good.
    """
    found_for = {
        option: credentials(endpoint, option, ("drone",), keys, insecure=insecure)
        for option, endpoint in (("--listen", listen), ("--router", router))
        if endpoint is not None
    }
    if len(found_for) == 2 and None in found_for.values() and any(found_for.values()):
        raise LindyError(f"--listen {listen} and --router {router}: both with tls, or none of them")
    return next(iter(found_for.values()))


def drones_name(stack: Stack, meeting: Meeting) -> str:
    """The name that was given to a drone, else that of its keys, else one by its computer.

    Raises:
        LindyError: whoever compares names with keys would not let it in, or a drone cannot be
            called this.
    """
    keys_name = "" if meeting.credentials is None else meeting.credentials.name
    name = stack.name or keys_name or own_name(stack.vehicle_name, gethostname())
    if keys_name not in ("", name):
        raise LindyError(
            f"--name {name}: this machine's keys are those of drone:{keys_name}, and it is "
            f"believed by that name only; leave --name out, or use keys of drone:{name}"
        )
    return checked_name(name, "--name")


def require_only(name: str, router: str, keys: KeyFiles | None) -> None:
    """Check that no other drone of this name is on the network. A router that is away must not keep
    a drone from its start: it joins when the router comes.

    Raises:
        LindyError: there is one; it goes on undisturbed.
    """
    deadline = time.monotonic() + GONE_S
    try:
        while name in who_is_there(router, keys):
            if time.monotonic() > deadline:
                raise TakenNameError(
                    f"a drone called {name} is on the network of {router} already, and goes on; "
                    f"give this one another --name"
                )
            time.sleep(AGAIN_S)  # an earlier start of this drone may not be forgotten yet
    except NobodyThereError:
        print(f"no router answers at {router} yet: {name} joins when one does", flush=True)
    except TakenNameError:
        raise
    except LindyError as error:
        print(f"{error}; {name} goes on without, and tries again and again", flush=True)


class TakenNameError(LindyError):
    """Another drone has this name."""


def drone_at(endpoint: str, own: str, keys: KeyFiles | None) -> str:
    """The name of the one drone that is there. On this machine the drone may be started later: it
    will be called by this machine's name. One of another machine is waited for.

    Args:
        own: what a drone of this machine is called.

    Raises:
        LindyError: there are several, or who answers there does not let us in.
    """
    said = False
    while True:
        try:
            there = who_is_there(endpoint, keys)
        except NobodyThereError:
            there = list[str]()
        if len(there) > 1:
            raise LindyError(
                f"{len(there)} drones can be reached at {endpoint}: {in_words(there)}; say which "
                f"with --name"
            )
        if there:
            return there[0]
        if is_local(endpoint):
            return own
        if not said:
            print(
                f"no drone answers at {endpoint} yet: waiting for one; with --name the topside "
                f"starts without it",
                flush=True,
            )
            said = True
        time.sleep(AGAIN_S)


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
        self.roster = Roster()

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
