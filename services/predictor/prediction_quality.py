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


class SquaredErrors(NamedTuple):
    """Squared errors of a prediction or of a delayed state."""

    depth: float  # [m²]
    heading: float  # [rad²]
    place: float | None  # [m²]


@dataclass(slots=True)
class PredictionQuality:
    _pending: deque[JudgedPrediction] = field(default_factory=deque[JudgedPrediction])
    _judged: deque[tuple[Ns, SquaredErrors, SquaredErrors]] = field(
        default_factory=deque[tuple[int, SquaredErrors, SquaredErrors]]
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
        _, predicted, delayed = zip(*self._judged, strict=True)
        return _miss(predicted), _miss(delayed)


def _between(before: tuple[Ns, Pose], after: tuple[Ns, Pose], at: Ns) -> Pose:
    (t0, p0), (t1, p1) = before, after
    share = (at - t0) / (t1 - t0) if t1 > t0 else 1.0
    return Pose(
        p0.depth + share * (p1.depth - p0.depth),
        p0.heading + share * (p1.heading - p0.heading),
        _mix(p0.north, p1.north, share),
        _mix(p0.east, p1.east, share),
    )


def _mix(a: float | None, b: float | None, share: float) -> float | None:
    return None if a is None or b is None else a + share * (b - a)


def _errors(judged: Pose, true: Pose) -> SquaredErrors:
    depth, heading = judged.depth - true.depth, judged.heading - true.heading
    return SquaredErrors(depth * depth, heading * heading, _place(judged, true))


def _place(judged: Pose, true: Pose) -> float | None:
    if judged.north is None or judged.east is None or true.north is None or true.east is None:
        return None
    distance = hypot(judged.north - true.north, judged.east - true.east)
    return distance * distance


def _miss(errors: Sequence[SquaredErrors]) -> Miss:
    depths, headings, maybe_places = zip(*errors, strict=True)
    places = [place for place in maybe_places if place is not None]
    return Miss(
        depth=_root_mean(depths),
        heading=_root_mean(headings),
        place=_root_mean(places) if places else None,
    )


def _root_mean(squares: Sequence[float]) -> float:
    return sqrt(plain_sum(squares) / len(squares))
