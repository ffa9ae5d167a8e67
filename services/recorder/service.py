"""Recorder service: records every topic of the vehicle, flushed five times a second. Its own health
and log lines are not in the file, because nobody receives their own messages; what it lost is in
the file's `losses` metadata."""

from messages import topics
from services.marine.vehicle import Vehicle
from services.recorder.core import Intake, Settings
from services.recorder.foxglove.views import Views
from services.recorder.io.mcap_session import McapSession
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

FLUSH_HZ = 5.0  # [1/s] at most 0.2 s of a dive is lost when the process is killed
DEPTH = 20_000  # envelopes held while the disk is slow: some ten seconds of a dive


def wire(node: Node, stack: Stack) -> None:
    settings = stack.section("recorder", Settings)
    views = Views(stack.section("vehicle", Vehicle)) if settings.foxglove else None
    session = McapSession(node, stack)  # knows by which time of day the dive counts
    intake = Intake(node.outbox, node.wall_offset_ns, node.local_ns, views)
    home = next(iter(node.sides))

    def record(envelope: Envelope, arrival: int) -> None:
        key, payload = envelope.key, envelope.payload
        found = intake.check(key, envelope.encoding, payload, arrival, envelope.message)
        if found is not None:
            for row in intake.rows(key, found):
                session.write(row)

    if (
        "drone" in node.sides
    ):  # a second recorder, topside, has no say in whether a film is recorded
        node.answers(topics.FILM_REQUEST, topics.FILM_ANSWER, session.films)
    node.collect(home, "**", record, depth=DEPTH)
    node.every(FLUSH_HZ, session.flush)
    node.on_close(lambda: session.close(intake.log_hash()))
