"""A pilot whose sticks come from outside of Lindy, as from a ground station or a node of ROS 2: the
lease, the sticks and their time-to-live by the rules of every pilot.

One sender at a time has the sticks. The pilot asks for control only while sticks arrive, and
publishes commands only while it has it: another pilot on this side is not disturbed.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from msgspec.structs import replace

from messages.events import Event, Row
from messages.pilot import TTL_MS, PilotAnswer, PilotRequest
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

    sender: F | None = None
    tilt: float = 0.0  # [-] of buttons, for the camera
    gripper: float = 0.0  # [-] of buttons
    _sticks: Sticks = CENTRED
    _heard_ns: Ns = 0
    _at_rest_once: bool = False  # its sticks were centred since it has them

    def take(self, sender: F, sticks: Sticks, now: Ns) -> bool:
        """Stick positions arrived. False: another sender has the sticks.

        Deflected sticks of a new holder move nothing until they were centred once.
        """
        if not self.may_take(sender, now):
            return False
        if sender != self.sender:
            self.sender, self._at_rest_once = sender, False
            self.tilt = self.gripper = 0.0
        self._sticks, self._heard_ns = sticks, now
        self._at_rest_once = self._at_rest_once or sticks.at_rest
        return True

    def may_take(self, sender: F, now: Ns) -> bool:
        free = self.sender is None or now >= self._heard_ns + KEPT_NS
        return free or sender == self.sender

    def release(self) -> None:
        """The holder lets go."""
        self.sender, self._sticks = None, CENTRED
        self.tilt = self.gripper = 0.0

    def age_ns(self, now: Ns) -> Ns:
        """[ns] Since the newest stick positions arrived."""
        return now - self._heard_ns

    def fresh(self, now: Ns) -> bool:
        return self.sender is not None and self.age_ns(now) <= TTL_NS

    def reading(self, now: Ns, presses: tuple[Intent, ...] = ()) -> StickReading:
        """As of any stick source; without fresh positions the pilot is lost."""
        if not self.fresh(now):
            return StickReading(present=False, at_rest=False, presses=presses)
        sticks = self._sticks if self._at_rest_once else CENTRED
        return StickReading(
            sticks=sticks._replace(tilt=self.tilt or sticks.tilt, gripper=self.gripper),
            at_rest=self._sticks.at_rest,
            age_ms=self.age_ns(now) / 1e6,
            presses=presses,
        )


@dataclass(slots=True)
class GuestPilot(Generic[F]):
    pilot: Pilot
    lost: Row  # told when the sticks fall silent
    not_the_holder: Event  # told of sticks of anybody else
    holder: StickHolder[F] = field(default_factory=StickHolder[F])
    _was_fresh: bool = False

    @property
    def name(self) -> str:
        """As the pilot's name."""
        return self.pilot.source

    def steer(self, sender: F, sticks: Sticks, waiting: Waiting, now: Ns, out: Effects) -> bool:
        """Stick positions. False: another sender has the sticks."""
        if not self.holder.take(sender, sticks, now):
            self.pilot.outbox.tell(self.not_the_holder)
            return False
        self._say_command(waiting, now, out)
        return True

    def press(self, intents: Iterable[Intent], waiting: Waiting, now: Ns, out: Effects) -> None:
        """What the holder asks for with buttons, or by a command."""
        for intent in intents:
            self._read((intent,), waiting, now, out)

    def repeat(self, waiting: Waiting, now: Ns, out: Effects) -> None:
        """Repeat the newest sticks for as long as they are fresh: a lost command costs nothing."""
        self._say_command(waiting, now, out)

    def follow(self, status: VehicleStatus, waiting: Waiting, now: Ns, out: Effects) -> None:
        """Ask for control only while sticks arrive."""
        if self.holder.fresh(now):
            out.add(self.pilot.status(status, waiting, now))

    def learn(self, request: PilotRequest, answer: PilotAnswer, now: Ns, out: Effects) -> None:
        """The drone's answer; it arms only with sticks of this epoch."""
        out.add(self.pilot.answered(request, answer, now))
        if answer.epoch is not None and self.holder.fresh(now):
            self._read((), frozenset(), now, out)

    def _say_command(self, waiting: Waiting, now: Ns, out: Effects) -> None:
        """While the sticks are fresh, and once when they no longer are."""
        fresh = self.holder.fresh(now)
        if fresh or self._was_fresh:
            self._read((), waiting, now, out)
        if self._was_fresh and not fresh and self.pilot.in_control:
            self.pilot.outbox.tell(self.lost(detail=f"{self.name}, for {TTL_MS:.0f} ms"))
        self._was_fresh = fresh

    def _read(self, presses: tuple[Intent, ...], waiting: Waiting, now: Ns, out: Effects) -> None:
        fresh = self.holder.fresh(now)
        effects = self.pilot.read(self.holder.reading(now, presses), self.name, 0, waiting, now)
        command, effects.command = effects.command, None
        out.add(effects)
        if command is not None and self.pilot.in_control and (fresh or self._was_fresh):
            left = TTL_MS - self.holder.age_ns(now) / 1e6 if fresh else TTL_MS
            out.command = replace(command, ttl_ms=left)
