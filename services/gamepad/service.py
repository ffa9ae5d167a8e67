"""Gamepad service: publishes the sticks at 50 Hz, and repeats requests until they are answered."""

from messages import events, topics
from messages.link import LinkAnswer
from messages.pilot import PilotAnswer, PilotRequest
from messages.simulator import FaultAnswer, FaultRequest
from messages.vehicle import VehicleStatus
from services.gamepad.core import Settings, StickSource
from services.gamepad.io.sources import open_source
from services.gamepad.stick_log import in_words
from services.marine.vehicle import Vehicle
from services.piloting.io.pilot_ports import PilotPorts, restored
from services.piloting.pilot import Effects, Pilot
from services.piloting.sticks import Incident, StickPhase
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

OVERHEARD = 16  # newest requests of others that may still be answered


def wire(node: Node, stack: Stack) -> None:
    progress = restored(node)
    source = open_source(node, stack, progress.played)
    is_script = stack.pilot.startswith("script:")
    name = stack.section("gamepad", Settings).pilot
    has = stack.section("vehicle", Vehicle).output
    # A person arms by a button alone.
    pilot = Pilot(progress, node.outbox, arms=is_script, resumes=is_script, has=has)
    Connected(node, source, pilot, name)
    if (window := getattr(source, "window", None)) is not None:
        window.look(node)  # after what publishes the sticks


class Connected:
    """Connects a `Pilot` to its stick source and to a node."""

    def __init__(self, node: Node, source: StickSource, pilot: Pilot, name: str = "") -> None:
        """`name`: of the pilot; empty: that of the source."""
        self._node, self._source, self._pilot, self._name = node, source, pilot, name
        pilot.source = name or source.name
        self._overheard: dict[str, PilotRequest] = {}  # by id, the oldest first
        self._change = node.alarm(self._publish)
        self._ports = PilotPorts(node, pilot, pilot, also=self._hand_over)
        self._causing = CausedIncidents(node)
        node.each(topics.PILOT_REQUEST, self._overhear)  # others on this side: `lindy ask`
        node.each(topics.PILOT_ANSWER, self._overhear_answer)
        node.each(topics.STATUS, self._on_status)
        tick, phase = node.every(topics.PILOT_COMMAND.hz, self._publish), StickPhase()
        node.each(topics.LATENCY, lambda budget, _: tick.shift(phase.shift(budget)))

    def _publish(self, now: int) -> None:
        """Read the source and publish it. Also called at the instant a script's row begins."""
        began, source = self._pilot.progress.began_ns, self._source
        reading = source.read(now, began)
        name = self._name or source.name
        self._ports.do(self._pilot.read(reading, name, source.played, now), now)
        for incident in reading.incidents:
            self._causing.cause(incident, now)
        if began is not None:
            self._change.set(source.next_ns(now, began))

    def _on_status(self, status: VehicleStatus, now: int) -> None:
        self._ports.do(self._pilot.status(status, now), now)

    def _overhear(self, request: PilotRequest, _: int) -> None:
        self._overheard[request.id] = request
        if len(self._overheard) > OVERHEARD:
            del self._overheard[next(iter(self._overheard))]

    def _overhear_answer(self, answer: PilotAnswer, now: int) -> None:
        if (request := self._overheard.pop(answer.id, None)) is not None:
            self._ports.do(self._pilot.overheard(request, answer), now)

    def _hand_over(self, effects: Effects, now: int) -> None:
        if effects.hand_over:
            self._publish(now)


class CausedIncidents:
    """Sends a script's incidents to the simulator and the tether; a refusal is counted and shown.
    They do not depend on who is in control."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._faults = node.request(
            topics.FAULT_REQUEST,
            topics.FAULT_ANSWER,
            on_answer=self._on_answer,
            on_given_up=self._on_given_up,
        )
        self._links = node.request(
            topics.LINK_REQUEST,
            topics.LINK_ANSWER,
            on_answer=self._on_answer,
            on_given_up=self._on_given_up,
        )

    def cause(self, incident: Incident, now: int) -> None:
        if isinstance(incident, FaultRequest):
            self._faults.ask(incident, now)
        else:
            self._links.ask(incident, now)

    def _on_answer(self, request: Incident, answer: FaultAnswer | LinkAnswer, _now: int) -> None:
        if not answer.accepted:
            detail = f"{in_words(request)}: {answer.reason}"
            self._node.tell(events.REFUSED_INCIDENT(detail=detail))

    def _on_given_up(self, request: Incident, _now: int) -> None:
        self._node.tell(events.UNANSWERED_INCIDENT(detail=in_words(request)))
