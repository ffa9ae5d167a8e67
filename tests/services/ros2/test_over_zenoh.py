"""The drone in a real Zenoh network as rmw_zenoh sees it: a router, a subscriber and a publisher
that know nothing of Lindy, only rmw_zenoh's design document."""

import json
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest
import zenoh
from zenoh.ext import HistoryConfig, RecoveryConfig, declare_advanced_subscriber

from messages import topics
from messages.events import MALFORMED
from messages.pilot import PilotRequest
from messages.vehicle import VehicleStatus
from services.ros2.core import Settings
from services.ros2.mapping import JOY, STORE, RosMessage, ros
from services.ros2.service import connected
from services.runtime.bus.other_network import OtherNetwork
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node
from tests.support import ros_document as document
from tests.support.doors import free_endpoint
from tests.support.patience import until

from .examples import state

MS = 1_000_000


class RosMachine:
    """A machine with ROS 2, and a node of Lindy's that is connected to its router."""

    node: Node

    def __init__(self, exits: ExitStack) -> None:
        self.router = free_endpoint()
        settings = zenoh.Config()
        for key, value in {
            "mode": "router",
            "listen/endpoints": [self.router],
            "scouting/multicast/enabled": False,
        }.items():
            settings.insert_json5(key, json.dumps(value))
        self.session = exits.enter_context(zenoh.open(settings))
        self.network = OtherNetwork(self.router, "ros2.router")
        self.host, self.requests = VirtualHost(), list[PilotRequest]()

        def wired(node: Node, stack: Stack) -> None:
            self.node = node
            connected(node, stack, Settings(domain=7, sticks=True), self.network)

        self.host.add("ros2", Registry.read("ros2")["ros2"], Stack(name="rov1"), wired)
        drone = self.host.node("drone", ["topside"])
        self.states = drone.publisher(topics.STATE)
        self.statuses = drone.publisher(topics.STATUS)
        drone.each(topics.PILOT_REQUEST, lambda request, _: self.requests.append(request))
        self.network.start()
        exits.callback(self.network.close)
        until(lambda: self.network.connected)

    def step(self) -> None:
        self.states.put(state())
        self.statuses.put(VehicleStatus(stamp_ns=self.host.now, activity="ready", armed=False))
        self.host.run(self.host.now + 20 * MS)

    @property
    def tokens(self) -> list[document.ReadToken]:
        replies = self.session.liveliness().get("@ros2_lv/7/**")
        return [document.read_token(str(reply.ok.key_expr)) for reply in replies if reply.ok]

    def entity(self, topic: str, kind: str) -> document.ReadToken:
        wanted = (topic, kind)
        (token,) = until(lambda: [t for t in self.tokens if (t.topic, t.kind) == wanted])
        return token

    @staticmethod
    def key(token: document.ReadToken) -> str:
        topic = token.topic.removeprefix("/")
        return f"{token.domain}/{topic}/{token.type}/{token.type_hash}"


@pytest.fixture
def machine() -> Iterator[RosMachine]:
    with ExitStack() as exits:
        yield RosMachine(exits)


def test_a_subscriber_of_ros_hears_the_odometry_and_knows_whose_it_is(machine: RosMachine) -> None:
    token = machine.entity("/rov1/odom", "MP")
    assert (token.namespace, token.name, token.session) == (
        "/rov1",
        "lindy",
        machine.network.session_id,
    )
    heard: list[zenoh.Sample] = []
    subscriber = machine.session.declare_subscriber(machine.key(token), heard.append)
    until(lambda: len(heard) > 3, meanwhile=machine.step)
    subscriber.undeclare()
    attached = [s.attachment.to_bytes() for s in heard if s.attachment is not None]
    read = [document.read_attachment(data) for data in attached]
    assert [each.sequence for each in read] == [*range(1, len(heard) + 1)]
    assert len({each.publisher for each in read}) == 1
    said: Any = STORE.deserialize_cdr(heard[0].payload.to_bytes(), "nav_msgs/msg/Odometry")
    assert (said.header.frame_id, said.child_frame_id) == ("rov1/odom", "rov1/base_link")
    assert said.pose.pose.position.z == -2.0


def test_who_subscribes_later_learns_where_the_sensors_sit(machine: RosMachine) -> None:
    token = machine.entity("/tf_static", "MP")
    assert (token.durability, token.depth) == ("1", "1")
    key = machine.key(token)
    for _ in range(2):  # as a subscription of rmw_zenoh that is transient-local and reliable
        heard: list[zenoh.Sample] = []
        subscriber = declare_advanced_subscriber(
            machine.session,
            key,
            heard.append,
            history=HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        until(lambda heard=heard: heard)
        subscriber.undeclare()
        assert len(heard) == 1
        assert heard[0].attachment is not None
        assert document.read_attachment(heard[0].attachment.to_bytes()).sequence == 1
        said: Any = STORE.deserialize_cdr(heard[0].payload.to_bytes(), "tf2_msgs/msg/TFMessage")
        assert {each.child_frame_id for each in said.transforms} == {
            "rov1/imu",
            "rov1/dvl",
            "rov1/pressure",
        }
        assert {each.header.frame_id for each in said.transforms} == {"rov1/base_link"}


def test_sticks_of_a_publisher_of_ros_arrive_and_rubbish_is_counted(machine: RosMachine) -> None:
    key = machine.key(machine.entity("/rov1/joy", "MS"))
    header = ros.std_msgs__msg__Header(ros.builtin_interfaces__msg__Time(0, 0), "")
    said: Any = ros.sensor_msgs__msg__Joy(header, np.zeros(6, np.float32), np.zeros(15, np.int32))
    good = RosMessage("", JOY, said).cdr()

    def say() -> None:
        attached = document.attachment(1, machine.host.now, b"p" * 16)
        machine.session.put(key, good, attachment=attached)
        machine.session.put(key, b"rubbish", attachment=attached)
        machine.session.put(key, good)  # without an attachment
        machine.step()

    until(lambda: machine.requests and machine.node.counts[MALFORMED("ros").name] > 3, None, say)
    asked = machine.requests[0]
    assert (asked.kind, asked.source) == ("lease", "ROS 2")
