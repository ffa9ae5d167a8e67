"""Logs of PX4 become recordings."""

from pathlib import Path

import pytest

from messages.pilot import PilotCommand
from messages.sensors import ImuSample, PressureSample
from messages.vehicle import VehicleEstimate, VehicleStatus
from services.marine.vehicle import GRAVITY
from tests.tools.test_cli_verbs import complaint
from tools.analysis.dive import read_dive
from tools.recordings.recording import open_recording

from .logs import BEGAN_NS, IMU_HZ, SECONDS, SLOW_HZ, messages, odd, report, ulog
from .test_rosbags import imported


def test_a_log_of_px4_has_everything_in_si(tmp_path: Path) -> None:
    out = imported(ulog(tmp_path / "1.ulg"), tmp_path / "dive")
    samples = messages(out, "sensor/imu")
    assert len(samples) == SECONDS * IMU_HZ
    assert samples[0].publish_ns == BEGAN_NS
    first = samples[0].message
    assert isinstance(first, ImuSample)
    assert first.angular_rate == pytest.approx((0.1, 0.2, 0.3))
    assert first.specific_force[2] == pytest.approx(-GRAVITY)
    pressures = [one.message for one in messages(out, "sensor/pressure")]
    assert len(pressures) == SECONDS * SLOW_HZ
    assert isinstance(pressures[-1], PressureSample)
    assert pressures[-1].pressure == pytest.approx(101_325.0 + 39_000.0, abs=1.0)
    sticks = messages(out, "pilot/command")[0].message
    assert isinstance(sticks, PilotCommand)
    assert (sticks.surge, sticks.sway, sticks.heave, sticks.yaw) == (0.5, 0.25, -0.75, -1.0)
    states = [one.message for one in messages(out, "vehicle/status")]
    assert [one.armed for one in states if isinstance(one, VehicleStatus)] == [False, *[True] * 3]
    stamps = [one.stamp_ns for one in states if isinstance(one, VehicleStatus)]
    seconds = read_dive(open_recording(out)).armed_seconds  # as `lindy log compare` says it
    assert seconds == pytest.approx((stamps[-1] - stamps[1]) / 1e9)
    assert seconds > 0.0
    assert odd(out) == {}
    assert "sensor/battery" in report(out)["missing"]


def test_px4_s_own_estimate_is_there_while_it_is_valid(tmp_path: Path) -> None:
    out = imported(ulog(tmp_path / "1.ulg"), tmp_path / "dive")
    found = [one.message for one in messages(out, "vehicle/estimate")]
    estimates = [one for one in found if isinstance(one, VehicleEstimate)]
    depths = [one.depth for one in estimates if one.depth is not None]
    assert depths == pytest.approx([k / SLOW_HZ for k in range(2 * SLOW_HZ)])
    headings = [one.heading for one in estimates if one.heading is not None]
    assert headings == pytest.approx([2.0] * SECONDS * SLOW_HZ)


def test_a_log_that_was_cut_off_keeps_its_whole_messages(tmp_path: Path) -> None:
    whole = ulog(tmp_path / "whole.ulg").read_bytes()
    (tmp_path / "1.ulg").write_bytes(whole[: len(whole) // 2])
    count = len(messages(imported(tmp_path / "1.ulg", tmp_path / "dive"), "sensor/imu"))
    assert SECONDS * IMU_HZ // 3 < count < SECONDS * IMU_HZ


def test_what_is_no_such_log_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign, empty = tmp_path / "foreign.ulg", tmp_path / "empty.ulg"
    foreign.write_bytes(b"PK\x03\x04 no log at all")
    empty.touch()
    cases = {
        foreign: "is not a log of PX4: it begins with b'PK",
        empty: "is not a log of PX4: it is empty",
        ulog(tmp_path / "copter.ulg", kind=2): "of MAVLink's type 2; expected 12, a submarine",
    }
    for log, said in cases.items():
        out = tmp_path / "dive"
        assert said in complaint(capsys, "import", str(log), "--out", str(out))
        assert not out.exists()
