"""The network as it is seen from outside: who is there, at a drone's hub or a router, from the
liveliness tokens of hubs and three rows of each drone; and where drone and topside meet, and by
which name."""

import re
import time
from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from socket import gethostname
from typing import Any, NamedTuple

import msgspec

from messages import topics
from messages.identity import SideIdentity
from messages.payload import UNDECODABLE
from messages.sensors import BatterySample
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.runtime.bus.access_control import Credentials, KeyFiles
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import (
    EVERY_SPACE,
    LONGEST,
    checked_name,
    here_key,
    here_of,
    name_in,
    namespace,
)
from services.runtime.bus.zenoh_bus import NobodyThereError, open_network
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tools.keys.credentials import credentials, is_local

LOOK_S = 1.6  # [s] who is there says so once a second
STEP_S = 0.01  # [s] between two looks at what has arrived
PATIENCE_S = 1.0  # [s] for the endpoint to answer
ROWS: tuple[AnyTopic, ...] = (topics.IDENTITY.of("drone"), topics.STATUS, topics.BATTERY)
AGAIN_S = 0.5  # [s] between two questions who is there
GONE_S = 3.0  # [s] in which an earlier start of this drone, cut off, is forgotten by the network
SHOWN = 8  # names in one sentence


@dataclass(slots=True)
class Drone:
    """What is known of a drone. A name alone anybody can announce."""

    name: str
    starts: set[str] = field(default_factory=set[str])  # instances of its hub; two: two drones
    identity: SideIdentity | None = None
    status: VehicleStatus | None = None
    battery: BatterySample | None = None

    @property
    def complete(self) -> bool:
        return None not in (self.identity, self.status, self.battery)


class Roster:
    """Tokens and rows, in any order. Pure."""

    def __init__(self) -> None:
        self.drones: dict[str, Drone] = {}
        self._decoders: dict[str, Any] = {
            topic.key: msgspec.msgpack.Decoder(topic.message) for topic in ROWS
        }

    def token(self, key: str) -> None:
        """A drone's hub is there; names that no drone may have mean nothing."""
        here = here_of(key)
        if here is not None and here.side == "drone":
            self.drones.setdefault(here.name, Drone(here.name)).starts.add(here.instance)

    def row(self, key: str, payload: bytes) -> None:
        """One of `ROWS` of a drone. Of one that is not announced it means nothing."""
        decoder = self._decoders.get(key.removeprefix(f"{namespace(name := name_in(key))}/"))
        drone = self.drones.get(name)
        if drone is None or decoder is None:
            return
        try:
            message = decoder.decode(payload)
        except UNDECODABLE:  # also a field that is out of its range
            return
        if isinstance(message, SideIdentity):
            drone.identity = message
        elif isinstance(message, VehicleStatus):
            drone.status = message
        else:
            drone.battery = message

    @property
    def complete(self) -> bool:
        """Has everybody who is announced said what there is to know?"""
        return bool(self.drones) and all(drone.complete for drone in self.drones.values())

    @property
    def names(self) -> list[str]:
        return sorted(self.drones)


def who_is_there(endpoint: str, keys: KeyFiles | None = None) -> list[str]:
    """Names of the drones that are announced now.

    Raises:
        LindyError: nobody answers there, or nobody who lets us in.
    """
    with open_network(endpoint, PATIENCE_S, keys=keys) as network:
        roster = Roster()
        for key in network.tokens(here_key(EVERY_SPACE, "drone")):
            roster.token(key)
        return roster.names


def look(endpoint: str, keys: KeyFiles | None = None, longest_s: float = LOOK_S) -> Roster:
    """Everything that is to be known of the drones that are there. Returns as soon as all of them
    have spoken, at the latest after `longest_s`.

    Raises:
        LindyError: nobody answers there, or nobody who lets us in.
    """
    roster = Roster()
    heard: deque[Envelope] = deque(maxlen=10_000)  # filled on Zenoh's thread
    with open_network(endpoint, PATIENCE_S, keys=keys) as network:
        for topic in ROWS:
            network.hear(f"{EVERY_SPACE}/{topic.key}", heard.append)
        for key in network.tokens(here_key(EVERY_SPACE, "drone")):
            roster.token(key)
        deadline = time.monotonic() + longest_s
        while not roster.complete and time.monotonic() < deadline:
            time.sleep(STEP_S)  # messages come on Zenoh's thread
            while heard:
                envelope = heard.popleft()
                roster.row(envelope.key, envelope.payload)
    return roster


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
                break
            time.sleep(AGAIN_S)  # an earlier start of this drone may not be forgotten yet
        else:
            return
    except NobodyThereError:
        print(f"no router answers at {router} yet: {name} joins when one does", flush=True)
        return
    except LindyError as error:
        print(f"{error}; {name} goes on without, and tries again and again", flush=True)
        return
    raise LindyError(
        f"a drone called {name} is on the network of {router} already, and goes on; give this one "
        f"another --name"
    )


def wanted_at(endpoint: str, wanted: str, keys: KeyFiles | None) -> str:
    """A drone's name as a pilot gave it. That only others are there now is printed: it may come."""
    with suppress(LindyError):  # nobody answers yet, or none who lets us in
        if (there := who_is_there(endpoint, keys)) and wanted not in there:
            print(f"{missing(wanted, there, endpoint)}; waits for {wanted}", flush=True)
    return wanted


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
