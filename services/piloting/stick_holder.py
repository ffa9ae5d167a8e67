"""Which sender outside of Lindy has the sticks: one at a time, such as a ground station."""

from dataclasses import dataclass
from typing import Generic, TypeVar

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
