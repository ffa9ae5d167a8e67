"""Recordings of other programs in MCAP files become ours."""

from pathlib import Path

import pytest

from messages.sensors import ImuSample
from services.marine.vehicle import GRAVITY
from tests.tools.test_cli_verbs import complaint

from .logs import BEGAN_NS, IMU_HZ, SECONDS, mcap, messages, report, ros2
from .test_rosbags import imported


@pytest.mark.parametrize("kind", ["ros1", "ros2", "json"])
def test_an_mcap_file_gives_what_the_bag_gives(tmp_path: Path, kind: str) -> None:
    ours = messages(imported(mcap(tmp_path / "a.mcap", kind), tmp_path / "a"), "sensor/imu")
    bag = messages(imported(ros2(tmp_path / "bag"), tmp_path / "b"), "sensor/imu")
    assert len(ours) == SECONDS * IMU_HZ
    assert ours == bag
    first = ours[0].message
    assert isinstance(first, ImuSample)
    assert first.specific_force == pytest.approx((0.0, -0.5, -GRAVITY), abs=0.1)
    assert ours[0].publish_ns == BEGAN_NS


def test_a_file_that_was_cut_off_keeps_its_whole_chunks(tmp_path: Path) -> None:
    whole = mcap(tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(whole[: len(whole) // 2])
    out = imported(tmp_path / "a.mcap", tmp_path / "dive")
    assert SECONDS * IMU_HZ // 4 < len(messages(out, "sensor/imu")) < SECONDS * IMU_HZ
    assert report(out)["remarks"] == [
        "a.mcap was not finished: what was recorded last may be missing"
    ]


def test_what_is_no_such_recording_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign, empty = tmp_path / "foreign.mcap", tmp_path / "empty.mcap"
    foreign.write_bytes(b"PK\x03\x04 no recording")
    empty.touch()
    own = imported(mcap(tmp_path / "a.mcap"), tmp_path / "own") / "dive.mcap"
    capsys.readouterr()
    cases = {
        foreign: "is not an MCAP file: it begins with b'PK",
        empty: "is not an MCAP file: it is empty",
        mcap(tmp_path / "proto.mcap", "protobuf"): "/imu is encoded as protobuf with protobuf",
        own: "is a recording of Lindy already",
    }
    for log, said in cases.items():
        out = tmp_path / "dive"
        assert said in complaint(capsys, "import", str(log), "--out", str(out))
        assert not out.exists()
