"""How good the predictions were, told by the states that arrive later."""

from collections import deque
from dataclasses import dataclass, field
from math import hypot, sqrt
from typing import NamedTuple

from messages.message import Ns
from messages.prediction import Miss

WINDOW_NS = 5_000_000_000  # [ns] of judged predictions


class Pose(NamedTuple):
    depth: float  # [m]
    heading: float  # [rad] accumulates
    north: float | None  # [m]
    east: float | None  # [m]


class Guess(NamedTuple):
    """A prediction, and the delayed picture it was made from."""

    at: Ns  # [ns] the moment it is about
    predicted: Pose
    delayed: Pose


@dataclass(slots=True)
class Judge:
    _open: deque[Guess] = field(default_factory=deque[Guess])
    _judged: deque[tuple[Ns, Guess, Pose]] = field(default_factory=deque[tuple[int, Guess, Pose]])
    _before: tuple[Ns, Pose] | None = None  # the state before

    def guessed(self, guess: Guess) -> None:
        self._open.append(guess)

    def truth(self, at: Ns, pose: Pose) -> None:
        """What the drone says of the moment `at` [ns], in order."""
        before, self._before = self._before, (at, pose)
        while self._open and self._open[0].at <= at:
            guess = self._open.popleft()
            if before is not None and before[0] <= guess.at:
                self._judged.append((at, guess, _between(before, (at, pose), guess.at)))
        while self._judged and self._judged[0][0] < at - WINDOW_NS:
            self._judged.popleft()

    def misses(self) -> tuple[Miss | None, Miss | None]:
        """Of the predictions, and of the delayed picture."""
        if not self._judged:
            return None, None
        return (
            _miss([(guess.predicted, true) for _, guess, true in self._judged]),
            _miss([(guess.delayed, true) for _, guess, true in self._judged]),
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


def _miss(pairs: list[tuple[Pose, Pose]]) -> Miss:
    return Miss(
        depth=_rms([guess.depth - true.depth for guess, true in pairs]),
        heading=_rms([guess.heading - true.heading for guess, true in pairs]),
        place=_place(pairs),
    )


def _place(pairs: list[tuple[Pose, Pose]]) -> float | None:
    off = [
        hypot(guess.north - true.north, guess.east - true.east)
        for guess, true in pairs
        if guess.north is not None
        and guess.east is not None
        and true.north is not None
        and true.east is not None
    ]
    return _rms(off) if off else None


def _rms(values: list[float]) -> float:
    return sqrt(sum(value * value for value in values) / len(values))
