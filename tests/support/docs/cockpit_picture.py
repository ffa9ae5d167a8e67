"""`docs/cockpit.png`: the pilot's page during a dive, as Chromium shows it.

`python -m tests.support.docs.cockpit_picture [FILE]`
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

from services.runtime.config.errors import LindyError
from tests.support.docs.chromium import Browser, BrowserPage, Size, chromium, insist
from tests.support.docs.cockpit_dive import CockpitDive

OUT = Path("docs/cockpit.png")
PORT = 8797
SCREEN = Size(1280, 800, touch=True)
STICKS = "document.getElementById('left').checkVisibility({ visibilityProperty: true })"
FLOWN_S = 9.0  # [s]


def main(out: Path) -> None:
    if (program := chromium()) is None:
        raise SystemExit("lindy: no Chromium on the path; Debian: apt install chromium")
    with CockpitDive(PORT, camera=True) as dive, Browser(program) as browser:
        page = browser.open(dive.url, SCREEN)
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        page.call("Emulation.setEmulatedMedia", features=dark)
        arm(page)
        left, right = page.middle("#left"), page.middle("#right")
        page.touch("touchStart", left, right)
        page.touch("touchMove", (left[0] + 22.0, left[1] + 70.0), (right[0], right[1] - 45.0))
        time.sleep(FLOWN_S)
        out.write_bytes(page.picture())


def arm(page: BrowserPage) -> None:
    """As a thumb does."""
    page.wait("document.getElementById('activity').textContent.startsWith('ready')")
    hold(page, lambda: page.look("document.getElementById('armed').textContent === 'ARMED'"))
    page.wait(STICKS)


def hold(page: BrowserPage, happens: Callable[[], object]) -> None:
    """The button that arms, by a thumb."""

    def let_go() -> None:
        page.touch("touchEnd")

    insist(happens, lambda: page.touch("touchStart", page.middle("#arm")), let_go)
    let_go()


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else OUT)
    except LindyError as error:
        raise SystemExit(f"lindy: {error}") from None
