"""Camera service: pictures become H.264 at the bitrate that the link has room for. Each of a
drone's cameras has one: the first is called `camera`, a further one such as `camera_down`."""

from collections.abc import Callable

import msgspec

from messages import cameras, events, topics
from messages.events import Event
from messages.units import Positive
from messages.video import CameraChoice, CameraShares
from services.camera.capture_time import Light
from services.camera.core import FURTHER, SIMULATED, Camera, OneCamera, Order, Settings
from services.camera.sea import CameraView, Picture, SimulatedSea
from services.marine import time_stripe
from services.marine.attitude import plus, to_world
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.extras import how_to_install
from services.runtime.config.passwords import without_passwords
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

# (when its light arrived, when the picture came, how to take it)
Film = Callable[[Light, int, Callable[[], tuple[Picture, int]]], None]
Send = Callable[[bytes, Order, Light, int], None]  # an access unit; when it was in memory
TRUTH_NS = 500_000_000  # [ns] an older truth is that of a simulator that has stopped


class Site(msgspec.Struct, frozen=True):
    """What the camera has to know of the table [simulator]."""

    floor_depth: Positive = 20.0  # [m] as in the simulator's own settings


def wire(node: Node, stack: Stack) -> None:
    every = stack.section("camera", Settings)
    name = node.name.removeprefix(FURTHER) if node.name.startswith(FURTHER) else cameras.FIRST
    if name not in every.by_name:
        raise LindyError(f"{node.name}: the vehicle file has no table [camera.more.{name}]")
    settings = every.by_name[name]
    try:
        from services.camera.io.encoder import VideoEncoder
    except ImportError:
        raise LindyError(
            f"camera needs PyAV, which is not installed; {how_to_install('camera')}"
        ) from None
    camera, encoder = Camera(every, name), VideoEncoder(settings.width, settings.height)
    send = _sender(node, camera, name)

    def film(light: Light, came: int, take: Callable[[], tuple[Picture, int]]) -> None:
        order = camera.order(came, node.now())
        if isinstance(order, Event):
            node.tell(order)
            return
        picture, captured = take()
        send(encoder.encode(picture, captured, order), order, light, captured)

    node.each(cameras.age(name), camera.heard)
    node.each(topics.LINK, lambda status, _: camera.link(status))
    if every.more:
        _share(node, camera, name)
    if settings.source == SIMULATED:
        _simulate(node, stack, settings, film, follows=name == cameras.FIRST)
    elif stack.virtual:
        raise NeedsRealTimeError(f"camera with the source {without_passwords(settings.source)}")
    else:
        called = cameras.called(name, several=bool(every.more))
        _watch(node, settings, camera, film, send, called)


def _sender(node: Node, camera: Camera, name: str) -> Send:
    video = node.publisher(cameras.video(name))

    def send(data: bytes, order: Order, light: Light, captured: int) -> None:
        parts = camera.parts(data, order, light, captured, node.now())
        if not parts:
            node.tell(events.UNENCODED_PICTURE())
        for part in parts:
            video.put(part)

    return send


def _share(node: Node, camera: Camera, name: str) -> None:
    """Share the link with the drone's other cameras."""
    shares = node.publisher(topics.CAMERA_SHARES.of(name))

    def say(now: int) -> None:
        if (said := camera.shares(now)) is not None:
            shares.put(said)

    def choose(choice: CameraChoice, now: int) -> None:
        was_large = camera.is_large
        camera.chosen(choice)
        if camera.is_large and not was_large:
            say(now)  # at once: until then the others send a slide show

    def hear(said: CameraShares, _: int) -> None:
        camera.told(said)

    node.each(topics.CAMERA_CHOICE, choose)
    node.each(topics.CAMERA_SHARES, hear)
    node.every(topics.CAMERA_SHARES.hz, say)


def _simulate(node: Node, stack: Stack, settings: OneCamera, film: Film, *, follows: bool) -> None:
    """Draw what a camera at the front of the simulated vehicle sees.

    Args:
        follows: the pilot tilts it.
    """
    site, vehicle = stack.section("simulator", Site), stack.section("vehicle", Vehicle)
    width, height = settings.width, settings.height
    sea = SimulatedSea(width, height, settings.angle, settings.water, site.floor_depth)
    truth, status = node.latest(topics.TRUTH), node.latest(topics.STATUS)
    reference = node.latest(topics.REFERENCE)
    filmed: int | None = None  # [ns] stamp of the truth that was filmed last
    front = (vehicle.size[0] / 2.0, 0.0, 0.0)
    stripe = time_stripe.fits(width, height)

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
                plus(here.position, to_world(here.attitude, front)),
                here.attitude,
                settings.tilt + (wanted.tilt.position if follows and wanted is not None else 0.0),
                0.0 if asked is None else asked.light,
                settings.yaw,
            )
            picture = sea.draw(view)
            if stripe:
                time_stripe.write(picture.y, here.stamp_ns)
            return picture, node.now()

        film(Light(here.stamp_ns, exact=True, stripe=stripe), here.stamp_ns, draw)

    node.every(settings.rate, tick)


def _watch(
    node: Node, settings: OneCamera, camera: Camera, film: Film, send: Send, called: str
) -> None:
    """Take what a device, the network or a file gives; its own H.264 where there is room for it."""
    from services.camera.io.feed import Feed

    feed = Feed(
        settings.source,
        settings.width,
        settings.height,
        node.now,
        lambda: node.wall_offset_ns,
        called,
    )

    def look(_: int) -> None:
        while feed.said:
            node.log("warning", feed.said.popleft())
        while feed.events:
            node.tell(feed.events.popleft())
        now = node.now()
        feed.passing = camera.passes(feed.kbit, feed.hz, now)
        while feed.units:
            unit = feed.units.popleft()
            order = camera.passed(now, keyframe=unit.keyframe)
            send(unit.data, order, unit.light, unit.arrived_ns)
        if (shot := feed.take()) is not None:
            film(shot.light, shot.arrived_ns, lambda: (shot.picture, shot.captured_ns))

    def look_after(now: int) -> None:
        feed.look_after(now)
        look(now)

    node.on_close(feed.close)
    node.every(1.0, look_after)
    feed.start(node.from_outside(look))
