"""The whole chain, from gamepad to simulator, on virtual time: flown by a script, interfered with
on the way, and all that it says, as messages and in columns."""

import tempfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import (
    FaultKind,
    FaultRequest,
    FlightMode,
    Message,
    PilotRequest,
    Topic,
    VehicleStatus,
    topics,
)
from services.runtime.hosts.loop import rare_collections

Floats = NDArray[np.float64]
M = TypeVar("M", bound=Message)
Stick = tuple[float, float, float, float]  # surge, sway, heave, yaw; -1 … 1
Row = tuple[float, Stick]  # from when [s after arming] on which sticks
HANDS_OFF: Stick = (0.0, 0.0, 0.0, 0.0)
CHAIN = ("simulator", "estimation", "reference", "control", "tether", "gamepad")
DEEP = "simulator.floor_depth=60"  # [m] nothing to bump into
QUICK_START = "estimation.calibration.still_time=3"  # [s] less to wait for
LONGEST_START = 60.0  # [s] until armed, or something is wrong
SECOND = 1_000_000_000  # [ns]
DT = 0.01  # [s] between two rows of a column
HEARD: tuple[Topic[Any], ...] = (
    topics.TRUTH, topics.STATE, topics.REFERENCE, topics.WRENCH, topics.THRUSTERS,
    topics.ACTUATION,
)  # fmt: skip


