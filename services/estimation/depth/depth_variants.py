"""The depth observers as one family: what each makes of acceleration and of a sample's time.

All share one filter (`depth_filter.py`) and one handling of outliers and drop-outs
(`depth_observer.py`). From the thesis' way to the default, each adds one thing to the one before;
`lindy bench --only estimation` measures what that thing is worth.
"""

from dataclasses import dataclass
from typing import Literal

# What the observer "reference" does when the vehicle does not do as it is told: asked_motion.py.
Observer = Literal["accelerometer", "reference", "timed", "new", "hold"]


@dataclass(frozen=True, slots=True)
class DepthVariant:
    """How an observer works."""

    driven: bool = False  # acceleration is a known input; False: the rate is taken as constant
    measured: bool = False  # that input is measured, so it has a bias to be estimated
    timed: bool = True  # a sample corrects the moment it belongs to; False: the step it is read in
    held: bool = False  # the newest sample counts again in every step until the next one


WAYS: dict[str, DepthVariant] = {
    "hold": DepthVariant(
        timed=False, held=True
    ),  # Andrén 2023, section 5.3.1: sampled and held at 100 Hz
    "new": DepthVariant(timed=False),  # each sample counts once
    "timed": DepthVariant(),
    "reference": DepthVariant(driven=True),  # fed the acceleration of the motion that is asked for
    "accelerometer": DepthVariant(driven=True, measured=True),
}
