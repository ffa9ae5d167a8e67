"""A disk that dies in mid-dive, as Linux sees it: its file system aborts and becomes read-only."""

import os
import shutil
import signal
import subprocess
from collections.abc import Generator
from pathlib import Path

import pytest

from services.runtime.config.running import RUNNING
from services.runtime.launch.process_plan import CHECKPOINTS
from tests.support.started import HAS_STICKS, Started
from tools.recordings.recording import open_recording

SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.5,0\n3,0,0,0,0\n600,0,0,0,0\n"


@pytest.fixture
def mortal_disk(tmp_path: Path) -> Generator[Path]:
    """A file system of 64 MB with a journal, which can be aborted."""
    disk, image = tmp_path / "disk", tmp_path / "image"
    disk.mkdir()
    with image.open("wb") as file:
        file.truncate(64 * 2**20)
    for tool, *words in (
        ("mkfs.ext4", "-q", str(image)),
        ("mount", "-o", "loop,errors=remount-ro", str(image), str(disk)),
    ):
        program = shutil.which(tool)
        if program is None or subprocess.run([program, *words], check=False).returncode != 0:
            pytest.skip("mounting a file system of its own is not allowed here")
    yield disk
    umount = shutil.which("umount")
    assert umount is not None
    subprocess.run([umount, "-l", str(disk)], check=True)  # at once, even if it is still in use


@pytest.mark.slow
def test_a_dive_outlives_its_disk_and_the_death_of_control(mortal_disk: Path, tmp_path: Path):
    (tmp_path / "sticks.csv").write_text(SCRIPT)
    (mortal_disk / "theirs").write_bytes(b"theirs")
    out = mortal_disk / "dive"
    words = "dive", "--headless", "--grouped", "--pilot", f"script:{tmp_path}/sticks.csv"
    with Started(out, *words, screen=tmp_path / "screen") as dive:
        dive.until_said(HAS_STICKS, "armed piloted  depth")
        pid = dive.running.pids["control"]
        dive.until((out / CHECKPOINTS / "estimation.json").exists)  # a disk may take seconds for it
        mount = ["mount", "-o", "remount,abort", str(mortal_disk)]
        subprocess.run(mount, check=True)
        with pytest.raises(OSError, match="Read-only"):
            (mortal_disk / "new").touch()
        dive.until_said(f"recording stopped: cannot write {out / 'dive.mcap'}: read-only")
        os.kill(pid, signal.SIGKILL)
        dive.until_said(
            f"cannot write {out / RUNNING}: read-only file system",
            "onboard runs without a log",
            "estimation: goes on with the dive",
            "estimation: its checkpoint cannot be written to the disk",
        )
        assert dive.end() in {1, 3}
    said = dive.said
    assert "\nDive  " in said
    assert (
        f"report.json: read-only file system), but the recording is kept: dive.mcap in {out}"
        in said
    )
    assert (mortal_disk / "theirs").read_bytes() == b"theirs"
    assert sum(1 for _ in open_recording(out).raw()) > 1000
