"""A ground station as a pilot: sticks, lease and requests by the rules of every pilot.

One ground station has the sticks. What it asks for goes to the drone in the name of that station,
and the drone's answer becomes the acknowledgement of its command.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from msgspec.structs import replace

from messages import events
from messages.pilot import TTL_MS, PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.mavlink.packets import GroundStation
from services.mavlink.reaction import Reaction
from services.mavlink.stick_holder import StickHolder
from services.mavlink_io.numbers import MavResult, MavSeverity
from services.piloting.overruling import OVERRULES
from services.piloting.pilot import Pilot, Waiting
from services.piloting.pilot_intents import Intent, ModeIntent
from services.piloting.sticks import Sticks

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
class GroundPilot:
    pilot: Pilot
    holder: StickHolder = field(default_factory=StickHolder)
    _open: list[OpenCommand] = field(default_factory=list[OpenCommand])
    _was_fresh: bool = False

    @property
    def name(self) -> str:
        """As the pilot's name; that of the last ground station when nobody has the sticks."""
        return self.holder.station.pilot if self.holder.station else self.pilot.source

    def steer(
        self, station: GroundStation, sticks: Sticks, waiting: Waiting, now: Ns, out: Reaction
    ) -> bool:
        """Stick positions of a ground station. False: another one has the sticks."""
        if not self.holder.take(station, sticks, now):
            self.pilot.outbox.tell(events.NOT_THE_HOLDER("sticks"))
            return False
        self._say_command(waiting, now, out)
        return True

    def press(self, intents: Iterable[Intent], waiting: Waiting, now: Ns, out: Reaction) -> None:
        """What the holder asks for with buttons, or by a command."""
        for intent in intents:
            self._read((intent,), waiting, now, out)

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
            assert self.holder.station is not None
            self.pilot.outbox.tell(events.NOT_THE_HOLDER(kind))
            whose = self.holder.station.pilot
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
            if self.holder.station is None:
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
        """Repeat the newest sticks for as long as they are fresh: a lost command costs nothing."""
        self._say_command(waiting, now, out)
        late = [o for o in self._open if now > o.since_ns + PATIENCE_NS]
        for one in late:
            self._open.remove(one)
            out.acknowledge(one.sender, one.command, MavResult.FAILED)

    def status(self, status: VehicleStatus, waiting: Waiting, now: Ns, out: Reaction) -> None:
        """Ask for control only while a ground station sends sticks."""
        if self.holder.fresh(now):
            out.add(self.pilot.status(status, waiting, now))

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns, out: Reaction) -> None:
        out.add(self.pilot.answered(request, answer, now))
        if answer.epoch is not None and self.holder.fresh(now):
            self._read((), frozenset(), now, out)  # the drone arms only with sticks of this epoch
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

    def _say_command(self, waiting: Waiting, now: Ns, out: Reaction) -> None:
        """While the sticks are fresh, and once when they no longer are; only in control, so that
        another pilot on this side is not disturbed."""
        fresh = self.holder.fresh(now)
        if fresh or self._was_fresh:
            self._read((), waiting, now, out)
        if self._was_fresh and not fresh and self.pilot.in_control:
            silence = f"{self.name}, for {TTL_MS:.0f} ms"
            self.pilot.outbox.tell(events.LOST_STICKS(detail=silence))
        self._was_fresh = fresh

    def _read(self, presses: tuple[Intent, ...], waiting: Waiting, now: Ns, out: Reaction) -> None:
        fresh = self.holder.fresh(now)
        effects = self.pilot.read(self.holder.reading(now, presses), self.name, 0, waiting, now)
        command, effects.command = effects.command, None
        out.add(effects)
        if command is not None and self.pilot.in_control and (fresh or self._was_fresh):
            left = TTL_MS - self.holder.age_ns(now) / 1e6 if fresh else TTL_MS
            out.command = replace(command, ttl_ms=left)

    def _close(self, kinds: Iterable[RequestKind], result: MavResult, out: Reaction) -> None:
        """Acknowledge the commands of these kinds."""
        closed = [one for one in self._open if one.kind in kinds]
        for one in closed:
            self._open.remove(one)
            out.acknowledge(one.sender, one.command, result)


def _kind(intent: Intent) -> RequestKind:
    match intent:
        case "arm" | "disarm" | "stop" | "light":
            return intent
        case _:
            raise ValueError(f"no command of a ground station asks for {intent}")
