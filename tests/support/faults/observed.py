"""What is seen of a dive to which faults happen."""

from dataclasses import dataclass, field
from typing import NamedTuple

from messages import topics
from messages.health import LogLine
from messages.link import LatencyBudget
from messages.pilot import PilotAnswer
from messages.reference import Reference
from messages.vehicle import Actuation, Truth, VehicleStatus
from services.runtime.node.node import Node

# What the simulator says of a fault it was asked for; a real vehicle says nothing.
ITS_OWN = ("simulated fault:", "mended:", "link:")


class ReadText(NamedTuple):
    """Something the pilot could read."""

    at_ns: int  # [ns]
    text: str


@dataclass
class Observed:
    """Messages in the order of their arrival; their stamps are of one clock."""

    truth: list[Truth] = field(default_factory=list[Truth])
    references: list[Reference] = field(default_factory=list[Reference])
    actuations: list[Actuation] = field(default_factory=list[Actuation])
    statuses: list[VehicleStatus] = field(default_factory=list[VehicleStatus])
    said: list[ReadText] = field(default_factory=list[ReadText])
    answers: list[PilotAnswer] = field(default_factory=list[PilotAnswer])
    shown: VehicleStatus | None = None  # the newest that the pilot's side has
    _alarm: str = ""

    @property
    def armed(self) -> bool:
        return bool(self.statuses) and self.statuses[-1].armed

    def listen(self, topside: Node, drone: Node) -> None:
        """Topside: what the screen shows, status, link alarm, log lines that are not mere
        information."""
        drone.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        drone.each(topics.REFERENCE, lambda m, _: self.references.append(m))
        drone.each(topics.ACTUATION, lambda m, _: self.actuations.append(m))
        drone.each(topics.STATUS, lambda m, _: self.statuses.append(m))
        topside.each(topics.STATUS, self._show)
        topside.each(topics.LATENCY, self._warn)
        topside.each(topics.LOG, self._read)
        topside.each(topics.PILOT_ANSWER, lambda m, _: self.answers.append(m))

    def forget(self) -> None:
        """What was seen is judged; only what is shown goes on to be."""
        for seen in (self.truth, self.references, self.actuations, self.said, self.answers):
            seen.clear()
        del self.statuses[:-1]

    def tell(self, at_ns: int, text: str) -> None:
        self.said.append(ReadText(at_ns, text))

    def _show(self, status: VehicleStatus, now: int) -> None:
        before, self.shown = self.shown, status
        if status.failsafe != "none" and (before is None or before.failsafe != status.failsafe):
            self.tell(now, f"FAILSAFE {status.failsafe}")
        if status.words and (before is None or before.words != status.words):
            self.tell(now, status.words)
        if status.note and (before is None or before.note != status.note):
            self.tell(now, status.note)

    def _warn(self, budget: LatencyBudget, now: int) -> None:
        if budget.alarm and budget.alarm != self._alarm:
            self.tell(now, f"LINK {budget.alarm}")
        self._alarm = budget.alarm

    def _read(self, line: LogLine, now: int) -> None:
        if line.level != "info" and not line.text.startswith(ITS_OWN):
            self.tell(now, f"{line.service}: {line.text}")
