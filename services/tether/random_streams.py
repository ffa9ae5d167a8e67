"""Random numbers of a link, drawn in blocks; every purpose has its own stream.

So the same seed loses the same messages, whatever a profile's delays or copies are.
"""

from math import erf, sqrt
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


def correlated(
    random: np.random.Generator, correlation: float, last: float
) -> tuple[Floats, float]:
    """A block of uniform numbers with correlated neighbours, and the state to continue from.

    A Gaussian copula: z follows a first-order autoregression of unit variance, and Φ(z) is uniform,
    so any distribution drawn by its quantile function keeps exactly its shape. (Linux netem mixes
    neighbours instead, which narrows the distribution.)

    Args:
        correlation: [-] of neighbouring z, 0 … 1 (1 excluded).
        last: z before this block.
    """
    noise = (sqrt(1.0 - correlation**2) * random.standard_normal(BLOCK)).tolist()
    uniform: list[float] = []
    for step in noise:
        last = correlation * last + step
        uniform.append(0.5 + 0.5 * erf(last / sqrt(2.0)))
    return np.array(uniform), last
