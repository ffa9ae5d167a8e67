"""One drone and two topsides as processes: the second one waits, is told who has control, takes it
when it is offered, and its end disarms nothing that the first one flies."""

import re
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.vehicle import VehicleStatus
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import connected
from services.runtime.config.running import RUNNING, Running
from tests.support.doors import free_endpoint
from tests.support.patience import PATIENCE_S, until

pytestmark = pytest.mark.system

QUICK = ("--set", "estimation.calibration.still_time=3")  # [s] less to wait for
REST = "t,surge,sway,heave,yaw\n0,0,0,0,0\n300,0,0,0,0\n"
DIVE = "t,surge,sway,heave,yaw\n0,0,0,1,0\n300,0,0,0,0\n"  # what must not be flown unasked
Process = subprocess.Popen[bytes]


def lindy(log: Path, *words: str) -> Process:
    with log.open("w") as screen:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "tools", *words],
            stdin=subprocess.DEVNULL,
            stdout=screen,
            stderr=subprocess.STDOUT,
        )


@contextmanager
def side(folder: Path, *words: str) -> Generator[Process]:
    process = lindy(
        folder.with_suffix(".txt"), "up", *words, "--grouped", *QUICK, "--out", str(folder)
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait(PATIENCE_S)


def asked(folder: Path, *words: str) -> str:
    """What `lindy ask` says in the name of the pilot of this folder."""
    command = [sys.executable, "-P", "-m", "tools", "ask", *words, "--dive", str(folder)]
    done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=PATIENCE_S)
    return (done.stdout + done.stderr).strip()


class Statuses:
    """An ear on the drone's own hub."""

    def __init__(self, folder: Path) -> None:
        running = msgspec.json.decode((folder / RUNNING).read_bytes(), type=Running)
        self.all: list[VehicleStatus] = []
        self._session = connected(running.endpoints["drone"], namespace(running.vehicle))
        decoder = msgspec.msgpack.Decoder(VehicleStatus)
        self._ear = self._session.declare_subscriber(
            topics.STATUS.key, lambda s: self.all.append(decoder.decode(s.payload.to_bytes()))
        )

    def close(self) -> None:
        self._session.close()  # type: ignore[no-untyped-call]

    def until(self, pilot: str, *, armed: bool) -> None:
        until(lambda: self._is(pilot, armed), lambda: self.all[-1:])

    def _is(self, pilot: str, armed: bool) -> bool:
        return bool(self.all) and (self.all[-1].pilot, self.all[-1].armed) == (pilot, armed)


@pytest.mark.slow
def test_of_two_topsides_exactly_one_flies(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    drone, ann, bob = (tmp_path / name for name in ("drone", "ann", "bob"))
    for folder, script in ((ann, REST), (bob, DIVE)):
        folder.with_suffix(".csv").write_text(script)

    def topside(folder: Path) -> tuple[str, ...]:
        pilot = ("--pilot", f"script:{folder}.csv", "--set", f"gamepad.pilot={folder.name}")
        return "topside", "--connect", endpoint, *pilot

    with ExitStack() as sides:
        sides.enter_context(side(drone, "drone", "--listen", endpoint))
        until(lambda: (drone / RUNNING).is_file(), drone.with_suffix(".txt").read_text)
        heard = Statuses(drone)
        sides.callback(heard.close)
        sides.enter_context(side(ann, *topside(ann)))
        heard.until("ann", armed=True)
        second = sides.enter_context(side(bob, *topside(bob)))
        said = bob.with_suffix(".txt")
        until(lambda: "ann has control; waiting" in said.read_text(), said.read_text)

        reason = asked(bob, "take")
        assert re.search(
            r"refuses \(take\): ann has control since \d+ s; ask for an offer, or take by force",
            reason,
        ), reason
        assert "refuses (disarm): ann has control since" in asked(bob, "disarm")
        second.send_signal(signal.SIGINT)
        second.wait(PATIENCE_S)
        begin = len(heard.all)
        until(lambda: len(heard.all) > begin + 5, lambda: heard.all[-1:])
        assert {(s.pilot, s.armed) for s in heard.all[begin:]} == {("ann", True)}

        again = tmp_path / "bob2"
        again.with_suffix(".csv").write_text(DIVE)
        third = sides.enter_context(side(again, *topside(again)))
        said = again.with_suffix(".txt")
        until(lambda: "ann has control; waiting" in said.read_text(), said.read_text)
        assert asked(ann, "offer", "--to", "bob2").endswith(": offer: accepted")
        assert asked(again, "take").endswith(": take: accepted")
        heard.until("bob2", armed=True)
        assert "refuses (light): bob2 has control" in asked(ann, "light", "--value", "1")
        assert asked(again, "light", "--value", "1").endswith(": light: accepted")
        assert asked(ann, "take", "--force").endswith(": take: accepted")
        heard.until("ann", armed=True)
        assert asked(again, "take", "--force").endswith(": take: accepted")
        heard.until("bob2", armed=True)
        third.send_signal(signal.SIGINT)  # it has control: its end disarms and gives control up
        third.wait(PATIENCE_S)
        heard.until("", armed=False)
        epochs = [s.epoch for s in heard.all]
        assert epochs == sorted(epochs)
