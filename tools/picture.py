"""A picture of a dive: the recording in a viewer without a window, photographed."""

import contextlib
import os
import socket
import subprocess
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from services.runtime.errors import LindyError
from services.runtime.extras import how_to_install
from tools.fresh import refuse_existing, write_fresh

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

SIZE = "1600x900"  # [px]
TIMELINE = "dive"
START_S = 20.0  # for the viewer to answer
LOAD_S = 60.0  # for the recording to be read
DRAW_S = 1.0  # for the panels to settle after the time is set
DIE_S = 2.0  # for a crashing viewer to be gone
POLL_S = 0.1
NO_VULKAN = (
    "the viewer could not draw: it needs Vulkan, in software at least; on Debian install "
    "mesa-vulkan-drivers and libvulkan1"
)
T = TypeVar("T")


def picture(rrd: Path, out: Path, at_s: float | None = None) -> None:
    """Write the first page of a recorded dive as a PNG.

    Args:
        rrd: a recording of the visualizer.
        out: the picture.
        at_s: [s] time cursor, since the dive began; None: the end.

    Raises:
        LindyError: no such recording, no rerun, no Vulkan, nowhere to write, a file of that name,
            or no answer in time.
    """
    if not rrd.is_file():
        raise LindyError(f"there is no recording {rrd}")
    refuse_existing(out)
    with _viewer(rrd) as client:
        begin, end = _loaded(client, rrd)
        at = end if at_s is None else at_s
        if not begin <= at <= end:
            raise LindyError(f"--at {at:g}: the dive in {rrd} is from {begin:.1f} to {end:.1f} s")
        client.set_time(TIMELINE, duration=at, play_state="paused")
        time.sleep(DRAW_S)
        client.take_screenshot()  # the first one may show panels that are still being drawn
        png = client.take_screenshot()
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LindyError(f"cannot write {out}: {error.strerror}") from None
    write_fresh(out, png)


@contextmanager
def _viewer(rrd: Path) -> "Generator[ViewerClient]":
    """A viewer without a window that has been told to open the recording."""
    program, port = _program(), _free_port()
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


def _program() -> Path:
    """The viewer itself; the `rerun` on the path is a wrapper that leaves it running."""
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise LindyError(
            f"a picture needs rerun, which is not installed; {how_to_install('viewer')}"
        )
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


def _loaded(client: "ViewerClient", rrd: Path) -> tuple[float, float]:
    """First and last time [s] of the dive, once all of it is there."""

    def attempt() -> tuple[float, float] | None:
        state = client.get_state()
        if state.loading or not state.views:
            return None
        for recording in state.recordings:
            for line in recording.timelines:
                if line.name == TIMELINE and line.start is not None and line.end is not None:
                    return line.start / 1e9, line.end / 1e9
        return None

    return _until(attempt, LOAD_S, f"{rrd} shows no dive: is it a recording of the visualizer?")


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
