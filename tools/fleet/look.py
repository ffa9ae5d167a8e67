"""A look at who is there at an endpoint, a drone's hub or a router: from the liveliness tokens of
hubs and three rows of each drone."""

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import msgspec

from messages import topics
from messages.identity import SideIdentity
from messages.payload import UNDECODABLE
from messages.sensors import BatterySample
from messages.topic import AnyTopic
from messages.vehicle import VehicleStatus
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.key_files import KeyFiles
from services.runtime.bus.spaces import EVERY_SPACE, here_key, here_of, name_in, namespace
from services.runtime.bus.zenoh_bus import open_network

LOOK_S = 1.6  # [s] who is there says so once a second
STEP_S = 0.01  # [s] between two looks at what has arrived
PATIENCE_S = 1.0  # [s] for the endpoint to answer
ROWS: tuple[AnyTopic, ...] = (topics.IDENTITY.of("drone"), topics.STATUS, topics.BATTERY)


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

    def token(self, key: str, there: bool = True) -> None:
        """A drone's hub came, or went; names that no drone may have mean nothing."""
        here = here_of(key)
        if here is None or here.side != "drone":
            return
        if there:
            self.drones.setdefault(here.name, Drone(here.name)).starts.add(here.instance)
        elif (drone := self.drones.get(here.name)) is not None:
            drone.starts.discard(here.instance)
            if not drone.starts:
                del self.drones[here.name]

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
