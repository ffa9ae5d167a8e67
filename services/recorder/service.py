"""Recorder service: records every topic of the vehicle, flushed five times a second. Its own health
and log lines are not in the file, because nobody receives their own messages; what it lost is in
the file's `losses` metadata."""

from services.recorder.core import Intake
from services.recorder.io.mcap_session import McapSession
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

FLUSH_HZ = 5.0  # [1/s] at most 0.2 s of a dive is lost when the process is killed
DEPTH = 20_000  # envelopes held while the disk is slow: some ten seconds of a dive


def wire(node: Node, stack: Stack) -> None:
    intake = Intake(node.wall_offset_ns, node.local_ns)
    session = McapSession(node, stack)
    home = next(iter(node.sides))

    def record(envelope: Envelope, arrival: int) -> None:
        row = intake.take(envelope.key, envelope.encoding, envelope.payload, arrival)
        if isinstance(row, str):
            node.count(row)
        else:
            session.write(row)

    node.collect(home, "**", record, depth=DEPTH)
    node.every(FLUSH_HZ, session.flush)
    node.on_close(lambda: session.close(intake.log_hash()))
