"""A ground station as a pilot: sticks, lease and requests by the rules of every pilot.

One ground station has the sticks. What it asks for goes to the drone in the name of that station,
and the drone's answer becomes the acknowledgement of its command.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from messages import events
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns
from services.mavlink.packets import GroundStation
from services.mavlink.reaction import Reaction
from services.mavlink_io.numbers import MavResult, MavSeverity
from services.piloting.guest_pilot import GuestPilot
from services.piloting.pilot import Waiting
from services.piloting.pilot_intents import OVERRULES, Intent, ModeIntent

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
        self,
        station: GroundStation,
        command: int,
        intent: Intent,
        waiting: Waiting,
        now: Ns,
        out: Reaction,
    ) -> None:
        """A command that the drone answers; it is acknowledged then."""
        kind: RequestKind = "mode" if isinstance(intent, ModeIntent) else _kind(intent)
        if kind != "stop" and not self.holder.may_take(station, now):
            assert self.holder.sender is not None
            self.pilot.outbox.tell(events.NOT_THE_HOLDER(kind))
            whose = self.holder.sender.pilot
            out.say(station.link, MavSeverity.WARNING, f"{whose} has the sticks: {kind} refused")
            out.acknowledge(station, command, MavResult.DENIED)
        elif kind == "arm" and not self.holder.fresh(now):
            refusal = events.REFUSED_HERE(kind, detail=NO_STICKS)
            self.pilot.outbox.count(refusal)
            out.say(station.link, MavSeverity.WARNING, refusal.sentence)
            out.acknowledge(station, command, MavResult.FAILED)
        else:
            self._close(OVERRULES.get(kind, ()), MavResult.FAILED, out)
            if len(self._open) >= OPEN:
                out.acknowledge(station, command, MavResult.FAILED)
                return
            if self.holder.sender is None:
                self.pilot.source = station.pilot  # in whose name it is asked
            self._open.append(OpenCommand(station, command, kind, now))
            refused, counts = events.REFUSED_HERE(kind).name, self.pilot.outbox.counts
            before = counts[refused]
            if kind == "mode" and self.pilot.in_failsafe:  # a deliberate act: it ends the failsafe
                self._read(("resume",), waiting, now, out)
            self._read((intent,), waiting, now, out)
            if counts[refused] > before:
                self._close((kind,), MavResult.FAILED, out)

    def light(self, value: float, out: Reaction) -> None:
        out.requests.append(
            PilotRequest(
                stamp_ns=0,
                id="",
                kind="light",
                value=value,
                source=self.name[:128],
                epoch=self.pilot.progress.epoch or 0,
            )
        )

    def tick(self, waiting: Waiting, now: Ns, out: Reaction) -> None:
        self.repeat(waiting, now, out)
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


def _kind(intent: Intent) -> RequestKind:
    match intent:
        case "arm" | "disarm" | "stop" | "light" | "home":
            return intent
        case _:
            raise ValueError(f"no command of a ground station asks for {intent}")
