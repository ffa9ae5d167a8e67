"""The jerk that the vehicle feels beside the one that its reference asks for, while it flies.

Both run through the same low-pass, so that they can be compared: a Butterworth filter of fourth
order with its edge at 2 Hz, the band of the report's `smoothness`; it delays both by 0.2 s. Above
that edge the accelerometer's own noise counts for more than what the vehicle does. The sections of
the filter give the derivative of what they let through, so that no noisy sample is differentiated
(trapezoidal state-variable filter: Zavalishin, The Art of VA Filter Design, 2018, chapter 4).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from math import cos, degrees, nan, pi, tan
from typing import Any

from messages import topics
from messages.message import Estimate, Message
from messages.topic import AnyTopic
from services.visualizer.batch import CurveColumns
from services.visualizer.curve import ESTIMATE, REFERENCE, Look

BAND = 2.0  # [Hz]
DAMPING = (2.0 * cos(pi / 8), 2.0 * cos(3 * pi / 8))  # [-] of the sections: 1 / Q
LONGEST_NS = 150_000_000  # [ns] a longer gap between two samples ends the line
SETTLE_NS = 700_000_000  # [ns] after a beginning, until the filter has forgotten it
SPACING_NS = 80_000_000  # [ns] between two points: six in a period at the edge


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

    of_rate: bool
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

    look: Look
    topic: AnyTopic
    read: Callable[[Any], float | None]  # acceleration or rate
    unit: Callable[[float], float]
    filter: LowPassedJerk
    _drawn: int | None = None  # [ns] of its newest point; None: the line has ended

    def hear(self, messages: Sequence[Any], times: Sequence[int]) -> CurveColumns | None:
        """Its points of these messages, whose times are [ns] since the dive began."""
        points = list(self._points(messages, times))
        if not points:
            return None
        return CurveColumns(self.look.path, [t for t, _ in points], [(jerk,) for _, jerk in points])

    def _points(self, messages: Sequence[Any], times: Sequence[int]) -> Iterator[tuple[int, float]]:
        for m, time in zip(messages, times, strict=True):
            self.filter.step(self.read(m), m.stamp_ns if m.sensor_ns is None else m.sensor_ns)
            if (jerk := self.filter.jerk) is None:
                if self._drawn is not None:
                    self._drawn = None
                    yield time, nan
            elif self._drawn is None or not self._drawn <= time < self._drawn + SPACING_NS:
                self._drawn = time
                yield time, self.unit(jerk)


class JerkLines:
    """All four lines: of heave [m/s³] and of yaw [°/s³], felt and asked for."""

    def __init__(self) -> None:
        self._lines = [
            _line("heave", topics.STATE, lambda m: _known(m.depth_acceleration)),
            _line("heave", topics.REFERENCE, lambda m: m.depth.acceleration),
            _line("yaw", topics.STATE, lambda m: _known(m.yaw_rate), degrees, of_rate=True),
            _line("yaw", topics.REFERENCE, lambda m: m.heading.acceleration, degrees),
        ]

    @property
    def looks(self) -> list[Look]:
        return [line.look for line in self._lines]

    def hear(
        self, topic: AnyTopic, messages: Sequence[Message], times: Sequence[int]
    ) -> list[CurveColumns]:
        """What these messages of a topic add."""
        added = [line.hear(messages, times) for line in self._lines if line.topic is topic]
        return [columns for columns in added if columns is not None]


def _line(
    axis: str,
    topic: AnyTopic,
    read: Callable[[Any], float | None],
    unit: Callable[[float], float] = float,
    *,
    of_rate: bool = False,
) -> JerkLine:
    name, colour, width = "felt", ESTIMATE, 3.0  # the other is drawn on top of it
    if topic is topics.REFERENCE:
        name, colour, width = "reference", REFERENCE, 1.5
    look = Look(f"jerk_{axis}/{name}", (name,), (colour,), width)
    return JerkLine(look, topic, read, unit, LowPassedJerk(of_rate))


def _known(estimate: Estimate) -> float | None:
    return estimate.value if estimate.valid else None
