"""How much of the link's room for pictures each camera may have: the one rule, and a pure function.

One camera is large, which the pilot flies by; the others are small. From what the bitrate law
leaves for all pictures together (`total_kbit`):

1. The small ones have SMALL of it: each its least bitrate, and of the rest equal parts. What is
   more than its most is the large one's.
2. Where the large one would then have less than ENOUGH, they have only what is above ENOUGH, down
   to their least bitrates, which is a picture or two a second.
3. Where even these are more than SMALL of it, small cameras get nothing, the last named first.

So the large one never has less than 1 - SMALL of it, and the sum is never more than all of it.
"""

from collections.abc import Mapping
from typing import NamedTuple

from services.marine.summation import plain_sum

SMALL = 0.3  # [-] of the room, for all small pictures together
ENOUGH_KBIT = 250.0  # [kbit/s] with which the large picture comes 25 times a second


class Range(NamedTuple):
    """Of the bitrate of a camera."""

    least_kbit: float  # [kbit/s]
    most_kbit: float  # [kbit/s]


def shares(total_kbit: float, large: str, cameras: Mapping[str, Range]) -> dict[str, float]:
    """[kbit/s] For each camera. 0: it is to send nothing.

    Args:
        total_kbit: [kbit/s] for the pictures of all cameras.
        large: one of the cameras.
        cameras: in the order of the vehicle file.
    """
    small = {name: bounds for name, bounds in cameras.items() if name != large}
    most = SMALL * total_kbit
    while small and _least(small) > most:
        small.popitem()
    given = dict.fromkeys(cameras, 0.0)
    rest = min(most, max(total_kbit - ENOUGH_KBIT, _least(small))) - _least(small)
    for name, bounds in small.items():
        given[name] = min(bounds.most_kbit, bounds.least_kbit + rest / len(small))
    given[large] = total_kbit - plain_sum(given.values())
    return given


def _least(cameras: Mapping[str, Range]) -> float:
    return plain_sum(bounds.least_kbit for bounds in cameras.values())
