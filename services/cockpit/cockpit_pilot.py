"""The page with the sticks as a pilot: one page at a time, by the rules of every pilot. The lease
decides between pilots; this decides between the pages of one."""

from messages import events
from messages.events import Row
from messages.pilot import RequestKind
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.cockpit.page_messages import Absence, PageSticks, PageWish, Wish
from services.marine.outputs import LIGHT
from services.piloting.guest_pilot import PlainGuest, StickHolder
from services.piloting.pilot import Effects, Pilot
from services.piloting.pilot_intents import (
    Intent,
    ModeIntent,
    OutputIntent,
    PlaceIntent,
    goto,
)
from services.piloting.sticks import Sticks

KEPT_NS = 2_000_000_000  # [ns] of silence until another page may take the sticks
REPEAT_NS = 30_000_000  # [ns] after the newest command: a page that is late for once
SAY_LOST_NS = 1_000_000_000  # [ns] so long `lost` is published; then silence
# A pad reports changes only. A thumb that deflects a stick never holds it so still for so long.
PAD_PATIENCE_MS = 1000.0  # [ms] without a report of a pad with a deflected stick
KINDS: dict[Wish, RequestKind] = {
    "take": "lease", "force": "force", "offer": "offer", "give_back": "release"
}  # fmt: skip
# A newer one withdraws an older one of the same output.
ASKED_ANEW: tuple[Wish, ...] = ("light", "light_2", "laser", "output")
LOST: dict[Absence, Row] = {
    "hidden": events.LOST_PAGE_HIDDEN,
    "closed": events.LOST_PAGE_CLOSED,
    "unplugged": events.LOST_PAGE_UNPLUGGED,
}


class CockpitPilot(PlainGuest[int]):
    __slots__ = ()

    @classmethod
    def named(cls, pilot: Pilot, name: str) -> "CockpitPilot":
        pilot.source = name
        return cls(
            pilot,
            events.LOST_PAGE_SILENT,
            events.NOT_THE_HOLDER_PAGE(),
            StickHolder(KEPT_NS),
            SAY_LOST_NS,
            REPEAT_NS,
        )

    # From pages.

    def moved(self, page: int, message: PageSticks, read_ns: Ns, now: Ns) -> Effects:
        out, m = Effects(), message
        if self.holder.sender != page:
            self.pilot.outbox.count(self.not_the_holder)
            return out
        sticks = Sticks(m.surge, m.sway, m.heave, m.yaw, m.tilt, m.gripper)
        self.holder.move(sticks, read_ns, now)
        if m.device_ms > PAD_PATIENCE_MS and not sticks.at_rest:
            self.holder.lose(events.LOST_PAGE_FROZEN)
        self.read((), now, out)
        return out

    def absent(self, page: int, why: Absence, now: Ns) -> Effects:
        """The pilot cannot steer from this page now."""
        out = Effects()
        if self.holder.sender == page:
            self.holder.lose(LOST[why])
            self.read((), now, out)
        return out

    def closed(self, page: int, now: Ns) -> Effects:
        out = self.absent(page, "closed", now)
        if self.holder.sender == page:
            self.holder.release()
        return out

    def wish(self, page: int, message: PageWish, now: Ns) -> Effects:
        out, what = Effects(), message.what
        if what in ("take", "force"):
            self._take(page, what, now, out)
        elif what != "stop" and self.holder.sender != page:
            self._refuse(what)
        elif what not in ASKED_ANEW and KINDS.get(what, what) in self.waiting:
            pass  # it is being repeated until the drone answers
        elif what == "give_back":
            self._give_back(out)
        elif what == "offer":
            out.requests.append(self.request("offer"))
        elif what in ("arm", "resume") and not self.holder.fresh(now):
            self.pilot.outbox.tell(events.REFUSED_HERE(what, detail="no stick positions arrive"))
        elif what in ("arm", "resume") and (what == "resume") != self.pilot.in_failsafe:
            self.pilot.outbox.tell(events.VOID_HOLD(detail=what))
        elif (intent := _intent(message)) is None:
            self.pilot.outbox.tell(events.MALFORMED_PAGE())
        else:
            self.read((intent,), now, out)
        return out

    def may_choose(self, page: int, camera: str, now: Ns) -> bool:
        """May this page say which camera is large? A refusal is counted and said."""
        if not self.holder.may_take(page, now):
            self._refuse(f"{camera} camera")
            return False
        return True

    # From the drone, and from the clock.

    def status(self, status: VehicleStatus, now: Ns) -> Effects:
        """Ask for control only while a page sends sticks."""
        out = Effects()
        self.pilot.notice_failsafe(status, now)
        self.follow(status, now, out)
        return out

    # Within.

    def _take(self, page: int, what: Wish, now: Ns, out: Effects) -> None:
        if not self.holder.claim(page, now):
            self._refuse(f"{_named(what)}: another page must give them back")
        elif KINDS[what] not in self.waiting:
            out.requests.append(self.request(KINDS[what]))

    def _give_back(self, out: Effects) -> None:
        """Deliberately: no pilot is lost by it."""
        self.holder.release()
        self._was_fresh, self.lost = False, ""
        if self.pilot.in_control:
            out.requests.append(self.request("release"))

    def _tell_lost(self, why: Row) -> None:
        """Whoever has control; and the sticks move nothing until they were centred."""
        self.holder.lose(why)
        self.pilot.outbox.tell(why())

    def _refuse(self, what: str) -> None:
        """A page without the sticks asked for something."""
        self.pilot.outbox.tell(events.NOT_THE_HOLDER_PAGE(detail=_named(what)))


def _intent(message: PageWish) -> Intent | None:
    """None: it says too little."""
    match message.what:
        case "mode":
            return message.flight_mode and ModeIntent(message.flight_mode)
        case "goto" if message.north is not None and message.east is not None:
            return PlaceIntent(message.north, message.east)
        case "goto" if message.depth is not None or message.heading_deg is not None:
            return goto(message.depth, message.heading_deg)
        case "light" if message.value is not None:
            return OutputIntent(LIGHT, message.value)
        case "output" if message.output:
            return OutputIntent(message.output, message.value)
        case "arm" | "resume" | "disarm" | "stop" | "home" | "unwind":
            return message.what
        case "light" | "light_2" | "laser":
            return message.what
        case _:
            return None


def _named(what: str) -> str:
    return what.replace("_", " ")
