"""ROS 2 service: the drone as a node of ROS 2, and a node of ROS 2 as its pilot where that is
allowed. It is on Lindy's bus like any service, and in the ROS network by a session of its own."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from messages import events, topics
from messages.message import Message
from messages.topic import AnyTopic
from services.marine.field_of_view import CameraViews
from services.marine.vehicle import Vehicle
from services.piloting.io.pilot_ports import PilotPorts, restored
from services.piloting.pilot import Pilot
from services.ros2.core import RosPilot, RosSticks, Settings, namespace_of, ros_name
from services.ros2.rmw_zenoh import LATCHED, QOS, Attachment, Kind, RosNode, id_of, key_of
from services.runtime.bus.other_network import OtherNetwork, OtherPublisher
from services.runtime.config.errors import LindyError, NeedsRealTimeError
from services.runtime.config.extras import how_to_install
from services.runtime.config.stack import Stack
from services.runtime.node.node import Node

if TYPE_CHECKING:
    from services.ros2.mapping import RosMessages, RosTopic, ToJpeg

LOOK_HZ = 50.0  # [1/s] how often what has arrived is sent on
WAITING = 256  # messages from ROS at most; the oldest go first
Arrived = tuple[bytes, bytes]  # payload and attachment
ASK_HZ = 1.0  # [1/s] is the router there?
NO_ROUTER = (
    "ROS 2: no router answers at {}; `ros2 run rmw_zenoh_cpp rmw_zenohd` starts one, and this "
    "drone will be there"
)
INSECURE = "INSECURE: whoever reaches the ROS network can fly the drone"


def wire(node: Node, stack: Stack) -> None:
    if stack.virtual:
        raise NeedsRealTimeError("ros2")
    settings = stack.section("ros2", Settings)
    network = OtherNetwork(settings.router, "ros2.router")
    drone = connected(node, stack, settings, network)
    node.on_close(network.close)
    network.start()
    node.log("info", f"ROS 2: {drone.namespace or '/'} at {settings.router}")
    if settings.sticks:
        node.log("warning", INSECURE)


def connected(node: Node, stack: Stack, settings: Settings, network: OtherNetwork) -> "DroneInRos":
    """
    Raises:
        LindyError: rosbags is not installed.
    """
    try:
        from services.ros2.mapping import RosMessages
    except ImportError:
        raise LindyError(
            f"ros2 needs rosbags, which is not installed; {how_to_install('ros2')}"
        ) from None
    name = ros_name(stack.drone_name)
    namespace = namespace_of(settings, name)
    vehicle = stack.section("vehicle", Vehicle)
    messages = RosMessages(name, namespace, vehicle.mounting, _jpegs(node))
    of_cameras = stack.section("camera", CameraViews).by_name
    drone = DroneInRos(node, settings, network, namespace, messages, of_cameras)
    if settings.sticks:
        pilot = Pilot(restored(node), node.outbox, arms=False, has=vehicle.output)
        SticksFromRos(node, drone, RosPilot.of(pilot))
    return drone


def _jpegs(node: Node) -> "Callable[[], ToJpeg] | None":
    try:
        from services.ros2.io.jpeg import JpegOfVideo
    except ImportError:
        node.log("info", f"ROS 2: no JPEG of cameras without PyAV; {how_to_install('camera')}")
        return None
    return JpegOfVideo


class DroneInRos:
    """Publishes what is heard of the drone."""

    def __init__(
        self,
        node: Node,
        settings: Settings,
        network: OtherNetwork,
        namespace: str,
        messages: "RosMessages",
        of_cameras: Iterable[str],
    ) -> None:
        from services.ros2.mapping import type_hash

        self.namespace, self.network, self._node = namespace, network, node
        self._settings, self._messages, self._hash = settings, messages, type_hash
        self._ros = RosNode(settings.domain, network.session_id, namespace, "lindy")
        self._topics: dict[str, RosPublisher] = {}
        self._was_connected: bool | None = None
        network.announce(self._ros.token())
        for topic in messages.offered(of_cameras):
            token, key = self.entity("MP", topic)
            self._topics[topic.name] = RosPublisher(network.publisher(key), id_of(token))
        self._keep_static()
        node.watch(self._show)
        node.every(LOOK_HZ, lambda _: None)  # the step of the node hands over what has arrived
        node.every(ASK_HZ, self._look)

    def entity(self, kind: Kind, topic: "RosTopic", qos: str = QOS) -> tuple[str, str]:
        """Announce one more publisher or subscription. Its token and its key."""
        described = self._hash(topic.kind)
        token = self._ros.entity(kind, topic.name, topic.kind, described, qos)
        self.network.announce(token)
        return token, key_of(self._settings.domain, topic.name, topic.kind, described)

    def whole(self, name: str) -> str:
        return self._messages.whole(name)

    def _keep_static(self) -> None:
        from services.ros2.mapping import RosTopic

        utc_ns = self._node.now() + self._node.wall_offset_ns
        if (said := self._messages.static(utc_ns)) is not None:
            token, key = self.entity("MP", RosTopic(said.topic, said.kind), LATCHED)
            self.network.keep(key, said.cdr(), Attachment(1, utc_ns, id_of(token)).packed())

    def _wanted(self, name: str) -> bool:
        return name in self._topics and self._topics[name].heard

    def _show(self, topic: AnyTopic, key: str, message: Message, _: int) -> None:
        utc_ns = message.stamp_ns + self._node.wall_offset_ns
        for said in self._messages.of(topic, key, message, utc_ns, self._wanted):
            try:
                data = said.cdr()
            except ValueError:
                self._node.tell(events.MALFORMED(topic.key))
                continue
            self._topics[said.topic].put(data, utc_ns)

    def _look(self, _: int) -> None:
        router, before = self._settings.router, self._was_connected
        self._was_connected = self.network.connected
        if self._was_connected and not before:
            self._node.log("info", f"ROS 2: connected with {router}")
        elif not self._was_connected and before is not False:
            self._node.log("warning", NO_ROUTER.format(router))


class RosPublisher:
    """One topic, with the count of its messages."""

    def __init__(self, publisher: OtherPublisher, identity: bytes) -> None:
        self._publisher, self._id, self._count = publisher, identity, 0

    @property
    def heard(self) -> bool:
        return self._publisher.heard

    def put(self, data: bytes, utc_ns: int) -> None:
        self._count += 1
        self._publisher.put(data, Attachment(self._count, utc_ns, self._id).packed())


class SticksFromRos:
    """Connects a `RosPilot` to the topics that sticks come from."""

    def __init__(self, node: Node, drone: DroneInRos, pilot: RosPilot) -> None:
        from services.ros2.mapping import JOY, STICKS, RosTopic

        self._node, self._drone, self._pilot = node, drone, pilot
        self._arrived = deque[Arrived](maxlen=WAITING)
        self._too_long = 0
        notify = node.from_outside(self.receive)

        def takes(_: str, payload: bytes, attachment: bytes) -> None:
            self._arrived.append((payload, attachment))
            notify()

        _, key = drone.entity("MS", RosTopic(drone.whole(STICKS), JOY))
        drone.network.hear(key, takes)
        self._ports = PilotPorts(node, pilot.pilot, pilot)
        do = self._ports.do
        node.each(topics.STATUS, lambda status, now: do(pilot.status(status, now), now))
        node.every(topics.PILOT_COMMAND.hz, self._tick)

    def receive(self, now: int) -> None:
        """Something has arrived from ROS 2."""
        while self._arrived:
            if (heard := self._read(self._arrived.popleft())) is not None:
                self._ports.do(self._pilot.heard(heard, now), now)

    def _read(self, arrived: Arrived) -> RosSticks | None:
        """Rubbish is counted and moves nothing."""
        from services.ros2.mapping import heard_of

        payload, attachment = arrived
        try:
            attached = Attachment.read(attachment)
            heard, clipped = heard_of(payload, attached)
        except ValueError:
            self._node.tell(events.MALFORMED("ros"))
            return None
        if clipped:
            self._node.tell(events.CLAMPED("sticks"))
        return heard

    def _tick(self, now: int) -> None:
        more = self._drone.network.too_long - self._too_long
        self._too_long += more
        self._node.tell(events.OVERSIZED("ros"), more)
        self._ports.do(self._pilot.tick(now), now)
