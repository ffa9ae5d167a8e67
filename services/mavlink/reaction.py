"""What one event causes: effects of the pilot, and packets to be sent."""

from dataclasses import dataclass, field
from typing import Any

from messages import events
from messages.events import Outbox
from messages.units import Ns
from services.mavlink.packets import Addressed, GroundStation
from services.mavlink_io.numbers import MavResult, MavSeverity
from services.mavlink_io.packet import MavlinkPacket
from services.piloting.pilot import Effects

TEXT = 50  # [B] of one STATUSTEXT; longer text is sent in several
LONGEST = 249  # [B] of a text; the rest is in the log
TEXTS = 20  # that may be sent at once
PER_TEXT_NS = 200_000_000  # [ns] in the long run there are no more than this allows


@dataclass(slots=True)
class Reaction(Effects):
    packets: list[Addressed] = field(default_factory=list[Addressed])
    texts: list[tuple[str | None, MavSeverity, str]] = field(
        default_factory=list[tuple[str | None, MavSeverity, str]]
    )  # (link; None: all, how bad, what)

    def send(self, link: str | None, name: str, **fields: Any) -> None:
        self.packets.append(Addressed(link, MavlinkPacket(name, fields)))

    def say(self, link: str | None, severity: MavSeverity, text: str) -> None:
        self.texts.append((link, severity, text))

    def acknowledge(self, to: GroundStation, command: int, result: MavResult) -> None:
        self.send(
            to.link,
            "COMMAND_ACK",
            command=command,
            result=int(result),
            target_system=to.system,
            target_component=to.component,
        )


@dataclass(slots=True)
class Texts:
    """Texts as STATUSTEXT packets, not more than a link can bear."""

    _left: float = TEXTS
    _since_ns: Ns = 0
    _id: int = 0

    def pack(self, reaction: Reaction, outbox: Outbox, now: Ns) -> None:
        """Turn its texts into packets. What is too much is counted."""
        self._left = min(TEXTS, self._left + (now - self._since_ns) / PER_TEXT_NS)
        self._since_ns = now
        for link, severity, text in reaction.texts:
            if self._left < 1.0:
                outbox.tell(events.DROPPED("statustext"))
                continue
            self._left -= 1.0
            reaction.packets += [
                Addressed(link, packet) for packet in self._packets(severity, text)
            ]
        reaction.texts.clear()

    def _packets(self, severity: MavSeverity, text: str) -> list[MavlinkPacket]:
        raw = _plain(text)[:LONGEST]
        # A chunk that is not full is the last one.
        end = len(raw) + 1 if len(raw) > TEXT else max(1, len(raw))
        chunks = [raw[at : at + TEXT] for at in range(0, end, TEXT)]
        number = 0
        if len(chunks) > 1:
            number = self._id = self._id % 65535 + 1
        return [
            MavlinkPacket(
                "STATUSTEXT",
                {"severity": int(severity), "text": chunk, "id": number, "chunk_seq": k},
            )
            for k, chunk in enumerate(chunks)
        ]


def _plain(text: str) -> bytes:
    """ASCII, which every ground station shows."""
    return text.replace("…", "...").replace("→", "->").encode("ascii", "replace")
