"""Services of a stack on virtual time, a pilot's script, and whoever listens; and a dive that can
be interfered with: parts break, ballast drops, modes change."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any, Self
from weakref import finalize

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.message import Message
from messages.pilot import FlightMode, PilotAnswer, PilotCommand, PilotRequest, RequestKind
from messages.simulator import FaultAnswer, FaultKind, FaultRequest
from messages.topic import M, Side, Topic
from messages.vehicle import VehicleStatus
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import Skew, VirtualHost
from services.runtime.node.node import Node
from tests.support.hindered_host import HinderedHost, Lateness

SECOND = 1_000_000_000  # [ns]
ON_BOARD = ("simulator", "estimation", "reference", "control")
CHAIN = (*ON_BOARD, "tether", "gamepad")
LONGEST_START_S = 60.0  # [s] until the drone is armed
DEEP = "simulator.floor_depth=60"  # [m] nothing to bump into
Wire = Callable[[Node, Stack], None]


class Dive:
    """Begins with the first `run`. Its statuses are heard on board."""

    def __init__(
        self,
        script: str = "",
        services: Sequence[str] = CHAIN,
        *,
        stack: str = "simulated",
        still_s: float = 3.0,
        overrides: Sequence[str] = (),
        wires: Mapping[str, Wire | None] | None = None,
        lateness: Mapping[str, Lateness] | None = None,
        clocks: Mapping[str, Skew] | None = None,
        **choices: Any,
    ) -> None:
        """
        Args:
            script: of the pilot, t,surge,sway,heave,yaw where its first line does not say what.
            still_s: [s] how long it calibrates; ten where nobody says so.
            wires: of services by name, in the place of their own.
            lateness: of services by name.
            clocks: of sides that are machines of their own.
            choices: of the stack.
        """
        self.folder = Path(mkdtemp(prefix="lindy-dive-"))
        finalize(self, rmtree, self.folder, ignore_errors=True)
        if script:
            path = self.folder / "script.csv"
            head = "" if script.startswith("t,") else "t,surge,sway,heave,yaw\n"
            path.write_text(head + script)
            choices["pilot"] = f"script:{path}"
        quick = f"estimation.calibration.still_time={still_s:g}"
        self.rows = Registry.read(stack)
        if clocks:
            self.rows = self.rows.only({name: self.rows[name] for name in services}).apart()
        self.stack = Stack(
            out=str(self.folder), services=stack, overrides=[quick, *overrides],
            apart=bool(clocks), **choices,
        )  # fmt: skip
        self.host = HinderedHost(clocks, lateness)
        self._wires = wires or {}
        self._ears: dict[Side, Node] = {}
        for name in self.rows if clocks else services:
            self.start(name)
        self.statuses = self.heard(topics.STATUS)

    def start(self, name: str) -> None:
        """A service, or again."""
        wire = self._wires.get(name) or self.rows.wire(name)
        self.host.add(name, self.rows[name], self.stack, wire)

    def ears(self, side: Side = "drone") -> Node:
        """Of somebody who only listens."""
        if side not in self._ears:
            self._ears[side] = self.host.node(f"ears_{side}", [side])
        return self._ears[side]

    def heard(self, topic: Topic[M], side: Side = "drone") -> list[M]:
        """What is heard of it from now on."""
        found: list[M] = []
        self.ears(side).each(topic, lambda message, _: found.append(message))
        return found

    def run(self, seconds: float) -> Self:
        self.host.run(self.host.now + round(seconds * SECOND))
        return self

    @property
    def armed(self) -> bool:
        return bool(self.statuses) and self.statuses[-1].armed

    def until_armed(self) -> Self:
        self.host.run(self.host.now + round(LONGEST_START_S * SECOND), done=lambda: self.armed)
        assert self.armed, self.statuses[-1:]
        return self

    @property
    def counts(self) -> Counter[str]:
        return sum((node.counts for node in self.host.nodes.values()), Counter[str]())


class Person:
    """A pilot by hand, whose sticks and requests a test gives."""

    def __init__(self, host: VirtualHost, name: str = "pilot", side: Side = "drone") -> None:
        node = host.node(name, [side])
        self.name, self._host, self._asked = name, host, 0
        self.epoch, self.heave, self.speaks = 0, 0.0, True
        self.answers: list[PilotAnswer] = []  # to his own requests
        self._commands = node.publisher(topics.PILOT_COMMAND)
        self._requests = node.publisher(topics.PILOT_REQUEST)
        node.every(topics.PILOT_COMMAND.hz, self._speak)
        node.each(topics.PILOT_ANSWER, self._hear)

    def say(self, kind: RequestKind, **more: Any) -> str:
        """Ask, and wait for nothing. Returns the name of the request."""
        self._asked += 1
        said: dict[str, Any] = {"source": self.name, "epoch": self.epoch} | more
        request = PilotRequest(
            stamp_ns=self._host.now, id=f"{self.name}-{kind}-{self._asked}", kind=kind, **said
        )
        self._requests.put(request)
        return request.id

    def ask(self, kind: RequestKind, **more: Any) -> str:
        """Why it is refused; empty: it is granted."""
        name = self.say(kind, **more)
        self._host.run(self._host.now + SECOND // 5)
        return self.answered(name)[-1].reason

    def answered(self, name: str) -> list[PilotAnswer]:
        return [answer for answer in self.answers if answer.id == name]

    def _hear(self, answer: PilotAnswer, _: int) -> None:
        if answer.id.startswith(f"{self.name}-"):
            self.answers.append(answer)
            self.epoch = self.epoch if answer.epoch is None else answer.epoch

    def _speak(self, now: int) -> None:
        if self.speaks:
            self._commands.put(
                PilotCommand(
                    stamp_ns=now, surge=0.0, sway=0.0, heave=self.heave, yaw=0.0,
                    source=self.name, epoch=self.epoch,
                )
            )  # fmt: skip


Floats = NDArray[np.float64]
SortieSticks = tuple[float, float, float, float]  # surge, sway, heave, yaw; -1 … 1
HANDS_OFF: SortieSticks = (0.0, 0.0, 0.0, 0.0)
SortieRow = tuple[float, SortieSticks]  # from when [s after arming] on which sticks


class SortieColumns(msgspec.Struct, frozen=True):
    """The dive at 100 Hz from arming on, one entry per instant."""

    north: Floats  # [m] truth
    east: Floats  # [m]
    depth: Floats  # [m]
    heading: Floats  # [rad] accumulated
    wanted_depth: Floats  # [m] reference
    wanted_heading: Floats  # [rad]
    thrust: Floats  # [N] commands, instants × thrusters


class Sortie(Dive):
    """Times are seconds after arming, which the constructor waits for."""

    def __init__(
        self,
        sticks: Sequence[SortieRow],
        *,
        vehicle: str = "pioneer",
        seed: int = 0,
        overrides: Sequence[str] = (DEEP,),
    ) -> None:
        rows = [(0.0, HANDS_OFF), *sticks, (3600.0, HANDS_OFF)]
        script = "\n".join(f"{t:.2f},{','.join(map(str, wish))}" for t, wish in rows)
        super().__init__(script, vehicle=vehicle, seed=seed, overrides=overrides)
        self.truth = self.heard(topics.TRUTH)
        self.references = self.heard(topics.REFERENCE)
        self.commands = self.heard(topics.THRUSTERS)
        self.wrenches = self.heard(topics.WRENCH)
        self.states = self.heard(topics.STATE)
        self.said = self.heard(topics.LOG)  # by all on board
        self.answers: list[PilotAnswer | FaultAnswer] = []
        self._asked = 0
        pilot = self.host.node("voice", ["topside"])
        self._wishes = pilot.publisher(topics.PILOT_REQUEST)
        self._breaks = pilot.publisher(topics.FAULT_REQUEST)
        pilot.each(topics.PILOT_ANSWER, lambda m, _: self.answers.append(m))
        pilot.each(topics.FAULT_ANSWER, lambda m, _: self.answers.append(m))
        self._armed_ns = self.until_armed().host.now

    @property
    def status(self) -> VehicleStatus:
        return self.statuses[-1]

    # What may happen.

    @property
    def t(self) -> float:
        """[s] after arming."""
        return (self.host.now - self._armed_ns) / SECOND

    @property
    def flight_mode(self) -> FlightMode:
        return self.status.flight_mode

    def until(self, t: float) -> Self:
        self.host.run(self._armed_ns + round(t * SECOND))
        return self

    def hold(self, hold: FlightMode) -> None:
        """Ask for a mode."""
        self._wish(kind="mode", flight_mode=hold)

    def ask(self, kind: RequestKind) -> None:
        """Ask for what needs no more words."""
        self._wish(kind=kind)

    def _wish(self, **wish: object) -> None:
        self._asked += 1
        request = PilotRequest(
            stamp_ns=self.host.now,
            id=f"voice-{self._asked}",
            epoch=self.status.epoch,
            **wish,  # type: ignore[arg-type]
        )
        self._wishes.put(request)

    def set_faults(self, part: str, fault: FaultKind, value: float | None = None) -> None:
        """Break a part, or mend it with `none`."""
        self._asked += 1
        request = FaultRequest(
            stamp_ns=self.host.now, id=f"voice-{self._asked}", part=part, fault=fault, value=value
        )
        self._breaks.put(request)

    def become(self, *overrides: str) -> None:
        """Go on with another body in the same place: the simulator restarts from its memory, which
        is at most 0.2 s old. Nobody else is told."""
        changed = msgspec.structs.replace(self.stack, overrides=[*self.stack.overrides, *overrides])
        self.host.kill("simulator")
        self.host.add("simulator", self.rows["simulator"], changed)

    def restart(self, name: str) -> None:
        """A service starts again, and its checkpoint is lost."""
        self.host.kill(name)
        self.host.forget(name)
        self.start(name)

    # What came of it.

    def refused(self) -> list[str]:
        """Why requests were not granted."""
        return [answer.reason for answer in self.answers if not answer.accepted]

    def columns(self, begin: float = 0.0, end: float | None = None) -> SortieColumns:
        """From `begin` to `end` [s], else until now."""
        last = self.t if end is None else end
        t = self._armed_ns / SECOND + np.arange(begin, last, 0.01)

        def at(messages: Sequence[Message], values: list[float]) -> Floats:
            return np.interp(t, [m.stamp_ns / SECOND for m in messages], values)

        count = len(self.commands[0].thrust)
        thrust = [at(self.commands, [m.thrust[k] for m in self.commands]) for k in range(count)]
        return SortieColumns(
            at(self.truth, [m.position[0] for m in self.truth]),
            at(self.truth, [m.position[1] for m in self.truth]),
            at(self.truth, [m.position[2] for m in self.truth]),
            at(self.truth, [m.heading for m in self.truth]),
            at(self.references, [m.depth.position for m in self.references]),
            at(self.references, [m.heading.position for m in self.references]),
            np.stack(thrust, axis=1),
        )

    def estimate_errors(self, seen: SortieColumns, begin: float) -> tuple[Floats, Floats]:
        """Estimate minus truth of these columns, which start at `begin` [s]: depth [m] and
        heading [rad]."""
        t = self._armed_ns / SECOND + begin + 0.01 * np.arange(len(seen.depth))
        at = np.array([m.sensor_ns / SECOND for m in self.states])
        depth = np.interp(t, at, [m.depth.value for m in self.states])
        heading = np.interp(t, at, [m.heading.value for m in self.states])
        return depth - seen.depth, heading - seen.heading
