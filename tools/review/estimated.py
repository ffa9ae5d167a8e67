"""Lindy's estimation over the recorded sensors, as `lindy replay --through estimation` runs it, and
how well each measurement fitted it."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from messages import topics
from messages.aiding import AidSource
from messages.events import sentence
from messages.state import VehicleState
from services.runtime.hosts.loop import rare_collections
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.recordings.columns import Array, Gathering, StreamFigures
from tools.recordings.mcap_records import nowhere
from tools.recordings.progress import reading
from tools.replay.on_board import OnBoard
from tools.replay.source import ReplaySource
from tools.review.recorded import STATE, Track, track

ESTIMATION = "estimation"
FAMILY = topics.AIDING.key[:-1]
VEHICLE_STATE: msgspec.json.Decoder[VehicleState] = msgspec.json.Decoder(VehicleState)
AIDING: msgspec.json.Decoder[AidSource] = msgspec.json.Decoder(AidSource)
COMPARED = StreamFigures(
    topics.AIDING, ("stamp_ns", "samples", "innovation", "spread", "variance", "rejected")
)
TOGETHER_S = 0.5  # [s] innovations further apart say nothing of each other


MEANS = {
    "hull": "level acceleration by thrust and drag",
    "rest": "gyroscope's bias at rest",
}


class Innovations(NamedTuple):
    """One aid source over time; arrays (n,) of its messages, at most ten a second."""

    t: Array  # [s] since the recording began
    samples: Array
    innovation: Array  # [unit] mean; NaN: no sample was compared
    square: Array  # [unit²] mean of the innovations squared
    variance: Array  # [unit²] expected of one innovation
    rejected: Array  # [-] share of its samples
    reasons: Counter[str]  # event: messages that name it
    verdicts: Counter[str]  # event: messages in which the sensor was not used

    @property
    def lag_one(self) -> float | None:
        """[-] Correlation of each innovation with the next, 0 of white ones. None: too few."""
        e, t = self.innovation, self.t
        near = np.isfinite(e[:-1]) & np.isfinite(e[1:]) & (np.diff(t) < TOGETHER_S)
        if np.count_nonzero(near) < 20:
            return None
        square = float(np.mean(e[np.isfinite(e)] ** 2))
        return round(float(np.mean(e[:-1][near] * e[1:][near])) / square, 3) if square else None

    @property
    def spread_ratio(self) -> float | None:
        """[-] Innovations over what was expected of them, both root mean square; 1 as stated."""
        known, count = np.isfinite(self.innovation), self.samples
        if not known.any():
            return None
        expected = float(np.average(self.variance[known], weights=count[known]))
        square = float(np.average(self.square[known], weights=count[known]))
        return round(float(np.sqrt(square / expected)), 3) if expected > 0.0 else None

    def measurement(self, name: str) -> "Measurement":
        events = dict([*self.reasons.most_common(), *self.verdicts.most_common()])
        return Measurement(
            name=name,
            samples=int(self.samples.sum()),
            rejected=round(float(np.average(self.rejected, weights=self.samples)), 4),
            lag_one=self.lag_one,
            spread_ratio=self.spread_ratio,
            not_used=round(self.verdicts.total() / len(self.t), 4),
            reasons=dict(self.reasons.most_common()),
            words=[sentence(event) for event in events],  # the commonest first
        )


class Measurement(msgspec.Struct, kw_only=True, frozen=True):
    """One measured quantity over the dive."""

    name: str
    samples: int
    rejected: float  # [-] share of all samples
    lag_one: float | None  # [-] correlation of each innovation with the next; None: too few
    spread_ratio: float | None  # [-] innovations over what was expected of them; None: none
    not_used: float  # [-] share of its messages in which the sensor was not used
    reasons: dict[str, int]  # event: messages with samples that were rejected for it
    words: list[str]  # the same events as sentences


def in_words(name: str) -> str:
    """What a row is called on the page."""
    words, means = name.replace("_", " "), MEANS.get(name.partition("_")[0])
    return f"{words} ({means})" if means else words


class Estimated(NamedTuple):
    track: Track | None  # None: no state at all
    innovations: dict[str, Innovations]
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
    with source.stack() as stack, rare_collections():
        stack.overrides.extend(overrides)
        stack.check(known_tables(services), recorded=True)
        replay = OnBoard(source, (ESTIMATION,), services, stack)
        heard = _Heard(replay, source.origin_ns - source.utc_offset_ns)
        with reading("estimating", source.recording.size) as bar:
            source.recording.advance = heard.draining(bar)
            replay.run(source.span[1])
        heard.drain(keep=0)
        source.recording.advance = nowhere
    return heard.found()


class _Heard:
    """Takes what is published out of a replay while it runs: of a dive of hours it is too much to
    keep."""

    def __init__(self, replay: OnBoard, begin_ns: int) -> None:
        self._replay, self._begin = replay, begin_ns
        self._states = Gathering(STATE)
        self._sources: dict[str, Gathering] = {}
        self._reasons: dict[str, Counter[str]] = {}
        self._verdicts: dict[str, Counter[str]] = {}
        self._first_ns: int | None = None
        self._last_ns = self._ran_ns = begin_ns
        self._running = False
        self._blocked, self._troubles = "", Counter[str]()

    def draining(self, bar: Callable[[int], None]) -> Callable[[int], None]:
        def advance(read: int) -> None:
            bar(read)
            self.drain(keep=1)

        return advance

    def drain(self, keep: int) -> None:
        """`keep`: newest messages that the replay itself still asks for."""
        for key in self._replay.outputs.keys:
            told = self._replay.outputs.of(key)
            taken = told[: len(told) - keep]
            del told[: len(taken)]
            for each in taken:
                if key == topics.STATE.key:
                    self._state(VEHICLE_STATE.decode(each.data))
                elif key.startswith(FAMILY):
                    self._aiding(key.removeprefix(FAMILY), AIDING.decode(each.data))
        self._replay.recorded.clear()

    def _state(self, state: VehicleState) -> None:
        self._states.add(state)
        self._first_ns = state.sensor_ns if self._first_ns is None else self._first_ns
        self._last_ns = state.sensor_ns
        if state.phase == "running" and not self._running:
            self._running, self._ran_ns = True, state.sensor_ns
        self._blocked = str(state.blocked_by or self._blocked) if not self._running else ""
        self._troubles.update(state.troubles or ())

    def _aiding(self, name: str, source: AidSource) -> None:
        self._sources.setdefault(name, Gathering(COMPARED)).add(source)
        self._reasons.setdefault(name, Counter()).update(source.reasons)
        self._verdicts.setdefault(name, Counter()).update(filter(None, [source.verdict]))

    def found(self) -> Estimated:
        until = self._ran_ns if self._running else self._last_ns
        first = self._begin if self._first_ns is None else self._first_ns
        return Estimated(
            track=track(self._states.columns(self._begin)),
            innovations={name: self._innovations(name) for name in self._sources},
            calibrating_s=max(0.0, (until - first) / 1e9),
            blocked_by=self._blocked,
            troubles=self._troubles,
        )

    def _innovations(self, name: str) -> Innovations:
        columns = self._sources[name].columns(self._begin)
        innovation = columns["innovation"]
        return Innovations(
            t=columns["stamp_ns"] / 1e9,
            samples=columns["samples"],
            innovation=innovation,
            square=innovation**2 + np.nan_to_num(columns["spread"]) ** 2,
            variance=columns["variance"],
            rejected=columns["rejected"],
            reasons=self._reasons[name],
            verdicts=self._verdicts[name],
        )
