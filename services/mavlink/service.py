"""MAVLink service: the drone's telemetry to ground stations, their sticks and requests to it."""

from messages import events, topics
from services.marine.outputs import OUTPUTS, Output
from services.marine.vehicle import Vehicle
from services.mavlink.core import Settings, Submarine
from services.mavlink.pilot import Reaction
from services.mavlink.telemetry import Snapshot
from services.mavlink_io.io.endpoint import MavlinkEndpoint
from services.mavlink_io.io.links import FarEndLimits, Links
from services.mavlink_io.packet import AUTOPILOT
from services.piloting.io.pilot_ports import PilotPorts, restored
from services.piloting.pilot import Pilot
from services.runtime.config.errors import NeedsRealTimeError
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node
from services.vehicle_view import ages
from services.vehicle_view.io.ports import VehiclePorts

HZ = topics.PILOT_COMMAND.hz
GROUND_STATIONS = FarEndLimits(most=16, silent_s=60.0, beyond=events.TOO_MANY_MAVLINK())


def wire(node: Node, stack: Stack) -> None:
    if stack.virtual:
        raise NeedsRealTimeError("mavlink")
    settings = stack.section("mavlink", Settings)
    links = Links(settings.links, "mavlink.links", GROUND_STATIONS, node.outbox)
    node.on_close(links.close)
    endpoint = MavlinkEndpoint(links, node.outbox, settings.system_id, AUTOPILOT, "ardupilotmega")
    connected = GroundStations(node, settings, endpoint, stack.section("vehicle", Vehicle).output)
    links.start(node.from_outside(connected.receive))
    node.log("info", f"ground stations: {', '.join(settings.links)}")
    if settings.insecure:
        node.log("warning", "INSECURE: whoever reaches a MAVLink port can fly the drone")


class GroundStations:
    """Connects a `Submarine` to its links and to a node."""

    def __init__(
        self,
        node: Node,
        settings: Settings,
        endpoint: MavlinkEndpoint,
        has: tuple[Output, ...] = OUTPUTS,
    ) -> None:
        """`has`: outputs of the vehicle."""
        self._node, self._endpoint = node, endpoint
        pilot = Pilot(restored(node), node.outbox, arms=False, has=has)
        self._boot_ns = node.now()
        self._submarine = Submarine(settings, pilot, self._boot_ns)
        self._vehicle = VehiclePorts(node)
        self._ports = PilotPorts(node, pilot, self._submarine, also=self._send)
        do = self._ports.do
        node.each(topics.STATUS, lambda status, now: do(self._submarine.status(status, now), now))
        node.each(topics.LOG, lambda line, now: do(self._submarine.log(line, now), now))
        node.every(HZ, self._tick)

    def receive(self, now: int) -> None:
        """Something has arrived from a ground station."""
        for packet in self._endpoint.receive():
            self._ports.do(self._submarine.received(packet, now), now)

    def _tick(self, now: int) -> None:
        names = self._endpoint.names
        self._ports.do(self._submarine.tick(names, self._snapshot(now), now), now)

    def _snapshot(self, now: int) -> Snapshot:
        newest = self._vehicle.newest(now)
        reference = ages.shown(topics.REFERENCE, newest.reference, now)
        return Snapshot(
            now=now,
            boot_ns=self._boot_ns,
            utc_ns=now + self._node.wall_offset_ns,
            status=ages.shown(topics.STATUS, newest.status, now),
            state=ages.shown(topics.STATE, newest.state, now),
            battery=ages.shown(topics.BATTERY, newest.battery, now),
            tilt=None if reference is None else reference.tilt.position,
            gain=self._submarine.gain,
        )

    def _send(self, reaction: Reaction, _: int) -> None:
        for addressed in reaction.packets:
            self._endpoint.send(addressed.packet, addressed.link)
