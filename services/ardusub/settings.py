"""The table [ardusub] of a vehicle file, and what all parts of the driver put what they have for
others into: packets, samples and events."""

from typing import Annotated, NamedTuple

import msgspec

from messages.events import Event, Level, Outbox
from messages.message import Message
from services.mavlink_io.packet import MavlinkPacket

Id = Annotated[int, msgspec.Meta(ge=1, le=255)]
Timeout = Annotated[float, msgspec.Meta(ge=0.1, le=3.0)]


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    # udpin:HOST:PORT and tcpin:HOST:PORT wait for the board, udpout:HOST:PORT and tcp:HOST:PORT
    # call it, serial:DEVICE:BAUD is a cable.
    url: Annotated[str, msgspec.Meta(max_length=200)] = "udpin:127.0.0.1:14551"
    system: Id = 255  # [-] ours, as a ground station: the board's SYSID_MYGCS or MAV_GCS_SYSID
    component: Id = 191  # [-] ours: an onboard computer
    board: Id = 1  # [-] system of the board
    pressure_rate: Annotated[float, msgspec.Meta(ge=1.0, le=100.0)] = 40.0  # [1/s] asked for
    # Of a value that the board has just taken over: half of the 100 ms of which it is the mean,
    # less the delay of its filter for the IMU (20 Hz).
    pressure_age: Annotated[float, msgspec.Meta(ge=0.0, le=0.3)] = 0.04  # [s]
    compass_age: Annotated[float, msgspec.Meta(ge=0.0, le=0.3)] = 0.04  # [s] the same
    # May Lindy set FS_PILOT_TIMEOUT to this? None: it only says that a second or less is better.
    set_pilot_timeout: Timeout | None = None  # [s]
    disarm_after: Annotated[float, msgspec.Meta(ge=0.2, le=60.0)] = 2.0  # [s] without commands
    tilt_range: Annotated[float, msgspec.Meta(gt=0.0, le=3.2)] | None = 0.785  # [rad] None: no tilt


class DriverOutput(NamedTuple):
    """What there is since the last time."""

    packets: list[MavlinkPacket]  # to the board
    samples: list[Message]  # to publish
    taken: bool | None  # to remember, where it has changed


class DriverOutbox:
    """All parts of the driver put what they have in here."""

    def __init__(self, outbox: Outbox) -> None:
        """`outbox`: of the service, which counts and logs the events."""
        self.packets: list[MavlinkPacket] = []
        self.samples: list[Message] = []
        self.events = outbox
        self._said: set[tuple[str, str]] = set()  # event or none, and sentence

    def take(self, taken: bool | None) -> DriverOutput:
        """Packets and samples; they are then forgotten here."""
        done = DriverOutput(self.packets, self.samples, taken)
        self.packets, self.samples = [], []
        return done

    def send(self, packet: MavlinkPacket) -> None:
        self.packets.append(packet)

    def tell(self, event: Event, times: int = 1) -> None:
        """Counted each time; a sentence is said once, until it `may_repeat`."""
        if event.row.said is None or self._is_new(event.name, event.sentence):
            self.events.tell(event, times)
        else:
            self.events.count(event, times)

    def say(self, level: Level, text: str) -> None:
        """A line that is no event, once."""
        if self._is_new("", text):
            self.events.say(level, text)

    def may_repeat(self, event: Event | None = None) -> None:
        """What was said may be said again: of this event, or all."""
        name = event and event.name
        self._said = {said for said in self._said if name not in (None, said[0])}

    def counted(self, event: Event) -> int:
        return self.events.counts[event.name]

    def _is_new(self, name: str, text: str) -> bool:
        new = (name, text) not in self._said
        self._said.add((name, text))
        return new
