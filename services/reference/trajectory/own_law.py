"""A reference law of the user's in the place of `solve`, for depth and heading while they follow
the stick.

The law plans a motion from where the reference is to the velocity that the stick asks for. A plan
is read before it flies: one that jumps, contradicts itself, exceeds the limits of an emergency stop
or does not arrive is refused and told of, and Lindy's own flies in its place. Failsafes, emergency
stops, depths and headings to go to, paths and the depth limit are planned by `solve` in any case.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite
from typing import NamedTuple, Protocol

from messages import events
from messages.events import Outbox
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample, State

LONGEST_S = 60.0  # [s] of a plan
READ = 100  # instants of a plan at which it is read, and its ends
SMALL = 1e-6  # [-] of a limit: rounding
ARRIVED = 0.02  # [-] of a limit that may be left at the end of a plan


class AxisPlan(NamedTuple):
    """A motion of one axis to a velocity, which it keeps then."""

    duration: float  # [s] until that velocity is reached
    at: Callable[[float], Sample]  # [s] since its beginning; the position counts from there


class Law(Protocol):
    def __call__(self, axis: str, here: Sample, velocity: float, /) -> AxisPlan:
        """
        Args:
            axis: `heave`, in m, or `yaw`, in rad.
            here: the reference as the plan begins, with which it must begin; its position is 0.
            velocity: per s, that is wanted.
        """
        ...


@dataclass(slots=True)
class LawRamp(Ramp):
    """A `Ramp` whose way to a velocity is planned by a law of the user's."""

    axis: str = field(kw_only=True)
    law: Law = field(kw_only=True)
    full: float = field(kw_only=True)  # per s, at full stick
    most: Limits = field(kw_only=True)  # of an emergency stop
    outbox: Outbox = field(kw_only=True)

    def aim(self, target: float, t: float) -> None:
        if target == self.target:
            return
        here = self.at(t)
        begin = here._replace(position=0.0)
        duration, at, end = 0.0, self.at, 0.0
        try:
            duration, at = plan = self.law(self.axis, begin, target)
            why = _wrong(plan, begin, target, self.full, self.most)
            end = at(duration).position
        except Exception as error:  # of somebody's code, which must not end a dive
            why = f"{type(error).__name__}: {error}"
        if why:
            self.outbox.tell(events.LAW_REFUSED(self.axis, detail=why))
            Ramp.aim(self, target, t)
            return

        def read(t: float) -> State:
            return at(t) if t < duration else (end + target * (t - duration), target, 0.0, 0.0)

        self._begin(here, (), target, t)
        self._read, self._end = read, t + duration


def _wrong(plan: AxisPlan, here: Sample, velocity: float, full: float, most: Limits) -> str:
    """Why it cannot be flown; empty: it can."""
    if not 0.0 <= plan.duration <= LONGEST_S:
        return f"it lasts {plan.duration:g} s, expected 0 to {LONGEST_S:g}"
    step = plan.duration / READ
    read = [Sample(*plan.at(k * step)) for k in range(READ + 1)]
    if not all(isfinite(value) for sample in read for value in sample):
        return "a value of it is not finite"
    fastest = max(full, abs(here.velocity), abs(velocity)) * (1.0 + ARRIVED)
    if (fast := max(abs(sample.velocity) for sample in read)) > fastest:
        return f"its velocity is up to {fast:.3g} per s, allowed is {fastest:.3g}"
    hardest = max(most.acceleration, abs(here.acceleration)) * (1.0 + SMALL)
    if (hard := max(abs(sample.acceleration) for sample in read)) > hardest:
        return f"its acceleration is up to {hard:.3g} per s², allowed is {hardest:.3g}"
    first, last = read[0], read[-1]
    begins = (
        abs(first.position) <= SMALL * full
        and abs(first.velocity - here.velocity) <= SMALL * full
        and abs(first.acceleration - here.acceleration) <= SMALL * hardest
    )
    if not begins:
        return f"it begins with {_words(first)}, the reference is at {_words(here)}"
    arrives = (
        abs(last.velocity - velocity) <= ARRIVED * full
        and abs(last.acceleration) <= ARRIVED * most.acceleration
    )
    if not arrives:
        return f"it ends with {_words(last)}, expected a velocity of {velocity:.3g}"
    rounding = SMALL * full
    for before, after in pairwise(read):
        moved = (before.velocity + after.velocity) / 2 * step
        gained = (before.acceleration + after.acceleration) / 2 * step
        if abs(after.position - before.position - moved) > hardest * step**2 + rounding:
            return "its position is not the integral of its velocity"
        if abs(after.velocity - before.velocity - gained) > 2.0 * hardest * step + rounding:
            return "its velocity is not the integral of its acceleration"
    return ""


def _words(sample: Sample) -> str:
    x, v, a, _ = sample
    return f"position {x:.3g}, velocity {v:.3g}, acceleration {a:.3g}"
