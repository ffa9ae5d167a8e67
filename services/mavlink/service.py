"""MAVLink service: the drone's telemetry to ground stations, their sticks and requests to it."""

from collections import Counter
from typing import Protocol

from messages import topics
from messages.health import LogLine
from messages.topic import M
from messages.vehicle import VehicleStatus
from services.mavlink.core import Settings, Submarine
from services.mavlink.packets import Addressed, ReceivedPacket
from services.mavlink.reaction import Reaction
from services.mavlink.telemetry import Snapshot
from services.piloting.io.pilot_ports import PilotPorts, restored
from services.piloting.pilot import Pilot
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
        pilot = Pilot(restored(node), arms=False)
        self._boot_ns = node.now()
        self._submarine = Submarine(settings, pilot, self._boot_ns)
        self._status: VehicleStatus | None = None
        self._state = node.latest(topics.STATE)
        self._battery = node.latest(topics.BATTERY)
        self._reference = node.latest(topics.REFERENCE)
        self._ports = PilotPorts(node, pilot, self._submarine, also=self._send)
        node.each(topics.STATUS, self._on_status)
        node.each(topics.LOG, self._on_log)
        node.every(HZ, self._tick)

    def receive(self, now: int) -> None:
        """Something has arrived from a ground station."""
        for packet in self._links.received():
            self._ports.do(self._submarine.received(packet, self._ports.waiting, now), now)

    def _tick(self, now: int) -> None:
        names, waiting = self._links.names, self._ports.waiting
        self._ports.do(self._submarine.tick(names, self._snapshot(now), waiting, now), now)
        for name in list(self._links.counts):
            self._node.count(name, self._links.counts.pop(name))

    def _on_status(self, status: VehicleStatus, now: int) -> None:
        self._status = status
        self._ports.do(self._submarine.status(status, self._ports.waiting, now), now)

    def _on_log(self, line: LogLine, now: int) -> None:
        self._ports.do(self._submarine.log(line, now), now)

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

    def _send(self, reaction: Reaction, _: int) -> None:
        for addressed in reaction.packets:
            self._links.send(addressed)


def _recent(port: Latest[M], now: int, patience_ns: int) -> M | None:
    message = port.newest(now)
    return None if message is None or now > message.stamp_ns + patience_ns else message