class Dive:
    """Times are seconds since arming, which the constructor waits for; the sticks begin then."""

    def __init__(
        self,
        sticks: str | Sequence[Row],
        *,
        vehicle: str = "pioneer",
        seed: int = 0,
        overrides: Sequence[str] = (),
    ) -> None:
        """
        Args:
            sticks: rows, or a file of deploy/dives/ as text.
            overrides: of the vehicle's file, as `key.path=value`.

        Raises:
            RuntimeError: the drone does not arm.
        """
        self._host, self._rows = VirtualHost(), Registry.read()
        self._said: defaultdict[str, list[Any]] = defaultdict(list)
        self._status: VehicleStatus | None = None
        self._asked = 0
        with tempfile.TemporaryDirectory() as folder:  # the script is read at once
            path = Path(folder) / "sticks.csv"
            text = sticks if isinstance(sticks, str) else script([*sticks, (3600.0, HANDS_OFF)])
            path.write_text(text, encoding="utf-8")
            self._stack = Stack(
                pilot=f"script:{path}", out=folder, vehicle=vehicle, seed=seed,
                overrides=[QUICK_START, *overrides],
            )  # fmt: skip
            for name in CHAIN:
                self._host.add(name, self._rows[name], self._stack)
        # Whoever speaks is heard over the link, if only by its health. A file's dive has nobody.
        self._voice = None if isinstance(sticks, str) else self._host.node("voice", ["topside"])
        self._observer = self._host.node("observer", ["drone"])
        self._observer.each(topics.STATUS, self._see)
        self._armed_at = 0  # [ns]
        self._run(round(LONGEST_START * SECOND), done=self._is_armed)
        if not self._is_armed():
            raise RuntimeError(f"the drone is not armed after {LONGEST_START:.0f} s")
        self._armed_at = self._host.now
        for topic in HEARD:
            self._observer.each(topic, lambda message, _, key=topic.key: self._keep(key, message))

    # What may happen.

    def until(self, t: float) -> Self:
        """Fly on to this time [s]."""
        self._run(self._armed_at + round(t * SECOND))
        return self

    def become(self, *overrides: str) -> Self:
        """Go on with another body in the same place: the simulator restarts from its memory, which
        is at most 0.2 s old. Nobody else is told."""
        more = [*self._stack.overrides, *overrides]
        self._host.kill("simulator")
        stack = msgspec.structs.replace(self._stack, overrides=more)
        self._host.add("simulator", self._rows["simulator"], stack)
        return self

    def hold(self, mode: FlightMode) -> None:
        """Ask for a mode."""
        assert self._status is not None
        request = PilotRequest(
            stamp_ns=self._host.now, id=self._next_id(), epoch=self._status.epoch, kind="mode",
            flight_mode=mode,
        )  # fmt: skip
        self._speak(topics.PILOT_REQUEST, request)

    def set_fault(self, part: str, fault: FaultKind, value: float | None = None) -> None:
        """Break a part, or mend it with `none`."""
        request = FaultRequest(
            stamp_ns=self._host.now, id=self._next_id(), part=part, fault=fault, value=value
        )
        self._speak(topics.FAULT_REQUEST, request)

    # What came of it.

    @property
    def seconds(self) -> float:
        """[s] flown since arming."""
        return (self._host.now - self._armed_at) / SECOND

    @property
    def t(self) -> Floats:
        """[s] of the rows of a whole column."""
        return self._times(0.0, None)

    @property
    def mode(self) -> FlightMode:
        assert self._status is not None
        return self._status.flight_mode

    def said(self, topic: Topic[M]) -> list[M]:
        """Since arming, of a topic in HEARD."""
        return self._said[topic.key]

    def when(self, stamp_ns: int) -> float:
        """[s] since arming."""
        return (stamp_ns - self._armed_at) / SECOND

    def column(
        self,
        topic: Topic[M],
        value: Callable[[M], float],
        begin: float = 0.0,
        end: float | None = None,
    ) -> Floats:
        """What a topic said, every DT from `begin` to `end` [s], else until now."""
        t, said = self._times(begin, end), self.said(topic)
        stamps = [self.when(message.stamp_ns) for message in said]
        return np.asarray(np.interp(t, stamps, [value(message) for message in said]), np.float64)

    def errors(self, begin: float = 0.0, end: float | None = None) -> tuple[Floats, Floats]:
        """Estimate minus truth, of the depth [m] and of the heading [rad]."""
        t, states = self._times(begin, end), self.said(topics.STATE)
        at = [self.when(state.sensor_ns) for state in states]
        depth = np.interp(t, at, [state.depth.value for state in states])
        heading = np.interp(t, at, [state.heading.value for state in states])
        return depth - self.depth(begin, end), heading - self.heading(begin, end)

    def depth(self, begin: float = 0.0, end: float | None = None) -> Floats:
        """[m] True."""
        return self.column(topics.TRUTH, lambda m: m.position[2], begin, end)

    def heading(self, begin: float = 0.0, end: float | None = None) -> Floats:
        """[rad] True, accumulated."""
        return self.column(topics.TRUTH, lambda m: m.heading, begin, end)

    def wanted_depth(self, begin: float = 0.0, end: float | None = None) -> Floats:
        """[m] Of the reference."""
        return self.column(topics.REFERENCE, lambda m: m.depth.position, begin, end)

    def wanted_heading(self, begin: float = 0.0, end: float | None = None) -> Floats:
        """[rad] Of the reference."""
        return self.column(topics.REFERENCE, lambda m: m.heading.position, begin, end)

    def _times(self, begin: float, end: float | None) -> Floats:
        end = self.seconds if end is None else end
        return np.arange(float(round(begin / DT)), float(round(end / DT))) * DT

    def _run(self, until: int, done: Callable[[], bool] | None = None) -> None:
        with rare_collections():
            self._host.run(until, done=done)

    def _is_armed(self) -> bool:
        return self._status is not None and self._status.armed

    def _see(self, status: VehicleStatus, _: int) -> None:
        self._status = status

    def _keep(self, key: str, message: Message) -> None:
        self._said[key].append(message)

    def _next_id(self) -> str:
        self._asked += 1
        return f"voice-{self._asked}"

    def _speak(self, topic: Topic[M], message: M) -> None:
        assert self._voice is not None, "a dive by a file is not interfered with"
        self._voice.publisher(topic).put(message)


def script(rows: Sequence[Row]) -> str:
    """As a file of deploy/dives/; hands off until the first row."""
    lines = [f"{t:.2f},{','.join(f'{part:.3f}' for part in wish)}" for t, wish in rows]
    return "\n".join(["t,surge,sway,heave,yaw", "0.00,0,0,0,0", *lines])
