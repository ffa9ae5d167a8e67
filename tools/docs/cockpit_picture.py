"""`docs/cockpit.png`: the pilot's page during a dive, as Chromium shows it.

`python -m tools.docs.cockpit_picture [FILE]`
"""

import sys
import time
from pathlib import Path

from services.runtime.config.errors import LindyError
from tools.docs.chromium import Browser, BrowserPage, Size, chromium
from tools.docs.cockpit_dive import CockpitDive

OUT = Path("docs/cockpit.png")
PORT = 8797
SCREEN = Size(1280, 800, touch=True)
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
    page.wait("document.getElementById('mode').textContent.startsWith('ready')")
    page.touch("touchStart", page.middle("#arm"))
    page.wait("document.getElementById('armed').textContent === 'ARMED'")
    page.touch("touchEnd")


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else OUT)
    except LindyError as error:
        raise SystemExit(f"lindy: {error}") from None
