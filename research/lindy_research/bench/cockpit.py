"""What the pilot's page costs and how late it is: a dive with processes, flown in Chromium.

A stick moves in the page, and the `pilot/command` that it causes arrives at a program on the
topside's hub; both are stamped by the same machine's clock. Beside it: a page and a server with a
WebSocket and nothing else. The ages are those of the light, as the page and as `camera_monitor`
know them.
"""

import json
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from lindy_research.bench.table import Figure
from services.cockpit.io.files import PageFiles
from services.runtime.config.errors import LindyError
from services.runtime.config.running import RUNNING, Running
from tests.support.started_dives import StartedDive, started
from tools.report.report import Report

MOST_KB = 150.0  # goal
STICK_MS = {"p50": 8.0, "p99": 20.0}  # goals on loopback
WATCHERS = 10
WATCH_S = 8.0  # [s] of ages and frames
PAGE_CORES = 0.15  # [cores] goal of a page
WITHOUT_PICTURE = 10.0  # [%] goal
CONTRAST_NEEDED = 4.5  # of WCAG, for text
STOP_S = 1.0  # [s] goal
FLOOR = "simulator.floor_depth=8"  # [m] so that there is something to be seen
# Sees what the page draws.
COUNTERS = """
window.drawn = { hud: 0, picture: 0, frames: 0 };
for (const [name, of] of [['clearRect', 'hud'], ['drawImage', 'picture']]) {
  const call = CanvasRenderingContext2D.prototype[name];
  CanvasRenderingContext2D.prototype[name] = function (...given) {
    if (this.canvas.id === of) window.drawn[of]++;
    return call.apply(this, given);
  };
}
const ask = requestAnimationFrame;
window.requestAnimationFrame = (then) => ask((now) => { window.drawn.frames++; then(now); });
"""
# The least that a page with this picture costs: the page's own decoder and canvas, nothing else.
PICTURE_ALONE = """
void (async () => {
  const version = (await (await fetch('/')).text()).match(/name="version" content="(\\w+)"/)[1];
  const { Video } = await import('/video.js');
  document.body.innerHTML = '<canvas id="picture" style="width: 1280px; height: 720px"></canvas>';
  const connection = {
    address: (path) => `ws://${location.host}${path}?version=${version}`,
    ages: { picture: [1000, 3000], state: [500, 1000] }, clock: { age: () => 50 },
  };
  window.video = new Video(document.getElementById('picture'), connection);
  Video.decoded = () => requestAnimationFrame(() => video.draw());
})()
"""
INSIDE = "void import('/main.js').then((main) => { window.video = main.video; })"
# The age of each picture when it was decoded [ms].
AGES = """
window.ages = [];
let light = null;
setInterval(() => {
  if (video.light === light) return;
  light = video.light;
  ages.push(video.age - video.silence);
}, 5);
"""


def figures() -> list[Figure]:
    if find_spec("websockets") is None:
        return [_figure("page", "", None, note="no websockets")]
    from tests.support.docs.chromium import chromium

    if (program := chromium()) is None:
        return [_figure("page", "", None, note="no Chromium on the path")]
    if find_spec("av") is None:
        return [_figure("page", "", None, note="no PyAV, so no picture")]
    return [_bytes(), *_screens(program), *_flown(program)]


def _figure(name: str, unit: str, ours: float | None, **more: Any) -> Figure:
    return Figure(section="cockpit", name=name, unit=unit, ours=ours, **more)


def _bytes() -> Figure:
    """All that is sent of one page, compressed: of the languages the largest, and English, which
    fills its gaps."""
    sizes = {name: len(body) for name, body in PageFiles().packed.items()}
    own = [name for name in sizes if name.startswith("words_") and name != "words_en.json"]
    size = sum(sizes.values()) - sum(sorted(sizes[name] for name in own)[:-1])
    return _figure("page", "kB", size / 1e3, baseline_name="goal", baseline=MOST_KB, goal=1.0)


def _screens(program: str) -> Iterator[Figure]:
    """What is on screens of eight sizes, with a picture of 16:9 and in every state of the drone."""
    from tests.support.docs.chromium import Browser
    from tests.support.page_screen import CONTRAST, SHARE, SIZES, STATES, Served

    least: list[tuple[float, str]] = []
    with ExitStack() as exits:
        browser, served = exits.enter_context(Browser(program)), Served(exits)
        for size in SIZES:
            name = f"{size.width} × {size.height}"
            page = served.open(browser, size)
            served.becomes(page)
            share = page.look(SHARE)
            for theme in ("dark", "bright"):
                page.look(f"document.documentElement.className = '{theme}'")
                for state, what in STATES.items():
                    served.becomes(page, **what)
                    contrast, where = page.look(CONTRAST)
                    least.append((contrast, f"{name}, {theme}, {state}: {where}"))
            page.close()
            yield _figure(
                f"screen without picture, {name}", "%", 100.0 * (1.0 - share),
                baseline_name="goal", baseline=WITHOUT_PICTURE,
                goal=1.0 if size.width > size.height else None,  # an upright one has other uses
            )  # fmt: skip
    contrast, where = min(least)
    yield _figure(
        "contrast that text needs", ":1", CONTRAST_NEEDED, note=where,
        baseline_name="the smallest on any screen", baseline=contrast, goal=1.0,
    )  # fmt: skip


