"""`lindy picture`: a screenshot of a recorded dive in a viewer without a window."""

import contextlib
import os
import socket
import subprocess
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, TypeVar

from cyclopts import Parameter

from messages import topics
from messages.events import Level
from messages.text import harmless
from messages.units import Ns
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.settings import nearest
from services.visualizer.core import Collector
from tools.choices import NewFile
from tools.fresh import refuse_existing, write_fresh
from tools.replay.source import ReplaySource, open_source

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

SIZE = "1600x900"  # [px]
TIMELINE = "dive"
FIRST = "dive"  # the page that is shown first
NAME = "dive.rrd"
MAGIC = b"RRF2"  # first bytes of a recording of the visualizer
START_S = 20.0  # for the viewer to answer
LOAD_S = 60.0  # for the recording to be read
IDLE_S = 5.0  # for the dive to be there once the viewer reads nothing more
DRAW_S = 1.0  # for the panels to settle after the time is set
DIE_S = 2.0  # for a crashing viewer to be gone
POLL_S = 0.1
NO_VULKAN = (
    "the viewer could not draw: it needs Vulkan, in software at least; on Debian install "
    "mesa-vulkan-drivers and libvulkan1"
)
NO_RERUN = f"a picture needs rerun, which is not installed; {how_to_install('viewer')}"
FRAME_NS = 100_000_000  # [ns] between two places of the vehicle, as in a dive
BATCH_NS = 12_000_000_000  # [ns] that are written at once
T = TypeVar("T")


def picture(
    recording: Path,
    *,
    out: NewFile = Path("dive.png"),
    at: Annotated[
        float | None, Parameter(help="seconds since the dive began; default: its end")
    ] = None,
    page: Annotated[
        str, Parameter(help="dive, motion, control, sensors, link, camera or health")
    ] = FIRST,
) -> int:
    """Draw a recorded dive as the viewer shows it.

    RECORDING is a dive's folder, or the dive.rrd or dive.mcap in it. It needs no display, but
    Vulkan, in software at least; on Debian: apt install mesa-vulkan-drivers libvulkan1

    Example: lindy picture dives/latest --at 40 --page link --out link.png
    """
    refuse_existing(out)
    program, page = viewer_program(), _page(page)
    with _drawn(recording) as rrd:
        png = _picture(program, rrd, page, at)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LindyError(f"cannot write {out}: {error.strerror}") from None
    write_fresh(out, png)
    print(harmless(f"written {out}"), flush=True)
    return 0


def _picture(program: Path, rrd: Path, page: str, at: float | None) -> bytes:
    print("starting the viewer …", flush=True)
    with viewer(program, rrd) as client:
        print(harmless(f"reading {rrd} ({rrd.stat().st_size / 1e6:.1f} MB) …"), flush=True)
        begin, end = loaded(client, rrd)
        at = end if at is None else at
        if not begin <= at <= end:
            raise LindyError(f"--at {at:g}: the dive in {rrd} is from {begin:.1f} to {end:.1f} s")
        print(harmless(f"drawing the page {page} at {at:.1f} s …"), flush=True)
        if page != FIRST:
            _turn_to(client, page, rrd)
        return shot(client, at, DRAW_S)


@contextmanager
def _drawn(recording: Path) -> Generator[Path]:
    """The visualizer's recording; where there is only the recorder's, such as of an import, one
    that is made from it and goes again.

    Raises:
        LindyError: as `rrd_of`.
    """
    mcap = recording / "dive.mcap" if recording.is_dir() else recording
    if mcap.suffix != ".mcap" or mcap.with_suffix(".rrd").exists() or not mcap.is_file():
        yield rrd_of(recording)
        return
    with TemporaryDirectory(prefix="lindy-") as folder:
        rrd = Path(folder) / NAME
        print(harmless(f"drawing {mcap} …"), flush=True)
        draw(open_source(mcap), rrd)
        yield rrd


def write_rrd(recording: Path, rrd: Path) -> int:
    """Write a file for rerun, and say so. Returns the exit status.

    Raises:
        LindyError: as `draw`, or the file is there already.
    """
    refuse_existing(rrd)
    source = open_source(recording)
    draw(source, rrd)
    print(harmless(f"written {rrd} ({rrd.stat().st_size / 1e6:.1f} MB)"), flush=True)
    return 0


def draw(source: ReplaySource, rrd: Path) -> None:
    """The visualizer's recording of a dive, made from the recorder's where the dive has none.

    Args:
        rrd: a new file.

    Raises:
        LindyError: rerun is not installed, the vehicle is not in the recording, or the disk fails.
    """
    try:
        from services.visualizer.io.rerun_writer import RerunWriter
        from services.visualizer.io.rrd_file import RrdFile
    except ModuleNotFoundError:
        raise LindyError(NO_RERUN) from None
    with source.stack() as stack:
        vehicle = stack.section("vehicle", Vehicle)
    failed: list[str] = []

    def say(level: Level, text: str) -> None:
        if level == "warning":
            failed.append(text)

    collector = Collector(vehicle)
    writer = RerunWriter(rrd.parent.name, vehicle)
    writer.save(RrdFile(rrd, lambda _: None, say))
    framed: Ns = 0
    written: Ns | None = None
    now: Ns = 0
    for raw in source.raw():
        topic, message = topics.find(raw.key), source.recording.decode(raw)
        if topic is None or message is None:
            continue
        now = raw.log_ns - source.utc_offset_ns
        written = now if written is None else written
        if now - framed >= FRAME_NS:
            collector.keep_frame()
            framed = now
        if now - written >= BATCH_NS:
            writer.write(collector.drain(now))
            written = now
        collector.hear(topic, raw.key, message, now)
    writer.write(collector.drain(now))
    writer.close()
    if failed:
        raise LindyError(failed[0])


