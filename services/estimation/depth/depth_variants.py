"""The variants of the depth observer: how each uses acceleration and the time of a sample.

All share one filter (`depth_filter.py`) and one handling of outliers and drop-outs
(`depth_observer.py`). From the thesis' variant to the default, each adds one feature to the
previous one; `lindy bench --only estimation` measures the effect.
"""

from dataclasses import dataclass
from typing import Literal

# "reference" with a blocked or drifting vehicle: see reference_input.py.
Observer = Literal["accelerometer", "reference", "timed", "new", "hold"]


@dataclass(frozen=True, slots=True)
class DepthVariant:
    """Properties of an observer."""

    driven: bool = False  # acceleration is an input; False: constant rate
    measured: bool = False  # that input is measured, so its bias is estimated
    timed: bool = True  # a sample applies at its own time; False: at the step it is read in
    held: bool = False  # the newest sample is used again in every step until the next one


VARIANTS: dict[str, DepthVariant] = {
    "hold": DepthVariant(
        timed=False, held=True
    ),  # Andrén 2023, section 5.3.1: sampled and held at 100 Hz
    "new": DepthVariant(timed=False),  # each sample counts once
    "timed": DepthVariant(),
    "reference": DepthVariant(driven=True),  # the input is the reference acceleration
    "accelerometer": DepthVariant(driven=True, measured=True),
}
