"""Services of a stack on virtual time, a pilot's script, and whoever listens."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any, Self
from weakref import finalize

from messages import topics
from messages.topic import M, Side, Topic
from services.runtime.config.stack import Stack
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import Skew
from services.runtime.node.node import Node
from tests.support.hindered_host import HinderedHost
from tests.support.jitter import Lateness

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
        self.host.add(name, self.rows[name], self.stack, self._wires.get(name))

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
