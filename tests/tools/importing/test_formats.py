"""Logs of each format become recordings; those of other vehicles do not."""

import os
from collections.abc import Callable
from math import radians
from pathlib import Path

import pytest

from messages.pilot import PilotCommand
from messages.sensors import ImuSample, MagnetometerSample, PressureSample
from messages.vehicle import VehicleEstimate, VehicleStatus
from services.marine.vehicle import GRAVITY
from tests.tools.test_cli_verbs import complaint
from tools.analysis.dive import read_dive
from tools.recordings.recording import open_recording

from .logs import (
    BEGAN_NS,
    IMU_HZ,
    SECONDS,
    SLOW_HZ,
    S,
    dataflash,
    imported,
    mcap,
    messages,
    odd,
    of,
    remarks,
    report,
    ros2,
    tlog,
    ulog,
)

CHANGED_S = 1_650_000_000  # [s] UTC at which a file was changed last


def armed(folder: Path) -> list[bool]:
    return [one.armed for one in of(folder, "vehicle/status", VehicleStatus)]


def test_a_dataflash_log_has_everything_in_si(tmp_path: Path) -> None:
    log = dataflash(tmp_path / "1.BIN")
    os.utime(log, (CHANGED_S, CHANGED_S))
    out = imported(log, tmp_path / "dive")
    samples = of(out, "sensor/imu", ImuSample)
    assert len(samples) == SECONDS * IMU_HZ  # of the first IMU alone
    assert samples[0].angular_rate == pytest.approx((0.1, 0.2, 0.3))
    assert samples[0].specific_force == pytest.approx((0.0, 0.0, -GRAVITY), abs=0.1)
    assert messages(out, "sensor/imu")[-1].publish_ns == CHANGED_S * S
    depth = of(out, "sensor/pressure", PressureSample)[0]
    assert depth.pressure == pytest.approx(101_325.0, abs=10.0)
    assert depth.temperature == pytest.approx(12.0)
    sticks = of(out, "pilot/command", PilotCommand)[0]
    assert (sticks.surge, sticks.sway, sticks.heave, sticks.yaw) == (0.5, -1.0, -1.0, 0.0)
    angles, depths = of(out, "vehicle/estimate", VehicleEstimate)[:2]
    assert angles.heading == pytest.approx(radians(270.0))
    assert (angles.roll, angles.depth) == (pytest.approx(radians(-10.0)), None)
    assert (depths.depth, depths.depth_rate, depths.roll) == (2.5, 0.25, None)
    assert armed(out) == [False, True, False]
    assert of(out, "vehicle/status", VehicleStatus)[1].flight_mode == "stabilised"  # ALT_HOLD
    assert odd(out) == {}
    assert "without a GPS" in remarks(out)


def test_a_board_that_starts_again_goes_on_in_time(tmp_path: Path) -> None:
    out = imported(dataflash(tmp_path / "1.bin", restart=True), tmp_path / "dive")
    samples = messages(out, "sensor/imu")
    arrivals = [one.log_ns for one in samples]
    assert arrivals == sorted(arrivals)
    assert len(samples) >= SECONDS * IMU_HZ - 1
    assert odd(out)["log: the logger's clock stepped back [s]; what follows was moved"] == 1


def test_telemetry_has_everything_in_si(tmp_path: Path) -> None:
    out = imported(tlog(tmp_path / "a.tlog"), tmp_path / "dive")
    samples = of(out, "sensor/imu", ImuSample)
    assert len(samples) == SECONDS * SLOW_HZ
    assert samples[0].angular_rate == pytest.approx((0.1, 0.2, 0.3))
    assert samples[0].specific_force[2] == pytest.approx(-GRAVITY)
    assert abs(messages(out, "sensor/imu")[0].publish_ns - BEGAN_NS) < 1_000_000
    field = of(out, "sensor/magnetometer", MagnetometerSample)[0].field
    assert field[2] == pytest.approx(4e-5)
    found = of(out, "vehicle/estimate", VehicleEstimate)
    assert [one.seq for one in found] == [*range(2 * SECONDS * SLOW_HZ)]
    angles = next(one for one in found if one.roll is not None)
    assert (angles.roll, angles.heading) == (pytest.approx(-0.1), pytest.approx(-2.5))
    assert angles.angular_rate == pytest.approx((0.01, 0.02, 0.03))
    depths = next(one for one in found if one.roll is None)
    assert (depths.depth, depths.depth_rate) == (3.5, 0.25)
    sticks = of(out, "pilot/command", PilotCommand)[0]
    assert (sticks.surge, sticks.sway, sticks.heave) == (0.5, -1.0, 1.0)
    assert armed(out) == [False, *[True] * 3]


