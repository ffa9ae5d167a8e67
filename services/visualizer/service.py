"""Visualizer service: writes every topic to `dive.rrd`, and to a live viewer where wanted."""

import msgspec

from messages import topics
from messages.link import Shown
from messages.message import Message
from messages.topic import AnyTopic
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.visualizer.batch import Batch
from services.visualizer.core import Collector
from services.visualizer.io.outputs import outputs

# Curves, states and log: how often they are handed over.
# Somebody who watches wants them soon; a file does not care, and takes several batches at once.
FLUSH_HZ, FILE_FLUSH_HZ = 4.0, 0.25
SCENE_HZ, FILE_SCENE_HZ = 20.0, 10.0


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
        if (reason := collector.hear(topic, key, message, arrival)) is not None:
            node.tell(reason(topic.key))

    node.watch(hear)
    node.on_close(finish)
    node.every(FLUSH_HZ if stack.viewer else FILE_FLUSH_HZ, flush)
    node.every(SCENE_HZ if stack.viewer else FILE_SCENE_HZ, show_scene)
