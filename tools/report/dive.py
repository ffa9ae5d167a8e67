"""A dive as the report needs it, read once from the recording."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from messages import topics
from messages.health import Health
from messages.link import Clock
from messages.message import Message
from messages.topic import AnyTopic
from services.runtime.node.clock_offset import ClockOffset
from services.runtime.node.stamps import mover
from tools.recordings.recording import Raw, Recording
from tools.report.columns import WANTED, Array, Gathering, StreamColumns

HEALTH = topics.HEALTH.key.removesuffix("*")  # how the keys of the family begin


@dataclass(slots=True)
class Traffic:
    """Messages of one key."""

    count: int
    first_ns: int  # [ns] UTC
    last_ns: int  # [ns] UTC


@dataclass(frozen=True)
class RecordedDive:
    """Everything a report is made from."""

    about: dict[str, str]  # vehicle, link, pilot, seed, overrides
    traffic: dict[str, Traffic]  # by key
    streams: dict[str, StreamColumns]  # by key; every stream of WANTED, perhaps with no rows
    health: dict[str, list[Health]] = field(default_factory=dict[str, list[Health]])
    losses: dict[str, int] = field(default_factory=dict[str, int])  # the recorder's own

    def __getitem__(self, topic: AnyTopic) -> StreamColumns:
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

        The true heading is given in the frame of the control heading, which is not relative to
        north: the difference between the two at the instant of arming is subtracted.
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


def read_dive(recording: Recording, *, apart: bool = False) -> RecordedDive:
    """Read a recording once, decoding only what the report needs.

    Args:
        apart: topside and drone were two machines: messages from the topside have stamps of the
            topside's clock.
    """
    topside_clock = _TopsideClock() if apart else None
    gathered = GatheredDive()
    for raw in recording.raw():
        gathered.pass_by(raw.key, raw.log_ns)
        if not gathered.wants(raw.key):
            continue
        message = recording.decode(raw)
        if message is not None and (topside_clock is None or topside_clock.convert(raw, message)):
            gathered.add(raw.key, message)
    return gathered.dive(recording.metadata("dive"), recording.losses() + _unreadable(recording))


class GatheredDive:
    """Collects what a report needs, message by message in the order of their arrival."""

    def __init__(self) -> None:
        self._traffic: dict[str, Traffic] = {}
        self._streams = {
            wanted.topic.key: Gathering(wanted.names, wanted.figures) for wanted in WANTED
        }
        self._health: dict[str, list[Health]] = {}

    def pass_by(self, key: str, log_ns: int) -> None:
        """Any message, with its arrival [ns] UTC."""
        if (seen := self._traffic.get(key)) is None:
            seen = self._traffic[key] = Traffic(0, log_ns, log_ns)
        seen.count += 1
        seen.last_ns = log_ns

    def wants(self, key: str) -> bool:
        """Are the messages of this key to be added?"""
        return key in self._streams or key.startswith(HEALTH)

    def add(self, key: str, message: Message) -> None:
        if (stream := self._streams.get(key)) is not None:
            stream.add(message)
        elif isinstance(message, Health):
            self._health.setdefault(message.service, []).append(message)

    def dive(self, about: dict[str, str], losses: dict[str, int]) -> RecordedDive:
        """
        Args:
            about: vehicle, link, pilot, seed, overrides.
            losses: what the recorder itself counted.
        """
        return RecordedDive(
            about=about,
            traffic=self._traffic,
            streams={key: stream.columns() for key, stream in self._streams.items()},
            health=self._health,
            losses=losses,
        )


class _TopsideClock:
    """Converts stamps to the drone's clock, with the offset that the drone knew at the time."""

    def __init__(self) -> None:
        self._clock = ClockOffset("drone")

    def convert(self, raw: Raw, message: Message) -> bool:
        """False: the offset was not known yet, and the message was not used on board."""
        if isinstance(message, Clock):
            self._clock.learn(message, raw.log_ns)
        topic = topics.find(raw.key)
        if topic is None or not self._clock.concerns(topic):
            return True
        if self._clock.ahead_ns is None:
            return False
        mover(type(message))(message, self._clock.ahead_ns)
        return True


def _unreadable(recording: Recording) -> Counter[str]:
    return Counter({f"unreadable:{key}": count for key, count in recording.unreadable.items()})
