"""What the driver has for others: packets, samples and events."""

from typing import NamedTuple

from messages.events import Event, Level, Outbox
from messages.message import Message
from services.mavlink_io.packet import MavlinkPacket


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
