"""The camera's picture in a real browser; skipped where there is no Chromium."""

import socket
import threading
import time
from collections.abc import Iterator

import msgspec
import numpy as np
import pytest

pytest.importorskip("websockets", reason="the extra cockpit is not installed")
pytest.importorskip("av", reason="the extra camera is not installed")

from messages.events import Outbox
from messages.video import VideoPart
from services.camera.core import Order
from services.camera.io.encoder import VideoEncoder
from services.camera.sea import Picture
from services.cockpit.core import Settings
from services.cockpit.io.access import access_to
from services.cockpit.io.server import PageServer
from services.cockpit.page_messages import PageClosed, PageOpened
from services.cockpit.page_view import AGES_MS
from services.cockpit.video import PageUnit, PictureStream
from services.marine import time_stripe
from tests.support.docs.chromium import Browser, BrowserPage, Size
from tests.support.patience import until

pytestmark = pytest.mark.system
WIDTH, HEIGHT, HZ = 640, 360, 25.0
FRAME_MS = 1000.0 / HZ
AGAIN = 500  # pictures from one keyframe to the next: a page that was held up waits for it
AGES = msgspec.json.encode(AGES_MS).decode()
SCREEN = Size(800, 600)

WORDS = "document.getElementById('no-picture').textContent"
# Rows [px] at the top of the picture that are not shown.
CUT = """((canvas) => {
  const { clipPath, width } = canvas.style;
  return (parseFloat(clipPath.slice(6)) / parseFloat(width)) * canvas.width;
})(document.getElementById('picture'))"""
SEEN = "!document.getElementById('picture').hidden"
FRESH = f"{SEEN} && {WORDS} === ''"
INSIDE = "void import('/main.js').then((main) => { window.video = main.video; })"
# The time stripe [µs] of what is on the canvas, as services/marine/time_stripe.py draws it, and the
# age [ms] that is shown beside it. `null`: its sum is wrong.
READ = """(() => {
  video.draw();
  const canvas = document.getElementById('picture');
  const pixels = canvas.getContext('2d').getImageData(0, 0, 512, 16).data;
  const bits = Array.from({ length: 64 }, (_, k) => {
    const x = (k % 32) * 16 + 8, y = (k >> 5) * 8 + 4;
    return pixels[4 * (y * 512 + x)] > 127 ? 1 : 0;
  });
  const bytes = Array.from({ length: 8 },
    (_, k) => parseInt(bits.slice(8 * k, 8 * k + 8).join(''), 2));
  let crc = 0xffff;
  for (const byte of bytes.slice(0, 6)) {
    crc ^= byte << 8;
    for (let k = 0; k < 8; k++) crc = ((crc << 1) ^ (crc & 0x8000 ? 0x1021 : 0)) & 0xffff;
  }
  if (crc !== bytes[6] * 256 + bytes[7]) return null;
  return [bytes.slice(0, 6).reduce((all, byte) => all * 256 + byte, 0), video.age, video.words];
})()"""


