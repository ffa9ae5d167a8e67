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
os.environ.setdefault("RUST_LOG", LOG_LEVEL)  # read when rerun is imported
with suppress(ImportError):  # `outputs` reports it
    # It takes a second: before anything is wired, because services may share a process.
    import_module("services.visualizer.io.rerun_writer")


def outputs(
    node: Node, stack: Stack, vehicle: Vehicle, part: int
) -> tuple[Callable[[Batch], None], Callable[[], None]]:
    """Functions that write a batch to, and that close, the file and the live viewer.

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
        writer.save(RrdFile(path, node.count, node.log))
    except OSError as error:
        raise LindyError(f"cannot write {path}: {reason(error)}; choose another --out") from None
    except ValueError as error:
        raise LindyError(f"{error}; install the rerun-sdk that `uv sync` installs") from None
    if not stack.viewer:
        return writer.write, writer.close
    live = LiveViewer(identity, vehicle, viewer_command(), node.count, node.log)

    def write(batch: Batch) -> None:
        writer.write(batch)
        live.send(batch)

    def close() -> None:
        writer.close()  # the file first: the viewer may be slow
        live.close()

    return write, close


def _free(folder: Path, part: int) -> Path:
    """The file of this part of the dive, or of the first later one that is not there yet."""
    path = folder / ("dive.rrd" if part == 1 else f"dive.part{part}.rrd")
    return _free(folder, part + 1) if path.exists() else path
