"""A dive on virtual time to which everything can happen that happens to processes, hubs, the link
and the parts of a vehicle.

The services are virtual processes of the real `Supervisor`: what it does about one that has ended
or hangs is what it does on a real computer. What virtual time cannot know is how long a process
takes to start; that was measured in real dives.
"""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from messages import topics
from messages.identity import SideIdentity
from messages.link import LinkRequest
from messages.pilot import PilotCommand, PilotRequest
from messages.simulator import FaultKind, FaultRequest
from services.runtime.bus.envelope import Envelope
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry, wire_of
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.launch.child import Task
from services.runtime.launch.supervisor import HangDetector, Supervisor
from services.runtime.node.loop_stats import Instance
from services.runtime.node.node import Node
from tests.support.faults.catalogue import VERTICAL, FlownMode
from tests.support.faults.figures import Observed
from tests.support.hindered_host import HinderedHost, Hindrance, take_name

SECOND = 1_000_000_000  # [ns]
STEP_NS = 40_000_000  # [ns] between two steps of the supervisor, at most as in a real dive
WATCH_NS = 100_000_000  # [ns] between two looks at who answers
START_NS = 350_000_000  # [ns] from a start to the first message of a service, measured
CARRY_STOP = ("hub_drone", "hub_topside", "tether", "gamepad")  # as `ProcessPlan.carries_stop`
LONGEST_START_S = 60.0  # [s] until the drone is armed
SERVICES = (
    "simulator", "estimation", "reference", "control", "tether", "gamepad", "link_monitor",
)  # fmt: skip
HUBS = {"hub_drone": "drone", "hub_topside": "topside"}
SETTINGS = [
    "estimation.calibration.still_time=3",
    "simulator.floor_depth=60",
    "reference.failsafe.pilot_patience=8",  # [s] so that an ascent without a pilot is seen
]
FIRST_PID = 1000


class VirtualProcess:
    """A child of the supervisor: a service, or a hub."""

    pid = 0
    unlogged = ""

    def __init__(self, end: Callable[[], None]) -> None:
        self._end = end
        self._status: int | None = None

    def ended(self) -> int | None:
        return self._status

    def last_line(self) -> str:
        return ""

    def terminate(self) -> None:
        self.end(0)

    def kill(self) -> None:
        self.end(-9)

    def end(self, status: int) -> None:
        if self._status is None:
            self._status = status
            self._end()


