"""A dive as the report needs it, read once from the recording."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from messages import events, topics
from messages.health import LogLine
from messages.link import Clock
from messages.message import Message
from messages.reference import Reference
from messages.topic import AnyTopic
from services.runtime.node.clock_offset import ClockOffset, mover
from tools.health_sums import HealthOfAll, HealthSums
from tools.recordings.columns import Array, Gathering, StreamColumns, StreamFigures
from tools.recordings.mcap_records import Noticed
from tools.recordings.recording import Recording
from tools.report.columns import FURTHER_WANTED, WANTED
from tools.report.holes import HOLE_NS, HoleFinder

ENDING_NS = 6_000_000_000  # [ns] the recorder may be stopped so long after the vehicle

Passing = Callable[[int], None]  # arrival [ns] UTC
Adding = Callable[[Any, int], None]  # message, arrival [ns] UTC
HEALTH, LOG = topics.HEALTH.key[:-1], topics.LOG.key[:-1]  # how the keys of the families begin


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
    streams: dict[str, StreamColumns]  # by key; all of WANTED, perhaps without rows
    health: dict[str, HealthSums] = field(default_factory=dict[str, HealthSums])
    losses: dict[str, int] = field(default_factory=dict[str, int])  # the recorder's own
    holes: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])  # [ns] UTC
    vehicle_holes: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    errors: Counter[str] = field(default_factory=Counter[str])  # lines of level error, by service
    armed_utc_ns: int | None = None  # when the first armed reference was recorded

    def __getitem__(self, topic: AnyTopic) -> StreamColumns:
        return self.streams[topic.key]

    @cached_property
    def armed(self) -> tuple[float, float] | None:
        """[ns] First and last instant at which the reference was armed; None: never."""
        reference = self[topics.REFERENCE]
        valid = reference["valid"][reference["armed"] > 0]
        return (float(valid[0]), float(valid[-1])) if len(valid) else None

    @property
    def seconds(self) -> float:
        """[s] From the first message to the last."""
        return (self.last_ns - self.first_ns) / 1e9

    @cached_property
    def armed_seconds(self) -> float:
        """[s] Sum of the times in which the drone was armed: by its reference, or, of a vehicle
        that another program flew, by its status."""
        told = self[topics.REFERENCE]
        if not len(told["stamp"]):
            told = self[topics.STATUS]
        stamp, armed = told["stamp"], told["armed"]
        if np.any(stamp[1:] < stamp[:-1]):  # in the order of their samples, of which one is late
            order = np.argsort(stamp, kind="stable")
            stamp, armed = stamp[order], armed[order]
        return float(np.sum(np.diff(stamp)[armed[:-1] > 0])) / 1e9

    @property
    def vehicle_silences(self) -> list[float]:
        """[s] Each time in which everything but the vehicle was recorded. At its end a dive goes
        on for a while after the vehicle has been stopped."""
        traffic = self.traffic.get(topics.ACTUATION.key)
        if traffic is None:
            return [self.seconds]
        last = traffic.last_ns
        ended = [(last, self.last_ns)] if self.last_ns - last > ENDING_NS else []
        silences = [
            end - begin - sum(max(0, min(end, b) - max(begin, a)) for a, b in self.holes)
            for begin, end in [*self.vehicle_holes, *ended]
        ]
        return [silence / 1e9 for silence in silences if silence > HOLE_NS]

    @property
    def first_ns(self) -> int:
        """[ns] UTC of the first message; 0 without any."""
        return min((traffic.first_ns for traffic in self.traffic.values()), default=0)

    @property
    def last_ns(self) -> int:
        """[ns] UTC of the last message; 0 without any."""
        return max((traffic.last_ns for traffic in self.traffic.values()), default=0)

    @property
    def max_depth_m(self) -> float | None:
        """[m] Of the vehicle's origin: true where that is known, else as estimated while it was
        known."""
        if self[topics.TRUTH].count:
            return float(np.max(self[topics.TRUTH]["heave"]))
        state = self[topics.STATE]
        known = state["heave"][state["heave known"] > 0.0] if state.count else np.empty(0)
        return float(np.max(known)) if len(known) else None

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

    def noticing(key: str) -> Noticed:
        passing, adding = gathered.passing(key), gathered.adding(key)
        if adding is None:
            return lambda _sequence, log_ns, _publish_ns, _data: passing(log_ns)
        decode = recording.decoding(key, gathered.kind(key))

        def see(_sequence: int, log_ns: int, _publish_ns: int, data: bytes) -> None:
            passing(log_ns)
            message = decode(data)
            if message is not None and (
                topside_clock is None or topside_clock.convert(key, message, log_ns)
            ):
                adding(message, log_ns)

        return see

    for _ in recording.raw(lambda _: False, noticing):
        pass  # all that is needed was noticed
    losses = recording.losses() + _unreadable(recording)
    return gathered.dive(recording.metadata("dive"), losses)


class GatheredDive:
    """Collects what a report needs, message by message in the order of their arrival. What is done
    with those of a key is asked for once: there are a thousand a second."""

    def __init__(self) -> None:
        self._traffic: dict[str, Traffic] = {}
        self._wanted = {wanted.topic.key: wanted for wanted in WANTED}
        self._streams = {key: _gathering(wanted) for key, wanted in self._wanted.items()}
        self._health = HealthOfAll()
        self._holes, self._vehicle_holes = HoleFinder(), HoleFinder()
        self._errors = Counter[str]()
        self._armed_utc_ns: int | None = None

    def passing(self, key: str) -> Passing:
        """What is told the arrival [ns] UTC of each of its messages."""
        see, see_vehicle = self._holes.see, self._vehicle_holes.see
        of_the_vehicle, seen = key == topics.ACTUATION.key, self._traffic.get(key)

        def pass_by(log_ns: int) -> None:
            nonlocal seen
            see(log_ns)
            if of_the_vehicle:
                see_vehicle(log_ns)
            if seen is None:
                seen = self._traffic.setdefault(key, Traffic(0, log_ns, log_ns))
            seen.count += 1
            seen.last_ns = log_ns

        return pass_by

    def kind(self, key: str) -> type[Message] | None:
        """As what its messages are decoded; None: this version of Lindy does not know the key."""
        if (wanted := self._wanted.get(key)) is not None:
            return wanted.message
        topic = topics.find(key)
        return topic and topic.message

    def adding(self, key: str) -> Adding | None:
        """What takes each of its messages, with its arrival; None: they are not needed."""
        if FURTHER_WANTED.topic.covers(key):
            self._streams.setdefault(key, _gathering(FURTHER_WANTED))
        if key == topics.REFERENCE.key:
            return self._reference
        if (stream := self._streams.get(key)) is not None:
            return stream.add
        if key.startswith(HEALTH):
            return lambda message, _: self._health.add(message)
        return self._log_line if key.startswith(LOG) else None

    def _reference(self, reference: Reference, log_ns: int) -> None:
        self._streams[topics.REFERENCE.key].add(reference)
        if self._armed_utc_ns is None and reference.armed:
            self._armed_utc_ns = log_ns

    def _log_line(self, line: LogLine, _log_ns: int) -> None:
        self._errors[line.service] += line.level == "error"

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
            health=self._health.sums,
            losses=losses,
            holes=self._holes.found,
            vehicle_holes=self._vehicle_holes.found,
            errors=+self._errors,
            armed_utc_ns=self._armed_utc_ns,
        )


def _gathering(wanted: StreamFigures) -> Gathering:
    return Gathering(wanted.names, wanted.figures)


class _TopsideClock:
    """Converts stamps to the drone's clock, with the offset that the drone knew at the time."""

    def __init__(self) -> None:
        self._clock = ClockOffset("drone")

    def convert(self, key: str, message: Message, log_ns: int) -> bool:
        """False: the offset was not known yet, and the message was not used on board."""
        if isinstance(message, Clock):
            self._clock.learn(message, log_ns)
        topic = topics.find(key)
        if topic is None or not self._clock.concerns(topic):
            return True
        if self._clock.ahead_ns is None:
            return False
        mover(type(message))(message, self._clock.ahead_ns)
        return True


def _unreadable(recording: Recording) -> Counter[str]:
    return Counter(
        {events.UNREADABLE(key).name: count for key, count in recording.unreadable.items()}
    )
