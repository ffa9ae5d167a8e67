"""All pages of the cockpit as a state machine: who they are, what they may, what they are shown."""

import ipaddress
from dataclasses import dataclass, field
from math import degrees
from typing import Annotated, Any

import msgspec
from msgspec.structs import replace

from messages import events, topics
from messages.events import Level
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.sensors import TemperatureSample
from messages.units import Name, Ns
from messages.vehicle import VehicleStatus
from messages.video import CameraChoice, CameraShares, FilmAnswer, FilmRequest
from services.cockpit.cameras import Cameras, Filming
from services.cockpit.cockpit_pilot import CockpitPilot
from services.cockpit.page_messages import (
    AnyPageMessage,
    PageAbsence,
    PageMessage,
    PageSeen,
    PageSticks,
    PageWish,
)
from services.cockpit.page_view import (
    AGES_MS,
    PageView,
    chart_view,
    line,
    positions,
    shown_outputs,
    turns,
)
from services.cockpit.past import Chart, DiveTimer, Endurance
from services.piloting.pilot import Effects, Pilot
from services.vehicle_view import ages, words
from services.vehicle_view.log_lines import LogLines
from services.vehicle_view.view import Newest, VehicleView, vehicle_view

SHOW_HZ = 25.0  # [1/s] pictures of the drone
UNSEEN = (
    15  # pictures that a page may have under way: 0.6 s; then it gets none until it has caught up
)
REMEMBERED = 64  # pictures whose time of sending is known
LISTED = 60  # newest warnings in the list
LIST_EVERY = 50  # pictures: a page that has lost the list has it after two seconds
LINK_LOST_S = 1.0  # [s] of silence that is a lost link for the drone
CLOCK_ERROR_NS = 20_000_000  # [ns] by which a browser's coarse clock may be ahead
WISH_PATIENCE_NS = 1_000_000_000  # [ns] an older wish is not carried out: it waited in a network
ALWAYS = ("stop", "disarm", "give_back")  # however old
VERY_OLD_NS = -(2**62)  # [ns] when a message was read that does not say so


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [cockpit] of a vehicle file."""

    host: str = "127.0.0.1"  # address to listen on; only this machine
    port: Annotated[int, msgspec.Meta(ge=1, le=65535)] = 8767
    pilot: Annotated[Name, msgspec.Meta(min_length=1)] = "cockpit"  # name, for other pilots
    certificate: str = ""  # PEM file, for https where other machines reach it
    key: str = ""  # PEM file of its private key
    insecure: bool = (
        False  # other machines too, without https and token: whoever reaches it may fly
    )

    def __post_init__(self) -> None:
        if bool(self.certificate) != bool(self.key):
            raise ValueError("certificate and key go together: give both or neither")
        if not self.certificate and not self.local and not self.insecure:
            raise ValueError(
                f"host {self.host} can be reached by other machines, and without https whoever "
                f"listens there may fly: set cockpit.certificate and cockpit.key, or forward the "
                f"port with ssh -L {self.port}:127.0.0.1:{self.port}; cockpit.insecure = true "
                f"allows it all the same"
            )

    @property
    def local(self) -> bool:
        """Can only this machine reach it?"""
        try:
            return self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False


class Patience(msgspec.Struct, frozen=True):
    """What pages must know of [reference.failsafe]."""

    pilot_patience: float = 60.0  # [s] without pilot or link before the drone rises

    def counted(self, view: VehicleView) -> VehicleView:
        """With the time until an armed drone rises that is not heard any more, and that hears
        nobody either."""
        if view.silent_s is None or not view.armed or view.acts:
            return view
        left = LINK_LOST_S + self.pilot_patience - view.silent_s
        return replace(view, next_s=max(0.0, round(left, 1)))


class Failsafes(msgspec.Struct, frozen=True):
    """The table [reference], as far as pages must know it."""

    failsafe: Patience = Patience()


class Personal(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """What is different for each page."""

    watcher: bool = False  # it may not command
    has_sticks: bool = False
    in_control: bool = False  # of the drone, this cockpit
    taken: bool = False  # another page of this cockpit has the sticks, and keeps them
    who: str = ""  # whom the drone obeys, in words
    lost: str = ""  # why the pilot is lost: the event's name
    wants_rest: bool = False  # its sticks move nothing until they were centred
    delay_ms: float | None = None  # [ms] there and back, between service and page
    stops: int = 0  # that were heard from it
    stop_waits: bool = False  # for the drone's answer


@dataclass(slots=True)
class Page:
    watcher: bool
    sent: int  # number of the newest picture that it was sent
    seen: int  # number of the newest that it has confirmed
    delay_ns: Ns | None = None
    stops: int = 0  # that were heard from it


@dataclass(slots=True)
class PageEffects(Effects):
    """What one event causes, beyond what a pilot does."""

    films: list[FilmRequest] = field(default_factory=list[FilmRequest])
    choices: list[CameraChoice] = field(default_factory=list[CameraChoice])


class Cockpit:
    """The state machine."""

    def __init__(
        self,
        settings: Settings,
        pilot: Pilot,
        drone: str,
        cameras: Cameras,
        patience: Patience,
    ) -> None:
        """
        Args:
            drone: its name, which every page is shown.
            patience: after which a drone that hears nobody rises.
        """
        self._drone, self.cameras, self._patience = drone, cameras, patience
        self._outbox = pilot.outbox
        # Here, and not on a page's lines yet: level, text, the event's name.
        self._said: list[tuple[Level, str, str]] = []
        self._outbox.also = self._overhear
        self._pilot = CockpitPilot.named(pilot, settings.pilot)
        self.filming = Filming(settings.pilot, pilot.progress.filming_ns)
        self._chart = Chart(pilot.progress.began_ns is not None)
        self._pages: dict[int, Page] = {}
        self._timer = DiveTimer(pilot.progress.began_ns)
        self._endurance = Endurance()
        self._lines = LogLines()
        self._listed = True  # nothing was said since the list of all lines was sent
        self._picture = 0  # number of the newest
        self._sent_ns: dict[int, Ns] = {}  # by number of the picture
        self._command: PilotCommand | None = None
        self._encode = msgspec.json.Encoder().encode
        self._ages = self._encode(AGES_MS).decode()

    # From pages.

    def opened(self, page: int, *, watcher: bool) -> None:
        self._pages[page] = Page(watcher, self._picture, self._picture)

    def closed(self, page: int, now: Ns) -> Effects:
        self._pages.pop(page, None)
        return self._kept(self._pilot.closed(page, now), now)

    def received(self, page: int, message: AnyPageMessage | None, now: Ns) -> Effects:
        """`message`: None for one that could not be read."""
        sender = self._pages.get(page)
        if sender is None:
            return Effects()  # closed meanwhile
        if message is None:
            self._outbox.tell(events.MALFORMED_PAGE())
            return Effects()
        read_ns = self._read_ns(sender, message, now)
        if isinstance(message, PageSeen):
            return Effects()
        if sender.watcher:
            self._outbox.tell(events.REFUSED_WATCHER())
            return Effects()
        match message:
            case PageSticks():
                out = self._pilot.moved(page, message, read_ns, now)
            case PageWish():
                sender.stops += message.what == "stop"
                out = self._wished(page, message, read_ns, now)
            case PageAbsence():
                out = self._pilot.absent(page, message.why, now)
        return self._kept(out, now)

    def _wished(self, page: int, wish: PageWish, read_ns: Ns, now: Ns) -> Effects:
        if wish.what not in ALWAYS and now > read_ns + WISH_PATIENCE_NS:
            self._outbox.tell(events.EXPIRED_WISH(detail=wish.what.replace("_", " ")))
            return Effects()
        match wish.what:
            case "film" | "snapshot":
                return self._film(wish)
            case "camera":
                return self._choose(page, wish.camera, now)
            case _:
                return self._pilot.wish(page, wish, now)

    def _film(self, wish: PageWish) -> Effects:
        """Any page that may fly may film, without the sticks."""
        request = self.filming.wish(wish)
        if isinstance(request, str):
            self._outbox.tell(events.REFUSED_HERE(wish.what, detail=request))
            return Effects()
        return PageEffects(films=[request])

    def _choose(self, page: int, camera: str, now: Ns) -> Effects:
        """Make a camera the large one, on every page."""
        if not self._pilot.may_choose(page, camera, now):
            return Effects()
        choice = self.cameras.choose(camera, now)
        if isinstance(choice, str):
            self._outbox.tell(events.REFUSED_HERE("camera", detail=choice))
            return Effects()
        return PageEffects(choices=[choice])

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

    def tick(self, now: Ns) -> Effects:
        return self._kept(self._pilot.tick(now), now)

    def repeated_choice(self, now: Ns) -> CameraChoice | None:
        """Which camera is large, where that is to be said again."""
        return self.cameras.repeated(now, in_control=self._pilot.pilot.in_control)

    def status(self, status: VehicleStatus, now: Ns) -> Effects:
        self._timer.heard(status, now)
        return self._kept(self._pilot.status(status, now), now)

    def shares(self, said: CameraShares, now: Ns) -> None:
        """The large camera says what each may send."""
        self.cameras.told(said, now, in_control=self._pilot.pilot.in_control)

    def answered(self, request: PilotRequest, answer: PilotAnswer, now: Ns) -> Effects:
        return self._kept(self._pilot.answered(request, answer, now), now)

    def given_up(self, request: PilotRequest, now: Ns) -> Effects:
        return self._kept(self._pilot.pilot.given_up(request, now), now)

    def filmed(self, request: FilmRequest, answer: FilmAnswer, now: Ns) -> None:
        """The recorder on board has answered."""
        self.filming.answered(request, answer, now)
        pilot = self._pilot.pilot  # whose checkpoint outlives this process
        pilot.progress = replace(pilot.progress, filming_ns=self.filming.since_ns)
        if not answer.accepted:
            self._outbox.tell(events.REFUSED(f"film {request.kind}", detail=answer.reason))

    def not_filmed(self, request: FilmRequest, _: Ns) -> None:
        """It has not answered."""
        self.filming.given_up(request)
        self._outbox.tell(events.UNANSWERED(f"film {request.kind}"))

    def sent_picture(self, camera: str, light_ns: Ns) -> None:
        """Pages were sent a picture; the large camera's is what is filmed."""
        if camera == self.cameras.large:
            self.filming.light_ns = light_ns
            self.filming.camera = camera if self.cameras.several else ""

    def log(self, line: LogLine, now: Ns) -> None:
        """Warnings and errors of all services."""
        if line.level != "info":
            self._remember(line, now)

    # To pages.

    def pictures(
        self,
        newest: Newest,
        now: Ns,
        temperature: TemperatureSample | None = None,
    ) -> dict[int, str]:
        """What each page is sent now. A page that has not seen the
        newest pictures gets none, so that none of them waits anywhere.

        Args:
            temperature: in the enclosure and of the water; None: never said.
        """
        self._picture += 1
        self._sent_ns[self._picture] = now
        self._sent_ns.pop(self._picture - REMEMBERED, None)
        inside = ages.shown(topics.TEMPERATURE, temperature, now)
        battery = ages.shown(topics.BATTERY, newest.battery, now)
        self._endurance.heard(battery)
        state, status = ages.shown(topics.STATE, newest.state, now), newest.status
        self._chart.step(state, now, armed=status is not None and status.armed)
        if not self._pages:
            return {}
        seen = self._patience.counted(vehicle_view(newest, now))
        view = PageView(
            **msgspec.structs.asdict(seen),
            drone=self._drone,
            sticks=positions(self._command, now),
            filming_s=self.filming.seconds(now),
            snapshots=self.filming.snapshots,
            **self._looks(seen, now),
            dive_s=self._timer.seconds(now),
            left_min=self._endurance.minutes(battery),
            water_c=None if inside is None or inside.water is None else round(inside.water, 1),
            tools=shown_outputs(self._pilot.pilot.has, seen.outputs),
            inside_c=None if inside is None else round(inside.temperature, 1),
            turns=turns(state),
            **chart_view(self._chart, state, ages.shown(topics.STATUS, status, now)),
        )
        shared = self._encode(view).decode()
        ready = [n for n, page in self._pages.items() if page.sent - page.seen < UNSEEN]
        for number in ready:
            self._pages[number].sent = self._picture
        head = f'{{"n":{self._picture},"t":{now / 1e6:.2f},"ages":{self._ages},"you":'
        if not self._listed or self._picture % LIST_EVERY == 0:
            every = self._encode([line(entry) for entry in self._lines.newest(LISTED)])
            head = f'{{"log":{every.decode()},"track":{self._chart.track()},{head[1:]}'
            self._listed = True
        self._outbox.tell(events.DROPPED_PAGE(), len(self._pages) - len(ready))
        return {n: f'{head}{self._personal(n, seen, newest, now)},"view":{shared}}}' for n in ready}

    def _looks(self, seen: VehicleView, now: Ns) -> dict[str, Any]:
        """What a page has to know of the cameras."""
        cameras = self.cameras
        found: dict[str, Any] = {
            "fov_deg": round(degrees(cameras.views[cameras.large].angle), 1),
            "looks_deg": cameras.looks(seen.tilt_deg),
        }
        if cameras.several:
            listed = tuple((name, cameras.roomless(name, now)) for name in cameras.views)
            found |= {"large": cameras.large, "cameras": listed}
        return found

    def _personal(self, number: int, view: VehicleView, newest: Newest, now: Ns) -> str:
        page, holder, pilot = self._pages[number], self._pilot.holder, self._pilot.pilot
        given = None if newest.status is None else newest.status.epoch
        in_control = pilot.in_control and pilot.progress.epoch == given
        has_sticks, taken = holder.sender == number, not holder.may_take(number, now)
        told = Personal(
            watcher=page.watcher,
            has_sticks=has_sticks,
            in_control=in_control,
            taken=taken,
            who=self._who(view, in_control=in_control, has_sticks=has_sticks, taken=taken),
            lost=self._pilot.lost,
            wants_rest=has_sticks and holder.wants_rest(now),
            delay_ms=None if page.delay_ns is None else round(page.delay_ns / 1e6, 1),
            stops=page.stops,
            stop_waits="stop" in self._pilot.waiting,
        )
        return self._encode(told).decode()

    def _kept(self, effects: Effects, now: Ns) -> Effects:
        """Remember what pages are shown of it."""
        for level, text, name in self._said:
            said = LogLine(stamp_ns=now, service="cockpit", level=level, text=text, event=name)
            self._remember(said, now)
        self._said.clear()
        self._command = effects.command or self._command
        return effects

    def _who(self, view: VehicleView, *, in_control: bool, has_sticks: bool, taken: bool) -> str:
        """Whom the drone obeys, as a page is told it."""
        if view.acts or not (has_sticks or (taken and in_control)):
            return words.sticks(view)
        if in_control:
            return "another page has the sticks" if taken else words.sticks(view, yours=True)
        return f"{view.pilot} has control" if view.pilot else "asking for control"

    def _overhear(self, level: Level, text: str, name: str) -> None:
        if name or level != "info":  # as that it was armed: a page shows it elsewhere
            self._said.append((level, text, name))

    def _remember(self, line: LogLine, now: Ns) -> None:
        self._lines.add(line, self._timer.seconds(now))
        self._listed = False
