"""How good the predictions were, told by the states that arrive later."""

from collections import deque
from dataclasses import dataclass, field
from math import hypot, sqrt
from typing import NamedTuple

from messages.prediction import Miss
from messages.units import Ns

WINDOW_NS = 5_000_000_000  # [ns] of judged predictions


class Pose(NamedTuple):
    depth: float  # [m]
    heading: float  # [rad] accumulates
    north: float | None  # [m]
    east: float | None  # [m]


class JudgedPrediction(NamedTuple):
    """A prediction, and the delayed picture it was made from."""

    at: Ns  # [ns] the moment it is about
    predicted: Pose
    delayed: Pose


class SquaredErrors(NamedTuple):
    """Squares of what a guess was off by."""

    depth: float  # [m²]
    heading: float  # [rad²]
    place: float | None  # [m²]


@dataclass(slots=True)
class PredictionQuality:
    _open: deque[JudgedPrediction] = field(default_factory=deque[JudgedPrediction])
    _judged: deque[tuple[Ns, SquaredErrors, SquaredErrors]] = field(
        default_factory=deque[tuple[int, SquaredErrors, SquaredErrors]]
    )
    _before: tuple[Ns, Pose] | None = None  # the state before

    def predicted(self, judged: JudgedPrediction) -> None:
        self._open.append(judged)

    def truth(self, at: Ns, pose: Pose) -> None:
        """What the drone says of the moment `at` [ns], in order."""
        before, self._before = self._before, (at, pose)
        while self._open and self._open[0].at <= at:
            judged = self._open.popleft()
            if before is not None and before[0] <= judged.at:
                true = _between(before, (at, pose), judged.at)
                errors = _off(judged.predicted, true), _off(judged.delayed, true)
                self._judged.append((at, *errors))
        while self._judged and self._judged[0][0] < at - WINDOW_NS:
            self._judged.popleft()

    def misses(self) -> tuple[Miss | None, Miss | None]:
        """Of the predictions, and of the delayed picture."""
        if not self._judged:
            return None, None
        return (
            _miss([predicted for _, predicted, _ in self._judged]),
            _miss([delayed for _, _, delayed in self._judged]),
        )


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


def _off(judged: Pose, true: Pose) -> SquaredErrors:
    depth, heading = judged.depth - true.depth, judged.heading - true.heading
    return SquaredErrors(depth * depth, heading * heading, _place(judged, true))


def _place(judged: Pose, true: Pose) -> float | None:
    if judged.north is None or judged.east is None or true.north is None or true.east is None:
        return None
    away = hypot(judged.north - true.north, judged.east - true.east)
    return away * away


def _miss(those: list[SquaredErrors]) -> Miss:
    places = [off.place for off in those if off.place is not None]
    return Miss(
        depth=_root_mean([off.depth for off in those]),
        heading=_root_mean([off.heading for off in those]),
        place=_root_mean(places) if places else None,
    )


def _root_mean(squares: list[float]) -> float:
    return sqrt(sum(squares) / len(squares))
