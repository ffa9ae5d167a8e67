"""What an axis has learnt over a longer time, and what of it is from before a fault.

A sensor that goes wrong is found out some seconds later. Until then the axis learns from it, so
what it learnt last cannot be relied on.
"""

from collections import deque
from dataclasses import dataclass, field
from statistics import median

SETTLES = 1.0  # [s] after a motion, while what is learnt is still of that motion
BLOCK = 1.0  # [s] of learning, of which the mean is kept
KEPT = 45  # blocks
DOUBTED = 15  # newest blocks, not used if there are enough older ones: longer than any recognition
SHARE = 3  # … and at most one in so many, early in a dive


def _blocks() -> deque[float]:
    return deque(maxlen=KEPT)


@dataclass(slots=True)
class LastingValue:
    """A learnt force [N] or moment [N m] of a vehicle at rest. Time counts while there is
    learning."""

    _blocks: deque[float] = field(default_factory=_blocks)
    _rested: float = 0.0  # [s] since the last motion
    _sum: float = 0.0  # [N s] or [N m s] of this block
    _seconds: float = 0.0  # [s] in it

    @property
    def trusted(self) -> float:
        """[N] or [N m] Median of the older blocks; zero before there are any."""
        count = len(self._blocks)
        older = list(self._blocks)[: count - min(DOUBTED, count // SHARE)]
        return median(older) if older else 0.0

    def add(self, value: float, dt: float) -> None:
        """Learnt now at rest, `dt` [s] after the last one."""
        self._rested += dt
        if self._rested < SETTLES:
            return
        self._sum += value * dt
        self._seconds += dt
        if self._seconds >= BLOCK:
            self._blocks.append(self._sum / self._seconds)
            self._sum = self._seconds = 0.0

    def move(self) -> None:
        """The vehicle is not at rest."""
        self._rested = self._sum = self._seconds = 0.0

    def forget(self) -> None:
        self.move()
        self._blocks.clear()
