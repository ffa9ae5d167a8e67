"""A ground station as a pilot: sticks, lease and requests by the rules of every pilot; and what
one of its packets causes.

One ground station has the sticks. What it asks for goes to the drone in the name of that station,
and the drone's answer becomes the acknowledgement of its command."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, cast

from messages import events
from messages.events import Outbox
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns
from services.mavlink_io.packet import GroundStation, MavlinkPacket, MavResult, MavSeverity
from services.piloting.guest_pilot import GuestPilot
from services.piloting.pilot import Effects
from services.piloting.pilot_intents import OVERRULES, Intent, ModeIntent


class Addressed(NamedTuple):
    """A packet for one link, or for all of them."""

    link: str | None
    packet: MavlinkPacket


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

    def acknowledge(self, to: GroundStation, command: int, result: MavResult | None) -> None:
        """None: not yet."""
        if result is not None:
            who = {"target_system": to.system, "target_component": to.component}
            self.send(to.link, "COMMAND_ACK", command=command, result=int(result), **who)


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
        said = {"severity": int(severity), "id": number}
        return [
            MavlinkPacket("STATUSTEXT", said | {"text": chunk, "chunk_seq": k})
            for k, chunk in enumerate(chunks)
        ]


def _plain(text: str) -> bytes:
    """ASCII, which every ground station shows."""
    return text.replace("…", "...").replace("→", "->").encode("ascii", "replace")


PATIENCE_NS = 6_000_000_000  # [ns] requests are given up earlier
OPEN = 16  # commands at most that wait for the drone's answer
NO_STICKS = "no stick positions arrive; first send MANUAL_CONTROL or RC_CHANNELS_OVERRIDE"


class OpenCommand(NamedTuple):
    """A command that waits for the drone's answer."""

    sender: GroundStation
    command: int
    kind: RequestKind
    since_ns: Ns


@dataclass(slots=True)
class GroundPilot(GuestPilot[GroundStation]):
    _open: list[OpenCommand] = field(default_factory=list[OpenCommand])

    @property
    def name(self) -> str:
        """As the pilot's name; that of the last ground station when nobody has the sticks."""
        return self.holder.sender.pilot if self.holder.sender else self.pilot.source

    def ask(
        self, station: GroundStation, command: int, intent: Intent, now: Ns, out: Reaction
    ) -> MavResult | None:
        """A command that the drone answers, by which it is acknowledged then: None. Else what it is
        acknowledged by now."""
        kind = "mode" if isinstance(intent, ModeIntent) else cast(RequestKind, intent)
        if kind != "stop" and not self.holder.may_take(station, now):
            assert self.holder.sender is not None
            self.pilot.outbox.tell(events.NOT_THE_HOLDER(kind))
            whose = self.holder.sender.pilot
            out.say(station.link, MavSeverity.WARNING, f"{whose} has the sticks: {kind} refused")
            return MavResult.DENIED
        if kind == "arm" and not self.holder.fresh(now):
            refusal = events.REFUSED_HERE(kind, detail=NO_STICKS)
            self.pilot.outbox.count(refusal)
            out.say(station.link, MavSeverity.WARNING, refusal.sentence)
            return MavResult.FAILED
        self._close(OVERRULES.get(kind, ()), MavResult.FAILED, out)
        if len(self._open) >= OPEN:
            return MavResult.FAILED
        if self.holder.sender is None:
            self.pilot.source = station.pilot  # in whose name it is asked
        self._open.append(OpenCommand(station, command, kind, now))
        refused, counts = events.REFUSED_HERE(kind).name, self.pilot.outbox.counts
        before = counts[refused]
        if kind == "mode" and self.pilot.in_failsafe:  # a deliberate act: it ends the failsafe
            self.read(("resume",), now, out)
        self.read((intent,), now, out)
        if counts[refused] > before:
            self._close((kind,), MavResult.FAILED, out)
        return None

    def tick(self, now: Ns, out: Reaction) -> None:
        self.repeat(now, out)
        late = [o for o in self._open if now > o.since_ns + PATIENCE_NS]
        for one in late:
            self._open.remove(one)
            out.acknowledge(one.sender, one.command, MavResult.FAILED)

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns, out: Reaction) -> None:
        self.learn(request, answer, now, out)
        if request.kind == "lease" and not answer.accepted:
            self._close(("arm",), MavResult.FAILED, out)
        result = MavResult.ACCEPTED if answer.accepted else MavResult.FAILED
        # Who arms while a failsafe acts resumes.
        closes: tuple[RequestKind, ...] = ("arm",) if request.kind == "resume" else (request.kind,)
        self._close(closes, result, out)

    def given_up(self, request: PilotRequest, now: Ns, out: Reaction) -> None:
        out.add(self.pilot.given_up(request, now))
        kinds: tuple[RequestKind, ...] = (request.kind,)
        self._close((*kinds, "arm") if request.kind == "lease" else kinds, MavResult.FAILED, out)

    def _close(self, kinds: Iterable[RequestKind], result: MavResult, out: Reaction) -> None:
        """Acknowledge the commands of these kinds."""
        closed = [one for one in self._open if one.kind in kinds]
        for one in closed:
            self._open.remove(one)
            out.acknowledge(one.sender, one.command, result)
