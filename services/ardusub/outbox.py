"""What the driver has for others: packets, samples, counts and lines."""

from collections import Counter
from typing import Literal, NamedTuple

from messages.message import Message
from services.ardusub.packet import MavlinkPacket

Level = Literal["info", "warning", "error"]


class DriverOutput(NamedTuple):
    """What there is since the last time."""

    packets: list[MavlinkPacket]  # to the board
    samples: list[Message]  # to publish
    events: Counter[str]  # to count
    lines: list[tuple[Level, str]]  # to log
    taken: bool | None  # to remember, where it has changed


class DriverOutbox:
    """All parts of the driver put what they have in here."""

    def __init__(self) -> None:
        self.packets: list[MavlinkPacket] = []
        self.samples: list[Message] = []
        self.events = Counter[str]()
        self.lines: list[tuple[Level, str]] = []
        self._said: set[str] = set()

    def take(self, taken: bool | None) -> DriverOutput:
        """Everything; it is then forgotten here."""
        done = DriverOutput(self.packets, self.samples, self.events, self.lines, taken)
        self.packets, self.samples, self.events, self.lines = [], [], Counter(), []
        return done

    def send(self, packet: MavlinkPacket) -> None:
        self.packets.append(packet)

    def count(self, name: str, times: int = 1) -> None:
        if times:
            self.events[name] += times

    def say(self, level: Level, sentence: str) -> None:
        """Once, until it `may_repeat`."""
        if sentence not in self._said:
            self._said.add(sentence)
            self.lines.append((level, sentence))

    def may_repeat(self, sentence: str | None = None) -> None:
        """What was said may be said again: this sentence, or all."""
        if sentence is None:
            self._said.clear()
        else:
            self._said.discard(sentence)
