"""Cockpit service: serves the pilot's page, and publishes what the page with the sticks says."""

from collections.abc import Callable, Mapping
from typing import Protocol

from messages import topics
from messages.cameras import video
from messages.health import LogLine
from messages.vehicle import VehicleStatus
from messages.video import VideoPart
from services.cockpit.cameras import Cameras
from services.cockpit.core import (
    SHOW_HZ,
    Cockpit,
    Failsafes,
    PageEffects,
    Patience,
    Settings,
)
from services.cockpit.page_messages import PageClosed, PageEvent, PageOpened, PageSaid
from services.cockpit.video import PageUnit, PictureStream
from services.marine.field_of_view import CameraViews
from services.marine.vehicle import Vehicle
from services.piloting.io.pilot_ports import PilotPorts, restored
from services.piloting.pilot import Effects, Pilot
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.vehicle_view.io.ports import VehiclePorts


class Pages(Protocol):
    """The pages that are open in browsers."""

    def received(self) -> list[PageEvent]: ...
    def show(self, texts: Mapping[int, str]) -> None: ...


def wire(node: Node, stack: Stack) -> None:
    if stack.virtual:
        raise NeedsRealTimeError("cockpit")
    try:
        from services.cockpit.io.server import PageServer
    except ImportError:
        raise LindyError(
            f"the cockpit needs websockets, which is not installed; {how_to_install('cockpit')}"
        ) from None
    from services.cockpit.io.access import access_to

    settings = stack.section("cockpit", Settings)
    access = access_to(settings)
    views = stack.section("camera", CameraViews).by_name
    server = PageServer(settings, access, node.outbox, tuple(views))
    node.on_close(server.close)
    vehicle = stack.section("vehicle", Vehicle)
    cameras = Cameras(views, settings.pilot)
    patience = stack.section("reference", Failsafes).failsafe
    connected = CockpitPages(node, settings, vehicle, server, stack.name, cameras, patience)
    for name in views:
        relay(node, name, server.show_video, connected.sent_picture)
    server.start(node.from_outside(connected.receive))
    node.log("info", f"cockpit: {access.address}")
    if settings.insecure and not settings.local:
        node.log("warning", "INSECURE: whoever reaches the cockpit's port can fly the drone")
    elif not settings.local:
        # Not on the bus: with the token in it whoever reads the recording could fly.
        node.show(_line(node, f"cockpit, to fly: {access.pilot_url}"))
        node.show(_line(node, f"cockpit, to watch: {access.watch_url}"))


class CockpitPages:
    """Connects a `Cockpit` to its pages and to a node."""

    def __init__(
        self,
        node: Node,
        settings: Settings,
        vehicle: Vehicle,
        pages: Pages,
        drone: str = "",
        cameras: Cameras | None = None,
        patience: Patience | None = None,
    ) -> None:
        self._node, self._pages = node, pages
        pilot = Pilot(restored(node), node.outbox, arms=False, has=vehicle.output)
        watched = cameras or Cameras()
        self._cockpit = Cockpit(settings, pilot, drone, watched, patience or Patience())
        self.sent_picture = self._cockpit.sent_picture
        self._vehicle = VehiclePorts(node)
        self._temperature = node.latest(topics.TEMPERATURE)
        self._ports = PilotPorts(node, pilot, self._cockpit, also=self._order)
        self._filming = node.request(
            topics.FILM_REQUEST,
            topics.FILM_ANSWER,
            on_answer=self._cockpit.filmed,
            on_given_up=self._cockpit.not_filmed,
        )
        if self._cockpit.cameras.several:
            self._choice = node.publisher(topics.CAMERA_CHOICE)
            node.each(topics.CAMERA_SHARES, self._cockpit.shares)
        node.each(topics.STATUS, self._on_status)
        node.each(topics.LOG, self._cockpit.log)
        node.every(topics.PILOT_COMMAND.hz, self._tick)
        node.every(SHOW_HZ, self._show)

    def receive(self, now: int) -> None:
        """Something has arrived from a page."""
        cockpit, ports = self._cockpit, self._ports
        for event in self._pages.received():
            match event:
                case PageOpened(page, watcher):
                    cockpit.opened(page, watcher=watcher)
                case PageClosed(page):
                    ports.do(cockpit.closed(page, now), now)
                case PageSaid(page, message):
                    ports.do(cockpit.received(page, message, now), now)

    def _tick(self, now: int) -> None:
        self._ports.do(self._cockpit.tick(now), now)
        if (choice := self._cockpit.repeated_choice(now)) is not None:
            self._choice.put(choice)

    def _show(self, now: int) -> None:
        newest, inside = self._vehicle.newest(now), self._temperature.newest(now)
        self._pages.show(self._cockpit.pictures(newest, now, inside))

    def _order(self, effects: Effects, now: int) -> None:
        if isinstance(effects, PageEffects):
            for request in effects.films:
                self._filming.ask(request, now)
            for choice in effects.choices:
                self._choice.put(choice)

    def _on_status(self, status: VehicleStatus, now: int) -> None:
        self._ports.do(self._cockpit.status(status, now), now)


def relay(
    node: Node,
    camera: str,
    show: Callable[[PageUnit, str], None],
    sent: Callable[[str, int], None],
) -> None:
    """Hand a camera's pictures on to the pages."""
    stream = PictureStream(node.outbox)

    def hear(part: VideoPart, _: int) -> None:
        unit = stream.take(part)
        if unit is not None:
            show(unit, camera)
            sent(camera, part.stamp_ns)

    node.each(video(camera), hear)


def _line(node: Node, text: str) -> LogLine:
    return LogLine(stamp_ns=node.now(), service=node.name, level="info", text=text)
