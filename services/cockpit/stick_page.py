"""Which page has the sticks of this cockpit: one at a time. The lease decides between pilots; this
decides between the pages of one."""

from dataclasses import dataclass

from messages import events
from messages.events import Row
from messages.pilot import TTL_MS
from messages.units import Ns
from services.cockpit.page_messages import PageSticks
from services.piloting.pilot_intents import Intent
from services.piloting.sticks import CENTRED, StickReading, Sticks

TTL_NS = round(TTL_MS * 1e6)  # [ns] sticks older than this move nothing, as any pilot's
KEPT_NS = 2_000_000_000  # [ns] of silence until another page may take them
# A pad reports changes only. A thumb that deflects a stick never holds it so still for so long.
PAD_PATIENCE_MS = 1000.0  # [ms] without a report of a pad with a deflected stick


@dataclass(slots=True)
class StickPage:
    """The newest stick positions of the page that has them."""

    page: int | None = None
    lost: Row | None = None  # why the pilot is lost; None: not lost
    device: str = ""
    _sticks: Sticks = CENTRED
    _read_ns: Ns = 0  # [ns] the earliest moment at which they may have been read
    _heard_ns: Ns = 0
    _known: bool = False  # positions arrived since it has them, or since the pilot was lost
    _rested: bool = False  # they were centred since then

    def take(self, page: int, now: Ns) -> bool:
        """False: another page has them."""
        if not self.may_take(page, now):
            return False
        if page != self.page:
            self.lay_down()
            self.page, self._heard_ns = page, now
        return True

    def may_take(self, page: int, now: Ns) -> bool:
        return self.page in (None, page) or now >= self._heard_ns + KEPT_NS

    def lay_down(self) -> None:
        """Nobody has them."""
        self.page, self.lost, self.device = None, None, ""
        self._sticks, self._known, self._rested = CENTRED, False, False

    def move(self, message: PageSticks, read_ns: Ns, now: Ns) -> None:
        """Its positions arrived. After every loss they move nothing until they were centred."""
        m = message
        sticks = Sticks(m.surge, m.sway, m.heave, m.yaw, m.tilt, m.gripper)
        self._heard_ns = now
        if message.device_ms > PAD_PATIENCE_MS and not sticks.at_rest:
            self.lose(events.LOST_PAGE_FROZEN)
            return
        self._sticks, self._read_ns, self._known, self.lost = sticks, read_ns, True, None
        self._rested = self._rested or sticks.at_rest
        self.device = message.device

    def lose(self, why: Row) -> None:
        """The pilot is lost until positions arrive again."""
        self.lost, self._known, self._rested = why, False, False
        self._sticks = CENTRED

    def age_ns(self, now: Ns) -> Ns:
        """[ns] At most, since the newest positions were read."""
        return now - self._read_ns

    def fresh(self, now: Ns) -> bool:
        return self.page is not None and self._known and self.age_ns(now) <= TTL_NS

    def wants_rest(self, now: Ns) -> bool:
        """Do its positions move nothing until they were centred?"""
        return self.fresh(now) and not self._rested

    def reading(self, now: Ns, presses: tuple[Intent, ...] = ()) -> StickReading:
        """As of any stick source; without fresh positions the pilot is lost."""
        if not self.fresh(now):
            return StickReading(present=False, at_rest=False, presses=presses)
        return StickReading(
            sticks=self._sticks if self._rested else CENTRED,
            at_rest=self._sticks.at_rest,
            age_ms=self.age_ns(now) / 1e6,
            presses=presses,
        )
