"""The visualizer's recording of a dive, made from the recorder's where the dive has none."""

from pathlib import Path

from messages import topics
from messages.events import Level
from messages.units import Ns
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.extras import how_to_install
from services.visualizer.core import Collector
from tools.replay.source import ReplaySource

FRAME_NS = 100_000_000  # [ns] between two places of the vehicle, as in a dive
BATCH_NS = 12_000_000_000  # [ns] that are written at once


def draw(source: ReplaySource, rrd: Path) -> None:
    """Write what the visualizer would have written.

    Args:
        rrd: a new file.

    Raises:
        LindyError: rerun is not installed, the vehicle is not in the recording, or the disk fails.
    """
    try:
        from services.visualizer.io.rerun_writer import RerunWriter
        from services.visualizer.io.rrd_file import RrdFile
    except ModuleNotFoundError:
        raise LindyError(
            f"a picture needs rerun, which is not installed; {how_to_install('viewer')}"
        ) from None
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
