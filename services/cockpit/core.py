"""All pages of the cockpit as a state machine: who they are, what they may, what they are shown."""

import ipaddress
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import msgspec

from messages.counts import in_words
from messages.fly import DroneList, FlyAnswer, FlyRequest
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.units import Name, Ns
from messages.vehicle import VehicleStatus
from services.cockpit.cockpit_pilot import CockpitPilot, refuse
from services.cockpit.drone_order import DroneOrder
from services.cockpit.outlook import LastHeard, outlook
from services.cockpit.page_messages import (
    AnyPageMessage,
    PageAbsence,
    PageFly,
    PageMessage,
    PageSeen,
    PageSticks,
    PageWish,
)
from services.piloting.pilot import Effects, Pilot, Waiting

SHOW_HZ = 25.0  # [1/s] pictures of the drone
UNSEEN = (
    15  # pictures that a page may have under way: 0.6 s; then it gets none until it has caught up
)
REMEMBERED = 64  # pictures whose time of sending is known
LINES = 4  # newest warnings that are shown
LONGEST_LINE = 160  # [characters]
CLOCK_ERROR_NS = 20_000_000  # [ns] by which a browser's coarse clock may be ahead
VERY_OLD_NS = -(2**62)  # [ns] when a message was read that does not say so


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [cockpit] of a vehicle file."""

    host: str = "127.0.0.1"  # address to listen on; only this machine
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 8767
    pilot: Annotated[Name, msgspec.Meta(min_length=1)] = "cockpit"  # name, for other pilots
    certificate: str = ""  # PEM file, for https where other machines reach it
    key: str = ""  # PEM file of its private key

    def __post_init__(self) -> None:
        if bool(self.certificate) != bool(self.key):
            raise ValueError("certificate and key go together: give both or neither")
        if not self.certificate and not self.local:
            raise ValueError(
                f"host {self.host} can be reached by other machines, and without https whoever "
                f"listens there may fly: set cockpit.certificate and cockpit.key, or forward the "
                f"port with ssh -L {self.port}:127.0.0.1:{self.port}"
            )

    @property
    def local(self) -> bool:
        """Can only this machine reach it?"""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


class Personal(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What is different for each page."""

    watcher: bool = False  # it may not command
    has_sticks: bool = False
    in_control: bool = False  # of the drone, this cockpit
    taken: bool = False  # another page of this cockpit has the sticks
    lost: str = ""  # why the pilot is lost
    wants_rest: bool = False  # its sticks move nothing until they were centred
    device: str = ""
    delay_ms: float | None = None  # [ms] there and back, between service and page
    pages: int = 0


@dataclass(slots=True)
class Page:
    watcher: bool
    sent: int  # number of the newest picture that it was sent
    seen: int  # number of the newest that it has confirmed
    delay_ns: Ns | None = None
    listed_ns: Ns | None = None  # stamp of the newest list of drones that it was sent


@dataclass(slots=True)
class PageEffects(Effects):
    """What one event causes, beyond what a pilot does."""

    orders: list[FlyRequest] = field(default_factory=list[FlyRequest])


