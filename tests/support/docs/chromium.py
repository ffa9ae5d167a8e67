"""A page in headless Chromium, driven through the DevTools protocol, for pictures and tests."""

import base64
import itertools
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from websockets.sync.client import connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATIENCE_S = 120.0  # [s] never reached unless something is broken, on a slow and busy computer
PRESS_S = 5.0  # [s] far longer than any button has to be held
NAVIGATED = "navigated or closed"  # as Chromium says it
LOOK_S = 0.05  # [s]
LARGEST = 64_000_000  # [B] of a picture
FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--mute-audio",
    "--no-first-run", "--disable-background-networking", "--disable-extensions",
    "--remote-debugging-port=0", "--remote-allow-origins=*",
)  # fmt: skip


class Size(NamedTuple):
    """A screen. Browsers count in CSS pixels; `scale` is the screen's own pixels for each."""

    width: int
    height: int
    scale: float = 1.0
    touch: bool = False


def chromium() -> str | None:
    """The program, if there is one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def insist(
    happens: Callable[[], object], press: Callable[[], None], let_go: Callable[[], None]
) -> None:
    """Press until something happens, as a person does: again where it did not. While a busy
    computer holds a dive up, its clock falls behind the page's: what the page says meanwhile counts
    as too old. When it happens, whatever was pressed still is."""
    deadline = time.monotonic() + PATIENCE_S
    while time.monotonic() < deadline:
        press()
        again = time.monotonic() + PRESS_S
        while time.monotonic() < again:
            if happens():
                return
            time.sleep(LOOK_S)
        let_go()
    raise TimeoutError("whatever is pressed, it does not happen")


class Browser:
    """Chromium with pages of its own, and a profile that is thrown away."""

    def __init__(self, program: str) -> None:
        self._profile = Path(tempfile.mkdtemp(prefix="lindy-chromium-"))
        self._process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={self._profile}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        port, path = self._address()
        self._base = f"ws://127.0.0.1:{port}"
        self._control = Channel(f"{self._base}{path}")
        self._pages = list[BrowserPage]()

    def open(self, url: str, size: Size, before: str = "") -> "BrowserPage":
        """`before`: a script that runs before those of the page."""
        target = self._control.call("Target.createTarget", url="about:blank")["targetId"]
        page = BrowserPage(Channel(f"{self._base}/devtools/page/{target}"), size)
        self._pages.append(page)
        if before:
            page.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        page.go(url)
        return page

    @property
    def pages(self) -> list["BrowserPage"]:
        """Those that are open."""
        self._pages = [page for page in self._pages if page.is_open]
        return self._pages

    def close(self) -> None:
        self._control.close()
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        shutil.rmtree(self._profile, ignore_errors=True)

    def _address(self) -> tuple[str, str]:
        file, deadline = self._profile / "DevToolsActivePort", time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline and self._process.poll() is None:
            lines = file.read_text().split() if file.exists() else []
            if len(lines) == 2:
                return lines[0], lines[1]
            time.sleep(LOOK_S)
        raise RuntimeError("Chromium did not start")

    def __enter__(self) -> "Browser":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()


class Channel:
    """Calls of the DevTools protocol over one WebSocket."""

    def __init__(self, url: str) -> None:
        self._exits = ExitStack()
        # Without pings: they would draw from `random`, and a test of another module, too.
        self._socket = self._exits.enter_context(
            connect(url, max_size=LARGEST, compression=None, ping_interval=None)
        )
        self._ids = itertools.count(1)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=PATIENCE_S))
            if answer.get("id") == number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]

    def close(self) -> None:
        self._exits.close()


class BrowserPage:
    def __init__(self, channel: Channel, size: Size) -> None:
        self.call = channel.call
        self.is_open = True
        self._channel = channel
        self.call("Page.enable")
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=size.width,
            height=size.height,
            deviceScaleFactor=size.scale,
            mobile=size.touch,
        )
        if size.touch:
            self.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)

    def go(self, url: str) -> None:
        self.call("Page.navigate", url=url)
        self.wait("document.readyState === 'complete' && location.href !== 'about:blank'")

    def look(self, script: str) -> Any:
        """The value of an expression in the page."""
        result = self.call("Runtime.evaluate", expression=script, returnByValue=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{script}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def wait(self, script: str, seconds: float = PATIENCE_S) -> Any:
        """Until an expression is true."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            try:
                if value := self.look(script):
                    return value
            except RuntimeError as error:
                if NAVIGATED not in str(error):  # the page is loaded anew just now
                    raise
            time.sleep(LOOK_S)
        raise TimeoutError(f"never true: {script}")

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """touchStart, touchMove or touchEnd with fingers at these places [CSS px]."""
        fingers = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)

    def key(self, kind: str, code: str, key: str) -> None:
        """keyDown or keyUp."""
        self.call("Input.dispatchKeyEvent", type=kind, code=code, key=key)

    def middle(self, selector: str) -> tuple[float, float]:
        """[CSS px] Of an element."""
        box = f"document.querySelector('{selector}').getBoundingClientRect()"
        x, y = self.look(f"(b => [b.x + b.width / 2, b.y + b.height / 2])({box})")
        return x, y

    def picture(self) -> bytes:
        """PNG of what is on the screen."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def close(self) -> None:
        self.is_open = False
        self.call("Page.close")
        self._channel.close()
