"""`lindy fly` changes the drone: real processes topside; the drones' own `reference` and clock, in
this process, behind hubs of their own on a router."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgspec
import pytest

from messages import topics
from messages.fly import DroneList, ReachableDrone
from messages.pilot import PilotCommand, PilotRequest
from services.link_monitor.service import wire as wire_monitor
from services.reference.service import wire as wire_reference
from services.runtime.bus.access_control import HubSide
from services.runtime.bus.envelope import Envelope
from services.runtime.bus.spaces import here_key, namespace
from services.runtime.bus.zenoh_bus import ZenohBus, announce_here, connected, listening, open_bus
from services.runtime.config.running import RUNNING, Running, running_in
from services.runtime.config.settings import DEPLOY
from services.runtime.config.stack import Stack
from services.runtime.hosts.process_host import HubLaunch
from services.runtime.node.checkpoint import VolatileCheckpoint
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.loop_stats import Instance
from services.runtime.node.node import Node
from tests.support.patience import PATIENCE_S, until
from tests.system.test_fleet import free_endpoint

pytestmark = pytest.mark.system

LINDY = [sys.executable, "-P", "-m", "tools"]


class Drone:
    """Grants control and says its status; it has no thrusters, so it never arms."""

    def __init__(self, folder: Path, router: str, name: str, number: int, exits: ExitStack) -> None:
        space, private = namespace(name), f"unixsock-stream/{folder}/{name}.sock"
        hub = listening(private, connect=[router], hub_side=HubSide("drone", space))
        exits.enter_context(hub)
        self._here = announce_here(hub, here_key(space, "drone", f"{number:x}"))
        bus = ZenohBus(exits.enter_context(connected(private, space, PATIENCE_S)))
        self.commands: list[tuple[float, PilotCommand]] = []  # [s] when each arrived
        self.requests: list[PilotRequest] = []
        bus.hear(topics.PILOT_COMMAND.key, self._command)
        bus.hear(topics.PILOT_REQUEST.key, self._request)
        self.nodes = [self._node("reference", bus), self._node("link_monitor_drone", bus)]
        wire_reference(self.nodes[0], Stack(name=name))
        wire_monitor(self.nodes[1], Stack(name=name, apart=True))

    @property
    def kinds(self) -> list[str]:
        """What pilots have asked for, once each."""
        return list({request.id: request.kind for request in self.requests}.values())

    def heard_lately(self) -> bool:
        return bool(self.commands) and time.monotonic() - self.commands[-1][0] < 0.3

    def _command(self, envelope: Envelope) -> None:
        command = msgspec.msgpack.decode(envelope.payload, type=PilotCommand)
        self.commands.append((time.monotonic(), command))

    def _request(self, envelope: Envelope) -> None:
        self.requests.append(msgspec.msgpack.decode(envelope.payload, type=PilotRequest))

    @staticmethod
    def _node(name: str, bus: ZenohBus) -> Node:
        offset = ClockOffset("drone")
        sides = {"drone": bus}
        node = Node(name, sides, time.monotonic_ns, VolatileCheckpoint(), clock_offset=offset)
        node.instance = Instance(1 + hash(name) % 1000, os.getpid())
        return node


class World:
    """A router with two drones on it, whose services run on a thread, and a pilot's program."""

    def __init__(self, folder: Path, exits: ExitStack) -> None:
        self.folder, self.router = folder, free_endpoint()
        self._router = self._start_router()
        exits.callback(lambda: self.kill_router())
        self.a = Drone(folder, self.router, "a", 1, exits)
        self.b = Drone(folder, self.router, "b", 2, exits)
        self._over = threading.Event()
        thread = threading.Thread(target=self._run)
        thread.start()
        exits.callback(thread.join)
        exits.callback(self._over.set)
        self.vehicle = folder / "pioneer.toml"
        self.vehicle.write_bytes((DEPLOY / "vehicles" / "pioneer.toml").read_bytes())
        words = ["fly", "a", "--router", self.router, "--grouped", "--pilot", "gamepad"]
        words += ["--vehicle", str(self.vehicle), "--out", str(folder / "out")]
        self._screen = folder / "screen.txt"
        with self._screen.open("w") as screen:
            self.program = subprocess.Popen(
                [*LINDY, *words], stdin=subprocess.DEVNULL, stdout=screen, stderr=screen
            )
        exits.callback(self._end)

    @property
    def said(self) -> str:
        return self._screen.read_text()

    def until(self, happened: Callable[[], bool]) -> None:
        until(happened, lambda: self.said, self._require_running)

    def _require_running(self) -> None:
        assert self.program.poll() is None, self.said

    def ask(self, drone: str, dive: str = "out") -> subprocess.CompletedProcess[str]:
        command = [*LINDY, "ask", "fly", drone, "--dive", str(self.folder / dive)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    @contextmanager
    def lists(self) -> Generator[Callable[[], tuple[ReachableDrone, ...]]]:
        """The drones on the newest list that the pilot's program has made."""
        running = msgspec.json.decode((self.folder / "out" / RUNNING).read_bytes(), type=Running)
        lists = [DroneList(stamp_ns=0, flown="", drones=())]
        with open_bus(running.endpoints["topside"], running.vehicle) as bus:
            decoder = msgspec.msgpack.Decoder(DroneList)
            bus.hear(topics.FLY_DRONES.key, lambda e: lists.append(decoder.decode(e.payload)))
            yield lambda: lists[-1].drones

    def _start_router(self) -> subprocess.Popen[bytes]:
        launch = HubLaunch(listen=[self.router], parent=os.getpid())
        text = msgspec.json.encode(launch).decode()
        return subprocess.Popen([sys.executable, "-P", "-m", "services", "hub", text])

    def kill_router(self) -> None:
        self._router.kill()
        self._router.wait(PATIENCE_S)

    def start_router_again(self) -> None:
        self._router = self._start_router()

    def processes(self) -> set[int]:
        """Every process that the pilot's program has started."""
        own = Path(f"/proc/{self.program.pid}/task").glob("*/children")
        return {int(pid) for file in own for pid in file.read_text().split()}

    def _run(self) -> None:
        nodes = [*self.a.nodes, *self.b.nodes]
        while not self._over.is_set():
            for node in nodes:
                node.step()
            time.sleep(0.005)  # Zenoh's threads bring the messages

    def _end(self) -> None:
        if self.program.poll() is None:
            self.program.kill()
            self.program.wait(PATIENCE_S)


@pytest.fixture
def world(tmp_path: Path) -> Generator[World]:
    with ExitStack() as exits:
        yield World(tmp_path, exits)


def exists(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.slow
def test_a_pilot_leaves_a_drone_and_takes_another(world: World) -> None:
    a, b = world.a, world.b
    world.until(lambda: "lease" in a.kinds and a.heard_lately())
    # What cannot be done leaves the flight as it is.
    for drone, why in (
        ("a", "a is flown already"),
        ("nobody", "no drone is called nobody; there are a, b"),
        ("no/body", "letters without accents"),
    ):
        refused = world.ask(drone)
        assert refused.returncode == 1
        assert why in refused.stderr
        assert refused.stderr.count("\n") == 1
    kept = world.vehicle.read_bytes()
    world.vehicle.write_text("[vehicle]\nmass = \n")
    refused = world.ask("b")
    assert refused.returncode == 1
    assert "still the topside of a: " in refused.stderr
    assert "not valid TOML" in refused.stderr
    world.vehicle.write_text(re.sub(r"(?m)^mass = .*", "mass = 14.7", kept.decode()))
    refused = world.ask("b")
    assert refused.returncode == 1
    assert "still the topside of a: b cannot be flown from here: " in refused.stderr
    assert "another vehicle than the topside" in refused.stderr
    world.vehicle.write_bytes(kept)
    assert a.heard_lately()
    assert a.kinds == ["lease"]
    assert (b.commands, b.requests) == ([], [])
    # What can be done.
    changed = world.ask("b")
    assert changed.returncode == 0, changed.stderr
    assert changed.stdout.startswith("this is the topside of b now, in ")
    assert changed.stdout.endswith("; a is left, disarmed, nobody flies it\n")
    world.until(lambda: "lease" in b.kinds and b.heard_lately())
    assert a.kinds == ["lease", "release"]
    assert not a.heard_lately()
    assert a.commands[-1][0] < b.commands[0][0]
    world.until(lambda: b.commands[-1][1].epoch > 0)
    last = b.commands[-1][1]
    assert (last.surge, last.sway, last.heave, last.yaw) == (0.0, 0.0, 0.0, 0.0)
    (running,) = filter(running_in, world.folder.glob("out*"))
    assert running.name.startswith("out-")
    # … and back, asked at the folder that was given at the start.
    assert world.ask("a").returncode == 0
    world.until(lambda: a.kinds == ["lease", "release", "lease"] and a.heard_lately())
    assert b.kinds == ["lease", "release"]
    world.program.send_signal(signal.SIGINT)
    assert world.program.wait(PATIENCE_S) == 0, world.said
    assert world.said.count("topside of a, ended") == 2
    assert world.said.count("topside of b, ended") == 1
    assert len(list(world.folder.glob("out*/dive.mcap"))) == 3
    assert not list(world.folder.glob("out*/" + RUNNING))
    assert "Traceback" not in world.said


@pytest.mark.slow
def test_a_topside_outlives_its_router(world: World) -> None:
    a, b = world.a, world.b
    world.until(lambda: "lease" in a.kinds and a.heard_lately())
    with world.lists() as newest:
        world.until(lambda: {each.name for each in newest() if each.activity} == {"a", "b"})
        world.kill_router()
        world.until(lambda: any("not heard for" in each.alarms for each in newest()))
        world.start_router_again()
        world.until(a.heard_lately)
        world.until(lambda: not any("not heard for" in each.alarms for each in newest()))
    changed = world.ask("b")
    assert changed.returncode == 0, changed.stderr
    world.until(b.heard_lately)
    world.program.send_signal(signal.SIGINT)
    assert world.program.wait(PATIENCE_S) == 0, world.said
    assert "error in Lindy itself" not in world.said


@pytest.mark.slow
def test_nothing_that_was_kept_ready_outlives_a_program_that_is_killed(world: World) -> None:
    world.until(lambda: world.a.heard_lately())

    def running() -> set[int]:
        text = (world.folder / "out" / RUNNING).read_bytes()
        return {*msgspec.json.decode(text, type=Running).pids.values()}

    world.until(lambda: len(world.processes() - running()) >= 4)
    started = world.processes()
    world.program.kill()
    world.program.wait(PATIENCE_S)
    until(lambda: not any(map(exists, started)))