class Cockpit:
    """The state machine. `waiting`: kinds of the requests that the drone has not answered yet."""

    def __init__(
        self,
        settings: Settings,
        pilot: Pilot,
        limits: Sequence[tuple[float, float]] = (),
        drone: str = "",
    ) -> None:
        """
        Args:
            limits: [N] least and most thrust of each thruster.
            drone: its name, which every page is shown.
        """
        self._drone = drone
        self._pilot = CockpitPilot(pilot, settings.pilot)
        self._order = DroneOrder()
        self._limits = limits
        self._pages: dict[int, Page] = {}
        self._lines: deque[tuple[str, str]] = deque(maxlen=LINES)
        self._picture = 0  # number of the newest
        self._sent_ns: dict[int, Ns] = {}  # by number of the picture
        self._command: PilotCommand | None = None
        self._encode = msgspec.json.Encoder().encode

    # From pages.

    def opened(self, page: int, *, watcher: bool) -> None:
        self._pages[page] = Page(watcher, self._picture, self._picture)

    def closed(self, page: int, waiting: Waiting, now: Ns) -> Effects:
        self._pages.pop(page, None)
        return self._kept(self._pilot.closed(page, waiting, now))

    def received(
        self, page: int, message: AnyPageMessage | None, waiting: Waiting, now: Ns
    ) -> Effects:
        """`message`: None for one that could not be read."""
        sender = self._pages.get(page)
        if sender is None:
            return Effects()  # closed meanwhile
        if message is None:
            return Effects(["malformed:page"])
        read_ns = self._read_ns(sender, message, now)
        if isinstance(message, PageSeen):
            return Effects()
        if sender.watcher:
            return Effects(["refused:watcher"])
        match message:
            case PageSticks():
                out = self._pilot.steer(page, message, read_ns, waiting, now)
            case PageWish():
                out = self._pilot.wish(page, message, read_ns, waiting, now)
            case PageFly():
                out = self._fly(page, message.drone, read_ns, now)
            case PageAbsence():
                out = self._pilot.absent(page, message.why, waiting, now)
        return self._kept(out)

    def _fly(self, page: int, drone: str, read_ns: Ns, now: Ns) -> Effects:
        """An order to fly another drone."""
        out = self._pilot.may_leave(page, drone, read_ns, now)
        if out.counts:
            return out
        if why := self._order.refusal(drone):
            refuse(out, "refused_here:fly", why)
            return out
        return PageEffects(orders=[self._order.ask(drone, now)])

    def _read_ns(self, sender: Page, message: PageMessage, now: Ns) -> Ns:
        """[ns] The earliest moment at which the page may have made the message."""
        sender.seen = max(sender.seen, min(message.seen, sender.sent))
        sent = self._sent_ns.get(message.seen)
        if sent is None or message.held_ms > (now - sent + CLOCK_ERROR_NS) / 1e6:
            return VERY_OLD_NS  # no page has held a picture for longer than there is one
        read = min(now, sent + round(message.held_ms * 1e6))
        sender.delay_ns = now - read
        return read

    # From the drone, and from the clock.

    def tick(self, waiting: Waiting, now: Ns) -> Effects:
        return self._kept(self._pilot.tick(waiting, now))

    def status(self, status: VehicleStatus, waiting: Waiting, now: Ns) -> Effects:
        return self._kept(self._pilot.status(status, waiting, now))

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Effects:
        return self._kept(self._pilot.answered(request, answer, now))

    def given_up(self, request: PilotRequest, now: Ns) -> Effects:
        return self._kept(self._pilot.pilot.given_up(request, now))

    def changed(self, request: FlyRequest, answer: FlyAnswer, now: Ns) -> None:
        """`lindy fly` has answered."""
        self._order.answered(request, answer, now)

    def not_changed(self, request: FlyRequest, now: Ns) -> None:
        """`lindy fly` has not answered."""
        self._order.given_up(request, now)

    def log(self, line: LogLine) -> None:
        """Warnings and errors of all services."""
        if line.level != "info":
            self._add_line(line.level, in_words(line.text))

    # To pages.

    def pictures(
        self, newest: LastHeard, drones: DroneList | None, now: Ns
    ) -> tuple[dict[int, str], list[str]]:
        """What each page is sent now, and what is to be counted. A page that has not seen the
        newest pictures gets none, so that none of them waits anywhere.

        Args:
            drones: that can be reached; None: nobody says so now.
        """
        self._order.look(drones, now)
        self._picture += 1
        self._sent_ns[self._picture] = now
        self._sent_ns.pop(self._picture - REMEMBERED, None)
        command = self._command
        if command is not None and now > command.stamp_ns + command.ttl_ms * 1e6:
            command = None
        if not self._pages:
            return {}, []
        lines, change = tuple(self._lines), self._order.words
        view = outlook(newest, command, self._limits, lines, self._drone, change, now)
        shared = self._encode(view).decode()
        ready = [n for n, page in self._pages.items() if page.sent - page.seen < UNSEEN]
        for number in ready:
            self._pages[number].sent = self._picture
        head = f'{{"n":{self._picture},"t":{now / 1e6:.2f},"you":'
        listed = "" if drones is None else f',"fly":{self._encode(drones).decode()}'
        texts = {
            n: f'{head}{self._personal(n, newest, now)},"view":{shared}'
            f"{listed if self._is_new(n, drones) else ''}}}"
            for n in ready
        }
        return texts, ["dropped:page"] * (len(self._pages) - len(ready))

    def _is_new(self, number: int, drones: DroneList | None) -> bool:
        """Has the page not been sent this list yet? It comes once a second, a picture 25 times."""
        page = self._pages[number]
        if drones is None or page.listed_ns == drones.stamp_ns:
            return False
        page.listed_ns = drones.stamp_ns
        return True

    def _personal(self, number: int, newest: LastHeard, now: Ns) -> str:
        page, holder, pilot = self._pages[number], self._pilot.holder, self._pilot.pilot
        given = None if newest.status is None else newest.status.epoch
        told = Personal(
            watcher=page.watcher,
            has_sticks=holder.page == number,
            in_control=pilot.in_control and pilot.progress.epoch == given,
            taken=holder.page not in (None, number),
            lost=self._pilot.lost,
            wants_rest=holder.page == number and holder.wants_rest(now),
            device=holder.device,
            delay_ms=None if page.delay_ns is None else round(page.delay_ns / 1e6, 1),
            pages=len(self._pages),
        )
        return self._encode(told).decode()

    def _kept(self, effects: Effects) -> Effects:
        """Remember what pages are shown of it."""
        for level, text in effects.notes:
            self._add_line(level, text)
        self._command = effects.command or self._command
        return effects

    def _add_line(self, level: str, text: str) -> None:
        self._lines.append((level, text[:LONGEST_LINE]))
