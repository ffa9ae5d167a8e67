"""Takes the recorder's place in a dive without files, and keeps in memory what a report needs.

It has the recorder's name, sides and rhythm, so that the same messages flow as in a dive that is
recorded, and the same hash comes of them.
"""

from messages.events import Outbox
from services.recorder.core import Intake
from services.recorder.io.mcap_session import about
from services.recorder.service import DEPTH, FLUSH_HZ
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from tools.report import GatheredDive, RecordedDive


class MemoryRecorder:
    """Of one dive. Read `dive` and `log_hash` after its end."""

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
            found = intake.check(key, envelope.encoding, envelope.payload, arrival)
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
