"""A dive on virtual time that can be interfered with: parts break, ballast drops, modes change.

The whole chain from gamepad to simulator, with real estimates, noise, dead-bands and the tether.
What is kept is the truth, the reference and the commands.
"""

import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.control import ThrusterCommand, Wrench
from messages.pilot import FlightMode, PilotAnswer, PilotRequest, RequestKind
from messages.reference import Reference
from messages.simulator import FaultAnswer, FaultKind, FaultRequest
from messages.state import VehicleState
from messages.vehicle import Truth, VehicleStatus
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from tests.support.hindered_host import HinderedHost

Floats = NDArray[np.float64]
SortieSticks = tuple[float, float, float, float]  # surge, sway, heave, yaw; -1 … 1
HANDS_OFF: SortieSticks = (0.0, 0.0, 0.0, 0.0)
SortieRow = tuple[float, SortieSticks]  # from when [s after arming] on which sticks
CHAIN = ("simulator", "estimation", "reference", "control", "tether", "gamepad")
SECOND = 1_000_000_000  # [ns]
LONGEST_START = 60.0  # [s]
DEEP = "simulator.floor_depth=60"  # [m] nothing to bump into
QUICK_START = "estimation.calibration.still_time=3"  # [s] less to wait for


class SortieColumns(msgspec.Struct, frozen=True):
    """The dive at 100 Hz from arming on, one entry per instant."""

    north: Floats  # [m] truth
    east: Floats  # [m]
    depth: Floats  # [m]
    heading: Floats  # [rad] accumulated
    wanted_depth: Floats  # [m] reference
    wanted_heading: Floats  # [rad]
    thrust: Floats  # [N] commands, instants × thrusters


