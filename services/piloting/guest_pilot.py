"""A pilot whose sticks come from outside of Lindy, as from a ground station, a node of ROS 2 or a
page in a browser: the lease, the sticks and their time-to-live by the rules of every pilot.

It asks for control only while sticks arrive, and publishes commands only while it has it: another
pilot on this side is not disturbed.

One sender at a time has the sticks, a ground station or a page.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from msgspec.structs import replace

from messages.events import Event, Row
from messages.pilot import TTL_MS, PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.piloting.pilot import Effects, Pilot, Waiting
from services.piloting.pilot_intents import Intent
from services.piloting.sticks import CENTRED, StickReading, Sticks

TTL_NS = round(TTL_MS * 1e6)  # [ns] sticks older than this move nothing, as any pilot's
# As long as the drone keeps control for a silent pilot (services/reference/guidance/authority.py).
KEPT_NS = 10_000_000_000  # [ns] of silence until another sender may have them


F = TypeVar("F")  # what a sender is known by; two are the same where it is equal


@dataclass(slots=True)
class StickHolder(Generic[F]):
    """The newest stick positions of the one who has them."""

    kept_ns: Ns = KEPT_NS
    sender: F | None = None
    tilt: float = 0.0  # [-] of buttons, for the camera
    gripper: float = 0.0  # [-] of buttons
    lost: Row | None = None  # why the pilot is lost; None: not lost, or silent
    _sticks: Sticks = CENTRED
    _read_ns: Ns = 0  # [ns] the earliest moment at which they may have been read
    _heard_ns: Ns = 0
    _known: bool = False  # positions arrived since it has them, or since the pilot was lost
    _rested: bool = False  # they were centred since then

    def claim(self, sender: F, now: Ns) -> bool:
        """It wants the sticks. False: another sender has them."""
        if not self.may_take(sender, now):
            return False
        if sender != self.sender:
            self.release()
            self.sender, self._heard_ns = sender, now
        return True

    def take(self, sender: F, sticks: Sticks, now: Ns) -> bool:
        """Stick positions arrived. False: another sender has the sticks.

        Deflected sticks of a new holder move nothing until they were centred once.
        """
        if not self.claim(sender, now):
            return False
        self.move(sticks, now, now)
        return True

    def move(self, sticks: Sticks, read_ns: Ns, now: Ns) -> None:
        """Positions of the holder arrived, which were read at `read_ns` [ns] or later. After it was
        lost they move nothing until they were centred."""
        self._sticks, self._read_ns, self._heard_ns = sticks, read_ns, now
        self._known, self.lost = True, None
        self._rested = self._rested or sticks.at_rest

    def lose(self, why: Row) -> None:
        """The pilot is lost until positions arrive again."""
        self.lost, self._known, self._rested, self._sticks = why, False, False, CENTRED

    def release(self) -> None:
        """The sender gives the sticks back."""
        self.sender, self.lost, self.tilt, self.gripper = None, None, 0.0, 0.0
        self._sticks, self._known, self._rested = CENTRED, False, False

    def may_take(self, sender: F, now: Ns) -> bool:
        return self.sender in (None, sender) or now >= self._heard_ns + self.kept_ns

    def age_ns(self, now: Ns) -> Ns:
        """[ns] At most, since the newest positions were read."""
        return now - self._read_ns

    def fresh(self, now: Ns) -> bool:
        return self.sender is not None and self._known and self.age_ns(now) <= TTL_NS

    def wants_rest(self, now: Ns) -> bool:
        """Do its positions move nothing until they were centred?"""
        return self.fresh(now) and not self._rested

    def reading(self, now: Ns, presses: tuple[Intent, ...] = ()) -> StickReading:
        """As of any stick source; without fresh positions the pilot is lost."""
        if not self.fresh(now):
            return StickReading(present=False, at_rest=False, presses=presses)
        sticks = self._sticks if self._rested else CENTRED
        return StickReading(
            sticks=sticks._replace(
                tilt=self.tilt or sticks.tilt, gripper=self.gripper or sticks.gripper
            ),
            at_rest=self._sticks.at_rest,
            age_ms=self.age_ns(now) / 1e6,
            presses=presses,
        )


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
