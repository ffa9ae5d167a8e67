"""MAVLink service: the drone's telemetry to ground stations, their sticks and requests to it."""

from collections import Counter
from typing import Protocol

from messages import topics
from messages.health import LogLine
from messages.pilot import PilotAnswer, PilotRequest, RequestKind
from messages.topic import M
from messages.vehicle import VehicleStatus
from services.mavlink.core import Settings, Submarine
from services.mavlink.packets import Addressed, ReceivedPacket
from services.mavlink.reaction import Reaction
from services.mavlink.telemetry import Snapshot
from services.piloting.overruling import overrules
from services.piloting.pilot import Pilot, Progress
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.runtime.node.ports import Latest

HZ = topics.PILOT_COMMAND.hz
PATIENCE_NS = 2_000_000_000  # [ns] telemetry that is older is not shown any more
BATTERY_PATIENCE_NS = (
    10_000_000_000  # [ns] its voltage changes slowly, and it is said once a second
)


class GroundLinks(Protocol):
    """Links to ground stations."""

    counts: Counter[str]

    @property
    def names(self) -> list[str]: ...
    def received(self) -> list[ReceivedPacket]: ...
    def send(self, addressed: Addressed) -> None: ...


def wire(node: Node, stack: Stack) -> None:
    if stack.virtual:
        raise NeedsRealTimeError("mavlink")
    from services.mavlink.io.links import Links  # here, because it imports pymavlink

    settings = stack.section("mavlink", Settings)
    links = Links(settings.links, settings.system_id)
    node.on_close(links.close)
    connected = GroundStations(node, settings, links)
    links.start(node.from_outside(connected.receive))
    node.log("info", f"ground stations: {', '.join(settings.links)}")
    if settings.insecure:
        node.log("warning", "INSECURE: whoever reaches a MAVLink port can fly the drone")


class GroundStations:
    """Connects a `Submarine` to its links and to a node."""

    def __init__(self, node: Node, settings: Settings, links: GroundLinks) -> None:
        self._node, self._links = node, links
        self._pilot = Pilot(node.restore_checkpoint(Progress) or Progress(), arms=False)
        self._kept = self._pilot.progress
        self._boot_ns = node.now()
        self._submarine = Submarine(settings, self._pilot, self._boot_ns)
        self._status: VehicleStatus | None = None
        self._state = node.latest(topics.STATE)
        self._battery = node.latest(topics.BATTERY)
        self._reference = node.latest(topics.REFERENCE)
        self._commands = node.publisher(topics.PILOT_COMMAND)
        self._asking = node.request(
            topics.PILOT_REQUEST,
            topics.PILOT_ANSWER,
            on_answer=self._on_answer,
            on_given_up=self._on_given_up,
            overrules=overrules,
        )
        node.each(topics.STATUS, self._on_status)
        node.each(topics.LOG, self._on_log)
        node.every(HZ, self._tick)

    def receive(self, now: int) -> None:
        """Something has arrived from a ground station."""
        for packet in self._links.received():
            self._do(self._submarine.received(packet, self._waiting, now), now)

    def _tick(self, now: int) -> None:
        self._do(
            self._submarine.tick(self._links.names, self._snapshot(now), self._waiting, now), now
        )
        for name in list(self._links.counts):
            self._node.count(name, self._links.counts.pop(name))

    def _on_status(self, status: VehicleStatus, now: int) -> None:
        self._status = status
        self._do(self._submarine.status(status, self._waiting, now), now)

    def _on_log(self, line: LogLine, now: int) -> None:
        self._do(self._submarine.log(line, now), now)

    def _on_answer(self, request: PilotRequest, answer: PilotAnswer, now: int) -> None:
        self._do(self._submarine.answered(request, answer, now), now)

    def _on_given_up(self, request: PilotRequest, now: int) -> None:
        self._do(self._submarine.given_up(request, now), now)

    def _snapshot(self, now: int) -> Snapshot:
        reference = self._reference.newest(now)
        status = self._status
        if status is not None and now > status.stamp_ns + PATIENCE_NS:
            status = None
        return Snapshot(
            now=now,
            boot_ns=self._boot_ns,
            utc_ns=now + self._node.wall_offset_ns,
            status=status,
            state=_recent(self._state, now, PATIENCE_NS),
            battery=_recent(self._battery, now, BATTERY_PATIENCE_NS),
            tilt=None if reference is None else reference.tilt.position,
            gain=self._submarine.gain,
        )

    @property
    def _waiting(self) -> set[RequestKind]:
        return {request.kind for request in self._asking.pending}

    def _do(self, reaction: Reaction, now: int) -> None:
        for name in reaction.counts:
            self._node.count(name)
        for level, text in reaction.notes:
            self._node.log(level, text)
        if reaction.command is not None:
            self._commands.put(reaction.command)
        for request in reaction.requests:
            self._asking.ask(request, now)
        for addressed in reaction.packets:
            self._links.send(addressed)
        if self._kept != self._pilot.progress:
            self._kept = self._pilot.progress
            self._node.save_checkpoint(self._kept)


def _recent(port: Latest[M], now: int, patience_ns: int) -> M | None:
    message = port.newest(now)
    return None if message is None or now > message.stamp_ns + patience_ns else message
