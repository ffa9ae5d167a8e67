"""A page in headless Firefox, driven through WebDriver BiDi, for tests."""

import itertools
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

from websockets.sync.client import connect

from tests.support.docs.chromium import LARGEST, LOOK_S, PATIENCE_S, Size

NAMES = ("firefox-esr", "firefox")


def firefox() -> str | None:
    """The program, if there is one."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Firefox:
    """With a profile that is thrown away, and one page."""

    def __init__(self, program: str) -> None:
        self._profile = Path(tempfile.mkdtemp(prefix="lindy-firefox-"))
        flags = ["--headless", "--no-remote", "--remote-debugging-port=0", "--profile"]
        self._process = subprocess.Popen(
            [program, *flags, str(self._profile), "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._exits = ExitStack()
        self._exits.callback(self._end)
        url = f"{self._address()}/session"
        socket = connect(url, max_size=LARGEST, compression=None)
        self._socket = self._exits.enter_context(socket)
        self._ids = itertools.count(1)
        self.call("session.new", capabilities={})
        self._context = self.call("browsingContext.getTree")["contexts"][0]["context"]

    def open(self, url: str, size: Size, before: str = "") -> "Firefox":
        """`before`: a script that runs before those of the page."""
        if before:
            self.call("script.addPreloadScript", functionDeclaration=f"() => {{ {before} }}")
        viewport = {"width": size.width, "height": size.height}
        self.call("browsingContext.setViewport", context=self._context, viewport=viewport)
        self.call("browsingContext.navigate", context=self._context, url=url, wait="complete")
        return self

    def look(self, script: str) -> Any:
        """The value of an expression in the page."""
        found = self.call(
            "script.evaluate",
            expression=f"JSON.stringify([{script}])",
            target={"context": self._context},
            awaitPromise=False,
        )
        if found["type"] == "exception":
            raise RuntimeError(f"{script}: {found['exceptionDetails']['text']}")
        return json.loads(found["result"]["value"])[0]

    def wait(self, script: str) -> Any:
        """Until an expression is true."""
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            if value := self.look(script):
                return value
            time.sleep(LOOK_S)
        raise TimeoutError(f"never true: {script}")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self._socket.recv(timeout=PATIENCE_S))
            if answer.get("id") == number:
                if answer["type"] == "error":
                    raise RuntimeError(f"{method}: {answer['message']}")
                return answer["result"]

    def _address(self) -> str:
        file, deadline = self._profile / "WebDriverBiDiServer.json", time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline and self._process.poll() is None:
            if file.exists() and (text := file.read_text()):
                at = json.loads(text)
                return f"ws://{at['ws_host']}:{at['ws_port']}"
            time.sleep(LOOK_S)
        raise RuntimeError("Firefox did not start")

    def __enter__(self) -> "Firefox":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._exits.close()

    def _end(self) -> None:
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        shutil.rmtree(self._profile, ignore_errors=True)