class Film:
    """A page server in real time, the drone's state as texts, and a camera of one moving edge.

    `late_ms`: how old each picture is when it is encoded. `exact`: as its source says. `running`:
    pictures are made. `broken`: what is sent in their place is garbage.
    """

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            settings = Settings(port=free.getsockname()[1])
        self.url = f"http://127.0.0.1:{settings.port}/watch"
        self.server = PageServer(settings, access_to(settings), Outbox())
        self.late_ms, self.running, self.broken, self.exact = 0.0, False, False, True
        self._wanted = True  # a keyframe
        self._encoder, self._stream = VideoEncoder(WIDTH, HEIGHT), PictureStream(Outbox())
        self._pages: set[int] = set()
        self._number = self.sent = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self.server.start(lambda: None)
        self._thread.start()

    def roll(self, late_ms: float = 0.0) -> None:
        """From a keyframe on; 20 s until the next."""
        self.late_ms, self._wanted, self.running = late_ms, True, True

    def _run(self) -> None:
        while not self._stop.wait(FRAME_MS / 1e3):
            self._number += 1
            for event in self.server.received():
                if isinstance(event, PageOpened):
                    self._pages.add(event.page)
                elif isinstance(event, PageClosed):
                    self._pages.discard(event.page)
            head = f'{{"n":{self._number},"t":{time.monotonic_ns() / 1e6},"ages":{AGES},'
            self.server.show(
                dict.fromkeys(
                    self._pages, head + '"you":{},"view":{"activity":"ready","doing":"ready"}}'
                )
            )
            if self.running:
                self.server.show_video(self._unit())

    def _unit(self) -> PageUnit:
        light = time.monotonic_ns() - round(self.late_ms * 1e6)
        luma = np.full((HEIGHT, WIDTH), 90, np.uint8)
        luma[:, : self._number * 5 % WIDTH] = 160
        time_stripe.write(luma, light)
        grey = np.full((HEIGHT // 2, WIDTH // 2), 128, np.uint8)
        keyframe, self._wanted = self._wanted or self._number % AGAIN == 0, False
        order = Order(1500.0, HZ, keyframe)
        data = self._encoder.encode(Picture(luma, grey, grey), light, order)
        if self.broken:
            data = data[:60] + bytes(range(1, 200)) * 5
        self.sent += 1
        unit = self._stream.take(
            VideoPart(
                stamp_ns=light, seq=self.sent, picture=self.sent, keyframe=keyframe,
                width=WIDTH, height=HEIGHT, exact=self.exact, stripe=True,
                captured_ns=light, encoded_ns=light, budget_kbit=1500.0, data=data[:60_000],
            )
        )  # fmt: skip
        assert unit is not None
        return unit

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.server.close()


@pytest.fixture
def film() -> Iterator[Film]:
    film = Film()
    yield film
    film.close()


def ages(page: BrowserPage) -> tuple[float, float, float]:
    """[ms] The age of the picture on the canvas by its stripe, at least and at most, and the age
    that the page shows: the reading, of many, that took the least time."""
    readings: list[tuple[float, float, float]] = []
    for _ in range(30):
        before = time.monotonic_ns()
        read = page.look(READ)
        after = time.monotonic_ns()
        assert read is not None, "the time stripe on the canvas cannot be read"
        light_ns, shown, _ = read[0] * 1000, read[1], read[2]
        readings.append(((before - light_ns) / 1e6, (after - light_ns) / 1e6, shown))
    return min(readings, key=lambda r: r[1] - r[0])


@pytest.mark.slow
@pytest.mark.parametrize("late_ms", [0.0, 300.0])
def test_the_shown_age_is_that_of_the_light_on_the_canvas(
    browser: Browser, film: Film, late_ms: float
):
    """Whoever opens the page late has the picture at once, though there is no new keyframe."""
    film.roll(late_ms)
    until(lambda: film.sent > 10)  # before the page is there
    page = browser.open(film.url, SCREEN)
    page.wait(FRESH)
    page.look(INSIDE)
    page.wait("window.video")
    # On the canvas for machines, and not shown to people.
    assert page.look(CUT) == pytest.approx(18.0, abs=0.1)  # rows
    least, most, shown = ages(page)
    assert least >= late_ms
    assert least - FRAME_MS <= shown <= most + FRAME_MS
    said = page.look("document.getElementById('picture-age').textContent")
    assert float(said.split()[1]) >= late_ms - FRAME_MS
    film.exact = False
    page.wait("document.getElementById('picture-age').textContent.includes('≥')")
    page.close()


@pytest.mark.slow
def test_a_picture_that_stops_is_marked_then_vanishes_and_comes_back(browser: Browser, film: Film):
    film.roll()
    page = browser.open(film.url, SCREEN)
    page.wait(FRESH)
    film.running = False
    page.wait("document.getElementById('picture').className === 'stopped'")
    page.wait(f"{WORDS}.includes('no picture for')")
    page.wait(f"!({SEEN})")
    page.wait(f"{WORDS}.includes('no picture for')")
    said = page.look("document.getElementById('picture-age').textContent")
    assert "ms" not in said  # it is seconds old, and does not look younger
    film.roll()
    page.wait(FRESH)
    film.broken = True
    page.wait(f"{WORDS}.includes('no picture for')")
    film.broken = False
    film.roll()
    page.wait(FRESH)
    page.close()


@pytest.mark.parametrize(
    ("before", "sentence"),
    [
        ("delete window.VideoDecoder", "has no WebCodecs"),
        ("Object.defineProperty(window, 'isSecureContext', { value: false })", "secure pages only"),
        (
            "const kept = VideoDecoder.prototype.configure; VideoDecoder.prototype.configure = "
            "function (c) { kept.call(this, { ...c, codec: 'avc1.ffffff' }); }",
            "no decoder for H.264 (avc1.",
        ),
    ],
)
def test_a_browser_that_cannot_says_why_in_a_sentence_and_shows_the_rest(
    browser: Browser, film: Film, before: str, sentence: str
):
    film.roll()
    page = browser.open(film.url, SCREEN, before)
    page.wait(f"{WORDS}.includes({sentence!r})")
    assert not page.look(SEEN)
    page.wait("document.getElementById('activity').textContent.startsWith('ready')")
    page.close()