class Sortie:
    """Times are seconds after arming, which the constructor waits for."""

    def __init__(
        self,
        sticks: Sequence[SortieRow],
        *,
        vehicle: str = "pioneer",
        seed: int = 0,
        overrides: Sequence[str] = (DEEP,),
    ) -> None:
        """
        Raises:
            RuntimeError: the drone does not arm.
        """
        self.truth: list[Truth] = []
        self.references: list[Reference] = []
        self.commands: list[ThrusterCommand] = []
        self.wrenches: list[Wrench] = []
        self.states: list[VehicleState] = []
        self.answers: list[PilotAnswer | FaultAnswer] = []
        self.said: list[str] = []  # in the log, by all on board
        self.status: VehicleStatus | None = None
        self._asked = 0
        self._rows = Registry.read()
        self._host = HinderedHost()
        with tempfile.TemporaryDirectory() as folder:  # the script is read at once
            self._stack = Stack(
                pilot=f"script:{_script(Path(folder), sticks)}",
                out=folder,
                vehicle=vehicle,
                seed=seed,
                overrides=[QUICK_START, *overrides],
            )
            for name in CHAIN:
                self._host.add(name, self._rows[name], self._stack)
        self._listen()
        self._armed_ns = 0
        self._host.run(round(LONGEST_START * SECOND), done=self._is_armed)
        if not self._is_armed():
            raise RuntimeError(f"the drone is not armed after {LONGEST_START:.0f} s")
        self._armed_ns = self._host.now

    def _is_armed(self) -> bool:
        return self.status is not None and self.status.armed

    def _listen(self) -> None:
        pilot = self._host.node("voice", ["topside"])
        self._wishes = pilot.publisher(topics.PILOT_REQUEST)
        self._breaks = pilot.publisher(topics.FAULT_REQUEST)
        pilot.each(topics.PILOT_ANSWER, lambda m, _: self.answers.append(m))
        pilot.each(topics.FAULT_ANSWER, lambda m, _: self.answers.append(m))
        observer = self._host.node("observer", ["drone"])
        observer.each(topics.TRUTH, lambda m, _: self.truth.append(m))
        observer.each(topics.REFERENCE, lambda m, _: self.references.append(m))
        observer.each(topics.THRUSTERS, lambda m, _: self.commands.append(m))
        observer.each(topics.WRENCH, lambda m, _: self.wrenches.append(m))
        observer.each(topics.STATE, lambda m, _: self.states.append(m))
        observer.each(topics.STATUS, lambda m, _: self._see(m))
        observer.each(topics.LOG, lambda m, _: self.said.append(m.text))

    def _see(self, status: VehicleStatus) -> None:
        self.status = status

    # What may happen.

    @property
    def t(self) -> float:
        """[s] after arming."""
        return (self._host.now - self._armed_ns) / SECOND

    @property
    def flight_mode(self) -> FlightMode:
        assert self.status is not None
        return self.status.flight_mode

    def until(self, t: float) -> "Sortie":
        self._host.run(self._armed_ns + round(t * SECOND))
        return self

    def hold(self, hold: FlightMode) -> None:
        """Ask for a mode."""
        self._wish(kind="mode", flight_mode=hold)

    def go(self, north: float, east: float, depth: float | None = None) -> None:
        """Ask for a place [m]."""
        self._wish(kind="goto", north=north, east=east, depth=depth)

    def ask(self, kind: RequestKind) -> None:
        """Ask for what needs no more words."""
        self._wish(kind=kind)

    def _wish(self, **wish: object) -> None:
        self._asked += 1
        assert self.status is not None
        request = PilotRequest(
            stamp_ns=self._host.now,
            id=f"voice-{self._asked}",
            epoch=self.status.epoch,
            **wish,  # type: ignore[arg-type]
        )
        self._wishes.put(request)

    def set_faults(self, part: str, fault: FaultKind, value: float | None = None) -> None:
        """Break a part, or mend it with `none`."""
        self._asked += 1
        request = FaultRequest(
            stamp_ns=self._host.now, id=f"voice-{self._asked}", part=part, fault=fault, value=value
        )
        self._breaks.put(request)

    def become(self, *overrides: str) -> None:
        """Go on with another body in the same place: the simulator restarts from its memory, which
        is at most 0.2 s old. Nobody else is told."""
        changed = msgspec.structs.replace(
            self._stack, overrides=[*self._stack.overrides, *overrides]
        )
        self._host.kill("simulator")
        self._host.add("simulator", self._rows["simulator"], changed)

    def restart(self, name: str) -> None:
        """A service starts again, and its checkpoint is lost."""
        self._host.kill(name)
        self._host.forget(name)
        self._host.add(name, self._rows[name], self._stack)

    # What came of it.

    @property
    def counts(self) -> Counter[str]:
        total: Counter[str] = Counter()
        for node in self._host.nodes.values():
            total.update(node.counts)
        return total

    def refused(self) -> list[str]:
        """Why requests were not granted."""
        return [answer.reason for answer in self.answers if not answer.accepted]

    def columns(self, begin: float = 0.0, end: float | None = None) -> SortieColumns:
        """From `begin` to `end` [s], else until now."""
        last = self.t if end is None else end
        t = self._armed_ns / SECOND + np.arange(begin, last, 0.01)
        at_truth = np.array([m.stamp_ns / SECOND for m in self.truth])
        at_reference = np.array([m.stamp_ns / SECOND for m in self.references])
        at_command = np.array([m.stamp_ns / SECOND for m in self.commands])
        count = len(self.commands[0].thrust)
        thrust: list[Floats] = [
            np.interp(t, at_command, [m.thrust[k] for m in self.commands]) for k in range(count)
        ]

        def true(values: list[float]) -> Floats:
            return np.interp(t, at_truth, values)

        def wanted(values: list[float]) -> Floats:
            return np.interp(t, at_reference, values)

        return SortieColumns(
            true([m.position[0] for m in self.truth]),
            true([m.position[1] for m in self.truth]),
            true([m.position[2] for m in self.truth]),
            true([m.heading for m in self.truth]),
            wanted([m.depth.position for m in self.references]),
            wanted([m.heading.position for m in self.references]),
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


def _script(folder: Path, sticks: Sequence[SortieRow]) -> Path:
    path = folder / "sticks.csv"
    rows = [(0.0, HANDS_OFF), *sticks, (3600.0, HANDS_OFF)]
    lines = [f"{t:.2f},{','.join(map(str, wish))}" for t, wish in rows]
    path.write_text("\n".join(["t,surge,sway,heave,yaw", *lines]))
    return path
