"""A sweep that records, on a disk that fills up: no dive is lost, and what is not whole is flown
again."""

import csv
import shutil
import subprocess
from collections.abc import Generator
from pathlib import Path

import pytest

from tools.__main__ import main
from tools.sweep.rows import rows_file

QUICK = "estimation.calibration.still_time=2"  # [s]
STICKS = "t,surge,sway,heave,yaw\n0,0,0,0,0\n0.2,0,0,0.6,0.4\n1.5,0,0,0,0\n8,0,0,0,0\n"


def mounted(disk: Path, options: str) -> bool:
    if (mount := shutil.which("mount")) is None:
        return False
    made = subprocess.run(
        [mount, "-t", "tmpfs", "-o", options, "tmpfs", str(disk)], check=False, capture_output=True
    )
    return made.returncode == 0


@pytest.fixture
def small_disk(tmp_path: Path) -> Generator[Path]:
    """A file system on which one dive fits, and a part of the next."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if not mounted(disk, "size=1700k"):
        pytest.skip("mounting a small file system is not allowed here")
    yield disk
    subprocess.run(["umount", "-l", str(disk)], check=True)  # at once, even if it is still in use


@pytest.mark.slow
def test_a_full_disk_ends_the_sweep_and_with_room_the_rest_is_flown(
    small_disk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    script, out = tmp_path / "sticks.csv", small_disk / "x.csv"
    script.write_text(STICKS)
    words = ["sweep", "--pilot", f"script:{script}", "--set", QUICK, "--seed", "1..3"]
    words += ["--record", "--workers", "1", "--out", str(out)]
    dives = small_disk / "x.csv.dives"

    assert main(words) == 1
    said = capsys.readouterr().err
    assert f"the recording in {dives}/dive-000001 was cut short: the disk is full; 1 of 3" in said
    assert "the same command goes on" in said
    assert said.count("\n") == 1
    assert len(rows_file(out).read_text().splitlines()) >= 2

    assert main(words) == 1  # there is no room even to begin
    said = capsys.readouterr().err
    assert f"cannot write the recording {dives}/dive-000001-2/dive.mcap: the disk is full" in said
    assert "1 of 3 dives are kept" in said
    assert sorted(path.name for path in dives.iterdir()) == ["dive-000000", "dive-000001"]

    assert mounted(small_disk, "remount,size=16m")
    assert main(words) == 0
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["dive"], row["end"]) for row in rows] == [(str(n), "clean") for n in range(3)]
    assert all(row["log_hash"] and "not_recorded" not in row["losses"] for row in rows)
    assert rows[1]["folder"].endswith("dive-000001-2")


@pytest.mark.slow
def test_an_empty_folder_that_was_there_stays(
    small_disk: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    script, out = tmp_path / "sticks.csv", small_disk / "x.csv"
    script.write_text(STICKS)
    mine = small_disk / "x.csv.dives" / "dive-000000"
    mine.mkdir(parents=True)
    (small_disk / "full").write_bytes(bytes(1_400_000))
    words = ["sweep", "--pilot", f"script:{script}", "--set", QUICK, "--workers", "1"]
    assert main([*words, "--record", "--out", str(out)]) == 1
    assert "the disk is full; 0 of 1 dive is kept" in capsys.readouterr().err
    assert mine.is_dir()
