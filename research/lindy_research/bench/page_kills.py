"""How long after `kill -9` of a topside process the page's STOP acts again, for
`bench --only cockpit`.

The page presses STOP twenty times a second, from the moment of the kill on; what counts is that a
request made after it arrives on board.
"""

import os
import signal
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import msgspec

from messages import topics
from messages.pilot import PilotRequest
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import connected
from services.runtime.config.running import Running
from tests.support.docs.chromium import BrowserPage
from tests.support.started_dives import StartedDive

KILLED = ("cockpit", "camera_monitor", "link_monitor", "predictor", "tether", "hub_topside")
AGAIN_S = 12.0  # [s] between two kills: nothing is restarted slowly
PATIENCE_S = 30.0  # [s] until a STOP is given up
PRESS = """window.pressing = setInterval(() => document.getElementById('stop').dispatchEvent(
  new PointerEvent('pointerdown', { cancelable: true })), 50)"""


class Stops:
    """The requests to stop that arrive on board."""

    def __init__(self) -> None:
        self._decode = msgspec.msgpack.Decoder(PilotRequest).decode
        self._arrived = threading.Event()

    @classmethod
    @contextmanager
    def of(cls, running: Running) -> Generator["Stops"]:
        stops = cls()
        with connected(running.endpoints["drone"], namespace(running.vehicle)) as session:
            _ear = session.declare_subscriber(topics.PILOT_REQUEST.key, stops._hear)
            yield stops

    def after_kill(self, page: BrowserPage, pid: int) -> float:
        """[s] From the kill of a process to the first STOP on board; infinite: none came."""
        os.kill(pid, signal.SIGKILL)
        killed = time.monotonic()
        self._arrived.clear()
        page.look(PRESS)
        came = self._arrived.wait(PATIENCE_S)
        took = time.monotonic() - killed
        page.look("clearInterval(pressing)")
        return took if came else float("inf")

    def _hear(self, sample: Any) -> None:
        if self._decode(sample.payload.to_bytes()).kind == "stop":
            self._arrived.set()


def stops_after_kills(page: BrowserPage, dive: StartedDive, running: Running) -> dict[str, float]:
    """[s] By the process that was killed."""
    found: dict[str, float] = {}
    with Stops.of(running) as stops:
        for name in KILLED:
            found[name] = stops.after_kill(page, dive.pids()[name])
            time.sleep(AGAIN_S)  # the next one meets a dive that has settled
    return found
