"""A whole stack on virtual time, from its start to the end of the dive, recorded in memory where it
leaves no files."""

import time
from collections.abc import Callable
from contextlib import closing

from messages import topics
from messages.events import Outbox
from messages.health import LogLine
from services.recorder.core import Intake
from services.recorder.io.mcap_session import about
from services.recorder.service import DEPTH, FLUSH_HZ
from services.runtime.bus.envelope import Envelope
from services.runtime.config.errors import EndedByUserError
from services.runtime.config.stack import Stack
from services.runtime.hosts.loop import rare_collections
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.launch.supervisor import NAME
from services.runtime.node.node import Node
from tools.analysis.dive import GatheredDive, RecordedDive
from tools.live.cockpit import VIEWER
from tools.live.dive_timeline import DiveTimeline
from tools.live.outcome import RECORDER, Outcome

STRIDE_NS = 100_000_000  # [ns] of virtual time between two checks of the dive
INTERRUPTED = "interrupted"  # how a dive ended that was to stop

Advance = Callable[[DiveTimeline, int], None]


class MemoryRecorder:
    """Takes the recorder's place, and keeps what a report needs. It has the recorder's name, sides
    and rhythm, so that the same messages flow as in a dive that is recorded, and the same hash
    comes of them. Read `dive` and `log_hash` after the end."""

    def __init__(self) -> None:
        self._gathered = GatheredDive()
        self._intake = Intake(Outbox())
        self._about: dict[str, str] = {}
        self._node: Node | None = None

    def wire(self, node: Node, stack: Stack) -> None:
        self._node, self._about, self._intake = node, about(stack), Intake(node.outbox)
        gathered, intake = self._gathered, self._intake

        def keep(envelope: Envelope, arrival: int) -> None:
            key = envelope.key
            payload, message = envelope.payload, envelope.message
            found = intake.check(key, envelope.encoding, payload, arrival, message)
            if found is None:
                return
            gathered.see(key, found.log_ns)
            if gathered.kind(key) is not None:
                gathered.add(key, found.message, found.log_ns)

        node.collect(next(iter(node.sides)), "**", keep, depth=DEPTH)
        node.every(FLUSH_HZ, lambda _: None)  # the node's next step collects

    def dive(self) -> RecordedDive:
        counts = {} if self._node is None else dict(sorted(self._node.counts.items()))
        return self._gathered.dive(self._about, counts)

    def log_hash(self) -> str:
        return self._intake.log_hash()


def fly(
    stack: Stack,
    services: Registry,
    timeline: DiveTimeline,
    outcome: Outcome,
    *,
    stop: Callable[[], bool],
    memory: MemoryRecorder | None = None,
    begun: Callable[[], None] = lambda: None,
    advance: Advance = lambda _timeline, _now: None,
    show: Callable[[LogLine], None] = lambda _line: None,
) -> None:
    """Fly a dive; how it ended is in `outcome`.

    Args:
        memory: takes the place of the stack's recorder; None: the recorder writes its files.
        begun: called when all services have started.
        advance: called every `STRIDE_NS` with the timeline and the time [ns].
        show: called with every log line that is not merely information.
    """
    with outcome.of_the_dive(), closing(VirtualHost()) as host:
        node = host.node(NAME, ["topside"])
        node.each(topics.STATUS, timeline.see)
        outcome.listen(node)
        host.add_all(services, stack, {} if memory is None else {RECORDER: memory.wire})
        begun()
        host.show(lambda line: None if line.level == "info" else show(line))
        began = time.perf_counter()
        with rare_collections():
            outcome.exit = _to_the_end(host, timeline, stop, advance)
        outcome.speedup = host.now / 1e9 / (time.perf_counter() - began)
        if outcome.exit == INTERRUPTED:
            raise EndedByUserError(INTERRUPTED)


def without_files(services: Registry) -> Registry:
    """The stack without its viewer, and with a recorder, whose place is taken in memory."""
    kept = {name: spec for name, spec in services.items() if name != VIEWER}
    kept.setdefault(RECORDER, Registry.read()[RECORDER])
    return services.only(kept)


def _to_the_end(
    host: VirtualHost, timeline: DiveTimeline, stop: Callable[[], bool], advance: Advance
) -> str:
    """Returns how the dive ended: `clean`, or why otherwise."""
    end = None
    while end is None:
        host.run(host.now + STRIDE_NS)
        advance(timeline, host.now)
        end = INTERRUPTED if stop() else timeline.over(host.now)
    return end
