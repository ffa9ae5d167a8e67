"""Errors of past predictions, measured with the states that arrive later."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, sqrt
from typing import NamedTuple

from messages.prediction import Miss
from messages.units import Ns
from services.marine.summation import plain_sum

WINDOW_NS = 5_000_000_000  # [ns] of judged predictions


class Pose(NamedTuple):
    depth: float  # [m]
    heading: float  # [rad] accumulates
    north: float | None  # [m]
    east: float | None  # [m]


class JudgedPrediction(NamedTuple):
    """A prediction, and the delayed state it was made from."""

    at: Ns  # [ns] the time it predicts
    predicted: Pose
    delayed: Pose


Errors = tuple[float, float, float | None]  # [m, rad, m] depth, heading, place


@dataclass(slots=True)
class PredictionQuality:
    _pending: deque[JudgedPrediction] = field(default_factory=deque[JudgedPrediction])
    _judged: deque[tuple[Ns, Errors, Errors]] = field(
        default_factory=deque[tuple[int, Errors, Errors]]
    )
    _before: tuple[Ns, Pose] | None = None  # the previous state

    def predicted(self, judged: JudgedPrediction) -> None:
        self._pending.append(judged)

    def truth(self, at: Ns, pose: Pose) -> None:
        """The drone's state at `at` [ns]; call in order of time."""
        before, self._before = self._before, (at, pose)
        while self._pending and self._pending[0].at <= at:
            judged = self._pending.popleft()
            if before is not None and before[0] <= judged.at:
                true = _between(before, (at, pose), judged.at)
                errors = _errors(judged.predicted, true), _errors(judged.delayed, true)
                self._judged.append((at, *errors))
        while self._judged and self._judged[0][0] < at - WINDOW_NS:
            self._judged.popleft()

    def misses(self) -> tuple[Miss | None, Miss | None]:
        """Rms errors of the predictions, and of the delayed state."""
        if not self._judged:
            return None, None
        return _rms([p for _, p, _ in self._judged]), _rms([d for _, _, d in self._judged])


def _between(before: tuple[Ns, Pose], after: tuple[Ns, Pose], at: Ns) -> Pose:
    (t0, p0), (t1, p1) = before, after
    share = (at - t0) / (t1 - t0) if t1 > t0 else 1.0

    def mixed(a: float | None, b: float | None) -> float | None:
        return None if a is None or b is None else a + share * (b - a)

    depth = p0.depth + share * (p1.depth - p0.depth)
    heading = p0.heading + share * (p1.heading - p0.heading)
    return Pose(depth, heading, mixed(p0.north, p1.north), mixed(p0.east, p1.east))


def _errors(judged: Pose, true: Pose) -> Errors:
    (depth, heading, north, east), (d, h, n, e) = judged, true
    if north is None or east is None or n is None or e is None:
        return depth - d, heading - h, None
    return depth - d, heading - h, hypot(north - n, east - e)


def _rms(errors: Sequence[Errors]) -> Miss:
    places = [place for _, _, place in errors if place is not None]
    return Miss(
        depth=_root_mean([depth for depth, _, _ in errors]),
        heading=_root_mean([heading for _, heading, _ in errors]),
        place=_root_mean(places) if places else None,
    )


def _root_mean(errors: Sequence[float]) -> float:
    return sqrt(plain_sum(e * e for e in errors) / len(errors))
