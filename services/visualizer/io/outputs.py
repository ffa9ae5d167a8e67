"""Where a dive is drawn: a file, and a live viewer where one is wanted."""

import os
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from services.marine.vehicle import Vehicle
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.visualizer.batch import Batch
from services.visualizer.io.live_viewer import LiveViewer, viewer_command
from services.visualizer.io.rrd_file import RrdFile

LOG_LEVEL = "warn"  # of rerun's own log on stderr
# [ns] between two writes to the file: fewer, longer ones are smaller and cheaper, but a live viewer
# must wait for each (some 50 ms after twelve seconds, 25 ms after four).
FILE_NS, FILE_NS_WHEN_LIVE = 12_000_000_000, 4_000_000_000
os.environ.setdefault("RUST_LOG", LOG_LEVEL)  # read when rerun is imported
with suppress(ImportError):  # `outputs` reports it
    # It takes a second: before anything is wired, because services may share a process.
    import_module(".rerun_writer", __package__)


def outputs(
    node: Node, stack: Stack, vehicle: Vehicle, part: int
) -> tuple[Callable[[Batch, int], None], Callable[[], None]]:
    """Functions that write a batch, now [ns], to the file and the live viewer, and that close both.

    Raises:
        LindyError: rerun is not installed, or the file cannot be made.
    """
    try:
        from services.visualizer.io.rerun_writer import RerunWriter
    except ImportError:
        raise LindyError(
            f"the visualizer needs rerun, which is not installed; {how_to_install('viewer')}"
        ) from None
    path = _free(stack.out_dir, part)
    # One id for file and viewer: opened together they show one dive.
    identity = f"{stack.out_dir.resolve().name}-{part}"
    writer = RerunWriter(identity, vehicle)
    try:
        writer.save(RrdFile(path, node.tell, node.log))
    except OSError as error:
        raise LindyError(f"cannot write {path}: {reason(error)}; choose another --out") from None
    except ValueError as error:
        raise LindyError(f"{error}; install the rerun-sdk that `uv sync` installs") from None
    live = None
    if stack.viewer:
        live = LiveViewer(identity, vehicle, viewer_command(), node.tell, node.log)
    waiting: list[Batch] = []
    due = 0  # [ns]

    def write(batch: Batch, now: int) -> None:
        nonlocal due
        if live is not None:
            live.send(batch)
        waiting.append(batch)
        if now >= due:
            due = now + (FILE_NS if live is None else FILE_NS_WHEN_LIVE)
            writer.write(*waiting)
            waiting.clear()

    def close() -> None:
        writer.write(*waiting)
        writer.close()  # the file first: the viewer may be slow
        if live is not None:
            live.close()

    return write, close


def _free(folder: Path, part: int) -> Path:
    """The file of this part of the dive, or of the first later one that is not there yet."""
    path = folder / ("dive.rrd" if part == 1 else f"dive.part{part}.rrd")
    return _free(folder, part + 1) if path.exists() else path
