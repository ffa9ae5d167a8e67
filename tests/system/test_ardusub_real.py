"""The stack as processes, in real time, over UDP on 127.0.0.1, with a board that is a process too.

The board is the double; and ArduSub's own firmware in its simulator, where LINDY_ARDUSUB names its
executable (several are separated by colons).
"""

import json
import os
import socket
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tools.recordings.recording import open_recording
from tools.report import read_dive

DOUBLE = "tools.research.ardusub_double.udp"
FIRMWARE = [path for path in os.environ.get("LINDY_ARDUSUB", "").split(":") if path]
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.8,0\n5,0,0,0,0\n9,0,0,0,0\n"
PATIENCE_S = 120.0  # for a slow and busy computer
# Of the simulator that comes with the firmware: no RC receiver, as on every tethered ROV, and
# sensors without the noise that no water has.
DEFAULTS = """FRAME_CONFIG 2
SIM_RC_FAIL 1
SIM_BARO_RND 0.002
SIM_BAR2_RND 0.002
FS_PILOT_TIMEOUT 1
"""
BOARDS = [
    "4.5",
    "4.8",
    *(FIRMWARE or [pytest.param("", marks=pytest.mark.skip("LINDY_ARDUSUB names no firmware"))]),
]


@contextmanager
def board_process(kind: str, port: int, folder: Path) -> Generator[None]:
    """The double of a version, or a firmware by its path, which calls this port."""
    if kind in ("4.5", "4.8"):
        said = [sys.executable, "-P", "-m", DOUBLE, "--to", str(port), "--version", kind]
    else:
        (folder / "lindy.parm").write_text(DEFAULTS)
        said = [kind, "--model", "vectored_6dof", "-S", "-I0", "--home", "63.4,10.4,0,90"]
        said += ["--defaults", "lindy.parm", "--serial0", f"udpclient:127.0.0.1:{port}"]
    with (folder / "board.log").open("wb") as log:
        process = subprocess.Popen(said, cwd=_root(kind, folder), stdout=log, stderr=log)
        try:
            yield
        finally:
            process.kill()
            process.wait()


def _root(kind: str, folder: Path) -> Path:
    """The firmware writes its memory into the folder that it runs in."""
    return Path(__file__).parents[2] if kind in ("4.5", "4.8") else folder


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.mark.system
@pytest.mark.parametrize("kind", BOARDS)
def test_a_dive_as_processes(tmp_path: Path, kind: str, port: int) -> None:
    script, out = tmp_path / "script.csv", tmp_path / "out"
    script.write_text(SCRIPT)
    command = [sys.executable, "-P", "-m", "tools", "dive", "--stack", "ardusub"]
    command += ["--vehicle", "bluerov2_heavy", "--pilot", f"script:{script}", "--headless"]
    command += ["--set", f"ardusub.url=udpin:127.0.0.1:{port}", "--out", str(out)]
    command += ["--set", "estimation.calibration.still_time=3"]
    with board_process(kind, port, tmp_path):
        said = subprocess.run(
            command, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    assert said.returncode == 0, said.stdout + said.stderr
    report = json.loads((out / "report.json").read_text())
    assert report["exit"] == "clean"
    assert report["services"]["ardusub"]["restarts"] == 0
    assert (read_dive(open_recording(out)).max_depth_m or 0.0) > 0.3
