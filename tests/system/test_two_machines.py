"""Two machines: `lindy up drone` and `lindy up topside` in network namespaces of their own, joined
by a cable (veth) that is pulled and put back; over TLS, each with keys that `lindy keys` made."""

import os
import shutil
import subprocess
import time
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from messages import topics
from tests.support.patience import until
from tests.support.started import Ear, Started
from tools.__main__ import main

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(
        not hasattr(os, "geteuid") or os.geteuid() != 0 or shutil.which("ip") is None,
        reason="network namespaces need root and the command `ip`",
    ),
]

CUT_S = 3.0  # [s] longer than Zenoh's lease of 1 s and every time-to-live
TTL_S = 0.3  # [s] of a pilot command
HANDS = "t,surge,sway,heave,yaw\n0,0,0,0,0\n1,0,0,0.3,0\n120,0,0,0,0\n"


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Cable:
    """Two namespaces of this test's own, with one cable between them."""

    def __init__(self) -> None:
        self.topside, self.drone = (f"lindy-{side}-{os.getpid()}" for side in ("t", "d"))
        self.address = "10.77.0.2"

    def lay(self) -> None:
        for name in (self.topside, self.drone):
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        ends = ("top0", "netns", self.topside), ("dro0", "netns", self.drone)
        ip("link", "add", *ends[0], "type", "veth", "peer", "name", *ends[1])
        for name, end, host in ((self.topside, "top0", "1"), (self.drone, "dro0", "2")):
            ip("-n", name, "addr", "add", f"10.77.0.{host}/24", "dev", end)
            ip("-n", name, "link", "set", end, "up")

    def pull(self) -> None:
        ip("-n", self.topside, "link", "set", "top0", "down")

    def put_back(self) -> None:
        ip("-n", self.topside, "link", "set", "top0", "up")

    def remove(self) -> None:
        for name in (self.topside, self.drone):
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)


@contextmanager
def two_machines(tmp_path: Path, *way: str) -> Generator[tuple[Cable, Ear, Started, Started]]:
    cable, keys = Cable(), ("--keys", str(tmp_path / "keys"))
    endpoint = f"tls/{cable.address}:7447"
    assert main(["keys", "new", *keys]) == 0

    def up(space: str, side: str, *words: str, script: str = "") -> Started:
        inside = ("ip", "netns", "exec", space)
        started = Started(tmp_path / side, "up", side, *words, *keys, script=script, before=inside)
        exits.callback(started.end)
        return started

    with ExitStack() as exits:
        exits.callback(cable.remove)
        cable.lay()
        drone = up(cable.drone, "drone", "--listen", endpoint)
        drone.until(lambda: drone.pid("reference"))
        topside = up(cable.topside, "topside", "--connect", endpoint, *way, script=HANDS)
        topside.until(lambda: topside.pid("gamepad"))
        ear = Ear(drone.running)
        exits.callback(ear.close)
        yield cable, ear, drone, topside


@pytest.mark.slow
@pytest.mark.parametrize("way", [(), ("--gateway", "--link", "perfect")], ids=["plain", "gateway"])
def test_a_cable_that_is_pulled_and_put_back(tmp_path: Path, way: tuple[str, ...]) -> None:
    with two_machines(tmp_path, *way) as (cable, ear, drone, topside):
        statuses, references = ear.heard(topics.STATUS), ear.heard(topics.REFERENCE)

        def failsafe() -> str:
            return statuses[-1].failsafe if statuses else "no word"

        def said() -> str:
            return f"{failsafe()}\ndrone:\n{drone.said}\ntopside:\n{topside.said}"

        def armed() -> bool:
            return bool(statuses) and statuses[-1].activity == "piloted"

        until(armed, said)
        pids = drone.running.pids, topside.running.pids
        until(lambda: bool(references) and references[-1].depth.velocity > 0.1, said)

        ashore = Ear(topside.running, "topside")
        commands = ashore.heard(topics.PILOT_COMMAND)
        time.sleep(CUT_S)  # what is counted is a rate
        usual = len(commands)

        cable.pull()
        until(lambda: failsafe() == "pilot_lost", said)
        # The cut is to outlast the lease, so that the link has to come again. What is topside goes
        # on meanwhile: its hub does not wait for the end of a link that nobody acknowledges.
        commands.clear()
        time.sleep(CUT_S)
        assert len(commands) > 0.5 * usual > 0
        ashore.close()
        assert references[-1].depth.velocity == 0.0, "it came to rest and holds"

        cable.put_back()
        back = time.monotonic()
        until(lambda: failsafe() == "none", said)
        assert time.monotonic() - back <= 2.0

        # The viewer starts last, on a busy computer perhaps only now.
        now = drone.running.pids, topside.running.pids
        same = [before.items() <= after.items() for before, after in zip(pids, now, strict=True)]
        assert same == [True, True], "no process was restarted"
        for reference in references:
            if reference.pilot_ns is not None:
                assert reference.stamp_ns - reference.pilot_ns <= TTL_S * 1e9
