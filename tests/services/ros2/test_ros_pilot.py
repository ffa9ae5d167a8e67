"""A node of ROS 2 flies the simulated vehicle on virtual time. See also
tests/contract/test_any_pilot.py."""

from pathlib import Path
from typing import Any

import pytest

from messages.events import LOST_ROS, STALE
from services.ros2.mapping import STORE
from services.ros2.service import wire
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.pilots import RosDive
from tests.support.ros_document import read_attachment, read_token

MS, S = 1_000_000, 1_000_000_000  # [ns]


def test_the_odometry_is_where_the_drone_is_and_a_lost_node_is_counted(tmp_path: Path) -> None:
    dive = RosDive(tmp_path, name="rov-1").armed()
    dive.steer(1.0, heave=1.0).steer(1.0)
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
    dive.run(1.0)
    assert dive.counts[LOST_ROS().name] == 1


def test_sticks_that_were_held_up_on_their_way_move_nothing(tmp_path: Path) -> None:
    dive = RosDive(tmp_path).armed()
    start = dive.depth
    for _ in range(20):
        dive.joy(age_ns=400 * MS, heave=1.0)
        dive.steer(0.05)
    assert abs(dive.depth - start) < 0.05
    assert dive.counts[STALE("ros").name] == 20


def test_another_clock_is_no_delay(tmp_path: Path) -> None:
    dive = RosDive(tmp_path)
    for _ in range(80):
        dive.joy(age_ns=3600 * S)
        dive.run(0.05)
    assert not dive.counts[STALE("ros").name]
    assert dive.status.pilot == "ROS 2"


def test_without_the_setting_nobody_in_ros_can_fly(tmp_path: Path) -> None:
    class Watched(RosDive):
        flies = False

    dive = Watched(tmp_path)
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
