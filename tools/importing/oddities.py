"""What was odd in a log: counted, with the first time and the worst of each."""

from statistics import median

import msgspec
import numpy as np
from numpy.typing import ArrayLike

from messages.units import Ns

SHORTEST_GAP_S = 0.25  # [s] less is jitter
GAP_PERIODS = 10  # a pause of so many usual periods is a gap
LEARNT = 50  # periods from which the usual one is taken


class Oddity(msgspec.Struct, kw_only=True):
    """One kind of oddity in one of our streams."""

    stream: str
    what: str
    count: int = 0
    first_s: float  # [s] since the log began
    most: float | None = None  # of the worst, in the unit that `what` says

    @property
    def in_words(self) -> str:
        """`sensor/imu: gap: 3, the first at 12.4 s, at most 0.8 s`"""
        before, _, unit = self.what.partition(" [")
        unit, _, after = unit.partition("]")
        times = f"{self.count}, the first at {self.first_s:.1f} s"
        worst = "" if self.most is None else f", at most {self.most:g} {unit}".rstrip()
        return f"{self.stream}: {before}{after}: {times}{worst}"


class Oddities:
    """Counts what is told."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], Oddity] = {}

    def tell(self, stream: str, what: str, at_s: ArrayLike, sizes: ArrayLike = ()) -> None:
        """
        Args:
            at_s: (n,) [s] since the log began.
            sizes: (n,) how bad, in the unit that `what` says; empty: that is not told.
        """
        times = np.atleast_1d(np.asarray(at_s, float))
        if not len(times):
            return
        first = round(float(times.min()), 3)
        odd = self._found.setdefault(
            (stream, what), Oddity(stream=stream, what=what, first_s=first)
        )
        odd.count += len(times)
        odd.first_s = min(odd.first_s, first)
        if np.size(sizes):
            odd.most = round(max(float(np.max(sizes)), odd.most or 0.0), 3)

    def all(self) -> list[Oddity]:
        return sorted(self._found.values(), key=lambda odd: (odd.stream, odd.what))


class GapWatch:
    """Pauses of one stream that are much longer than its usual period."""

    def __init__(self) -> None:
        self._last: Ns | None = None
        self._periods: list[float] = []  # [s] until the usual one is known
        self._usual = 0.0  # [s]

    def pause(self, at: Ns) -> float | None:
        """[s] since the sample before, where that is a gap; None: it is not."""
        last, self._last = self._last, at
        if last is None:
            return None
        seconds = (at - last) / 1e9
        if len(self._periods) < LEARNT:
            self._periods.append(seconds)
            self._usual = median(self._periods)
        return seconds if seconds > max(SHORTEST_GAP_S, GAP_PERIODS * self._usual) else None
