"""Curves that need every message, not only those that become points: the jerk that the vehicle
feels beside the one that its reference asks for, and how often its thrusters start and reverse.

Both jerks run through the same low-pass, so that they can be compared: a Butterworth filter of
fourth order with its edge at 2 Hz, the band of the report's `smoothness`; it delays both by 0.2 s.
Above that edge the accelerometer's own noise counts for more than what the vehicle does. The
sections of the filter give the derivative of what they let through, so that no noisy sample is
differentiated (trapezoidal state-variable filter: Zavalishin, The Art of VA Filter Design, 2018,
chapter 4).
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from math import cos, nan, pi, tan
from typing import Any

from messages import topics
from messages.message import Estimate, Message
from messages.topic import AnyTopic
from services.visualizer.batch import CurveColumns
from services.visualizer.curves import AXES, DEG, ESTIMATE, REFERENCE, Look

BAND = 2.0  # [Hz]
DAMPING = (2.0 * cos(pi / 8), 2.0 * cos(3 * pi / 8))  # [-] of the sections: 1 / Q
LONGEST_NS = 150_000_000  # [ns] a longer gap between two samples ends the line
SETTLE_NS = 700_000_000  # [ns] after a beginning, until the filter has forgotten it
SPACING_NS = 80_000_000  # [ns] between two points: six in a period at the edge
WINDOW = 60  # [s] over which starts and reversals are counted
SECOND = 1_000_000_000  # [ns]
FELT, WANTED = ("felt", ESTIMATE, 3.0), ("reference", REFERENCE, 1.5)  # name, colour, width
CHANGES = Look("thruster_changes", ("starts", "reversals"), (AXES[1], AXES[3]), 2.0)


@dataclass(slots=True)
class Section:
    """A low-pass of second order."""

    damping: float  # [-]
    _band: float = 0.0  # states of the two integrators
    _low: float = 0.0

    def begin(self, value: float) -> None:
        """At rest at this value."""
        self._band, self._low = 0.0, value

    def step(self, value: float, dt: float) -> tuple[float, float]:
        """What it lets through, and the derivative of that, `dt` [s] > 0 after the last sample."""
        g = tan(pi * BAND * dt)
        band = (self._band + g * (value - self._low)) / (1.0 + g * (g + self.damping))
        low = self._low + g * band
        self._band, self._low = 2.0 * band - self._band, 2.0 * low - self._low
        return low, 2.0 * g / dt * band


@dataclass(slots=True)
class LowPassedJerk:
    """Of samples of an acceleration, or of a rate."""

    of_rate: bool = False
    jerk: float | None = None  # unit / s³; None: not known
    _first: Section = field(default_factory=lambda: Section(DAMPING[0]))
    _second: Section = field(default_factory=lambda: Section(DAMPING[1]))
    _at: int | None = None  # [ns] of the newest sample
    _begun: int = 0  # [ns]

    def step(self, value: float | None, at: int) -> None:
        """Take in a sample of time `at` [ns]; None: it is not known."""
        before, self._at = self._at, None if value is None else at
        if value is None:
            self.jerk = None
        elif before is None or not 0 <= at - before <= LONGEST_NS:
            self.jerk, self._begun = None, at
            self._first.begin(value)
            self._second.begin(0.0 if self.of_rate else value)
        elif at > before:
            dt = (at - before) / 1e9
            low, slope = self._first.step(value, dt)
            _, jerk = self._second.step(slope if self.of_rate else low, dt)
            self.jerk = jerk if at - self._begun > SETTLE_NS else None


@dataclass(slots=True)
class JerkLine:
    """One line of a plot."""

    topic: AnyTopic
    path: str
    read: Callable[[Any], Estimate | float]  # acceleration or rate
    unit: float
    filter: LowPassedJerk = field(default_factory=LowPassedJerk)
    _drawn: int | None = None  # [ns] of its newest point; None: the line has ended

    def points(self, messages: Sequence[Any], times: Sequence[int]) -> Iterator[tuple[int, float]]:
        """Of these messages, whose times are [ns] since the dive began."""
        for m, time in zip(messages, times, strict=True):
            value = self.read(m)
            if isinstance(value, Estimate):
                value = value.value if value.valid else None
            self.filter.step(value, m.stamp_ns if m.sensor_ns is None else m.sensor_ns)
            if (jerk := self.filter.jerk) is None:
                if self._drawn is not None:
                    self._drawn = None
                    yield time, nan
            elif self._drawn is None or not self._drawn <= time < self._drawn + SPACING_NS:
                self._drawn = time
                yield time, self.unit * jerk


class JerkLines:
    """All four lines: of heave [m/s³] and of yaw [°/s³], felt and asked for."""

    def __init__(self) -> None:
        state, wanted = topics.STATE, topics.REFERENCE
        self._lines = [
            JerkLine(state, "jerk_heave/felt", lambda m: m.depth_acceleration, 1.0),
            JerkLine(wanted, "jerk_heave/reference", lambda m: m.depth.acceleration, 1.0),
            JerkLine(state, "jerk_yaw/felt", lambda m: m.yaw_rate, DEG, LowPassedJerk(True)),
            JerkLine(wanted, "jerk_yaw/reference", lambda m: m.heading.acceleration, DEG),
        ]

    def hear(
        self, topic: AnyTopic, messages: Sequence[Message], times: Sequence[int]
    ) -> list[CurveColumns]:
        """What these messages of a topic add."""
        added = list[CurveColumns]()
        for line in self._lines:
            if line.topic is topic and (points := list(line.points(messages, times))):
                rows: list[Sequence[float]] = [(jerk,) for _, jerk in points]
                added.append(CurveColumns(line.path, [time for time, _ in points], rows))
        return added


class ThrusterChanges:
    """Counts as the report does. A start: from no thrust to some. A reversal: some thrust in
    the other direction than the last. Kept are the counts of each second of the last minute, of all
    thrusters together."""

    def __init__(self) -> None:
        self._thrust: Sequence[float] | None = None  # [N] of the newest command
        self._ahead: dict[int, bool] = {}  # the direction in which each thruster turned last
        self._second: int | None = None  # that is being counted, since the dive began
        self._counts = deque([[0, 0]], maxlen=WINDOW)  # starts and reversals of each second

    def hear(self, messages: Sequence[Any], times: Sequence[int]) -> list[CurveColumns]:
        """A point for each second that has ended; `times` [ns] since the dive began."""
        at, rows = list[int](), list[Sequence[float]]()
        for message, time in zip(messages, times, strict=True):
            second = time // SECOND
            if self._second is not None and second > self._second:
                at.append(time)
                rows.append([float(sum(kind)) for kind in zip(*self._counts, strict=True)])
                for _ in range(min(second - self._second, WINDOW)):
                    self._counts.append([0, 0])
            self._second = second
            self._count(message.thrust)
        return [CurveColumns(CHANGES.path, at, rows)] if at else []

    def _count(self, thrust: Sequence[float]) -> None:
        now = self._counts[-1]
        before, self._thrust = self._thrust, thrust
        for k, newton in enumerate(thrust):
            if newton == 0.0:
                continue
            now[0] += before is not None and before[k] == 0.0
            now[1] += self._ahead.get(k, newton > 0.0) != (newton > 0.0)
            self._ahead[k] = newton > 0.0


LOOKS = (
    *(
        Look(f"jerk_{axis}/{name}", (name,), (colour,), width)
        for axis in ("heave", "yaw")
        for name, colour, width in (FELT, WANTED)
    ),
    CHANGES,
)