def _flown(program: str) -> Iterator[Figure]:
    from lindy_research.bench.page_kills import stops_after_kills
    from lindy_research.bench.stick_clock import Commands, plain, watching
    from tests.support.docs.chromium import Browser, Size
    from tests.support.docs.cockpit_picture import arm

    with ExitStack() as exits:
        folder = Path(exits.enter_context(TemporaryDirectory(prefix="lindy-bench-")))
        browser = exits.enter_context(Browser(program))
        alone = plain(browser)
        empty = browser.open("data:text/html,<title>empty</title>", Size(1280, 800), COUNTERS)
        quiet = _per_second(browser, empty)
        empty.close()
        port = _free_port()
        url = f"http://127.0.0.1:{port}/"
        words = ("--cockpit", "--headless", "--set", f"cockpit.port={port}", "--set", FLOOR)
        began = time.monotonic()
        dive = exits.enter_context(started(folder / "dive", "dive", *words))
        _until_it_listens(port, dive)
        page = browser.open(url, Size(1280, 800, touch=True), COUNTERS)
        page.wait("document.getElementById('activity').textContent.length > 3")
        state_s = time.monotonic() - began
        page.wait("!document.getElementById('picture').hidden")
        picture_s = time.monotonic() - began
        arm(page)
        page.look(INSIDE)
        page.wait("window.video")
        running = msgspec.json.decode((folder / "dive" / RUNNING).read_bytes(), type=Running)
        commands = exits.enter_context(Commands.of(running))
        page.look(AGES)
        shown = _per_second(browser, page)
        ages = json.loads(page.look("JSON.stringify(ages)"))
        page.look("video.close()")
        bare = browser.open(f"{url}shape.js", Size(1280, 800), COUNTERS)
        bare.look(PICTURE_ALONE)
        bare.wait("window.video && video.light !== null")
        alone_shown = _per_second(browser, bare)
        bare.close()
        page.look("video.open()")
        page.wait("video.silence < 100")
        sticks = {"with the picture": commands.delays(page)}
        with watching(url, WATCHERS):
            sticks[f"and {WATCHERS} watchers"] = commands.delays(page)
        page.look("video.close()")
        sticks["without"] = commands.delays(page)
        stops = stops_after_kills(page, dive, running)
        page.close()
        report = dive.report()
    for name, share in (("p50", 0.5), ("p99", 0.99)):
        for what, delays in sticks.items():
            yield _figure(
                f"stick to pilot/command, {what}, {name}", "ms", _share(delays, share),
                baseline_name="goal", baseline=STICK_MS[name], goal=1.0,
                note=f"{len(delays)} movements; a WebSocket alone {_share(alone, share):.1f} ms",
            )  # fmt: skip
    yield _figure(
        "start to the first picture", "s", picture_s,
        baseline_name="to the first state", baseline=state_s,
    )  # fmt: skip
    yield from _drawn(shown, alone_shown, quiet)
    yield from _aged(ages, report)
    for name, seconds in stops.items():
        yield _figure(
            f"kill -9 of {name} to the first STOP on board", "s", seconds,
            baseline_name="goal", baseline=STOP_S, goal=1.0,
        )  # fmt: skip


def _drawn(
    shown: dict[str, float], alone: dict[str, float], quiet: dict[str, float]
) -> Iterator[Figure]:
    yield _figure("frames asked of the browser", "1/s", shown["frames"])
    yield _figure(
        "the browser's processes, with the page", "cores", shown["cores"] - quiet["cores"],
        baseline_name="goal", baseline=PAGE_CORES, goal=1.0,
        note=f"less {quiet['cores']:.2f} of an empty page; the picture alone "
        f"{alone['cores'] - quiet['cores']:.2f}",
    )  # fmt: skip
    yield _figure("head-up display, drawn", "1/s", shown["hud"])
    yield _figure("pictures, drawn", "1/s", shown["picture"])


def _aged(ages: list[float], report: Report) -> Iterator[Figure]:
    if report.picture is msgspec.UNSET:
        raise LindyError("no picture was measured in the benchmark's dive")
    measured = {"p50": report.picture.p50_ms, "p99": report.picture.p99_ms}
    for name, share in (("p50", 0.5), ("p99", 0.99)):
        yield _figure(
            f"light to decoded in the page, {name}", "ms", _share(ages, share),
            baseline_name="camera_monitor", baseline=measured[name],
            note=f"{len(ages)} pictures",
        )  # fmt: skip


def _per_second(browser: Any, page: Any) -> dict[str, float]:
    """[1/s] What the page draws, by COUNTERS; and what that costs [cores]."""
    read = "JSON.stringify([performance.now(), drawn])"
    spent, (began, before) = browser.spent_s(), json.loads(page.look(read))
    time.sleep(WATCH_S)  # the browser is measured, not this
    ended, after = json.loads(page.look(read))
    seconds = (ended - began) / 1e3
    drawn = {name: (after[name] - before[name]) / seconds for name in after}
    return {**drawn, "cores": (browser.spent_s() - spent) / seconds}


def _share(values: list[float], share: float) -> float:
    if not values:
        return float("inf")
    return sorted(values)[min(len(values) - 1, int(share * len(values)))]


def _until_it_listens(port: int, dive: StartedDive) -> None:
    dive.until_said("cockpit: http")
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline:
        with socket.socket() as trying:
            if trying.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)  # another process does it, and nothing announces it
    raise LindyError("the benchmark's cockpit does not listen")


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]
