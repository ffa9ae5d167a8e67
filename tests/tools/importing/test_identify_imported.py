"""A dive that went out as tables and came in again is identified as the dive itself."""

from pathlib import Path

import pytest

from services.runtime.config.settings import DEPLOY
from tools.__main__ import main
from tools.identify.command import identify_dive

COMMANDS = """
[[take]]
topic = "control_thrusters"
as = "control/thrusters"
stamp = "publish_ns"
stamp_unit = "ns"
[take.fields]
armed = { from = ["armed"] }
[take.fields.thrust]
from = ["thrust.port", "thrust.starboard", "thrust.lateral", "thrust.vertical"]
unit = "N"
"""


@pytest.mark.slow
def test_it_says_what_the_dive_itself_says(tmp_path: Path) -> None:
    sticks, dive, tables = tmp_path / "sticks.csv", tmp_path / "dive", tmp_path / "tables"
    assert main(["identify", "plan", "--axes", "heave", "--out", str(sticks)]) == 0
    assert main(["simulate", "--pilot", f"script:{sticks}", "--out", str(dive)]) == 0
    assert main(["log", "export", "--as", "parquet", str(dive), "--out", str(tables)]) == 0
    wanted = tmp_path / "own.toml"
    began = "began = 2024-05-01T09:30:00Z\n"  # virtual time begins at 0
    wanted.write_text(began + (DEPLOY / "imports" / "tables.toml").read_text() + COMMANDS)
    named = ("sensor_imu", "sensor_magnetometer", "sensor_pressure", "control_thrusters")
    files = [str(tables / f"{name}.parquet") for name in named]
    options = ("--map", str(wanted), "--vehicle", "pioneer", "--out", str(tmp_path / "again"))
    assert main(["import", *files, *options]) == 0
    before, after = (identify_dive(tmp_path / name, axes=("heave",)) for name in ("dive", "again"))
    assert before.fit.axes == after.fit.axes == ("heave",)
    std = before.fit.covariance.diagonal() ** 0.5
    used = (std > 0.0) & (std < 0.1)  # logarithms of the numbers that this dive tells
    assert used.sum() >= 3
    assert abs(before.fit.x - after.fit.x)[used].max() < 0.02
