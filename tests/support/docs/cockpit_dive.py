"""A simulated dive with a cockpit in one process, at the pace of the clock on the wall, for
pictures and for tests with a browser."""

import threading
import time
from collections.abc import Callable, Sequence
from types import TracebackType

from services.cockpit.core import Settings
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.docs.chromium import BrowserPage, insist

SERVICES = ("simulator", "estimation", "reference", "control", "tether", "link_monitor", "cockpit")
FLOOR = "simulator.floor_depth=4"  # [m] so that there is something to be seen
STILL = "estimation.calibration.still_time=3"  # [s] less to wait for
READY_NS = 6_000_000_000  # [ns] calibration is done by then; it is not waited for
STEP_NS = 5_000_000  # [ns]
STICKS = "document.getElementById('left').checkVisibility({ visibilityProperty: true })"
LAG_NS = 50_000_000  # [ns] a busy computer is not made up for in one go


class CockpitDive:
    """Runs until it is closed. The pilot is whoever opens `url`."""

    def __init__(
        self, port: int, *, camera: bool = False, name: str = "", settings: Sequence[str] = ()
    ) -> None:
        """
        Args:
            settings: more of them, `key.path=value`.
            name: of the drone; empty: it has none of its own.
        """
        rows = Registry.read("cockpit")
        overrides = [STILL, FLOOR, f"cockpit.port={port}", *settings]
        stack = Stack(pilot="cockpit", name=name, overrides=overrides)
        self.host = VirtualHost()
        for name in (*SERVICES, "camera") if camera else SERVICES:
            self.host.add(name, rows[name], stack)
        self.counts = self.host.nodes["cockpit"].counts
        # Its own ticks suffice to notice what arrives; the host is for one thread.
        self.host.nodes["cockpit"].wake = lambda: None
        self.url = f"http://{Settings().host}:{port}/"
        self.host.run(READY_NS)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        began = time.monotonic_ns() - self.host.now
        while not self._stop.is_set():
            late = time.monotonic_ns() - began - self.host.now
            if late > LAG_NS:
                began += late - LAG_NS
            if late < STEP_NS:
                time.sleep(STEP_NS / 1e9)
            else:
                self.host.run(self.host.now + STEP_NS)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.host.close()

    def __enter__(self) -> "CockpitDive":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self.close()


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
