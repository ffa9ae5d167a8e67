"""Visualizer service: every stream into `dive.rrd`, and into a live viewer where wanted."""

import os
from collections.abc import Callable
from pathlib import Path

import msgspec

from messages import topics
from messages.link import Shown
from messages.message import Message
from messages.topic import AnyTopic, Way
from services.marine.vehicle import Vehicle
from services.runtime.bus.envelope import Envelope
from services.runtime.config.disk import reason
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.gate import Gate
from services.runtime.node.node import Node
from services.visualizer.batch import Batch
from services.visualizer.core import Collector
from services.visualizer.io.live_viewer import LiveViewer, viewer_command
from services.visualizer.io.rrd_file import RrdFile

# Curves, states and log; every sample is kept, this is only how often they are handed over.
# Somebody who watches wants them soon, a file does not care, and fewer, longer batches are cheap.
FLUSH_HZ, FILE_FLUSH_HZ = 4.0, 0.25
SCENE_HZ, FILE_SCENE_HZ = 20.0, 10.0
RING = 4096  # envelopes; seconds of a whole dive's traffic
RERUN_SAYS = "warn"  # and worse, of all that rerun tells on stderr
KEYS = 256  # different keys; a stranger may invent more, we do not draw them


class ViewerCheckpoint(msgspec.Struct):
    """What a restart in mid-dive must know."""

    written: int = 0  # files of this dive so far
    start: int | None = None  # [ns] when the dive began


def wire(node: Node, stack: Stack) -> None:
    vehicle = stack.section("vehicle", Vehicle)
    parts = node.restore_checkpoint(ViewerCheckpoint) or ViewerCheckpoint()
    parts.written += 1
    node.save_checkpoint(parts)
    collector = Collector(vehicle, parts.start)
    shown = node.publisher(topics.SHOWN.of(node.name))
    write, close = _outputs(node, stack, vehicle, parts.written)

    def flush(now: int) -> None:
        write(collector.drain(now))

    def show_scene(now: int) -> None:
        if parts.start != collector.start:
            parts.start = collector.start
            node.save_checkpoint(parts)
        if not stack.viewer:
            collector.keep_frame()
        elif (frame := collector.frame()) is not None:
            write(Batch(frames=[frame]))
            if (sensor_ns := collector.newest_sample()) is not None:
                shown.put(Shown(stamp_ns=now, sensor_ns=sensor_ns))

    def finish() -> None:
        flush(collector.newest)
        close()

    _listen(node, collector)
    node.on_close(finish)
    node.every(FLUSH_HZ if stack.viewer else FILE_FLUSH_HZ, flush)
    node.every(SCENE_HZ if stack.viewer else FILE_SCENE_HZ, show_scene)


def _listen(node: Node, collector: Collector) -> None:
    """Everything at home; from the drone's own realm what never crosses the tether."""
    gates: dict[str, tuple[AnyTopic, Gate[Message]]] = {}

    def hear(envelope: Envelope, arrived: int) -> None:
        known = gates.get(envelope.key) or _gate(node, gates, envelope.key)
        if known is None:
            node.count("unknown_key")
            return
        topic, gate = known
        message = gate.admit(envelope, arrived)
        if message is None:
            return
        if (reason := collector.hear(topic, envelope.key, message, arrived)) is not None:
            node.count(f"{reason}:{topic.key}")

    home, *others = node.sides
    node.collect(home, "**", hear, RING)
    for side in others:
        for topic in topics.ALL:
            if topic.way is Way.STAY:
                node.collect(side, topic.key, hear, RING)


def _gate(
    node: Node, gates: dict[str, tuple[AnyTopic, Gate[Message]]], key: str
) -> tuple[AnyTopic, Gate[Message]] | None:
    topic = topics.find(key)
    if topic is None or len(gates) >= KEYS:
        return None
    return gates.setdefault(key, (topic, node.gate(topic, onlooker=True)))


def _outputs(
    node: Node, stack: Stack, vehicle: Vehicle, part: int
) -> tuple[Callable[[Batch], None], Callable[[], None]]:
    """How to write to, and how to end, the file and the live viewer where one is wanted."""
    os.environ.setdefault("RUST_LOG", RERUN_SAYS)  # read when rerun is imported
    try:
        from services.visualizer.io.rerun_writer import RerunWriter
    except ImportError:
        raise LindyError(
            f"the visualizer needs rerun, which is not installed; {how_to_install('viewer')}"
        ) from None
    path = _free(stack.out_dir, part)
    # One id for file and viewer: who opens both sees one dive.
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
        writer.close()  # the file first: the viewer may take its time
        live.close()

    return write, close


def _free(folder: Path, part: int) -> Path:
    """The file of this part of the dive, or of the first later one that is not there yet."""
    path = folder / ("dive.rrd" if part == 1 else f"dive.part{part}.rrd")
    return _free(folder, part + 1) if path.exists() else path
