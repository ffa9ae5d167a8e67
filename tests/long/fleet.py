"""Two drones, a pilot and a router as processes: found, flown, cut off and flown again. Half a
minute: `pytest tests/long/fleet.py`."""

import json
import re
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.support.patience import PATIENCE_S, until

pytestmark = pytest.mark.system

QUICK = ("--grouped", "--set", "estimation.calibration.still_time=3")
SCRIPT = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.5,0\n300,0,0,0,0\n"
LINDY = (sys.executable, "-P", "-m", "tools")


class Program:
    """A verb as a user starts it."""

    def __init__(self, log: Path, exits: ExitStack, *words: str) -> None:
        self._log = log
        with log.open("w") as screen:
            self.process = subprocess.Popen(
                [*LINDY, *words], stdin=subprocess.DEVNULL, stdout=screen, stderr=subprocess.STDOUT
            )
        exits.callback(self.end)

    @property
    def said(self) -> str:
        return self._log.read_text()

    def end(self, how: signal.Signals = signal.SIGTERM) -> int:
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.process.wait(PATIENCE_S)


def once(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*LINDY, *words], check=False, capture_output=True, text=True, timeout=PATIENCE_S
    )


def test_a_fleet_is_found_flown_cut_off_and_flown_again(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        router = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    script = tmp_path / "script.csv"
    script.write_text(SCRIPT)

    def there() -> dict[str, dict[str, Any]]:
        listed = once("drones", "--router", router, "--json")
        answer: dict[str, list[dict[str, Any]]] = json.loads(listed.stdout or "{}")
        return {row["name"]: row for row in answer.get("drones", []) if row["speaks"]}

    def side(name: str, exits: ExitStack, *words: str) -> Program:
        out = str(tmp_path / name)
        log = tmp_path / f"{name}.txt"
        return Program(log, exits, *words, "--router", router, *QUICK, "--out", out)

    with ExitStack() as exits:
        first = side("rov1", exits, "up", "drone", "--name", "rov1")  # before there is a router
        until(lambda: "no router answers" in first.said, lambda: first.said)
        hub = Program(tmp_path / "hub.txt", exits, "hub", router)
        second = side("rov2", exits, "up", "drone", "--name", "rov2")
        until(lambda: {*there()} == {"rov1", "rov2"}, there)

        double = once("up", "drone", "--router", router, "--name", "rov1", "--out", str(tmp_path))
        assert double.returncode == 1
        assert "a drone called rov1 is on the network" in double.stderr
        flies = ("--pilot", f"script:{script}")
        unnamed = once("up", "topside", "--router", router, *flies, "--out", str(tmp_path))
        assert "2 drones can be reached" in unnamed.stderr

        pilot = side("ann", exits, "fly", "rov1", *flies)
        until(lambda: there().get("rov1", {}).get("armed") is True, lambda: pilot.said)
        assert there()["rov2"]["pilot"] == ""

        hub.end(signal.SIGKILL)
        until(lambda: "link lost: nothing arrives from topside" in first.said, lambda: first.said)
        Program(tmp_path / "hub2.txt", exits, "hub", router)
        until(lambda: "the link is back to normal" in first.said, lambda: first.said)
        until(lambda: there().get("rov1", {}).get("activity") == "piloted", there)
        assert there()["rov2"]["armed"] is False
        assert pilot.end(signal.SIGINT) == 0, pilot.said
        until(lambda: there()["rov1"]["pilot"] == "", there)

        other = side("bob", exits, "fly", "rov2", *flies)
        until(lambda: there().get("rov2", {}).get("armed") is True, lambda: other.said)
        assert there()["rov1"]["armed"] is False
        assert other.end(signal.SIGINT) == 0, other.said
        for drone in (first, second):
            assert drone.end() in (0, 3), drone.said  # 3: a busy computer lost some of a recording
        assert re.search(r"failsafe +1 × pilot lost", first.said), first.said
        assert "failsafe" not in second.said
