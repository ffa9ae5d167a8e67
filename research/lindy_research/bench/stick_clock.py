"""How long a stick's movement in a browser takes to where it is wanted, for `bench --only cockpit`.

The page moves its own stick: a key is pressed and released, which tilts the camera, and the moment
is noted. Browser and receiver are on one machine and have one clock.
"""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import msgspec
from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from messages import topics
from messages.pilot import PilotCommand
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import connected
from services.runtime.config.errors import LindyError
from services.runtime.config.running import Running
from tests.support.docs.chromium import Browser, BrowserPage, Size

MOVES = 300  # movements that are measured
# To and fro, at moments that keep no step with any timer; the times are those of the wall [ms].
MOVE = f"""
window.moved = [];
window.move = () => {{
  const value = moved.length % 2 ? 0 : 1;
  moved.push([performance.timeOrigin + performance.now(), value]);
  window.dispatchEvent(new KeyboardEvent(value ? 'keydown' : 'keyup', {{ code: 'KeyR' }}));
  if (moved.length < {MOVES}) setTimeout(move, 50 + 30 * Math.random());
}};
move();
"""
BARE = """<!doctype html><title>bare</title><script>
const socket = new WebSocket(`ws://${location.host}/ws`);
for (const kind of ['keydown', 'keyup'])
  addEventListener(kind, () => socket.send(JSON.stringify({ kind: 'sticks', seen: 0, held_ms: 0,
    surge: 0, sway: 0, heave: 0, yaw: 0, tilt: Number(kind === 'keydown'), device: 'keyboard' })));
</script>"""
WATCHER = """
import asyncio, re, sys, urllib.request
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed
url, number = sys.argv[1], int(sys.argv[2])
version = re.search(rb'name="version" content="(\\w+)"', urllib.request.urlopen(url).read())[1]
address = url.replace("http", "ws") + "ws/{}?version=" + version.decode()
async def states():
    async with connect(address.format("watch"), origin=url.rstrip("/"), compression=None) as page:
        async for text in page:
            seen = re.search(r'"n":(\\d+)', text)[1]
            await page.send(f'{{"kind":"seen","seen":{seen},"held_ms":0}}')
async def pictures():
    async with connect(
        address.format("video"), origin=url.rstrip("/"), compression=None, max_size=None
    ) as page:
        async for unit in page:
            await page.send(str(int.from_bytes(unit[4:8], "little")))
async def lasting(each):
    while True:  # as a page does, which a busy computer may lose
        try:
            await each()
        except (ConnectionClosed, OSError, TimeoutError) as error:
            print(f"a watcher of {number} connects again: {error}", file=sys.stderr)
        await asyncio.sleep(0.7)
async def main():
    await asyncio.gather(*(lasting(each) for each in (states, pictures) for _ in range(number)))
asyncio.run(main())
"""


class Commands:
    """The camera's tilt in the commands on the topside, and when it changed."""

    def __init__(self) -> None:
        self._decode = msgspec.msgpack.Decoder(PilotCommand).decode
        self._heard: list[tuple[float, float]] = []  # [ms], tilt

    @classmethod
    @contextmanager
    def of(cls, running: Running) -> Generator["Commands"]:
        commands = cls()
        with connected(running.endpoints["topside"], namespace(running.vehicle)) as session:
            _ear = session.declare_subscriber(topics.PILOT_COMMAND.key, commands._hear)
            yield commands

    def delays(self, page: BrowserPage) -> list[float]:
        """[ms] Of each movement."""
        self._heard.clear()
        return _delays(page, lambda: self._heard)

    def _hear(self, sample: Any) -> None:
        now = time.time() * 1e3
        tilt = self._decode(sample.payload.to_bytes()).tilt
        if not self._heard or self._heard[-1][1] != tilt:
            self._heard.append((now, tilt))


def plain(browser: Browser) -> list[float]:
    """[ms] Of each movement, from a page to a server that have a WebSocket and nothing else."""
    heard: list[tuple[float, float]] = []

    def hear(connection: ServerConnection) -> None:
        heard.extend((time.time() * 1e3, json.loads(raw)["tilt"]) for raw in connection)

    def answer(_: ServerConnection, request: Request) -> Response | None:
        if "Upgrade" in request.headers:
            return None
        return Response(200, "OK", Headers({"Content-Type": "text/html"}), BARE.encode())

    with serve(hear, "127.0.0.1", 0, process_request=answer, compression=None) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        port = server.socket.getsockname()[1]
        page = browser.open(f"http://127.0.0.1:{port}/", Size(1280, 800))
        page.wait("socket.readyState === 1")
        found = _delays(page, lambda: heard)
        page.close()
        server.shutdown()
        thread.join()
    return found


@contextmanager
def watching(url: str, number: int) -> Generator[None]:
    """So many pages watch, picture and all, from a process of their own."""
    watchers = subprocess.Popen([sys.executable, "-c", WATCHER, url, str(number)])
    time.sleep(2.0)  # until all have the picture
    try:
        yield
        if watchers.poll() is not None:
            raise LindyError("the benchmark's watchers ended while they were needed")
    finally:
        watchers.terminate()
        watchers.wait()


def _delays(page: BrowserPage, heard: Callable[[], list[tuple[float, float]]]) -> list[float]:
    page.look(MOVE)
    page.wait(f"moved.length >= {MOVES}", 120.0)
    time.sleep(1.0)  # the last one may be on its way
    moved = [*json.loads(page.look("JSON.stringify(moved)")), (float("inf"), 0)]
    found: list[float] = []
    for (at, value), (until, _) in pairwise(moved):
        there = [when for when, tilt in heard() if at <= when < until and tilt == value]
        found += [min(there) - at] if there else []
    return found
