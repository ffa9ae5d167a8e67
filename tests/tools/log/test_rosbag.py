"""A bag holds every message that has a place in ROS 2, and rosbags reads it back."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag2, QosDurability

from messages import topics
from messages.vehicle import Truth
from services.ros2.mapping import MADE, STORE
from services.runtime.config.settings import deploy_file
from tests.support.recorded import ShortDive
from tools.__main__ import main
from tools.recordings.recording import open_recording


@pytest.fixture(scope="module")
def bag(dive: ShortDive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("bag") / "bag"
    assert main(["log", "export", "--as", "rosbag", str(dive.folder), "--out", str(out)]) == 0
    return out


def test_rosbags_reads_every_message_back_in_its_order(dive: ShortDive, bag: Path) -> None:
    expected = Counter[str]()
    for recorded in open_recording(dive.folder):
        topic = topics.find(recorded.key)
        assert topic is not None
        expected[topic.key] += topic.key in MADE
    with AnyReader([bag], default_typestore=STORE) as reader:
        found = Counter[str]()
        before = 0
        for connection, at_ns, data in reader.messages():
            message: Any = reader.deserialize(data, connection.msgtype)
            found[connection.topic] += 1
            assert at_ns >= before
            before = at_ns
            assert message.__msgtype__ == connection.msgtype
        (latched,) = (each for each in reader.connections if each.topic == "/tf_static")
        digests = {each.topic: each.digest for each in reader.connections}
    assert found["/my_drone/imu/data_raw"] == expected["sensor/imu"] > 100
    assert found["/my_drone/truth"] == expected["simulator/truth"]
    assert found["/my_drone/sticks"] == expected["pilot/command"]
    assert found["/diagnostics"] == expected["vehicle/status"] + expected["health/*"]
    assert found["/tf"] == found["/my_drone/odom"] > 100
    assert found["/tf_static"] == 1
    assert isinstance(latched.ext, ConnectionExtRosbag2)
    (offered,) = latched.ext.offered_qos_profiles
    assert (offered.durability, offered.depth) == (QosDurability.TRANSIENT_LOCAL, 1)
    assert digests["/tf"] == STORE.hash_rihs01("tf2_msgs/msg/TFMessage")


def test_the_depth_of_the_bag_is_that_of_the_recording(dive: ShortDive, bag: Path) -> None:
    recorded = (each.message for each in open_recording(dive.folder))
    truths = [message for message in recorded if isinstance(message, Truth)]
    with AnyReader([bag], default_typestore=STORE) as reader:
        (truth,) = (each for each in reader.connections if each.topic == "/my_drone/truth")
        odometry: list[Any] = [
            reader.deserialize(data, truth.msgtype) for _, _, data in reader.messages([truth])
        ]
    heights = [each.pose.pose.position.z for each in odometry]
    assert heights == [-message.position[2] for message in truths]


def test_the_bag_imported_again_has_the_samples_of_the_recording(
    dive: ShortDive, bag: Path, tmp_path: Path
) -> None:
    """By the map that is taken where none is named, with a time, for virtual time has none."""
    out, own = tmp_path / "again", tmp_path / "own.toml"
    own.write_text("began = 2024-05-01T09:30:00Z\n" + deploy_file("imports", "ros").read_text())
    assert main(["import", str(bag), "--map", str(own), "--out", str(out)]) == 0
    for key in ("sensor/imu", "sensor/pressure"):
        before, after = (
            [each.message for each in open_recording(folder) if each.key == key]
            for folder in (dive.folder, out)
        )
        fields = ("specific_force", "pressure")
        assert [[getattr(one, name, None) for name in fields] for one in after] == [
            [getattr(one, name, None) for name in fields] for one in before
        ]
        assert after
    assert any(each.key == "vehicle/estimate" for each in open_recording(out))


def test_it_says_what_has_no_place_in_ros(
    dive: ShortDive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["log", "export", "--as", "rosbag", str(dive.folder), "--out", str(tmp_path / "b")])
        == 0
    )
    said = capsys.readouterr().out
    assert "not in ROS 2's words: " in said
    assert "control/wrench" in said
    assert "sensor/imu" not in said
