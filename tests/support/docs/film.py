"""The moving picture of the README: a pilot flies in a browser, and then a dive in the viewer.

`python -m tests.support.docs.film FOLDER FILE.webp`; FOLDER is a new one, for the dive.
"""

import io
import subprocess
import sys
import time
from pathlib import Path

from PIL import Image

from services.runtime.config.errors import LindyError
from tests.support.docs.chromium import Browser, Size, chromium
from tests.support.docs.cockpit_dive import CockpitDive
from tests.support.docs.cockpit_picture import arm
from tests.support.docs.viewer_picture import loaded, shot, viewer

PORT = 8798
SCREEN = Size(960, 540, touch=True)
PAGE_S, PAGE_HZ = 9.0, 5.0  # [s], [1/s] of the page
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
Picture = tuple[Image.Image, int]  # and how long it is shown [ms]


def main(folder: Path, out: Path) -> None:
    pictures = [*_page(), *_viewer(folder)]
    first, *others = [picture for picture, _ in pictures]
    times = [ms for _, ms in pictures]
    first.save(
        out, save_all=True, append_images=others, duration=times, loop=0, quality=QUALITY, method=6
    )
    print(f"{len(pictures)} pictures, {sum(times) / 1e3:.0f} s, {out.stat().st_size / 1e6:.1f} MB")


def _page() -> list[Picture]:
    """The pilot's page while its two sticks are moved."""
    if (program := chromium()) is None:
        raise LindyError("no Chromium on the path; Debian: apt install chromium")
    with CockpitDive(PORT, camera=True) as dive, Browser(program) as browser:
        page = browser.open(dive.url, SCREEN)
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        page.call("Emulation.setEmulatedMedia", features=dark)
        arm(page)
        if page.look("document.getElementById('lines').textContent"):
            raise LindyError("a busy computer has put a warning on the page: film it once more")
        left, right = page.middle("#left"), page.middle("#right")
        page.touch("touchStart", left, right)
        began, taken, pictures = time.monotonic(), list[float](), list[Image.Image]()
        moves = list(STICKS)
        while (now := time.monotonic() - began) < PAGE_S:
            if moves and moves[0][0] <= now:
                _, a, b = moves.pop(0)
                thumbs = (left[0] + a[0], left[1] + a[1]), (right[0] + b[0], right[1] + b[1])
                page.touch("touchMove", *thumbs)
            pictures.append(_read(page.picture()))
            taken.append(now)
            time.sleep(max(0.0, 1 / PAGE_HZ - (time.monotonic() - began - now)))
        page.touch("touchEnd")
    ends = [*taken[1:], PAGE_S]
    return [
        (picture, round(1e3 * (end - at)))
        for picture, at, end in zip(pictures, taken, ends, strict=True)
    ]


def _viewer(folder: Path) -> list[Picture]:
    """The first dive in the viewer."""
    dive = folder / "dive"
    command = [sys.executable, "-m", "tools", "simulate", "--out", str(dive)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    begin, end = DIVE_S
    with viewer(dive / "dive.rrd") as client:
        loaded(client)
        times = [begin + k / DIVE_HZ for k in range(round((end - begin) * DIVE_HZ) + 1)]
        return [(_read(shot(client, at, SETTLE_S)), SHOWN_MS) for at in times]


def _read(png: bytes) -> Image.Image:
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    return picture.resize((SCREEN.width, SCREEN.height), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]), Path(sys.argv[2]))
    except LindyError as error:
        raise SystemExit(f"lindy: {error}") from None
