"""The page with the sticks as a pilot: sticks, lease and requests by the rules of every pilot."""

from dataclasses import dataclass, field

from msgspec.structs import replace

from messages import events
from messages.events import Row
from messages.pilot import TTL_MS, PilotAnswer, PilotRequest, RequestKind
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.cockpit.page_messages import Absence, PageSticks, PageWish, Wish
from services.cockpit.stick_page import StickPage
from services.marine.outputs import LIGHT
from services.piloting.pilot import Effects, Pilot, Waiting
from services.piloting.pilot_intents import (
    Intent,
    ModeIntent,
    OutputIntent,
    PlaceIntent,
    goto,
)

REPEAT_NS = 30_000_000  # [ns] after the newest command: a page that is late for once
SAY_LOST_NS = (
    1_000_000_000  # [ns] so long `lost` is published; then silence, so that the lease ends
)
WISH_PATIENCE_NS = 1_000_000_000  # [ns] an older wish is not carried out: it waited in a network
ALWAYS: tuple[Wish, ...] = ("stop", "disarm", "give_back")  # however old
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


@dataclass(slots=True)
class CockpitPilot:
    pilot: Pilot
    name: str
    holder: StickPage = field(default_factory=StickPage)
    lost: str = ""  # why the pilot is lost, in words; empty: not lost
    _was_fresh: bool = False
    _lost_ns: Ns = -SAY_LOST_NS
    _said_ns: Ns = 0

    def __post_init__(self) -> None:
        self.pilot.source = self.name

    # From pages.

    def steer(
        self, page: int, message: PageSticks, read_ns: Ns, waiting: Waiting, now: Ns
    ) -> Effects:
        out = Effects()
        if self.holder.page != page:
            self.pilot.outbox.count(events.NOT_THE_HOLDER_PAGE())
            return out
        self.holder.move(message, read_ns, now)
        self._notice(now)
        self._say(waiting, now, out)
        return out

    def absent(self, page: int, why: Absence, waiting: Waiting, now: Ns) -> Effects:
        """The pilot cannot steer from this page now."""
        return self._lose(page, LOST[why], waiting, now)

    def _lose(self, page: int, why: Row, waiting: Waiting, now: Ns) -> Effects:
        out = Effects()
        if self.holder.page == page:
            self.holder.lose(why)
            self._notice(now)
            self._say(waiting, now, out)
        return out

    def closed(self, page: int, waiting: Waiting, now: Ns) -> Effects:
        out = self._lose(page, events.LOST_PAGE_CLOSED, waiting, now)
        if self.holder.page == page:
            self.holder.lay_down()
        return out

    def wish(self, page: int, message: PageWish, read_ns: Ns, waiting: Waiting, now: Ns) -> Effects:
        out, what = Effects(), message.what
        if what not in ALWAYS and now > read_ns + WISH_PATIENCE_NS:
            self.pilot.outbox.tell(events.EXPIRED_WISH(detail=_named(what)))
        elif what in ("take", "force"):
            self._take(page, what, waiting, now, out)
        elif what != "stop" and self.holder.page != page:
            self._refuse(what)
        elif what not in ASKED_ANEW and KINDS.get(what, what) in waiting:
            pass  # it is being repeated until the drone answers
        elif what == "give_back":
            self._give_back(out)
        elif what == "offer":
            out.requests.append(self._request("offer"))
        elif what in ("arm", "resume") and not self.holder.fresh(now):
            self.pilot.outbox.tell(events.REFUSED_HERE(what, detail="no stick positions arrive"))
        else:
            self._press(message, waiting, now, out)
        return out

    def may_choose(self, page: int, camera: str, read_ns: Ns, now: Ns) -> bool:
        """May this page say which camera is large? A refusal is counted and said."""
        if now > read_ns + WISH_PATIENCE_NS:
            self.pilot.outbox.tell(events.EXPIRED_WISH(detail=f"{camera} camera"))
            return False
        if not self.holder.may_take(page, now):
            self._refuse(f"{camera} camera")
            return False
        return True

    # From the drone, and from the clock.

    def tick(self, waiting: Waiting, now: Ns) -> Effects:
        """Repeat the newest sticks while they are fresh, and say so when they no longer are."""
        out = Effects()
        self._notice(now)
        if now >= self._said_ns + REPEAT_NS:
            self._say(waiting, now, out)
        return out

    def status(self, status: VehicleStatus, waiting: Waiting, now: Ns) -> Effects:
        """Ask for control only while a page sends sticks."""
        if self.holder.fresh(now):
            return self.pilot.status(status, waiting, now)
        self.pilot.notice_failsafe(status, now)
        return Effects()

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Effects:
        out = self.pilot.answered(request, answer, now)
        if answer.epoch is not None:
            self._say(frozenset(), now, out)  # the drone arms only with sticks of this epoch
        return out

    # Within.

    def _take(self, page: int, what: Wish, waiting: Waiting, now: Ns, out: Effects) -> None:
        if not self.holder.take(page, now):
            self._refuse(f"{_named(what)}: another page must give them back")
        elif KINDS[what] not in waiting:
            out.requests.append(self._request(KINDS[what]))

    def _give_back(self, out: Effects) -> None:
        """Deliberately: no pilot is lost by it."""
        self.holder.lay_down()
        self._was_fresh, self.lost = False, ""
        if self.pilot.in_control:
            out.requests.append(self._request("release"))

    def _press(self, message: PageWish, waiting: Waiting, now: Ns, out: Effects) -> None:
        intent = _intent(message)
        resumes = message.what == "resume"
        if message.what in ("arm", "resume") and resumes != self.pilot.in_failsafe:
            self.pilot.outbox.tell(events.VOID_HOLD(detail=message.what))
            return
        if intent is None:
            self.pilot.outbox.tell(events.MALFORMED_PAGE())
        else:
            self._say(waiting, now, out, (intent,))

    def _notice(self, now: Ns) -> None:
        """Whether the pilot was lost or is there again."""
        fresh = self.holder.fresh(now)
        if self._was_fresh and not fresh:
            why = self.holder.lost or events.LOST_PAGE_SILENT
            self.holder.lose(why)
            self.lost, self._lost_ns = why.sentence, now
            self.pilot.outbox.tell(why())
        elif fresh:
            self.lost = ""
        self._was_fresh = fresh

    def _say(
        self, waiting: Waiting, now: Ns, out: Effects, presses: tuple[Intent, ...] = ()
    ) -> None:
        """Read the sticks, and publish them while this pilot has control: another pilot on this
        side is not disturbed."""
        effects = self.pilot.read(self.holder.reading(now, presses), self.name, 0, waiting, now)
        out.requests += effects.requests
        fresh = self.holder.fresh(now)
        if effects.command is None or not self.pilot.in_control:
            return
        if fresh or now < self._lost_ns + SAY_LOST_NS:
            left = TTL_MS - self.holder.age_ns(now) / 1e6 if fresh else TTL_MS
            out.command = replace(effects.command, ttl_ms=left)
            self._said_ns = now

    def _refuse(self, what: str) -> None:
        """A page without the sticks asked for something."""
        self.pilot.outbox.tell(events.NOT_THE_HOLDER_PAGE(detail=_named(what)))

    def _request(self, kind: RequestKind) -> PilotRequest:
        epoch = self.pilot.progress.epoch or 0
        return PilotRequest(stamp_ns=0, id="", kind=kind, source=self.name, epoch=epoch)


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
