"""How late a pilot's commands become while an observer floods the drone's hub, by turns with nobody
flooding. Run it on a quiet computer: `python -m tests.long.floods [SECONDS] [TURNS]`.

A real hub with TLS, a pilot's and an observer's certificates, each in a process of its own. The
observer comes again if its link ends.
"""

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np
import zenoh

from services.runtime.bus.access_control import HubSide
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import namespace
from services.runtime.bus.zenoh_bus import ZenohBus, connected
from services.runtime.hosts.process_host import HubLaunch
from services.runtime.launch.process_plan import PYTHON
from tests.support.patience import PATIENCE_S
from tools.keys.authority import KeyAuthority, own_keys
from tools.keys.credentials import parse

SECONDS, TURNS = 15, 3
PILOT_HZ = 50.0  # [1/s] as commands are sent
WARM_S = 2.0  # [s] before it counts
SPACE, NOW = namespace("pioneer"), datetime.now(UTC)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


class Door:
    """A drone's hub as a process, and a service on board that hears everything."""

    def __init__(self, folder: Path) -> None:
        self.keys = folder / "keys"
        KeyAuthority(self.keys).make(NOW)
        for name in ("drone:pioneer", "pilot:ann", "observer:eve"):
            KeyAuthority(self.keys).add(parse(name), NOW, 10)
        drone = own_keys(self.keys / "drone-pioneer", ("drone",), NOW)[1]
        self.address = f"tls/127.0.0.1:{free_port()}"
        private, self._log = f"unixsock-stream/{folder}/hub.sock", folder / "hub.log"
        launch = HubLaunch(
            listen=[self.address, private],
            hub_side=HubSide("drone", SPACE, drone),
        )
        with self._log.open("wb") as log:
            command = [*PYTHON, "hub", msgspec.json.encode(launch).decode()]
            self.process = subprocess.Popen(command, stderr=log)
        self.heard: list[Envelope] = []
        self.board = connected(private, SPACE, PATIENCE_S)
        self.bus = ZenohBus(self.board)
        self.bus.hear("**", self.heard.append)

    def session(self, folder: str) -> zenoh.Session:
        role = parse(folder.replace("-", ":", 1)).role
        keys = own_keys(self.keys / folder, (role,), NOW)[1].keys
        return connected(self.address, SPACE, PATIENCE_S, keys=keys)

    @property
    def log(self) -> str:
        return self._log.read_text()

    def close(self) -> None:
        self.board.close()
        self.process.terminate()
        self.process.wait()


LONG = "x" * 500  # so that it is a flood on a busy computer, too


def junk(session: zenoh.Session, number: int) -> object:
    for _ in range(200):
        session.put("pilot/command", bytes(60), congestion_control=zenoh.CongestionControl.BLOCK)
    return number


def tokens(session: zenoh.Session, number: int) -> object:
    names = (f"here/topside/{LONG}{number:x}{each:x}" for each in range(50))
    return [session.liveliness().declare_token(name) for name in names]


def subscriptions(session: zenoh.Session, number: int) -> object:
    names = (f"health/{LONG}{number}_{each}" for each in range(50))
    return [session.declare_subscriber(name, lambda _: None) for name in names]


FLOODS = {each.__name__: each for each in (junk, tokens, subscriptions)}


def p99_ms(door: Door, pilot: zenoh.Session, seconds: float) -> float:
    """[ms] From the pilot's program to a service on board."""
    found: list[float] = []

    def hear(envelope: Envelope) -> None:
        if envelope.key == "pilot/request":
            found.append((time.monotonic_ns() - int(envelope.payload)) / 1e6)

    door.bus.hear("pilot/request", hear)
    ends, due = time.monotonic() + seconds, time.monotonic()
    while time.monotonic() < ends:
        pilot.put("pilot/request", str(time.monotonic_ns()).encode())
        due += 1.0 / PILOT_HZ
        time.sleep(max(0.0, due - time.monotonic()))  # a pilot's own clock
    return float(np.percentile(found[round(WARM_S * PILOT_HZ) :], 99))


def beside(door: Door, kind: str, measure: Callable[[], float]) -> float:
    """What is measured while an observer floods so."""
    # Its processor time is that of another computer, and is not to be missed here.
    command = ["nice", "-n", "19", sys.executable, "-m", "tests.long.floods", "flood", kind]
    flood = subprocess.Popen([*command, door.address, str(door.keys)])
    try:
        return measure()
    finally:
        flood.kill()
        flood.wait()


def flood(kind: str, address: str, keys: str) -> None:
    door = Door.__new__(Door)  # its keys and address alone
    door.keys, door.address = Path(keys), address
    kept: list[object] = []
    while True:
        try:
            with door.session("observer-eve") as eve:
                while not eve.is_closed():
                    kept.append(FLOODS[kind](eve, len(kept)))
        except Exception as error:  # its link has ended
            print(error, file=sys.stderr)


def main(seconds: float, turns: int) -> None:
    with TemporaryDirectory() as folder:
        door = Door(Path(folder))
        try:
            with door.session("pilot-ann") as pilot:
                for turn in range(turns):
                    for kind in FLOODS:
                        alone = p99_ms(door, pilot, seconds)
                        flooded = beside(door, kind, lambda: p99_ms(door, pilot, seconds))
                        print(
                            f"turn {turn + 1}: alone {alone:6.2f} ms, beside {kind:13s} "
                            f"{flooded:6.2f} ms, {flooded / alone:5.1f} times",
                            flush=True,
                        )
        finally:
            door.close()


if __name__ == "__main__":
    if sys.argv[1:2] == ["flood"]:
        flood(*sys.argv[2:])
    given = [float(each) for each in sys.argv[1:]]
    main(given[0] if given else SECONDS, round(given[1]) if len(given) > 1 else TURNS)
