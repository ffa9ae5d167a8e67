"""A disk that dies in mid-dive, as Linux sees it: its file system aborts and becomes read-only."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import suppress
from pathlib import Path

import msgspec
import pytest

from services.runtime.config.running import RUNNING, Running
from services.runtime.launch.process_plan import CHECKPOINTS
from tests.support.patience import PATIENCE_S, until
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
    out, screen = mortal_disk / "dive", tmp_path / "screen"
    with screen.open("wb") as terminal:
        dive = subprocess.Popen(
            [sys.executable, "-P", "-m", "tools", "dive", "--headless", "--grouped", "--out",
             str(out), "--pilot", "script:sticks.csv", "--set",
             "estimation.calibration.still_time=3"],
            cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
            stdin=subprocess.DEVNULL, stdout=terminal, stderr=subprocess.STDOUT,
        )  # fmt: skip

    def wait_for(*said: str) -> None:
        def alive() -> None:
            assert dive.poll() is None, screen.read_text()

        until(lambda: all(words in screen.read_text() for words in said), screen.read_text, alive)

    try:
        wait_for("has the sticks", "armed piloted  depth")
        running = msgspec.json.decode((out / RUNNING).read_bytes(), type=Running)
        kept = out / CHECKPOINTS / "estimation.json"
        until(kept.exists, screen.read_text)  # a disk may take seconds for it
        mount = shutil.which("mount")
        assert mount is not None
        subprocess.run([mount, "-o", "remount,abort", str(mortal_disk)], check=True)
        with pytest.raises(OSError, match="Read-only"):
            (mortal_disk / "new").touch()
        wait_for(f"recording stopped: cannot write {out / 'dive.mcap'}: read-only file system")
        os.kill(running.pids["control"], signal.SIGKILL)
        wait_for(
            f"cannot write {out / RUNNING}: read-only file system",
            "onboard runs without a log",
            "estimation: goes on with the dive",
            "estimation: its checkpoint cannot be written to the disk",
        )
        dive.send_signal(signal.SIGINT)
        assert dive.wait(PATIENCE_S) in {1, 3}
    finally:
        with suppress(ProcessLookupError):
            dive.kill()
        dive.wait()
    said = screen.read_text()
    assert "\nDive  " in said
    assert (
        f"report.json: read-only file system), but the recording is kept: dive.mcap in {out}"
        in said
    )
    assert (mortal_disk / "theirs").read_bytes() == b"theirs"
    assert sum(1 for _ in open_recording(out).raw()) > 1000
