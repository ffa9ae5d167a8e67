"""Which sender outside of Lindy has the sticks: one at a time, as a ground station or a page."""

from dataclasses import dataclass
from typing import Generic, TypeVar

from messages.events import Row
from messages.pilot import TTL_MS
from messages.units import Ns
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
        """Nobody has them."""
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