def shot(client: "ViewerClient", at_s: float, settle_s: float) -> bytes:
    """The viewer with its time cursor at `at_s` [s], as a PNG."""
    client.set_time(TIMELINE, duration=at_s, play_state="paused")
    time.sleep(settle_s)
    client.take_screenshot()  # the first one may show panels that are still being drawn
    return client.take_screenshot()


def rrd_of(recording: Path) -> Path:
    """The visualizer's recording in a dive's folder, or beside the recorder's, or this file.

    Raises:
        LindyError: there is none, or it is something else.
    """
    rrd = recording
    if recording.is_dir():
        rrd = recording / NAME
    elif recording.suffix == ".mcap":
        rrd = recording.with_suffix(".rrd")
    if not rrd.is_file():
        beside = "" if rrd == recording else f" (for {recording})"
        raise LindyError(
            f"there is no recording of the visualizer {rrd}{beside}; `lindy simulate --from` flies "
            f"a recorded dive again and makes one"
        )
    try:
        with rrd.open("rb") as file:
            beginning = file.read(len(MAGIC))
    except OSError as error:
        raise LindyError(f"cannot read {rrd}: {error.strerror}") from None
    if beginning != MAGIC:
        raise LindyError(
            f"{rrd} shows no dive: it does not begin as a recording of the visualizer ({NAME}) does"
        )
    return rrd


def _page(name: str) -> str:
    from services.visualizer.blueprint import PAGES

    if name.lower() not in (known := [FIRST, *PAGES]):
        raise LindyError(f"--page: unknown page {name!r}{nearest(name.lower(), known)}")
    return name.lower()


def _turn_to(client: "ViewerClient", page: str, rrd: Path) -> None:
    """Bring a page to the front."""
    layout = client.get_blueprint().blueprint
    root = layout["/viewport"]["ViewportBlueprint"]["root_container"]
    tabs = layout.get(f"/container/{root}", {}).get("ContainerBlueprint", {})
    for one in tabs.get("contents", []):
        named = layout.get(f"/{one}", {}).get("ContainerBlueprint", {}).get("display_name", "")
        if named.lower() == page:
            tabs["active_tab"] = one
            client.set_blueprint(layout, of="recording")
            return
    raise LindyError(f"--page {page}: {rrd} has no such page; another version may have written it")


@contextmanager
def viewer(program: Path, rrd: Path) -> "Generator[ViewerClient]":
    """A viewer without a window that has been told to open the recording."""
    port = _free_port()
    command = [str(program), "--headless", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--window-size", SIZE, "--hide-welcome-screen", str(rrd)]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield _connect(process, port)
    except LindyError:
        raise
    except Exception as error:  # rerun's client raises many kinds, a dead viewer all of them
        raise LindyError(f"{_why(process)} (showing {rrd}: {error})") from None
    finally:
        _end(process)


def viewer_program() -> Path:
    """The viewer itself; the `rerun` on the path is a wrapper that leaves it running."""
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise LindyError(NO_RERUN)
    return Path(spec.origin).parent / ("rerun.exe" if os.name == "nt" else "rerun")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def _connect(process: "subprocess.Popen[bytes]", port: int) -> "ViewerClient":
    from rerun.experimental import ViewerClient

    def attempt() -> "ViewerClient | None":
        if process.poll() is not None:
            raise LindyError(_why(process))
        with contextlib.suppress(Exception):  # nobody listens yet
            return ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        return None

    return _until(attempt, START_S, "the viewer did not start")


def _why(process: "subprocess.Popen[bytes]") -> str:
    """What became of a viewer that does not answer. Without Vulkan it dies of it at once."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(DIE_S)
    return "the viewer stopped answering" if process.poll() is None else NO_VULKAN


def loaded(client: "ViewerClient", rrd: Path) -> tuple[float, float]:
    """First and last time [s] of the dive, once all of it is there."""
    failure = f"{rrd} shows no dive: is it a recording of the visualizer?"
    idle_since: float | None = None  # [s] nothing more is read

    def attempt() -> tuple[float, float] | None:
        nonlocal idle_since
        state = client.get_state()
        if state.loading:
            idle_since = None
            return None
        idle_since = time.monotonic() if idle_since is None else idle_since
        if time.monotonic() - idle_since > IDLE_S:
            raise LindyError(failure)
        if not state.views:
            return None
        for recording in state.recordings:
            for line in recording.timelines:
                if line.name == TIMELINE and line.start is not None and line.end is not None:
                    return line.start / 1e9, line.end / 1e9
        return None

    return _until(attempt, LOAD_S, failure)


def _until(attempt: Callable[[], T | None], seconds: float, failure: str) -> T:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if (result := attempt()) is not None:
            return result
        time.sleep(POLL_S)
    raise LindyError(f"{failure} ({seconds:g} s)")


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    try:
        process.wait(5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
