"""`lindy log export --as rrd`: the visualizer's recording, made from the recorder's."""

from pathlib import Path

from messages import topics
from messages.events import Level
from messages.text import harmless
from messages.units import Ns
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.visualizer.core import Collector
from tools.fresh import refuse_existing
from tools.packages import require_package
from tools.replay.source import ReplaySource, open_source

FRAME_NS = 100_000_000  # [ns] between two places of the vehicle, as in a dive
BATCH_NS = 12_000_000_000  # [ns] that are written at once


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
    """Draw a dive as the visualizer does.

    Args:
        rrd: a new file.

    Raises:
        LindyError: rerun is not installed, the vehicle is not in the recording, or the disk fails.
    """
    require_package("rerun", "viewer", "a file for rerun")
    from services.visualizer.io.rerun_writer import RerunWriter
    from services.visualizer.io.rrd_file import RrdFile

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
