"""A pilot whose sticks come from outside of Lindy, as from a ground station, a node of ROS 2 or a
page in a browser: the lease, the sticks and their time-to-live by the rules of every pilot.

It asks for control only while sticks arrive, and publishes commands only while it has it: another
pilot on this side is not disturbed.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic

from msgspec.structs import replace

from messages.events import Event, Row
from messages.pilot import TTL_MS, PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.piloting.pilot import Effects, Pilot, Waiting
from services.piloting.pilot_intents import Intent
from services.piloting.stick_holder import F, StickHolder
from services.piloting.sticks import Sticks

ONCE_NS = 1  # [ns] at the instant at which the loss is noticed
NEVER_NS = -(2**62)  # [ns]


@dataclass(slots=True)
class GuestPilot(Generic[F]):
    pilot: Pilot
    silent: Row  # told when the sticks fall silent
    not_the_holder: Event  # told of sticks of anybody else
    holder: StickHolder[F] = field(default_factory=StickHolder[F])
    say_lost_ns: Ns = ONCE_NS  # so long `lost` is published; then silence, so that the lease ends
    repeat_ns: Ns = 0  # [ns] after the newest command: sticks that are late for once
    lost: str = ""  # why the pilot is lost: the event's name; empty: not lost
    _was_fresh: bool = False
    _lost_ns: Ns = NEVER_NS
    _said_ns: Ns = NEVER_NS

    @property
    def name(self) -> str:
        """As the pilot's name."""
        return self.pilot.source

    @property
    def waiting(self) -> Waiting:
        """Kinds of the requests that the drone has not answered yet."""
        return self.pilot.asked()

    def request(self, kind: RequestKind, value: float | None = None) -> PilotRequest:
        """In the pilot's name; without stamp and id, which the sender fills in."""
        name, epoch = self.name[:128], self.pilot.progress.epoch or 0
        return PilotRequest(stamp_ns=0, id="", kind=kind, value=value, source=name, epoch=epoch)

    def steer(self, sender: F, sticks: Sticks, now: Ns, out: Effects) -> bool:
        """Stick positions. False: another sender has the sticks."""
        if not self.holder.take(sender, sticks, now):
            self.pilot.outbox.tell(self.not_the_holder)
            return False
        self.read((), now, out)
        return True

    def press(self, intents: Iterable[Intent], now: Ns, out: Effects) -> None:
        """What the holder asks for with buttons, or by a command."""
        for intent in intents:
            self.read((intent,), now, out)

    def repeat(self, now: Ns, out: Effects) -> None:
        """Repeat the newest sticks for as long as they are fresh, where a lost command costs
        nothing; and say so when they no longer are."""
        self._notice(now)
        if self._speaks(now) and now >= self._said_ns + self.repeat_ns:
            self.read((), now, out)

    def follow(self, status: VehicleStatus, now: Ns, out: Effects) -> None:
        """Ask for control only while sticks arrive."""
        if self.holder.fresh(now):
            out.add(self.pilot.status(status, now))

    def learn(self, request: PilotRequest, answer: PilotAnswer, now: Ns, out: Effects) -> None:
        """The drone's answer; it arms only with sticks of this epoch."""
        out.add(self.pilot.answered(request, answer, now))
        if answer.epoch is not None and self.holder.fresh(now):
            self.read((), now, out)

    def read(self, presses: tuple[Intent, ...], now: Ns, out: Effects) -> None:
        """Read the sticks, and publish them while this pilot has control."""
        self._notice(now)
        effects = self.pilot.read(self.holder.reading(now, presses), self.name, 0, now)
        command, effects.command = effects.command, None
        out.add(effects)
        if command is not None and self.pilot.in_control and self._speaks(now):
            left = TTL_MS - self.holder.age_ns(now) / 1e6 if self._was_fresh else TTL_MS
            out.command, self._said_ns = replace(command, ttl_ms=left), now

    def _speaks(self, now: Ns) -> bool:
        return self._was_fresh or now < self._lost_ns + self.say_lost_ns

    def _notice(self, now: Ns) -> None:
        """Whether the pilot was lost or is there again."""
        fresh = self.holder.fresh(now)
        if self._was_fresh and not fresh:
            why = self.holder.lost or self.silent
            self.lost, self._lost_ns = why.name, now
            self._tell_lost(why)
        elif fresh:
            self.lost = ""
        self._was_fresh = fresh

    def _tell_lost(self, why: Row) -> None:
        if self.pilot.in_control:
            self.pilot.outbox.tell(why(detail=f"{self.name}, for {TTL_MS:.0f} ms"))


class PlainGuest(GuestPilot[F]):
    """A guest that causes nothing but what every pilot does."""

    __slots__ = ()

    def tick(self, now: Ns) -> Effects:
        out = Effects()
        self.repeat(now, out)
        return out

    def status(self, status: VehicleStatus, now: Ns) -> Effects:
        out = Effects()
        self.follow(status, now, out)
        return out

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Effects:
        out = Effects()
        self.learn(request, answer, now, out)
        return out

    def given_up(self, request: PilotRequest, now: Ns) -> Effects:
        return self.pilot.given_up(request, now)