class VirtualDive:
    """Armed and settled in a mode when the constructor returns."""

    def __init__(self, mode: FlownMode, seed: int = 0, settings: Sequence[str] = ()) -> None:
        """
        Args:
            settings: more than those of every such dive.

        Raises:
            RuntimeError: the drone does not arm.
        """
        self.seen, self._vertical, self._asked = Observed(), mode.vertical, 0
        self.hindrances = {
            name: Hindrance(lambda: self.host.now, seed + n) for n, name in enumerate(SERVICES)
        }
        self.host = HinderedHost(lateness=self.hindrances)
        self._rows = Registry.read()
        self._later: list[tuple[int, str]] = []  # (when [ns], service) of starts under way
        self._processes: dict[str, VirtualProcess] = {}
        self._stopped: dict[str, int] = {}  # [ns] last sign of life of those that are stopped
        self._watched_ns = 0
        self._instances = 0  # processes that have begun
        self._answering = HangDetector()
        self._supervisor = Supervisor(self._tell, self._spawn, lambda: self.host.now)
        self._folder = tempfile.TemporaryDirectory(prefix="lindy-faults-")
        script = Path(self._folder.name) / "sticks.csv"
        script.write_text(mode.script)
        self._stack = Stack(
            pilot=f"script:{script}", out=self._folder.name, vehicle=mode.vehicle, seed=seed,
            overrides=[
                *SETTINGS, f"reference.failsafe.depth_limit={mode.depth_limit}", *settings
            ],
        )  # fmt: skip
        self._begin(mode)

    def close(self) -> None:
        """Remove its script, which a gamepad reads again when it starts again."""
        self._folder.cleanup()

    def _begin(self, mode: FlownMode) -> None:
        names = (*HUBS, *SERVICES)
        self._supervisor.add(Task(name, [], Path()) for name in names)
        self._supervisor.step()
        ears, board = self.host.node("screen", ["topside"]), self.host.node("observer", ["drone"])
        self.seen.listen(ears, board)
        self._wishes = ears.request(
            topics.PILOT_REQUEST, topics.PILOT_ANSWER, on_answer=lambda _q, _a, _n: None
        )
        self._links = ears.publisher(topics.LINK_REQUEST)
        self._breaks = board.publisher(topics.FAULT_REQUEST)
        while not self.seen.armed:
            if self.host.now > LONGEST_START_S * SECOND:
                raise RuntimeError(f"the drone is not armed after {LONGEST_START_S:.0f} s")
            self.run(0.1)
        self.run(mode.settled)

    @property
    def restarts(self) -> dict[str, int]:
        """How often each process was started again."""
        return self._supervisor.restarts

    # Time.

    @property
    def now(self) -> int:
        """[ns]"""
        return self.host.now

    def run(self, seconds: float) -> None:
        end = self.host.now + round(seconds * SECOND)
        while self.host.now < end:
            next_start = min((at for at, _ in self._later), default=end)
            self.host.run(min(end, self.host.now + STEP_NS, max(next_start, self.host.now)))
            self._start_what_is_due()
            self._supervisor.step()
            self._watch()

    def _watch(self) -> None:
        """As `LocalStack` does it."""
        now = self.host.now
        if now - self._watched_ns < WATCH_NS:
            return
        self._watched_ns = now
        beats = {name: self._stopped.get(name, now) for name in self._processes}
        for name, what in self._answering.look(beats, self._supervisor.lives, now, self._stuck):
            if what == "silent":
                self._tell("error", f"{name} does not answer any more")
            elif what == "again":
                self._tell("warning", f"{name} answers again")
            else:
                self._supervisor.kill(name)

    def _stuck(self, name: str) -> bool:
        return name in self._stopped and name in CARRY_STOP

    def _tell(self, _level: str, text: str) -> None:
        self.seen.tell(self.host.now, f"supervisor: {text}")

    # What the pilot's side asks, as `lindy ask`, `fault` and `link` do.

    def ask(self, **wish: Any) -> None:
        epoch = 0 if self.seen.shown is None else self.seen.shown.epoch
        request = PilotRequest(stamp_ns=self.now, id="", source="voice", epoch=epoch, **wish)
        self._wishes.ask(request, self.now)

    def part(self, part: str, fault: FaultKind, value: float | None = None) -> None:
        """Break a part of the vehicle, or mend it with `none`."""
        part = self._vertical if part == VERTICAL else part
        self._breaks.put(
            FaultRequest(stamp_ns=self.now, id=self._name(), part=part, fault=fault, value=value)
        )

    def link(self, request: LinkRequest) -> None:
        """Change the link."""
        self._links.put(msgspec.structs.replace(request, stamp_ns=self.now, id=self._name()))

    def _name(self) -> str:
        self._asked += 1
        return f"fault-{self._asked}"

    # Processes.

    def _spawn(self, task: Task) -> VirtualProcess:
        name = task.name
        self._stopped.pop(name, None)
        takes = START_NS if self._supervisor.lives[name].restarts else 0
        self._later.append((self.host.now + takes, name))
        process = self._processes[name] = VirtualProcess(lambda: self._drop(name))
        if not takes:
            self._start_what_is_due()
        return process

    def _start_what_is_due(self) -> None:
        due = [name for at, name in self._later if at <= self.host.now]
        self._later = [(at, name) for at, name in self._later if at > self.host.now]
        for name in due:
            if name in HUBS:
                self.host.hub(HUBS[name]).go_on()
            else:
                self.hindrances[name].go_on()
                self._add(name, self._rows[name])
            self._supervisor.seen(name)

    def _add(self, name: str, spec: ServiceSpec) -> None:
        """Every process is known by a number of its own, as on a real computer."""
        self._instances += 1
        instance = Instance(self._instances, FIRST_PID + self._instances)

        def wire(node: Node, stack: Stack) -> None:
            node.instance = instance
            if spec.service is not None:
                take_name(node, spec.service)
            wire_of(spec.service or name)(node, stack)

        self.host.add(name, spec, self._stack, wire)

    def _drop(self, name: str) -> None:
        """The process has ended; its last messages are out."""
        self._later = [(at, other) for at, other in self._later if other != name]
        self._stopped.pop(name, None)
        if name in HUBS:
            self.host.hub(HUBS[name]).stop(keeps=False)
        elif name in self.host.nodes:
            self.host.kill(name)

    def kill(self, name: str) -> None:
        """As kill -9 does."""
        self._processes[name].kill()

    def fail(self, name: str) -> None:
        """As an exception in a handler does."""
        self._processes[name].end(1)

    def stop(self, name: str) -> None:
        """As SIGSTOP does."""
        self._stopped[name] = self.host.now
        if name in HUBS:
            self.host.hub(HUBS[name]).stop(keeps=True)
        else:
            self.hindrances[name].stop()

    def go_on(self, name: str) -> None:
        """As SIGCONT does, unless the process was ended meanwhile."""
        if self._stopped.pop(name, None) is None:
            return
        if name in HUBS:
            self.host.hub(HUBS[name]).go_on()
        else:
            self.hindrances[name].go_on()

    # Strangers.

    def second(self, service: str) -> None:
        """The same service once more, on the same side."""
        name, row = f"{service}_2", self._rows[service]
        spec = ServiceSpec(sides=row.sides, service=service)
        self._add(name, spec)

    def leave(self, name: str) -> None:
        """A stranger, or a second service, goes."""
        if name in self.host.nodes:
            self.host.kill(name)

    def junk(self, side: str, hz: float) -> None:
        """Somebody publishes nonsense on every key."""
        port = self.host.side(side)

        def spit(_: int) -> None:
            for topic in topics.ALL:
                key = topic.key.replace("*", "stranger")
                port.forward(Envelope(key, b"\xc1junk", topic.encoding))
                port.forward(Envelope(key, b"\x81\xa6source\xa1\xff", topic.encoding))

        self.host.node("junk", [side]).every(hz, spit)

    def other_lindy(self) -> None:
        """The drone runs another version, which says so besides the one that flies."""
        node = self.host.node("other", ["drone"])
        identities = node.publisher(topics.IDENTITY.of("drone"))
        identity = SideIdentity(side="drone", instance=1, version="0.0.1", vehicle="pioneer")

        def introduce(now: int) -> None:
            identities.put(msgspec.structs.replace(identity, stamp_ns=now))

        node.every(1.0, introduce)

    def sticks(self, **sticks: float) -> None:
        """The pilot's own process goes on with these sticks; `hush` the script's first."""
        shown = self.seen.shown
        assert shown is not None
        node = self.host.node("sticks", ["topside"])
        commands = node.publisher(topics.PILOT_COMMAND)
        held = {"surge": 0.0, "sway": 0.0, "heave": 0.0, "yaw": 0.0, **sticks}
        held |= {"epoch": shown.epoch}

        def speak(now: int) -> None:
            commands.put(PilotCommand(stamp_ns=now, source=shown.pilot, **held))  # type: ignore[arg-type]

        node.every(topics.PILOT_COMMAND.hz, speak)

    def stranger(self, **more: object) -> None:
        """Somebody topside who has no control moves full sticks and asks for everything."""
        node = self.host.node("stranger", ["topside"])
        commands = node.publisher(topics.PILOT_COMMAND)
        requests = node.publisher(topics.PILOT_REQUEST)

        def speak(now: int) -> None:
            words = {"surge": -1.0, "sway": 1.0, "heave": 1.0, "yaw": 1.0, "source": "stranger"}
            commands.put(PilotCommand(stamp_ns=now, **{**words, **more}))  # type: ignore[arg-type]

        def ask(now: int) -> None:
            for kind in ("disarm", "goto", "mode"):
                requests.put(
                    PilotRequest(
                        stamp_ns=now, id=f"stranger-{kind}-{now}", kind=kind, source="stranger",
                        depth=9.0 if kind == "goto" else None,
                        flight_mode="manual" if kind == "mode" else None,
                    )
                )  # fmt: skip

        node.every(topics.PILOT_COMMAND.hz, speak)
        node.every(2.0, ask)
