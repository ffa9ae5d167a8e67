"""A dive as columns, read once from its recording: of each message a few figures, for a dive of
hours has millions. Times are in ns of the vehicle's clock."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from messages import events, topics
from messages.control import ThrusterCommand
from messages.link import DOWN_STAGES, UP_STAGES, Clock, LatencyBudget, Stage
from messages.message import Message
from messages.topic import AnyTopic
from messages.vehicle import Actuation, Truth
from messages.video import PICTURE_STAGES, PictureAge
from services.runtime.hosts.loop import rare_collections
from services.runtime.node.clock_offset import ClockOffset, mover
from tools.health_sums import HealthOfAll, HealthSums
from tools.recordings.columns import (
    Array,
    Figures,
    Gathering,
    StreamColumns,
    StreamFigures,
)
from tools.recordings.recording import Recording

HOLE_NS = 1_000_000_000  # [ns] without any message; a usual dive has hundreds in this time
ENDING_NS = 6_000_000_000  # [ns] the recorder may be stopped so long after the vehicle
HEALTH, LOG = topics.HEALTH.key[:-1], topics.LOG.key[:-1]  # how the keys of the families begin
STICKS = ("surge", "sway", "heave", "yaw")
FIELD = {"heave": "depth", "yaw": "heading"}  # of a state and of a reference, by axis


def _thrusters(m: ThrusterCommand) -> Figures:
    """How many there are; bit k: thruster k turns ahead, or astern."""
    ahead = sum(1 << k for k, thrust in enumerate(m.thrust) if thrust > 0.0)
    astern = sum(1 << k for k, thrust in enumerate(m.thrust) if thrust < 0.0)
    return len(m.thrust), ahead, astern


def _actuation(m: Actuation) -> Figures:
    return (sum(thrust * thrust for thrust in m.thrust),)  # [N²]


def _truth(m: Truth) -> Figures:
    return m.position[2], m.heading


def _latency(m: LatencyBudget) -> Figures:
    return *_medians(m.down, len(DOWN_STAGES)), *_medians(m.up, len(UP_STAGES))


def _picture(m: PictureAge) -> Figures:
    return _medians(m.stages, len(PICTURE_STAGES))


def _medians(stages: tuple[Stage, ...] | None, count: int) -> Figures:
    """[ms]"""
    if stages is None or len(stages) != count:
        return (None,) * count
    return tuple(stage.p50_ms for stage in stages)


def _motion(axis: str) -> tuple[str, ...]:
    """Fields of a reference's axis: [m, rad] and their derivatives."""
    parts = ("position", "velocity", "acceleration", "jerk", "jerk_limit")
    return tuple(f"{axis}.{part}" for part in parts)


PICTURE_WANTED = StreamFigures(
    topics.PICTURE_AGE,
    ("stamp_ns", "total.p50_ms", "total.p99_ms", "per_second"),
    PICTURE_STAGES,
    _picture,
)
FURTHER_WANTED = PICTURE_WANTED._replace(topic=topics.FURTHER_AGE)  # of every member
WANTED = (
    StreamFigures(topics.PILOT_COMMAND, ("stamp_ns", *STICKS, "pilot", "epoch")),
    StreamFigures(topics.PILOT_REQUEST, ("stamp_ns", "kind")),
    StreamFigures(
        topics.STATUS,
        ("stamp_ns", "failsafe", "reaction", "since_ns", "activity", "flight_mode", "armed"),
    ),
    StreamFigures(
        topics.STATE,
        ("sensor_ns", "stamp_ns", "depth.value", "heading.value", "depth_moved", "depth_corrected",
         "depth.valid", "heading.valid", "depth_acceleration.value", "yaw_rate.value"),
    ),
    StreamFigures(
        topics.REFERENCE,
        ("stamp_ns", "sensor_ns", "pilot_ns", "armed", "epoch", *_motion("depth"),
         *_motion("heading")),
    ),
    StreamFigures(
        topics.THRUSTERS, ("stamp_ns", "sensor_ns"), ("count", "ahead", "astern"), _thrusters
    ),
    StreamFigures(
        topics.ACTUATION, ("stamp_ns", "actuated_ns", "sensor_ns", "pilot_ns", "power"),
        ("thrust_squared",), _actuation,
    ),
    StreamFigures(topics.BATTERY, ("stamp_ns", "used_wh", "capacity_wh")),
    StreamFigures(
        topics.LATENCY, ("stamp_ns", "stick_to_thruster_ms", "sensor_to_screen_ms", "lost_s"),
        (*(f"down {stage}" for stage in DOWN_STAGES), *(f"up {stage}" for stage in UP_STAGES)),
        _latency,
    ),
    PICTURE_WANTED,
    StreamFigures(topics.CLOCK, ("stamp_ns", "offset_ns", "bound_ns", "drift_ppm")),
    StreamFigures(topics.TRUTH, ("stamp_ns",), ("heave", "yaw"), _truth),
)  # fmt: skip


