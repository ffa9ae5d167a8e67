"""A node of ROS 2 flies the simulated vehicle on virtual time, over a network that a test holds."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from messages import topics
from messages.events import LOST_ROS, MALFORMED, NOT_THE_HOLDER_ROS, STALE
from messages.pilot import PilotCommand
from messages.vehicle import Truth, VehicleStatus
from services.ros2.core import Settings
from services.ros2.mapping import JOY, STORE, RosMessage, ros
from services.ros2.service import connected, wire
from services.runtime.bus.other_network import OtherPublisher
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from services.runtime.node.node import Node

from .design_document import attachment, read_attachment, read_token

MS = 1_000_000
S = 1000 * MS
DRONE = ("simulator", "estimation", "reference", "control", "tether")
ANN, BOB = b"a" * 16, b"b" * 16
START, BACK = 6, 4  # buttons
LEFT_Y = 1  # an axis


class Heard(OtherPublisher):
    """Somebody listens to the odometry alone."""

    def __init__(self, key: str) -> None:
        super().__init__()
        self.heard, self.sent = "/odom/" in key, list[tuple[bytes, bytes]]()

    def put(self, payload: bytes, attachment: bytes) -> None:
        self.sent.append((payload, attachment))


class Air:
    """A ROS network that the test holds the other end of."""

    session_id, connected, too_long = "1f", True, 0

    def __init__(self) -> None:
        self.tokens: list[str] = []
        self.published: dict[str, Heard] = {}
        self.subscribed: dict[str, Callable[[str, bytes, bytes], None]] = {}

    def publisher(self, key: str) -> OtherPublisher:
        self.published[key] = Heard(key)
        return self.published[key]

    def keep(self, key: str, payload: bytes, attachment: bytes) -> None:
        """Nobody here asks where the sensors sit."""

    def hear(self, key: str, takes: Callable[[str, bytes, bytes], None]) -> None:
        self.subscribed[key] = takes

    def announce(self, token: str) -> None:
        self.tokens.append(token)

    def say(self, kind: str, payload: bytes, attached: bytes) -> None:
        dds = f"/{kind.replace('/msg/', '::msg::dds_::')}_/"
        (key,) = (key for key in self.subscribed if dds in key)
        self.subscribed[key](key, payload, attached)


class Dive:
    """The whole chain with a node of ROS 2 as pilot."""

    def __init__(self, folder: Path, settings: Settings = Settings(sticks=True)) -> None:  # noqa: B008
        rows = Registry.read("ros2")
        self.stack = Stack(
            out=str(folder), overrides=["estimation.calibration.still_time=3"], name="rov-1"
        )
        self.host, self.air, self.count = VirtualHost(), Air(), 0
        for name in DRONE:
            self.host.add(name, rows[name], self.stack)
        self.node: Node

        def wired(node: Node, stack: Stack) -> None:
            self.node = node
            connected(node, stack, settings, self.air)

        self.host.add("ros2", rows["ros2"], self.stack, wired)
        self.truth: list[Truth] = []
        self.statuses: list[VehicleStatus] = []
        self.commands: list[PilotCommand] = []
        observer = self.host.node("observer", ["drone"])
        observer.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        observer.each(topics.STATUS, lambda m, _: self.statuses.append(m))
        observer.each(topics.PILOT_COMMAND, lambda m, _: self.commands.append(m))

    def run(self, seconds: float) -> "Dive":
        self.host.run(self.host.now + round(seconds * S))
        return self

    def joy(
        self,
        sender: bytes = ANN,
        *buttons: int,
        sent_ns: int | None = None,
        lefty: float = 0.0,
    ) -> None:
        """Axes as of game_controller_node: up is positive."""
        values, down = np.zeros(6, np.float32), np.zeros(15, np.int32)
        values[LEFT_Y] = lefty
        down[list(buttons)] = 1
        header = ros.std_msgs__msg__Header(ros.builtin_interfaces__msg__Time(0, 0), "")
        said: Any = ros.sensor_msgs__msg__Joy(header, values, down)
        self.count += 1
        sent = self.host.now if sent_ns is None else sent_ns
        self.air.say(JOY, RosMessage("", JOY, said).cdr(), attachment(self.count, sent, sender))

    def steer(
        self, seconds: float, sender: bytes = ANN, *buttons: int, lefty: float = 0.0
    ) -> "Dive":
        """At 20 Hz, as game_controller_node repeats itself."""
        for _ in range(round(seconds * 20)):
            self.joy(sender, *buttons, lefty=lefty)
            self.run(0.05)
        return self

    def armed(self) -> "Dive":
        for _ in range(20):
            self.steer(0.5)
            if self.status.activity == "ready":
                break
        self.steer(0.5, ANN, START)
        self.steer(0.3)
        assert self.status.armed
        return self

    @property
    def status(self) -> VehicleStatus:
        return self.statuses[-1]

    @property
    def depth(self) -> float:
        return self.truth[-1].position[2]


def test_a_node_of_ros_arms_dives_a_metre_lets_go_and_the_drone_holds(tmp_path: Path) -> None:
    dive = Dive(tmp_path).armed()
    assert dive.status.pilot == "ROS 2"
    start = dive.depth
    while dive.depth < start + 1.0:
        dive.steer(0.2, lefty=-1.0)
    dive.steer(3.0)
    held = dive.depth
    assert abs(dive.steer(3.0).depth - held) < 0.1
    dive.steer(0.5, ANN, BACK)
    assert not dive.status.armed
    (key,) = (key for key in dive.air.published if "/odom/" in key)
    assert key.startswith("0/rov_1/odom/nav_msgs::msg::dds_::Odometry_/RIHS01_")
    payload, attached = dive.air.published[key].sent[-1]
    odom: Any = STORE.deserialize_cdr(payload, "nav_msgs/msg/Odometry")
    assert odom.pose.pose.position.z == pytest.approx(-dive.depth, abs=0.1)
    stamp = odom.header.stamp
    read = read_attachment(attached)
    assert read.utc_ns == stamp.sec * S + stamp.nanosec
    assert read.sequence == len(dive.air.published[key].sent)
    topics_there = {read_token(token).topic for token in dive.air.tokens}
    assert {"/rov_1/joy", "/rov_1/odom", "/tf", "/diagnostics"} < topics_there


def test_a_node_that_falls_silent_is_a_lost_pilot_within_the_time_to_live(tmp_path: Path) -> None:
    dive = Dive(tmp_path).armed().steer(1.0, lefty=-1.0)
    silent = dive.host.now - 50 * MS  # the last sticks
    dive.run(2.0)
    lost = next(status for status in dive.statuses if status.failsafe == "pilot_lost")
    assert lost.stamp_ns - silent <= 330 * MS  # 300 ms, a state's period and the link
    assert dive.node.counts[LOST_ROS().name] == 1
    dive.steer(1.0)
    dive.steer(0.2, ANN, START)
    dive.steer(0.3)
    assert dive.status.failsafe == "none", "who arms while a failsafe acts resumes"


def test_a_second_node_moves_nothing_and_what_it_holds_down_asks_for_nothing(
    tmp_path: Path,
) -> None:
    dive = Dive(tmp_path).armed()
    start = dive.depth
    for _ in range(20):
        dive.joy(BOB, BACK, lefty=-1.0)
        dive.steer(0.05)
    assert abs(dive.depth - start) < 0.05
    assert dive.status.armed
    assert dive.node.counts[NOT_THE_HOLDER_ROS().name] == 20


def test_sticks_that_were_held_up_on_their_way_move_nothing(tmp_path: Path) -> None:
    dive = Dive(tmp_path).armed()
    start = dive.depth
    for _ in range(20):
        dive.joy(sent_ns=dive.host.now - 400 * MS, lefty=-1.0)
        dive.steer(0.05)
    assert abs(dive.depth - start) < 0.05
    assert dive.node.counts[STALE("ros").name] == 20


def test_another_clock_is_no_delay(tmp_path: Path) -> None:
    dive = Dive(tmp_path)
    for _ in range(80):
        dive.joy(sent_ns=dive.host.now - 3600 * S)
        dive.run(0.05)
    assert not dive.node.counts[STALE("ros").name]
    assert dive.status.pilot == "ROS 2"


def test_rubbish_is_counted_and_ends_nothing(tmp_path: Path) -> None:
    dive = Dive(tmp_path)
    good = attachment(1, 0, ANN)
    for payload, attached in ((b"", good), (b"\0\1\0\0" + b"\xff" * 60, good), (b"x", b"short")):
        dive.air.say(JOY, payload, attached)
    dive.run(0.2)
    assert dive.node.counts[MALFORMED("ros").name] == 3
    assert not dive.commands


def test_without_the_setting_nobody_in_ros_can_fly(tmp_path: Path) -> None:
    dive = Dive(tmp_path, Settings())
    dive.run(0.5)
    assert not dive.air.subscribed
    assert {read_token(token).kind for token in dive.air.tokens} == {"NN", "MP"}


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ("ros2.router=localhost", "ros2.router 'localhost': expected PROTOCOL/ADDRESS:PORT"),
        ("ros2.domain=300", "domain"),
        ("ros2.namespace=rov 1", "expected names of letters, digits and _"),
    ],
)
def test_a_wrong_setting_is_one_sentence(tmp_path: Path, setting: str, sentence: str) -> None:
    stack = Stack(out=str(tmp_path), overrides=[setting])
    with pytest.raises(LindyError, match=sentence) as refused:
        wire(VirtualHost().node("ros2", ["topside", "drone"]), stack)
    assert "\n" not in str(refused.value)
