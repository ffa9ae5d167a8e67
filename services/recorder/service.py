"""Recorder service: records every topic of the vehicle, flushed five times a second. Its own health
and log lines are not in the file, because nobody receives their own messages; what it lost is in
the file's `losses` metadata."""

from messages import events, topics
from services.marine.vehicle import Vehicle
from services.recorder.core import Intake, RecordedRow
from services.recorder.foxglove.views import Views
from services.recorder.io.mcap_session import McapSession
from services.recorder.ring import Ring, trigger
from services.recorder.settings import Settings
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

FLUSH_HZ = 5.0  # [1/s] at most 0.2 s of a dive is lost when the process is killed
DRONE = "drone"
DEPTH = 20_000  # envelopes held while the disk is slow: some ten seconds of a dive


def wire(node: Node, stack: Stack) -> None:
    settings = stack.section("recorder", Settings)
    views = Views(stack.section("vehicle", Vehicle)) if settings.foxglove else None
    session = McapSession(node, stack, settings)  # knows by which time of day the dive counts
    intake = Intake(node.outbox, node.wall_offset_ns, node.local_ns, views)
    ring = Ring(0.0 if session.begun else settings.ring, settings.ring_size * 1e6)
    home = next(iter(node.sides))

    def keep(row: RecordedRow) -> None:
        if not ring.holds:
            session.write(row)
        elif dropped := ring.keep(row):
            node.tell(events.DROPPED("ring"), dropped)

    def begin(why: str) -> None:
        session.begin()
        rows = ring.release()
        node.log("info", f"recording begins {_span_s(rows):.1f} s before this: {why}")
        for row in rows:
            session.write(row)

    def record(envelope: Envelope, arrival: int) -> None:
        found = intake.check(envelope.key, envelope.encoding, envelope.payload, arrival)
        if found is None:
            return
        for row in intake.rows(envelope.key, found):
            keep(row)
        if ring.holds and (why := trigger(found.message)) is not None:
            begin(why)

    _answer(node, session)
    node.collect(home, "**", record, depth=DEPTH)
    node.every(FLUSH_HZ, session.flush)
    node.on_close(lambda: session.close(intake.log_hash()))


def _answer(node: Node, session: McapSession) -> None:
    """Say whether what the pilot films is recorded. A second recorder, topside, has no say."""
    if DRONE in node.sides:
        node.answers(topics.FILM_REQUEST, topics.FILM_ANSWER, session.films)


def _span_s(rows: list[RecordedRow]) -> float:
    return (rows[-1].log_ns - rows[0].log_ns) / 1e9
