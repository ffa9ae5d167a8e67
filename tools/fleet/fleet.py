"""`lindy fleet`: all drones of a network on one screen, until Ctrl-C."""

import sys
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Annotated

from cyclopts import Parameter

from messages import topics
from services.runtime.bus.network import Network, open_network
from services.runtime.config.identity import messages_hash
from tools.choices import HERE, Insecure, KeysFolder, Router, UntilCtrlC
from tools.fleet.drones import WATCHERS
from tools.fleet.fleet_screen import as_json, line, news, screen, title_of
from tools.fleet.look import PATIENCE_S
from tools.fleet.roster import ROWS
from tools.fleet.watching import FleetRow, FleetWatch
from tools.keys.credentials import credentials
from tools.live.stop_signals import StopSignals
from tools.live.terminal import drawn_anew

LOOK_S = 1.0  # [s] between two looks at what has arrived
REPEAT_S = 60.0  # [s] after which every drone gets a line again
KEPT = 50_000  # messages between two looks; of more the oldest are left out

Show = Callable[[FleetWatch, int], None]


def fleet(
    *,
    router: Router = HERE,
    keys: KeysFolder = None,
    insecure: Insecure = False,
    json: Annotated[bool, Parameter(help="a line of JSON every second")] = False,
    seconds: UntilCtrlC = None,
) -> int:
    """Watch all drones that can be reached.

    Mode, depth, heading, battery, link, who flies, alarms: on a terminal one screen; elsewhere a
    line for each drone whenever its mode, its pilot or its alarms change. `link` is the time since
    the drone was last heard, and what was lost since.

    Example: lindy fleet --router tls/192.168.2.1:7447
    """
    way = credentials(router, "--router", WATCHERS, keys, insecure=insecure)
    watch = FleetWatch(messages_hash(topics.ALL))
    on_terminal = _screen(router) if sys.stdout.isatty() else _lines(router)
    shown = _json() if json else on_terminal
    with (
        open_network(router, PATIENCE_S, keys=None if way is None else way.keys) as network,
        StopSignals() as stop,
        shown as show,
    ):
        look = watched(network, watch)
        end = time.monotonic() + (float("inf") if seconds is None else seconds)
        while not stop.asked and time.monotonic() < end:
            time.sleep(LOOK_S)  # messages come on Zenoh's thread; nothing here is in a hurry
            now = time.monotonic_ns()
            look(now)
            show(watch, now)
    return 0


def watched(network: Network, watch: FleetWatch) -> Callable[[int], None]:
    """Subscribe; returns a function that takes in what has arrived."""
    tokens: deque[tuple[str, bool]] = deque(maxlen=KEPT)  # both are filled on Zenoh's thread
    heard: deque[tuple[str, bytes, int]] = deque(maxlen=KEPT)

    def hear(key: str, payload: bytes) -> None:
        heard.append((key, payload, time.monotonic_ns()))

    def look(now: int) -> None:
        while tokens:
            watch.token(*tokens.popleft(), now)
        while heard:
            watch.row(*heard.popleft())
        watch.router(network.answers, now)

    network.watch(lambda key, there: tokens.append((key, there)))
    for topic in ROWS:
        network.hear(topic, hear)
    return look


@contextmanager
def _screen(endpoint: str) -> Generator[Show]:
    with drawn_anew() as draw:

        def show(watch: FleetWatch, now: int) -> None:
            rows, remarks = watch.rows(now), watch.roster.remarks
            title = title_of(rows, endpoint, watch.router_answers)
            draw(lambda size: screen(rows, remarks, title, size.width, size.height))

        yield show


@contextmanager
def _lines(endpoint: str) -> Generator[Show]:
    """A line for a drone when its mode, pilot or alarms change, and for all every minute."""
    said: dict[str, tuple[object, ...]] = {}
    about, repeated = "", -float("inf")

    def show(watch: FleetWatch, now: int) -> None:
        nonlocal about, repeated
        rows = watch.rows(now)
        if time.monotonic() - repeated >= REPEAT_S:
            repeated = time.monotonic()
            said.clear()
        changed = [row for row in rows if said.get(row.name) != news(row)]
        said.update((row.name, news(row)) for row in changed)
        now_about = "; ".join(
            [title_of(rows, endpoint, watch.router_answers), *watch.roster.remarks]
        )
        _say(*([now_about] if now_about != about else []), *map(line, changed))
        about = now_about
        _forget(said, rows)

    yield show


@contextmanager
def _json() -> Generator[Show]:
    """One line a second, for programs."""

    def show(watch: FleetWatch, now: int) -> None:
        _say(as_json(watch.rows(now), watch.roster.remarks, watch.router_answers))

    yield show


def _say(*lines: str) -> None:
    for each in lines:
        print(each, flush=True)


def _forget(said: dict[str, tuple[object, ...]], rows: list[FleetRow]) -> None:
    for name in said.keys() - {row.name for row in rows}:
        del said[name]
