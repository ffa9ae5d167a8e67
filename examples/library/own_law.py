"""A reference law of one's own: a low-pass filter of the stick, as most autopilots have it.

The velocity approaches what the stick asks for with two equal poles; position and acceleration are
its integral and its derivative.
"""

from math import exp

from lindy.api import laws
from lindy.api.laws import AxisPlan, Sample, Settings
from lindy.api.service import Node, Stack

__all__ = ["Settings", "low_pass", "wire"]

POLES = {"heave": 2.0, "yaw": 2.5}  # [1/s]
SETTLED = 10.0  # time constants until nothing is left to see


def low_pass(axis: str, here: Sample, velocity: float) -> AxisPlan:
    """`here` has position 0; a plan counts from there."""
    w, gap = POLES[axis], here.velocity - velocity
    slope = here.acceleration + w * gap

    def at(t: float) -> Sample:
        left = exp(-w * t)
        speed = velocity + (gap + slope * t) * left
        gained = (here.acceleration - w * slope * t) * left
        jerk = -w * (slope + here.acceleration - w * slope * t) * left
        moved = gap * (1.0 - left) / w + slope * (1.0 - left * (1.0 + w * t)) / w**2
        return Sample(velocity * t + moved, speed, gained, jerk)

    return AxisPlan(SETTLED / w, at)


def wire(node: Node, stack: Stack) -> None:
    laws.wire(node, stack, low_pass)