@dataclass(slots=True)
class Traffic:
    """Messages of one key."""

    count: int
    first_ns: int  # [ns] UTC
    last_ns: int  # [ns] UTC

    @property
    def hz(self) -> float | None:
        """[1/s] Between the first and the last; None: fewer than two."""
        seconds = (self.last_ns - self.first_ns) / 1e9
        return round((self.count - 1) / seconds, 2) if seconds > 0 else None


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
        valid = reference["valid_ns"][reference["armed"] > 0]
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
        if not told.count:
            told = self[topics.STATUS]
        told = told.with_columns({"stamp_ns": told["stamp_ns"]})  # a sample may be late
        return float(np.sum(np.diff(told["stamp_ns"])[told["armed"][:-1] > 0])) / 1e9

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
        known = state["depth.value"][state["depth.valid"] > 0.0]
        return float(np.max(known)) if len(known) else None

    def estimate(self, axis: str) -> tuple[Array, Array] | None:
        """(times [ns], depth [m] or heading [rad]) as the drone estimated; None: it did not."""
        state = self[topics.STATE]
        return (state["sensor_ns"], state[f"{FIELD[axis]}.value"]) if state.count else None

    def truth(self, axis: str) -> tuple[Array, Array] | None:
        """(times [ns], true depth [m] or heading [rad]), or None on a dive without a simulator.

        The true heading is given in the frame of the control heading, which is not relative to
        north: the difference between the two at the instant of arming is subtracted.
        """
        truth = self[topics.TRUTH]
        if not truth.count:
            return None
        if axis == "heave":
            return truth["stamp_ns"], truth["heave"]
        state = self[topics.STATE]
        if self.armed is None or not state.count:
            return None
        start = self.armed[0]
        true = np.interp(start, truth["stamp_ns"], truth["yaw"])
        estimated = np.interp(start, state["sensor_ns"], state["heading.value"])
        return truth["stamp_ns"], truth["yaw"] - true + estimated


def kept(values: Array) -> Array:
    """Each value, or where it is not known the one before; 0 before the first."""
    newest = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return np.nan_to_num(values)[newest]


def read_dive(
    recording: Recording,
    *,
    apart: bool = False,
    more: Sequence[StreamFigures] = (),
    origin_ns: int = 0,
    utc_offset_ns: int = 0,
) -> RecordedDive:
    """Read a recording once, decoding only what is needed.

    Args:
        apart: topside and drone were two machines: messages from the topside have stamps of the
            topside's clock.
        more: streams besides those of a report; one of them takes the place of the report's.
        origin_ns: [ns] from which times in the streams count, by the clock of the stamps.
        utc_offset_ns: [ns] UTC minus that clock.
    """
    topside_clock = _TopsideClock() if apart else None
    gathered = GatheredDive(more, origin_ns, utc_offset_ns)
    decoders: dict[str, Callable[[bytes], Message | None] | None] = {}
    with rare_collections():
        for key, data, log_ns, *_ in recording.raw():
            gathered.see(key, log_ns)
            if key not in decoders:
                kind = gathered.kind(key, whole=apart)
                decoders[key] = kind if kind is None else recording.decoding(key, kind)
            decode = decoders[key]
            if decode is None or (message := decode(data)) is None:
                continue
            if topside_clock is None or topside_clock.convert(key, message, log_ns):
                gathered.add(key, message, log_ns)
    losses = recording.losses() + Counter(
        {events.UNREADABLE(key).name: count for key, count in recording.unreadable.items()}
    )
    return gathered.dive(recording.metadata("dive"), losses)


