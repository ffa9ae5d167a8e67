"""A driver with wrong units, signs or stamps in the whole chain, on virtual time: the vehicle does
not arm, and the pilot reads why."""

import json
from pathlib import Path

import pytest

from messages.vehicle import VehicleStatus
from tools.__main__ import main
from tools.recordings.recording import open_recording

EXAMPLE = Path(__file__).parents[2] / "examples" / "point_vehicle"
QUICK = ("--set", "estimation.calibration.still_time=2")  # [s] at rest instead of ten
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n2,0,0,0,0\n"
FORCE, STAMP = "specific_force=force", "ImuSample(stamp_ns=now"

# The mistake in the driver, the count, and what the warning and the last sentence say of it.
WRONG = {
    "in_g": (
        FORCE, f"{FORCE[:-5]}tuple(f / 9.81 for f in force)", "wrong_unit:sensor/imu",
        "the IMU reads a specific force of 1 m/s², allowed are 3 to 30: its driver must say m/s²",
        "do not fit its unit (sensor/imu)",
    ),
    "upside_down": (
        FORCE, f"{FORCE[:-5]}(force[0], -force[1], -force[2])", "upside_down:sensor/imu",
        "check [vehicle.mounting.imu] in the vehicle file and the sign of the IMU's z axis",
        "the IMU reads as if the drone lay upside down",
    ),
    "late": (
        STAMP, f"{STAMP} - 5_000_000_000", "old_stamps:sensor/imu",
        "samples of the IMU are 5 s old when they arrive, allowed are 0.2 s",
        "too old when they arrive (sensor/imu)",
    ),
    "ahead": (
        STAMP, f"{STAMP} + 5_000_000_000", "unusable:sensor/imu",
        "the IMU cannot be used: no attitude and heading, depth from pressure alone; a message had "
        "a time stamp in the future (sensor/imu)",
        "no usable samples of its IMU",
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("mistake", WRONG)
def test_a_vehicle_with_a_wrong_driver_stays_disarmed_and_says_why(
    tmp_path: Path, mistake: str, capsys: pytest.CaptureFixture[str]
) -> None:
    right, wrong, count, warning, ending = WRONG[mistake]
    stack, out = driver_with(tmp_path, mistake, right, wrong), tmp_path / "out"
    (tmp_path / "script.csv").write_text(SCRIPT)
    vehicle = ("--vehicle", f"{EXAMPLE}/vehicle.toml", *QUICK)
    pilot = ("--pilot", f"script:{tmp_path}/script.csv", "--out", str(out))
    assert main(["simulate", "--stack", str(stack), *vehicle, *pilot]) == 1
    said = capsys.readouterr()
    assert said.out.count(warning) == 1
    assert ending in said.err
    assert "keep the drone still" not in said.err
    assert json.loads((out / "report.json").read_text())["losses"][count] == 1
    heard = [entry.message for entry in open_recording(out)]
    armed = [message.armed for message in heard if isinstance(message, VehicleStatus)]
    assert armed
    assert not any(armed)


def driver_with(folder: Path, mistake: str, right: str, wrong: str) -> Path:
    """The example's stack with this mistake in its driver."""
    name = f"driver_{mistake}"
    code = (EXAMPLE / "driver.py").read_text()
    assert code.count(right) == 1
    (folder / f"{name}.py").write_text(code.replace(right, wrong))
    (folder / "pretend_hardware.py").write_text((EXAMPLE / "pretend_hardware.py").read_text())
    stack = folder / "stack.toml"
    text = (EXAMPLE / "stack.toml").read_text()
    stack.write_text(text.replace('module = "driver"', f'module = "{name}"'))
    return stack
