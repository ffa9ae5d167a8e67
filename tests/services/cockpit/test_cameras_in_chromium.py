"""Two cameras on the pilot's page in a real browser, with the cockpit's own service behind it;
skipped where there is no Chromium."""

import socket
import threading
import time
from contextlib import ExitStack
from typing import Any

import msgspec
import numpy as np
import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")
pytest.importorskip("av", reason="the extra camera is not installed")

from messages import cameras, topics
from messages.video import CameraChoice, CameraShares, VideoPart
from services.camera.core import Order
from services.camera.io.encoder import VideoEncoder
from services.camera.sea import Picture
from services.cockpit.cameras import Cameras
from services.cockpit.core import Settings
from services.cockpit.io.access import access_to
from services.cockpit.io.server import PageServer
from services.cockpit.service import CockpitPages, relay
from services.marine.field_of_view import FieldOfView
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.docs.chromium import Browser, BrowserPage, Size
from tests.support.page_screen import CONTRAST, FINGER, SIZES, STATES, UNPRESSED, Served

pytestmark = pytest.mark.system
STEP_NS = 40_000_000  # [ns]
WIDTH, HEIGHT = 320, 180
LUMA = {"front": 200, "down": 60, "gripper": 120, "aft": 90}  # by which a picture is known
VIEWS = {
    "front": FieldOfView(),
    "down": FieldOfView(angle=1.0, tilt=-1.5),
    "gripper": FieldOfView(tilt=-0.4),
    "aft": FieldOfView(yaw=3.1),
}
# Which camera's picture a canvas shows, by its brightness [0 … 255] in the middle.
BRIGHT = """((canvas) => canvas && !canvas.hidden && canvas.width > 300
  ? canvas.getContext('2d').getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data[0] : -1)"""
LARGE = f"{BRIGHT}(document.getElementById('picture'))"
SMALL = f"{BRIGHT}(document.querySelector('.camera:not([hidden]) canvas'))"
LABELS = "[...document.querySelectorAll('.camera:not([hidden])')].map((e) => e.ariaLabel)"