class GatheredDive:
    """Collects what is needed of a dive, message by message in the order of their arrival.
    Arguments as of `read_dive`."""

    def __init__(
        self, more: Sequence[StreamFigures] = (), origin_ns: int = 0, utc_offset_ns: int = 0
    ) -> None:
        self._origin_ns, self._arrival_origin_ns = origin_ns, origin_ns + utc_offset_ns
        self._traffic: dict[str, Traffic] = {}
        self._wanted = {wanted.topic.key: wanted for wanted in (*WANTED, *more)}
        self._arrival = bool(more)  # a report needs none
        self._streams = {
            key: Gathering(wanted, arrival=self._arrival) for key, wanted in self._wanted.items()
        }
        self._health = HealthOfAll()
        self._holes, self._vehicle_holes = HoleFinder(), HoleFinder()
        self._errors = Counter[str]()
        self._armed_utc_ns: int | None = None

    def see(self, key: str, log_ns: int) -> None:
        """A message of this key has arrived at that time [ns] UTC."""
        self._holes.see(log_ns)
        if key == topics.ACTUATION.key:
            self._vehicle_holes.see(log_ns)
        if (seen := self._traffic.get(key)) is None:
            seen = self._traffic[key] = Traffic(0, log_ns, log_ns)
        seen.count += 1
        seen.last_ns = log_ns

    def kind(self, key: str, *, whole: bool = True) -> type[Message] | None:
        """As what its messages are decoded; None: they are not needed.

        Args:
            whole: with all fields, not only those that are needed.
        """
        if FURTHER_WANTED.topic.covers(key):
            self._streams.setdefault(key, Gathering(FURTHER_WANTED, arrival=self._arrival))
        if (wanted := self._wanted.get(key)) is not None and not whole:
            return wanted.message
        if key in self._streams or key.startswith((HEALTH, LOG)):
            topic = topics.find(key)
            return topic and topic.message
        return None

    def add(self, key: str, message: Any, log_ns: int) -> None:
        """A message of which `kind` says that it is needed."""
        if (stream := self._streams.get(key)) is not None:
            stream.add(message, log_ns - self._arrival_origin_ns)
            if key == topics.REFERENCE.key and self._armed_utc_ns is None and message.armed:
                self._armed_utc_ns = log_ns
        elif key.startswith(HEALTH):
            self._health.add(message)
        else:
            self._errors[message.service] += message.level == "error"

    def dive(self, about: dict[str, str], losses: dict[str, int]) -> RecordedDive:
        """
        Args:
            about: vehicle, link, pilot, seed, overrides.
            losses: what the recorder itself counted.
        """
        keys = [*self._streams]  # of a long dive both forms of all streams would be too much
        streams = {key: self._streams.pop(key).columns(self._origin_ns) for key in keys}
        reference = streams[topics.REFERENCE.key]
        known = np.isfinite(reference["sensor_ns"])
        valid = np.where(known, reference["sensor_ns"], reference["stamp_ns"])
        streams[topics.REFERENCE.key] = reference.with_columns({"valid_ns": valid})
        return RecordedDive(
            about=about,
            traffic=self._traffic,
            streams=streams,
            health=self._health.sums,
            losses=losses,
            holes=self._holes.found,
            vehicle_holes=self._vehicle_holes.found,
            errors=+self._errors,
            armed_utc_ns=self._armed_utc_ns,
        )


class HoleFinder:
    """Shown the time of every message, in the order in which they were recorded: when nothing at
    all was, although every service publishes its health once a second."""

    def __init__(self) -> None:
        self.found: list[tuple[int, int]] = []  # [ns]
        self._newest: int | None = None

    def see(self, log_ns: int) -> None:
        newest = self._newest
        if newest is not None and log_ns <= newest:
            return
        if newest is not None and log_ns - newest > HOLE_NS:
            self.found.append((newest, log_ns))
        self._newest = log_ns


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
