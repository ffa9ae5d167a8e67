"""Lindy's estimation over the recorded sensors, as `lindy replay --through estimation` runs it, and
how well each measurement fitted it."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import msgspec
import numpy as np

from messages import topics
from messages.events import row_of, sentence
from messages.message import Message
from messages.state import AidSource, VehicleState
from services.runtime.hosts.loop import rare_collections
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.recordings.columns import Array, Gathering, StreamFigures
from tools.recordings.progress import reading
from tools.replay.on_board import OnBoard
from tools.replay.source import ReplaySource
from tools.review.recorded import STATE, Track, track
from tools.review.section import OURS, ReviewSection, figure, image, paragraph, table, thinned

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ESTIMATION = "estimation"
FAMILY = topics.AIDING.key[:-1]
COMPARED = StreamFigures(topics.AIDING, ("stamp_ns", "samples", "rejected"))
MEANS = {
    "hull": "level acceleration by thrust and drag",
    "rest": "gyroscope's bias at rest",
}


class AidUse(NamedTuple):
    """One aid source over time; arrays (n,) of its messages, at most ten a second."""

    t: Array  # [s] since the recording began
    samples: Array
    rejected: Array  # [-] share of its samples
    reasons: Counter[str]  # event: messages that name it
    verdicts: Counter[str]  # event: messages in which the sensor was not used

    def measurement(self, name: str) -> "Measurement":
        events = dict([*self.reasons.most_common(), *self.verdicts.most_common()])
        return Measurement(
            name=name,
            samples=int(self.samples.sum()),
            rejected=round(float(np.average(self.rejected, weights=self.samples)), 4),
            not_used=round(self.verdicts.total() / len(self.t), 4),
            reasons=dict(self.reasons.most_common()),
            words=[sentence(event) for event in events],  # the commonest first
        )


class Measurement(msgspec.Struct, kw_only=True, frozen=True):
    """One measured quantity over the dive."""

    name: str
    samples: int
    rejected: float  # [-] share of all samples
    not_used: float  # [-] share of its messages in which the sensor was not used
    reasons: dict[str, int]  # event: messages with samples that were rejected for it
    words: list[str]  # the same events as sentences


def in_words(name: str) -> str:
    """What a row is called on the page."""
    words, means = name.replace("_", " "), MEANS.get(name.partition("_")[0])
    return f"{words} ({means})" if means else words


class Estimated(NamedTuple):
    track: Track | None  # None: no state at all
    aids: dict[str, AidUse]
    calibrating_s: float  # [s] until it ran; the whole time, where it never did
    blocked_by: str  # event that kept the calibration from ending, last; empty: none
    troubles: Counter[str]  # event: states that name it

    @property
    def runs(self) -> bool:
        return self.track is not None and bool(np.isfinite(self.track.depth).any())


def estimate(source: ReplaySource, overrides: Sequence[str] = ()) -> Estimated:
    """
    Args:
        overrides: key.path=value into the vehicle file.

    Raises:
        LindyError: settings that are refused, or nothing in the recording.
    """
    services = Registry.read()
    heard = _Heard(source.origin_ns - source.utc_offset_ns)
    with source.stack() as stack, rare_collections():
        stack.overrides.extend(overrides)
        stack.check(known_tables(services), recorded=True)
        replay = OnBoard(source, (ESTIMATION,), services, stack, heard.add)
        with reading("estimating", source.recording.size) as source.recording.advance:
            replay.run(source.span[1])
    return heard.found()


class _Heard:
    """What is published in a replay."""

    def __init__(self, begin_ns: int) -> None:
        self._begin = begin_ns
        self._states = Gathering(STATE)
        self._sources: dict[str, Gathering] = {}
        self._reasons: dict[str, Counter[str]] = {}
        self._verdicts: dict[str, Counter[str]] = {}
        self._first_ns: int | None = None
        self._last_ns = self._ran_ns = begin_ns
        self._running = False
        self._blocked, self._troubles = "", Counter[str]()

    def add(self, key: str, message: Message) -> None:
        if isinstance(message, VehicleState):
            self._state(message)
        elif isinstance(message, AidSource):
            name = key.removeprefix(FAMILY)
            self._sources.setdefault(name, Gathering(COMPARED)).add(message)
            self._reasons.setdefault(name, Counter()).update(message.reasons)
            self._verdicts.setdefault(name, Counter()).update(filter(None, [message.verdict]))

    def _state(self, state: VehicleState) -> None:
        self._states.add(state)
        self._first_ns = state.sensor_ns if self._first_ns is None else self._first_ns
        self._last_ns = state.sensor_ns
        if state.phase == "running" and not self._running:
            self._running, self._ran_ns = True, state.sensor_ns
        self._blocked = str(state.blocked_by or self._blocked) if not self._running else ""
        self._troubles.update(state.troubles or ())

    def found(self) -> Estimated:
        until = self._ran_ns if self._running else self._last_ns
        first = self._begin if self._first_ns is None else self._first_ns
        return Estimated(
            track=track(self._states.columns(self._begin)),
            aids={name: self._use(name) for name in self._sources},
            calibrating_s=max(0.0, (until - first) / 1e9),
            blocked_by=self._blocked,
            troubles=self._troubles,
        )

    def _use(self, name: str) -> AidUse:
        columns = self._sources[name].columns(self._begin)
        return AidUse(
            t=columns["stamp_ns"] / 1e9,
            samples=columns["samples"],
            rejected=columns["rejected"],
            reasons=self._reasons[name],
            verdicts=self._verdicts[name],
        )


class MeasurementSection(ReviewSection):
    key, heading = "measurements", "What was rejected"

    def __init__(self, estimated: Estimated) -> None:
        """Where the estimation never ran, nothing was compared; its own section says why."""
        self._found = estimated.aids if estimated.runs else {}
        never = "Nothing was compared, because the estimation never ran."
        super().__init__([] if self._found else [never])
        self.measurements = [each.measurement(name) for name, each in self._found.items()]

    def sentences(self) -> Iterator[str]:
        rejected = [
            f"{in_words(m.name)} {m.rejected:.0%}{f': {plain(m.words[0])}' if m.words else ''}"
            for m in self.measurements if m.rejected > 0.01
        ]  # fmt: skip
        if rejected:
            yield f"Rejected measurements: {'; '.join(rejected)}."
            mostly = (
                row_of(event).to_do
                for m in self.measurements if m.rejected > 0.5 for event in m.reasons
            )  # fmt: skip
            yield from (f"What helps: {to_do}." for to_do in dict.fromkeys(mostly) if to_do)
        elif self.measurements:
            yield "Nearly all measurements were used."

    def html(self) -> str:
        if not self.measurements:
            return ""
        rows = [
            (in_words(m.name), m.samples, m.rejected, m.not_used, "; ".join(m.words))
            for m in self.measurements
        ]
        heads = ("measured", "samples", "rejected", "not used", "why")
        return (
            paragraph("The share of each measurement that was used, over time: 1 all, 0 none.")
            + image(self._used(), "Share of each measurement used over time")
            + table(heads, rows, words=1)
        )

    def _used(self) -> "Figure":
        """The share of each measurement's samples that was used."""
        drawn = figure(0.9 + 0.75 * len(self._found))
        panels = np.atleast_1d(drawn.subplots(len(self._found), 1, sharex=True))
        for panel, (name, each) in zip(panels, self._found.items(), strict=True):
            t, share = thinned(each.t, 1.0 - each.rejected)
            panel.fill_between(t, share, step="mid", color=OURS, alpha=0.5, linewidth=0)
            panel.set_ylim(0.0, 1.05)
            panel.set_ylabel(
                name.replace("_", "\n"), rotation=0, ha="right", va="center", fontsize="small"
            )
            panel.grid(alpha=0.3)
        panels[-1].set_xlabel("time since the recording began [s]")
        return drawn


def plain(text: str) -> str:
    """Without the keys that name a sensor for programs."""
    return re.sub(r" \(sensor/\w+\)", "", text)
