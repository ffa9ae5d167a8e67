"""A dive as the report sees it: read once from the recording, then only looked at."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from messages import topics
from messages.health import Health
from messages.topic import AnyTopic
from tools.recording import Recording
from tools.report.columns import WANTED, Array, Columns, Gathering


@dataclass(slots=True)
class Traffic:
    """How much went over one key."""

    count: int
    first_ns: int  # [ns] UTC
    last_ns: int  # [ns] UTC


@dataclass(frozen=True)
class Dive:
    """Everything a report is made of."""

    about: dict[str, str]  # vehicle, link, pilot, seed, overrides
    traffic: dict[str, Traffic]  # by key
    streams: dict[str, Columns]  # by key; every stream of WANTED, perhaps with no rows
    health: dict[str, list[Health]] = field(default_factory=dict[str, list[Health]])
    losses: dict[str, int] = field(default_factory=dict[str, int])  # the recorder's own

    def __getitem__(self, topic: AnyTopic) -> Columns:
        return self.streams[topic.key]

    @property
    def armed(self) -> tuple[float, float] | None:
        """[ns] First and last instant at which the reference was armed; None: never."""
        reference = self[topics.REFERENCE]
        valid = reference["valid"][reference["armed"] > 0]
        return (float(valid[0]), float(valid[-1])) if len(valid) else None

    @property
    def seconds(self) -> float:
        """[s] From the first arming to the last disarming or the end of the recording. A dive
        that was never armed is as long as its recording."""
        if self.armed is not None:
            return (self.armed[1] - self.armed[0]) / 1e9
        if not self.traffic:
            return 0.0
        first = min(traffic.first_ns for traffic in self.traffic.values())
        return (max(traffic.last_ns for traffic in self.traffic.values()) - first) / 1e9

    @property
    def max_depth_m(self) -> float | None:
        """[m] Of the vehicle's origin: true where that is known, else estimated."""
        for topic in (topics.TRUTH, topics.STATE):
            if self[topic].count:
                return float(np.max(self[topic]["heave"]))
        return None

    def truth(self, axis: str) -> tuple[Array, Array] | None:
        """(times [ns], true depth [m] or heading [rad]), or None on a dive without a simulator.

        The true heading is given in the frame of the control heading, which knows no north: the
        difference between the two at the instant of arming is taken off.
        """
        truth = self[topics.TRUTH]
        if not truth.count:
            return None
        if axis == "heave":
            return truth["stamp"], truth["heave"]
        state = self[topics.STATE]
        if self.armed is None or not state.count:
            return None
        start = self.armed[0]
        true = np.interp(start, truth["stamp"], truth["yaw"])
        estimated = np.interp(start, state["sensor"], state["yaw"])
        return truth["stamp"], truth["yaw"] - true + estimated


def read_dive(recording: Recording) -> Dive:
    """Read a recording once, opening only what the report needs."""
    traffic: dict[str, Traffic] = {}
    gathering = {wanted.topic.key: Gathering(wanted.names, wanted.figures) for wanted in WANTED}
    health: dict[str, list[Health]] = {}
    for raw in recording.raw():
        if (seen := traffic.get(raw.key)) is None:
            seen = traffic[raw.key] = Traffic(0, raw.log_ns, raw.log_ns)
        seen.count += 1
        seen.last_ns = raw.log_ns
        if raw.key in gathering:
            if (message := recording.decode(raw)) is not None:
                gathering[raw.key].add(message)
        elif topics.HEALTH.covers(raw.key):
            message = recording.decode(raw)
            if isinstance(message, Health):
                health.setdefault(message.service, []).append(message)
    return Dive(
        about=recording.metadata("dive"),
        traffic=traffic,
        streams={key: gathered.columns() for key, gathered in gathering.items()},
        health=health,
        losses=recording.losses() + _unreadable(recording),
    )


def _unreadable(recording: Recording) -> Counter[str]:
    return Counter({f"unreadable:{key}": count for key, count in recording.unreadable.items()})
