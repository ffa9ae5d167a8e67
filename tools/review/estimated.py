"""Lindy's estimation over the recorded sensors, as `lindy replay --through estimation` runs it."""

from array import array
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from messages import topics
from messages.aiding import AidSource
from messages.state import VehicleState
from services.runtime.hosts.garbage_collection import rare_collections
from services.runtime.hosts.registry import Registry
from tools.checks import known_tables
from tools.recordings.columns import Array
from tools.recordings.mcap_records import nowhere
from tools.recordings.progress import reading
from tools.replay.on_board import OnBoard
from tools.replay.source import ReplaySource
from tools.review.track import Track, TrackRows

ESTIMATION = "estimation"
FAMILY = topics.AIDING.key[:-1]
STATE: msgspec.json.Decoder[VehicleState] = msgspec.json.Decoder(VehicleState)
AIDING: msgspec.json.Decoder[AidSource] = msgspec.json.Decoder(AidSource)
TOGETHER_S = 0.5  # [s] innovations further apart say nothing of each other


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
    unit: str

    @property
    def share_rejected(self) -> float:
        """[-] Of all samples."""
        return float(np.average(self.rejected, weights=self.samples))

    @property
    def lag_one(self) -> float | None:
        """[-] Correlation of each innovation with the next, 0 of white ones. None: too few."""
        e, t = self.innovation, self.t
        near = np.isfinite(e[:-1]) & np.isfinite(e[1:]) & (np.diff(t) < TOGETHER_S)
        if np.count_nonzero(near) < 20:
            return None
        square = float(np.mean(e[np.isfinite(e)] ** 2))
        return float(np.mean(e[:-1][near] * e[1:][near])) / square if square > 0.0 else None

    @property
    def spread_ratio(self) -> float | None:
        """[-] Innovations over what was expected of them, both root mean square; 1 as stated."""
        known, count = np.isfinite(self.innovation), self.samples
        if not known.any():
            return None
        expected = float(np.average(self.variance[known], weights=count[known]))
        square = float(np.average(self.square[known], weights=count[known]))
        return float(np.sqrt(square / expected)) if expected > 0.0 else None


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
        self._track = TrackRows(begin_ns)
        self._innovations: dict[str, _InnovationRows] = {}
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
            if key == topics.STATE.key:
                for each in taken:
                    self._state(STATE.decode(each.data))
            elif key.startswith(FAMILY):
                rows = self._innovations.setdefault(key.removeprefix(FAMILY), _InnovationRows())
                for each in taken:
                    rows.add(AIDING.decode(each.data), self._begin)
        self._replay.recorded.clear()

    def _state(self, state: VehicleState) -> None:
        self._track.add(state)
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
            track=self._track.track() if self._track.count else None,
            innovations={name: rows.found() for name, rows in self._innovations.items()},
            calibrating_s=max(0.0, (until - first) / 1e9),
            blocked_by=self._blocked,
            troubles=self._troubles,
        )


class _InnovationRows:
    def __init__(self) -> None:
        self._rows = array("d")
        self._reasons, self._verdicts = Counter[str](), Counter[str]()
        self._unit = ""

    def add(self, source: AidSource, begin_ns: int) -> None:
        nan, s = float("nan"), source
        self._unit = s.unit
        self._reasons.update(s.reasons)
        if s.verdict is not None:
            self._verdicts[s.verdict] += 1
        innovation = nan if s.innovation is None else s.innovation
        square = innovation**2 + (s.spread or 0.0) ** 2
        variance = nan if s.variance is None else s.variance
        at = (s.stamp_ns - begin_ns) / 1e9
        self._rows.extend((at, s.samples, innovation, square, variance, s.rejected))

    def found(self) -> Innovations:
        t, samples, innovation, square, variance, rejected = np.asarray(self._rows).reshape(-1, 6).T
        return Innovations(
            t, samples, innovation, square, variance, rejected,
            self._reasons, self._verdicts, self._unit,
        )  # fmt: skip