class Deck:
    """A cockpit in real time, and the cameras of its drone."""

    def __init__(self, exits: ExitStack, names: list[str]) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            settings = Settings(port=free.getsockname()[1], pilot="ann")
        self.url = f"http://127.0.0.1:{settings.port}/"
        self.views = {name: VIEWS[name] for name in names}
        self.host = VirtualHost()
        node = self.host.node("cockpit", ["topside"])
        self._server = PageServer(settings, access_to(settings), node.outbox, names)
        self.cameras = Cameras(self.views, "ann")
        vehicle = Stack(vehicle="pioneer").section("vehicle", Vehicle)
        self._pages = CockpitPages(node, settings, vehicle, self._server, "rov1", self.cameras)
        for name in names:
            relay(node, name, self._server.show_video, self._pages.sent_picture)
        self.chosen: list[CameraChoice] = []
        bus = self.host.side("topside")
        decode = msgspec.msgpack.Decoder(CameraChoice).decode
        bus.hear(topics.CAMERA_CHOICE.key, lambda e: self.chosen.append(decode(e.payload)))
        self._say: dict[str, Any] = {name: bus.say(cameras.video(name)) for name in names}
        self._shares = bus.say(topics.CAMERA_SHARES.of("front"))
        self._encoders = {name: VideoEncoder(WIDTH, HEIGHT) for name in names}
        self.filming = set(names)  # cameras that give pictures
        self.roomless = set[str]()
        self._sent, self._stop = 0, threading.Event()
        self._server.start(lambda: None)
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        exits.callback(self._server.close)
        exits.callback(thread.join)
        exits.callback(self._stop.set)

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.wait(max(0.0, due - time.monotonic())):
            due += STEP_NS / 1e9
            self.host.run(self.host.now + STEP_NS)
            self._pages.receive(self.host.now)
            self._sent += 1
            for name in sorted(self.filming):
                self._film(name)
            kbit = {name: 0.0 if name in self.roomless else 100.0 for name in self.views}
            said = CameraShares(
                stamp_ns=self.host.now, seq=self._sent, large=self.cameras.large, total_kbit=300.0,
                kbit=kbit,
            )  # fmt: skip
            self._shares(msgspec.msgpack.encode(said))

    def _film(self, name: str) -> None:
        now = self.host.now
        grey = np.full((HEIGHT // 2, WIDTH // 2), 128, np.uint8)
        picture = Picture(np.full((HEIGHT, WIDTH), LUMA[name], np.uint8), grey, grey)
        keyframe = self._sent % 25 == 1
        data = self._encoders[name].encode(picture, now, Order(400.0, 25.0, keyframe))
        part = VideoPart(
            stamp_ns=now, seq=self._sent, picture=self._sent, keyframe=keyframe, width=WIDTH,
            height=HEIGHT, exact=True, captured_ns=now, encoded_ns=now, budget_kbit=400.0,
            data=data,
        )  # fmt: skip
        self._say[name](msgspec.msgpack.encode(part))


def wait_for(page: BrowserPage, what: str, camera: str) -> None:
    """Until a canvas shows this camera: video range becomes full range, and coding blurs."""
    bright = (LUMA[camera] - 16) * 255 / 219
    page.wait(f"Math.abs({what} - {bright}) < 12")


def tap(page: BrowserPage, selector: str) -> None:
    page.look(f"document.querySelector('{selector}').click()")


def test_a_tap_makes_the_small_picture_large_and_the_large_one_small(
    browser: Browser, exits: ExitStack
) -> None:
    deck = Deck(exits, ["front", "down"])
    page = browser.open(deck.url, Size(1366, 768), "localStorage.setItem('language', 'en')")
    wait_for(page, LARGE, "front")
    wait_for(page, SMALL, "down")
    page.wait(f"/^down · \\d+ ms · \\d+ kbit\\/s$/.test({LABELS}.join())")
    wide = page.look("document.getElementById('picture').getBoundingClientRect().width")
    tap(page, ".camera:not([hidden])")
    wait_for(page, LARGE, "down")
    wait_for(page, SMALL, "front")
    assert page.look("document.getElementById('picture').getBoundingClientRect().width") == wide
    small = page.look("document.querySelector('.camera canvas:not(#picture)').clientWidth")
    assert 48 <= small < wide / 4
    page.wait(f"{LABELS}.join().startsWith('front · ')")
    assert [choice.camera for choice in deck.chosen] == ["down"]
    assert deck.chosen[0].source == "ann"
    said = page.look("document.getElementById('picture-age').textContent")
    assert said.startswith("down ")
    assert "kbit/s" in said
    page.look("dispatchEvent(new KeyboardEvent('keydown', { code: 'KeyT' }))")
    wait_for(page, LARGE, "front")
    page.close()


def test_each_camera_has_an_age_of_its_own(browser: Browser, exits: ExitStack) -> None:
    deck = Deck(exits, ["front", "down"])
    page = browser.open(deck.url, Size(1366, 768), "localStorage.setItem('language', 'en')")
    wait_for(page, SMALL, "down")
    deck.filming.discard("down")
    page.wait(f"/down · [1-9][\\d.]* s/.test({LABELS}.join())")  # seconds old, and it says so
    page.wait("document.querySelector('.camera:not([hidden]) canvas').className === 'stopped'")
    wait_for(page, LARGE, "front")
    page.wait("document.getElementById('no-picture').textContent === ''")  # the large one goes on
    deck.roomless.add("down")
    page.wait(f"{LABELS}.join() === 'down · no room on the link'")
    page.close()


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size.width}x{size.height}")
def test_every_camera_and_button_can_be_pressed_whatever_the_drone_does(
    browser: Browser, served: Served, size: Size
) -> None:
    page = served.open(browser, size)
    listed: dict[str, Any] = {
        "cameras": [[name, name == "aft"] for name in VIEWS],
        "large": "front",
    }
    for state in STATES.values():
        served.becomes(page, **state, **listed)
        page.look(FINGER if size.touch else "0")
        assert page.look(UNPRESSED) == "", state
        alarmed = page.look("!document.getElementById('silence').hidden")
        if alarmed and size.height < 560:  # they give way to what is more urgent
            page.look("document.getElementById('silence').click()")
            served.becomes(page, **state, **listed)
        seen = "document.querySelectorAll('.camera:not([hidden])')"
        assert page.look(f"[...{seen}].filter((e) => e.checkVisibility()).length") == 3
        assert page.look(UNPRESSED) == "", state
        contrast, where = page.look(CONTRAST)
        assert contrast >= 4.5, where
    page.close()
