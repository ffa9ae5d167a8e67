"""The topside on a computer without POSIX, as far as Linux can pretend to be one
(tests/support/disguise). What only Windows itself can show is not shown here."""

import json
import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tests.support.patience import PATIENCE_S

ROOT = Path(__file__).parents[1]
DISGUISE = ROOT / "tests" / "support" / "disguise"
QUICK = ["--set", "estimation.calibration.still_time=1"]
ENVIRONMENT = {
    **os.environ,
    "PYTHONPATH": f"{DISGUISE}:{ROOT}",
    # Files have another encoding than UTF-8 where nobody says which: here ASCII.
    "PYTHONUTF8": "0",
    "LC_ALL": "C",
    "LANG": "C",
    "PYTHONCOERCECLOCALE": "0",
}
EVERY_MODULE = """
import importlib, pkgutil, sys
import lindy, messages, services, tools
from services.runtime.os import system
assert system.WINDOWS and system.LOCAL == "ws", "this is no disguise"
for package in (lindy, messages, services, tools):
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)
print(sum(name.partition(".")[0] in ("services", "tools") for name in sys.modules))
"""


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Windows and Linux lock their runtime folders in different ways, and share none: a start of
    the one, of whatever test, takes the other's for left over."""
    with tempfile.TemporaryDirectory(prefix="t-") as place:
        return subprocess.run(
            [sys.executable, *words], cwd=folder, env={**ENVIRONMENT, "TMPDIR": place},
            capture_output=True, text=True, encoding="utf-8", errors="replace",
            timeout=PATIENCE_S, check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip


def lindy(folder: Path, words: str, *more: str) -> str:
    """What it prints."""
    done = run(folder, "-P", "-m", "lindy", *words.split(), *more)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


@pytest.mark.slow
def test_every_module_can_be_imported(tmp_path: Path) -> None:
    done = run(tmp_path, "-c", EVERY_MODULE)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) > 300


@pytest.mark.slow
def test_a_dive_on_virtual_time_needs_no_posix(tmp_path: Path) -> None:
    assert "armed" in lindy(tmp_path, "simulate --no-files --seconds 2", *QUICK)


@pytest.mark.slow
@pytest.mark.system
def test_a_dive_is_flown_and_looked_at(tmp_path: Path) -> None:
    """A minute of words: the dive of real processes, then what reads recordings."""
    lindy(tmp_path, "dive --headless --seconds 2 --out one", *QUICK)
    report = json.loads((tmp_path / "one" / "report.json").read_text(encoding="utf-8"))
    assert report["exit"] == "clean"
    assert all(each["restarts"] == 0 for each in report["services"].values())
    said = lindy(tmp_path, "simulate --seconds 2", *QUICK)
    assert "cannot make" in said  # the link dives/latest
    (flown,) = (tmp_path / "dives").iterdir()
    dive = str(flown.relative_to(tmp_path))
    assert "control" in lindy(tmp_path, f"log info {dive}")
    lindy(tmp_path, f"log export --as csv {dive} --out csv")
    lindy(tmp_path, f"log compare {dive} {dive}")
    lindy(tmp_path, f"review {dive} --out review.html")
    lindy(tmp_path, f"replay {dive} --through control --diff")
    lindy(tmp_path, f"simulate --from {dive} --no-files")
    lindy(tmp_path, "sweep --seed 1..2 --seconds 1 --out two.csv", *QUICK)
    assert len((tmp_path / "two.csv").read_text(encoding="utf-8").splitlines()) == 3


@pytest.mark.slow
@pytest.mark.system
def test_the_topside_flies_a_drone_that_has_posix(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        link = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    up = [sys.executable, "-P", "-m", "lindy", "up", "drone", "--listen", link, "--out", "drone"]
    common = ["--insecure", "--name", "far", *QUICK]
    with subprocess.Popen(
        [*up, *common], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    ) as drone:  # fmt: skip
        try:
            words = f"up topside --connect {link} --out top --pilot script:first_dive --seconds 2"
            lindy(tmp_path, words, *common)
        finally:
            drone.terminate()
        heard, _ = drone.communicate(timeout=PATIENCE_S)
    assert drone.returncode == 0, heard
    report = json.loads((tmp_path / "drone" / "report.json").read_text(encoding="utf-8"))
    assert report["exit"] == "clean"
    assert report["armed_seconds"] > 1


def test_what_needs_posix_is_said_in_a_sentence(tmp_path: Path) -> None:
    done = run(tmp_path, "-P", "-m", "lindy", "up", "drone")
    assert done.returncode == 1
    assert done.stderr == (
        "lindy: `lindy up drone` needs Linux or macOS; this computer can be the topside: "
        "lindy up topside\n"
    )