def test_damaged_packets_are_left_out(tmp_path: Path) -> None:
    data = bytearray(tlog(tmp_path / "a.tlog").read_bytes())
    data[len(data) // 2 : len(data) // 2 + 200] = bytes(200)
    out = imported(written(tmp_path / "a.tlog", data[:-5]), tmp_path / "dive")
    assert SECONDS * SLOW_HZ // 2 < len(messages(out, "sensor/imu")) < SECONDS * SLOW_HZ
    assert "bytes of it are no message and are left out" in remarks(out)


REAL = {"small.BIN": ("sensor/imu", 594), "small.tlog": ("sensor/pressure", 532)}


@pytest.mark.parametrize("name", REAL)
def test_a_real_log_is_imported(name: str, tmp_path: Path) -> None:
    folder = Path(os.environ.get("LINDY_REAL", ""))
    if not (folder / name).is_file():
        pytest.skip(f"LINDY_REAL names no folder with {name}")
    key, count = REAL[name]
    assert len(messages(imported(folder / name, tmp_path / "dive"), key)) == count


def test_a_hole_of_rubbish_is_left_out_and_what_is_behind_it_is_there(tmp_path: Path) -> None:
    """Also where the rubbish looks like messages, of which the times would be absurd."""
    data = bytearray(dataflash(tmp_path / "whole.bin").read_bytes())
    middle = len(data) // 2
    rubbish = bytes(range(256)) * 8 + b"\xa3\x95\x83" + b"\xff" * 40
    data[middle : middle + len(rubbish)] = rubbish
    out = imported(written(tmp_path / "hole.bin", data), tmp_path / "dive")
    stamps = [m.log_ns for m in messages(out, "sensor/imu")]
    assert len(stamps) > 150
    assert 3.5e9 < stamps[-1] - stamps[0] < 4.1e9
    assert "bytes of it are no message and are left out" in remarks(out)


@pytest.mark.parametrize("bit", [25, 40, 63])
def test_a_damaged_time_is_that_of_the_message_before(tmp_path: Path, bit: int) -> None:
    data = bytearray(dataflash(tmp_path / "whole.bin").read_bytes())
    at = data.index(b"\xa3\x95\x83", len(data) // 2) + 3  # the time of an IMU's message
    data[at + bit // 8] ^= 1 << bit % 8
    out = imported(written(tmp_path / "torn.bin", data), tmp_path / "dive")
    stamps = [m.log_ns for m in messages(out, "sensor/imu")]
    assert len(stamps) >= 199  # of two at one instant the second is left out
    assert stamps == sorted(stamps)
    assert 3.5e9 < stamps[-1] - stamps[0] < 4.1e9
    assert "1 of its times are damaged" in remarks(out)


def test_a_log_of_px4_has_everything_in_si(tmp_path: Path) -> None:
    out = imported(ulog(tmp_path / "1.ulg"), tmp_path / "dive")
    samples = of(out, "sensor/imu", ImuSample)
    assert len(samples) == SECONDS * IMU_HZ
    assert messages(out, "sensor/imu")[0].publish_ns == BEGAN_NS
    assert samples[0].angular_rate == pytest.approx((0.1, 0.2, 0.3))
    assert samples[0].specific_force[2] == pytest.approx(-GRAVITY)
    pressures = of(out, "sensor/pressure", PressureSample)
    assert len(pressures) == SECONDS * SLOW_HZ
    assert pressures[-1].pressure == pytest.approx(101_325.0 + 39_000.0, abs=1.0)
    sticks = of(out, "pilot/command", PilotCommand)[0]
    assert (sticks.surge, sticks.sway, sticks.heave, sticks.yaw) == (0.5, 0.25, -0.75, -1.0)
    assert armed(out) == [False, *[True] * 3]
    stamps = [one.stamp_ns for one in of(out, "vehicle/status", VehicleStatus)]
    seconds = read_dive(open_recording(out)).armed_seconds  # as `lindy log compare` says it
    assert seconds == pytest.approx((stamps[-1] - stamps[1]) / 1e9)
    assert seconds > 0.0
    assert odd(out) == {}
    assert "sensor/battery" in report(out)["missing"]
    # Its own estimate is there while it is valid.
    estimates = of(out, "vehicle/estimate", VehicleEstimate)
    depths = [one.depth for one in estimates if one.depth is not None]
    assert depths == pytest.approx([k / SLOW_HZ for k in range(2 * SLOW_HZ)])
    headings = [one.heading for one in estimates if one.heading is not None]
    assert headings == pytest.approx([2.0] * SECONDS * SLOW_HZ)


@pytest.mark.parametrize("kind", ["ros1", "ros2", "json"])
def test_an_mcap_file_gives_what_the_bag_gives(tmp_path: Path, kind: str) -> None:
    ours = messages(imported(mcap(tmp_path / "a.mcap", kind), tmp_path / "a"), "sensor/imu")
    bag = messages(imported(ros2(tmp_path / "bag"), tmp_path / "b"), "sensor/imu")
    assert len(ours) == SECONDS * IMU_HZ
    assert ours == bag
    force = of(tmp_path / "a", "sensor/imu", ImuSample)[0].specific_force
    assert force == pytest.approx((0.0, -0.5, -GRAVITY), abs=0.1)
    assert ours[0].publish_ns == BEGAN_NS


def test_a_file_that_was_cut_off_keeps_its_whole_chunks(tmp_path: Path) -> None:
    whole = mcap(tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(whole[: len(whole) // 2])
    out = imported(tmp_path / "a.mcap", tmp_path / "dive")
    assert SECONDS * IMU_HZ // 4 < len(messages(out, "sensor/imu")) < SECONDS * IMU_HZ
    assert report(out)["remarks"] == [
        "a.mcap was not finished: what was recorded last may be missing"
    ]


@pytest.mark.parametrize(("write", "name"), [(dataflash, "1.bin"), (ulog, "1.ulg")])
def test_a_log_that_was_cut_off_keeps_its_whole_messages(
    tmp_path: Path, write: Callable[[Path], Path], name: str
) -> None:
    whole = write(tmp_path / f"whole{name}").read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    count = len(messages(imported(tmp_path / name, tmp_path / "dive"), "sensor/imu"))
    assert SECONDS * IMU_HZ // 3 < count < SECONDS * IMU_HZ


def test_what_is_no_such_log_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = imported(mcap(tmp_path / "a.mcap"), tmp_path / "own") / "dive.mcap"
    capsys.readouterr()
    cases = {
        own: "is a recording of Lindy already",
        mcap(
            tmp_path / "proto.mcap", "protobuf"
        ): "is left out: it is encoded as protobuf with protobuf",
        dataflash(
            tmp_path / "copter.bin", "ArduCopter V4.3.6"
        ): "is of ArduCopter V4.3.6; expected a log of ArduSub",
        ulog(tmp_path / "copter.ulg", kind=2): "of MAVLink's type 2; expected 12, a submarine",
        tlog(tmp_path / "copter.tlog", kind=2): "of MAVLink's type 2; expected 12, a submarine",
        tlog(tmp_path / "two.tlog", systems=(1, 2)): "is of two boards, systems 1 and 2",
        tlog(
            tmp_path / "milli.tlog", milli=0.001
        ): "write zero = -1013.25 where it counts from the surface",
        written(tmp_path / "empty.tlog", b""): "empty.tlog is empty",
        written(
            tmp_path / "a.bag", b"PK\x03\x04 no"
        ): "a.bag is no log that is read and begins with",
    }
    for log, said in cases.items():
        out = tmp_path / "dive"
        assert said in complaint(capsys, "import", str(log), "--out", str(out))
        assert not out.exists()


def written(path: Path, data: bytes | bytearray) -> Path:
    path.write_bytes(data)
    return path
