"""What can be asked of a dive and what is seen of it, in a virtual and in a real one alike."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from msgspec.structs import replace

from messages import topics
from messages.events import note
from messages.health import LogLine
from messages.link import LatencyBudget, LinkRequest
from messages.notice import Notice
from messages.pilot import PilotAnswer, PilotRequest
from messages.reference import Reference
from messages.simulator import FaultKind, FaultRequest
from messages.vehicle import Actuation, Truth, VehicleStatus
from services.runtime.node.node import Node
from services.vehicle_view import words
from services.vehicle_view.view import Newest, vehicle_view
from tests.support.faults.modes import VERTICAL

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
    _alarms: tuple[Notice, ...] = ()
    _acting: str = ""

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
        acting = words.acting(vehicle_view(Newest(status=status), status.stamp_ns))
        if acting and acting != self._acting:
            self.tell(now, acting)
        self._acting = acting
        if status.notices and (before is None or before.notices != status.notices):
            self.tell(now, note(status.notices))

    def _warn(self, budget: LatencyBudget, now: int) -> None:
        if budget.alarms and budget.alarms != self._alarms:
            self.tell(now, f"LINK {note(budget.alarms)}")
        self._alarms = budget.alarms

    def _read(self, line: LogLine, now: int) -> None:
        if line.level != "info" and not line.text.startswith(ITS_OWN):
            self.tell(now, f"{line.service}: {line.text}")


class FaultDive(ABC):
    """A dive to which faults happen."""

    def __init__(self, vertical: str) -> None:
        self.seen = Observed()
        self._vertical = vertical
        self._asked = 0

    def _connect(self, topside: Node, drone: Node) -> None:
        self.seen.listen(topside, drone)
        self._wishes = topside.request(
            topics.PILOT_REQUEST, topics.PILOT_ANSWER, on_answer=lambda _q, _a, _n: None
        )
        self._links = topside.publisher(topics.LINK_REQUEST)
        self._breaks = drone.publisher(topics.FAULT_REQUEST)

    @property
    @abstractmethod
    def now(self) -> int:
        """[ns] the clock of all stamps."""

    @abstractmethod
    def run(self, seconds: float) -> None:
        """Look on."""

    def ask(self, **wish: Any) -> None:
        """A request of the pilot's side, as `lindy ask` sends it."""
        epoch = 0 if self.seen.shown is None else self.seen.shown.epoch
        request = PilotRequest(stamp_ns=self.now, id="", source="voice", epoch=epoch, **wish)
        self._wishes.ask(request, self.now)

    def part(self, part: str, fault: FaultKind, value: float | None = None) -> None:
        """Break a part of the vehicle, or mend it with `none`."""
        part = self._vertical if part == VERTICAL else part
        self._breaks.put(
            FaultRequest(stamp_ns=self.now, id=self._name(), part=part, fault=fault, value=value)
        )

    def link(self, request: LinkRequest) -> None:
        """Change the link."""
        self._links.put(replace(request, stamp_ns=self.now, id=self._name()))

    def _name(self) -> str:
        self._asked += 1
        return f"fault-{self._asked}"
