"""Random numbers of a link, drawn in blocks; every purpose has its own stream.

So the same seed loses the same messages, whatever a profile's delays or copies are.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
BLOCK = 1024  # numbers drawn at once: a tenth of the cost of drawing one by one


class UniformStream:
    """Numbers of [0, 1), one after the other."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._left: list[float] = []

    def next(self) -> float:
        if not self._left:
            self._left = self._random.random(BLOCK).tolist()
        return self._left.pop()

    def happens(self, share: float) -> bool:
        """True with this probability. Costs no draw when it is impossible."""
        return share > 0.0 and self.next() < share


class Streams(NamedTuple):
    """One generator per purpose."""

    delay: np.random.Generator
    loss: UniformStream
    late: UniformStream
    copy: UniformStream
    damage: UniformStream


def streams(random: np.random.Generator) -> Streams:
    delay, *others = random.spawn(5)
    return Streams(delay, *map(UniformStream, others))
