"""Visualizer service: writes every topic to `dive.rrd`, and to a live viewer where wanted."""

from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import msgspec

from messages import topics
from messages.link import Shown
from messages.message import Message
from messages.topic import AnyTopic
from services.marine.vehicle import Vehicle
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.visualizer.batch import Batch
from services.visualizer.core import Collector
from services.visualizer.io.live_viewer import LiveViewer, viewer_command
from services.visualizer.io.rrd_file import RrdFile

# Curves, states and log: how often they are handed over.
# Somebody who watches wants them soon; a file does not care, and takes several batches at once.
FLUSH_HZ, FILE_FLUSH_HZ = 4.0, 0.25
SCENE_HZ, FILE_SCENE_HZ = 20.0, 10.0
# [ns] between two writes to the file: fewer, longer ones are smaller and cheaper, but a live viewer
# must wait for each (some 50 ms after twelve seconds, 25 ms after four).
FILE_NS, FILE_NS_WHEN_LIVE = 12_000_000_000, 4_000_000_000
with suppress(ImportError):  # `outputs` reports it
    # It takes a second: before anything is wired, because services may share a process.
    import_module("services.visualizer.io.rerun_writer")


class ViewerCheckpoint(msgspec.Struct):
    """Checkpoint for a restart during a dive."""

    written: int = 0  # files of this dive so far
    start: int | None = None  # [ns] when the dive began


def wire(node: Node, stack: Stack) -> None:
    vehicle = stack.section("vehicle", Vehicle)
    parts = node.restore_checkpoint(ViewerCheckpoint) or ViewerCheckpoint()
    parts.written += 1
    node.save_checkpoint(parts)
    collector = Collector(vehicle, parts.start)
    shown = node.publisher(topics.SHOWN.of(node.name))
    write, close = outputs(node, stack, vehicle, parts.written)

    def flush(now: int) -> None:
        write(collector.drain(now), now)

    def show_scene(now: int) -> None:
        if parts.start != collector.start:
            parts.start = collector.start
            node.save_checkpoint(parts)
        if not stack.viewer:
            collector.keep_frame()
        elif (frame := collector.frame()) is not None:
            write(Batch(frames=[frame]), now)
            if (sensor_ns := collector.newest_sample()) is not None:
                shown.put(Shown(stamp_ns=now, sensor_ns=sensor_ns))

    def finish() -> None:
        flush(collector.newest)
        close()

    def hear(topic: AnyTopic, key: str, message: Message, arrival: int) -> None:
        if (refused := collector.hear(topic, key, message, arrival)) is not None:
            node.tell(refused(topic.key))

    node.watch(hear)
    node.on_close(finish)
    node.every(FLUSH_HZ if stack.viewer else FILE_FLUSH_HZ, flush)
    node.every(SCENE_HZ if stack.viewer else FILE_SCENE_HZ, show_scene)


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
    viewer = live = None
    if stack.viewer:
        viewer, live = (
            LiveViewer(viewer_command(), node.tell, node.log),
            RerunWriter(identity, vehicle),
        )
        live.save(viewer)
    waiting: list[Batch] = []
    due = 0  # [ns]

    def write(batch: Batch, now: int) -> None:
        nonlocal due
        if live is not None and viewer is not None and viewer.is_open:
            live.write(batch)
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
