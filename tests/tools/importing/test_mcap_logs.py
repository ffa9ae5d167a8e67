"""Recordings of other programs in MCAP files become ours."""

from pathlib import Path

import pytest
from mcap.writer import Writer

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


SEPARATOR = "=" * 80
OTHERS = f"""
{SEPARATOR}
MSG: x/Nothing
uint8[0] q
{SEPARATOR}
MSG: x/Many
float64[1000] q
"""


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ("x/Nothing[900000000] a", "it has an array of nothing"),
        ("x/Nothing[] a", "it has an array of nothing"),
        ("x/Many[1000] a", "its arrays hold more numbers than those of any message"),
        ("x/Many[1000][1000] a", ""),
        ("x/Many[] a\nfloat64[36] b", None),
    ],
)
def test_a_type_whose_arrays_take_no_byte_or_all_the_memory_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], fields: str, why: str | None
) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        kind, text = "sensor_msgs/msg/FluidPressure", f"float64 fluid_pressure\n{fields}{OTHERS}"
        schema = writer.register_schema(kind, "ros2msg", text.encode())
        channel = writer.register_channel("/pressure", "cdr", schema)
        writer.add_message(channel, BEGAN_NS, bytes(4), BEGAN_NS)
        writer.finish()
    said = complaint(capsys, "import", str(path))
    if why is None:
        assert "is not of its type" in said  # four bytes are none of it
    else:
        assert f"the type {kind} is none: {why}" in said
