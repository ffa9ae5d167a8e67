"""Sums of floats that have the same bits under every Python."""

from collections.abc import Iterable
from functools import reduce
from operator import add


def plain_sum(values: Iterable[float]) -> float:
    """The sum in the order of the values, rounded after each addition.

    From Python 3.12 on the builtin `sum` compensates these rounding errors, so that the same dive
    would have other bits there than under 3.11.
    """
    return reduce(add, values, 0)
