"""Camera service: pictures become H.264 at the bitrate that the link has room for."""

from collections.abc import Callable

import msgspec

from messages import events, topics
from messages.events import Event
from messages.units import Positive, Vec3
from services.camera.capture_time import Light
from services.camera.core import SIMULATED, Camera, Settings
from services.camera.sea import CameraView, Picture, SimulatedSea
from services.marine import time_stripe
from services.marine.attitude import to_world
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.extras import how_to_install
from services.runtime.config.passwords import without_passwords
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

# (when its light arrived, when the picture came, how to take it)
Film = Callable[[Light, int, Callable[[], tuple[Picture, int]]], None]
TRUTH_NS = 500_000_000  # [ns] an older truth is that of a simulator that has stopped


class Site(msgspec.Struct, frozen=True):
    """What the camera has to know of the table [simulator]."""

    floor_depth: Positive = 20.0  # [m] as in the simulator's own settings


def wire(node: Node, stack: Stack) -> None:
    settings = stack.section("camera", Settings)
    try:
        from services.camera.io.encoder import VideoEncoder
    except ImportError:
        raise LindyError(
            f"camera needs PyAV, which is not installed; {how_to_install('camera')}"
        ) from None
    camera, encoder = Camera(settings), VideoEncoder(settings.width, settings.height)
    video = node.publisher(topics.VIDEO)

    def film(light: Light, came: int, take: Callable[[], tuple[Picture, int]]) -> None:
        order = camera.order(came, node.now())
        if isinstance(order, Event):
            node.tell(order)
            return
        picture, captured = take()
        data = encoder.encode(picture, captured, order)
        parts = camera.parts(data, order, light, captured, node.now())
        if not parts:
            node.tell(events.UNENCODED_PICTURE())
        for part in parts:
            video.put(part)

    node.each(topics.PICTURE_AGE, camera.heard)
    node.each(topics.LINK, lambda status, _: camera.link(status))
    if settings.source == SIMULATED:
        _simulate(node, stack, settings, film)
    elif stack.virtual:
        raise NeedsRealTimeError(f"camera with the source {without_passwords(settings.source)}")
    else:
        _watch(node, settings, film)


def _simulate(node: Node, stack: Stack, settings: Settings, film: Film) -> None:
    """Draw what a camera at the front of the simulated vehicle sees."""
    site, vehicle = stack.section("simulator", Site), stack.section("vehicle", Vehicle)
    width, height = settings.width, settings.height
    sea = SimulatedSea(width, height, settings.angle, settings.water, site.floor_depth)
    truth, status = node.latest(topics.TRUTH), node.latest(topics.STATUS)
    reference = node.latest(topics.REFERENCE)
    filmed: int | None = None  # [ns] stamp of the truth that was filmed last
    front = (vehicle.size[0] / 2.0, 0.0, 0.0)

    def tick(now: int) -> None:
        nonlocal filmed
        here, asked, wanted = truth.newest(now), status.newest(now), reference.newest(now)
        if here is None or now > here.stamp_ns + TRUTH_NS:
            node.tell(events.SILENT(topics.TRUTH.key))
            return
        if here.stamp_ns == filmed:
            return
        filmed = here.stamp_ns

        def draw() -> tuple[Picture, int]:
            view = CameraView(
                _plus(here.position, to_world(here.attitude, front)),
                here.attitude,
                0.0 if wanted is None else wanted.tilt.position,
                0.0 if asked is None else asked.light,
            )
            picture = sea.draw(view)
            if time_stripe.fits(width, height):
                time_stripe.write(picture.y, here.stamp_ns)
            return picture, node.now()

        film(Light(here.stamp_ns, exact=True), here.stamp_ns, draw)

    node.every(settings.rate, tick)


def _watch(node: Node, settings: Settings, film: Film) -> None:
    """Take what a device, the network or a file gives."""
    from services.camera.io.feed import Feed

    feed = Feed(
        settings.source, settings.width, settings.height, node.now, lambda: node.wall_offset_ns
    )

    def look(_: int) -> None:
        while feed.said:
            node.log("warning", feed.said.popleft())
        while feed.events:
            node.tell(feed.events.popleft())
        if (shot := feed.take()) is not None:
            film(shot.light, shot.arrived_ns, lambda: (shot.picture, shot.captured_ns))

    def look_after(now: int) -> None:
        feed.look_after(now)
        look(now)

    node.on_close(feed.close)
    node.every(1.0, look_after)
    feed.start(node.from_outside(look))


def _plus(a: Vec3, b: Vec3) -> Vec3:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]
