"""The pictures of the front page: `python -m tests.support.docs.pictures`; with `moving`, the one
that moves: a pilot flies in a browser, and then a dive in the viewer."""

import io
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from math import radians
from pathlib import Path

import av
import numpy as np
from matplotlib import image
from PIL import Image

from services.camera.core import Order
from services.camera.io.encoder import VideoEncoder
from services.camera.sea import CameraView, SimulatedSea, WaterLight
from services.marine import time_stripe
from services.marine.attitude import from_euler
from services.runtime.config.errors import LindyError
from tests.support.docs.chromium import Browser, BrowserPage, Size, chromium
from tests.support.docs.cockpit_dive import CockpitDive, arm
from tests.support.docs.viewer_picture import loaded, picture, shot, viewer

DOCS = Path("docs")
PORT = 8797
DRAWN = {"dive": "dive", "andren-5.6": "retargeting", "link-profiles": "link-profiles"}
SCREEN = Size(1280, 800, touch=True)
FLOWN_S = 9.0  # [s]
# The simulated camera's picture: water, lamp [-], bitrate [kbit/s], pictures a second.
WIDTH, HEIGHT, HZ, FLOOR = 640, 360, 25.0, 8.0  # [px], [1/s], [m]
WATERS = (
    (WaterLight(turbidity=0.2), 0.0, 1500.0, HZ),
    (WaterLight(turbidity=0.5), 0.0, 1500.0, HZ),
    (WaterLight(turbidity=0.3, daylight=0.0), 1.0, 1500.0, HZ),
    (WaterLight(turbidity=0.2), 0.0, 50.0, 8.0),
)
# The moving one.
SMALL = Size(960, 540, touch=True)
PAGE_HZ = 5.0  # [1/s] of the page
DIVE_S, DIVE_HZ = (8.0, 62.0), 0.8  # [s], [1/s] of the dive in the viewer
SHOWN_MS = 160  # [ms] each picture of the viewer; so it runs eight times as fast
SETTLE_S = 0.15  # [s] for the viewer's panels
QUALITY = 54  # [-] of 100
STICKS = (  # from when on [s], and how far the thumbs are from the middle [px]
    (0.0, (0.0, 75.0), (0.0, 0.0)),  # down
    (2.5, (40.0, 0.0), (0.0, -60.0)),  # turning, ahead
    (6.0, (0.0, 0.0), (0.0, -60.0)),
    (7.5, (0.0, 0.0), (0.0, 0.0)),  # and stop
)
Shown = tuple[Image.Image, int]  # and how long it is shown [ms]


def lindy(*said: str) -> None:
    subprocess.run([str(Path(sys.executable).with_name("lindy")), *said], check=True)


def still() -> None:
    with tempfile.TemporaryDirectory() as folder:
        lindy("simulate", "--out", f"{folder}/dive")
        dive = Path(folder)
        (dive / "dive.png").write_bytes(picture(dive / "dive/dive.rrd", at_s=60.0))
        lindy("figures", "--only", "andren-5.6", "link-profiles", "--out", folder)
        for name, page in DRAWN.items():
            shutil.copy(f"{folder}/{name}.png", DOCS / f"{page}.png")
    seas = [in_the_sea(*water) for water in WATERS]
    rows = [np.hstack(seas[:2]), np.hstack(seas[2:])]
    image.imsave(DOCS / "camera.png", np.vstack(rows))
    out = DOCS / "cockpit.png"
    flown(SCREEN, lambda page, _: out.write_bytes(page.picture()), first_s=5.5, last_s=5.9)


def in_the_sea(water: WaterLight, lamp: float, kbit: float, hz: float) -> np.ndarray:
    """The picture as it is decoded topside, after three seconds of a slow way past the pilings, as
    RGB."""
    sea = SimulatedSea(WIDTH, HEIGHT, radians(80.0), water, FLOOR)
    encoder, decoder = VideoEncoder(WIDTH, HEIGHT), av.CodecContext.create("h264", "r")
    frames: list[av.VideoFrame] = []
    for number in range(round(3.0 * hz)):
        at = number / hz  # [s]
        attitude = from_euler(0.03, -0.05, 0.4 + 0.05 * at)
        seen = sea.draw(CameraView((0.1 * at, 0.3, 6.4), attitude, -0.15, lamp))
        stamp = round((100.0 + at) * 1e9)
        time_stripe.write(seen.y, stamp)
        data = encoder.encode(seen, stamp, Order(kbit, hz, number == 0))
        frames += decoder.decode(av.Packet(data))  # type: ignore[attr-defined]
    return frames[-1].to_ndarray(format="rgb24")


def flown(
    screen: Size,
    look: Callable[[BrowserPage, float], object],
    first_s: float = 0.0,
    last_s: float = FLOWN_S,
) -> None:
    """The pilot's page while its two sticks are moved; `look` at it from `first_s` to `last_s`."""
    if (program := chromium()) is None:
        raise LindyError("no Chromium on the path; Debian: apt install chromium")
    with CockpitDive(PORT, camera=True) as dive, Browser(program) as browser:
        page = browser.open(dive.url, screen)
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        page.call("Emulation.setEmulatedMedia", features=dark)
        arm(page)
        if page.look("document.getElementById('lines').textContent"):
            raise LindyError("a busy computer has put a warning on the page: film it once more")
        left, right = page.middle("#left"), page.middle("#right")
        page.touch("touchStart", left, right)
        began, moves = time.monotonic(), list(STICKS)
        while (now := time.monotonic() - began) < last_s:
            if moves and moves[0][0] <= now:
                _, a, b = moves.pop(0)
                thumbs = (left[0] + a[0], left[1] + a[1]), (right[0] + b[0], right[1] + b[1])
                page.touch("touchMove", *thumbs)
            if now >= first_s:
                look(page, now)
            time.sleep(max(0.0, 1 / PAGE_HZ - (time.monotonic() - began - now)))
        page.touch("touchEnd")


def moving() -> None:
    taken: list[tuple[Image.Image, float]] = []
    flown(SMALL, lambda page, now: taken.append((read(page.picture()), now)))
    ends = [*(at for _, at in taken[1:]), FLOWN_S]
    shown: list[Shown] = [
        (each, round(1e3 * (end - at))) for (each, at), end in zip(taken, ends, strict=True)
    ]
    with tempfile.TemporaryDirectory() as folder:
        lindy("simulate", "--out", f"{folder}/dive")
        begin, end = DIVE_S
        with viewer(Path(folder) / "dive/dive.rrd") as client:
            loaded(client)
            times = [begin + k / DIVE_HZ for k in range(round((end - begin) * DIVE_HZ) + 1)]
            shown += [(read(shot(client, at, SETTLE_S)), SHOWN_MS) for at in times]
    first, *others = [each for each, _ in shown]
    first.save(
        DOCS / "dive.webp", save_all=True, append_images=others,
        duration=[ms for _, ms in shown], loop=0, quality=QUALITY, method=6,
    )  # fmt: skip


def read(png: bytes) -> Image.Image:
    found = Image.open(io.BytesIO(png)).convert("RGB")
    return found.resize((SMALL.width, SMALL.height), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    try:
        moving() if sys.argv[1:] == ["moving"] else still()
    except LindyError as error:
        raise SystemExit(f"lindy: {error}") from None
