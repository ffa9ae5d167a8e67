"""The whole chain, from gamepad to simulator, on virtual time, and all that it says, in columns."""

import tempfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.message import Message
from messages.topic import M, Topic
from messages.vehicle import VehicleStatus
from services.runtime.config.stack import Stack
from services.runtime.hosts.garbage_collection import rare_collections
from services.runtime.hosts.registry import Registry
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support.flights import CHAIN, LONGEST_START

Floats = NDArray[np.float64]
SECOND = 1_000_000_000  # [ns]
DT = 0.01  # [s] between two rows of a column
HEARD: tuple[Topic[Any], ...] = (
    topics.TRUTH, topics.STATE, topics.REFERENCE, topics.WRENCH, topics.THRUSTERS,
    topics.ACTUATION,
)  # fmt: skip


class Chain:
    """One dive. Times are seconds since arming; the script begins then."""

    def __init__(self, script: str, overrides: Sequence[str] = (), seed: int = 0) -> None:
        """
        Args:
            script: sticks, as in a file of deploy/dives/.
            overrides: of the Pioneer's file, as `key.path=value`.
        """
        self.seconds = 0.0  # [s] flown
        self._script, self._overrides, self._seed = script, overrides, seed
        self._host, self._rows = VirtualHost(), Registry.read()
        self._said: defaultdict[str, list[Message]] = defaultdict(list)
        self._armed_at = 0  # [ns]

    @classmethod
    def flown(
        cls, script: str, seconds: float, overrides: Sequence[str] = (), seed: int = 0
    ) -> Self:
        """A dive without incidents."""
        return cls(script, overrides, seed).fly((seconds, ()))

    def fly(self, *parts: tuple[float, Sequence[str]]) -> Self:
        """Fly to the end of each part [s]. A part begins with a simulator that goes on where the
        one before ended, with these overrides more.

        Raises:
            RuntimeError: the drone does not arm.
        """
        with tempfile.TemporaryDirectory() as folder, closing(self._host), rare_collections():
            for name in CHAIN:
                self._host.add(name, self._rows[name], self._stack(folder))
            self._listen()
            for end, more in parts:
                if more:
                    self._host.kill("simulator")
                    row = self._rows["simulator"]
                    self._host.add("simulator", row, self._stack(folder, more))
                self._host.run(self._armed_at + round(end * SECOND))
                self.seconds = end
        return self

    def column(self, topic: Topic[M], value: Callable[[M], float]) -> Floats:
        """What a topic said, at times `t`."""
        said: list[Any] = self._said[topic.key]
        stamps = [(message.stamp_ns - self._armed_at) / SECOND for message in said]
        values = [value(message) for message in said]
        return np.asarray(np.interp(self.t, stamps, values), np.float64)

    @property
    def t(self) -> Floats:
        """[s]"""
        return np.arange(0.0, round(self.seconds / DT)) * DT

    def _stack(self, folder: str, more: Sequence[str] = ()) -> Stack:
        path = Path(folder) / "sticks.csv"
        path.write_text(self._script, encoding="utf-8")
        changes = ["estimation.calibration.still_time=3", *self._overrides, *more]
        return Stack(pilot=f"script:{path}", out=folder, seed=self._seed, overrides=changes)

    def _listen(self) -> None:
        """Until it is armed, and from then on."""
        port, statuses = self._host.node("observer", ["drone"]), list[VehicleStatus]()
        port.each(topics.STATUS, lambda status, _: statuses.append(status))
        self._host.run(
            round(LONGEST_START * SECOND), done=lambda: bool(statuses) and statuses[-1].armed
        )
        if not statuses or not statuses[-1].armed:
            raise RuntimeError(f"the drone is not armed after {LONGEST_START:.0f} s")
        self._armed_at = self._host.now
        for topic in HEARD:
            port.each(topic, lambda message, _, key=topic.key: self._said[key].append(message))
