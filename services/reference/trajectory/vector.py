"""Velocity changes of two or three axes together, along a straight line in velocity space.

Planned axis by axis, a simultaneous change of surge and sway curves, because the smaller change
ends first. Here the limits apply to the norms of jerk and acceleration, and the result does not
depend on the frame's orientation. Any position unit, seconds; vectors are tuples of one float per
axis, in one frame.

Source: Andrén 2023 proposes a vector form in 7.2.4: one cubic, end jerk of norm J, with the faults
of the scalar rule (the jerk may reach 3.9 J). `bounded_plan` is ours.
"""

from dataclasses import dataclass
from math import copysign, hypot, inf, isfinite, sqrt

from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import Limits, Sample, Segment, solve

Vector = tuple[float, ...]
Stage = tuple[Segment, ...]  # one segment per axis, all of the same duration
SEARCHES = 44  # golden sections, each narrowing the turning time by 0.618
SHORTEST = 1e-100  # lengths and times below this count as 0
GOLDEN = (sqrt(5) - 1) / 2


def bounded_plan(
    velocity: Vector, acceleration: Vector, target: Vector, limits: Limits
) -> list[Stage]:
    """The transition within norm limits from any state. Empty when already there.

    First, at constant jerk, the acceleration is turned onto the straight line that then remains
    to the target; the scalar bounded law follows that line. The turning time is the one with the
    earliest arrival (golden section). An acceleration above the limit is lowered first.

    Guaranteed: |jerk| ≤ J; |acceleration| ≤ a_max once inside, and never above its initial value;
    velocity and acceleration are continuous; it arrives; it does not depend on the frame; from
    rest, or with acceleration and change on one line, it is the scalar bounded law on that line.
    Solving again half-way may shorten the rest, so it is not bit-invariant: solve once per change
    of target.

    Raises:
        ValueError: lengths differ, a number is not finite, or a limit is not above 0.
    """
    _check(velocity, acceleration, target, limits)
    stages: list[Stage] = []
    v, a = velocity, acceleration
    norm = hypot(*a)
    if norm > limits.acceleration:
        v, a = _turn(v, a, _times(a, limits.acceleration / norm), limits.jerk, stages)
    turning = _best_turning(a, _minus(target, v), limits)
    line, along, across = _line(a, _minus(target, v), turning)
    along = _turned(turning, along, across, limits.jerk)
    v, a = _turn(v, a, _times(line, along), limits.jerk, stages)
    left = _dot(_minus(target, v), line)
    for part in solve(0.0, along, left, limits):
        start = tuple(x - (left - part.v0) * n for x, n in zip(target, line, strict=True))
        stages.append(_on_line(part, start, line))
    return stages


def _line(a: Vector, e: Vector, turning: float) -> tuple[Vector, float, float]:
    """The straight line that remains after `turning` [s]; a along it and, as a size, across it.

    Constant jerk from a to an acceleration on the line gains their mean times `turning`, so what
    then remains of e is on the line exactly when e - a turning / 2 is.
    """
    rest = _minus(e, _times(a, turning / 2))
    if hypot(*rest) < SHORTEST:
        rest = a if hypot(*a) >= SHORTEST else (1.0,) + (0.0,) * (len(a) - 1)
    line = _times(rest, 1 / hypot(*rest))
    along = _dot(a, line)
    return line, along, hypot(*_minus(a, _times(line, along)))


def _possible(turning: float, across: float, jerk: float) -> bool:
    """Whether the jerk can remove the acceleration across the line in this time."""
    return across <= jerk * turning * (1 + 1e-12)


def _turned(turning: float, along: float, across: float, jerk: float) -> float:
    """The acceleration along the line after the whole turning time at constant jerk."""
    reach = sqrt(max(0.0, (jerk * turning) ** 2 - across * across))
    return 0.0 if reach >= abs(along) else along - copysign(reach, along)


def _best_turning(a: Vector, e: Vector, limits: Limits) -> float:
    """[s] Between the quickest turning, with the jerk across the line, and bringing the whole
    acceleration to zero."""
    longest = hypot(*a) / limits.jerk
    shortest = _quickest_turning(a, e, limits.jerk, longest)
    if longest - shortest <= 1e-12 * longest or _runs_on(a, e, shortest, limits.jerk):
        return shortest

    def total(turning: float) -> float:
        return turning + _duration_after(a, e, turning, limits)

    low, high = shortest, longest
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = total(left), total(right)
    for _ in range(SEARCHES):
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = total(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = total(right)
    return min((shortest, longest, left, right), key=total)


def _runs_on(a: Vector, e: Vector, turning: float, jerk: float) -> bool:
    """Whether the line can be followed without first bringing the acceleration to zero. Then no
    longer turning arrives sooner (found in every one of many random states, not proved)."""
    line, along, across = _line(a, e, turning)
    along = _turned(turning, along, across, jerk)
    gained = _times(_plus(a, _times(line, along)), turning / 2)
    return along >= 0 and along * along <= 2 * jerk * _dot(_minus(e, gained), line)


def _quickest_turning(a: Vector, e: Vector, jerk: float, longest: float) -> float:
    """[s] By bisection: the least time to remove the acceleration across the line."""
    low, high = 0.0, longest
    for _ in range(50):
        middle = (low + high) / 2
        if _possible(middle, _line(a, e, middle)[2], jerk):
            high = middle
        else:
            low = middle
    return high


def _duration_after(a: Vector, e: Vector, turning: float, limits: Limits) -> float:
    line, along, across = _line(a, e, turning)
    if not _possible(turning, across, limits.jerk):
        return inf
    along = _turned(turning, along, across, limits.jerk)
    gained = _times(_plus(a, _times(line, along)), turning / 2)
    parts = solve(0.0, along, _dot(_minus(e, gained), line), limits)
    return plain_sum(part.duration for part in parts)


def _turn(
    v: Vector, a: Vector, to: Vector, jerk: float, stages: list[Stage]
) -> tuple[Vector, Vector]:
    """Constant jerk of norm `jerk` until the acceleration is `to`."""
    change = _minus(to, a)
    time = hypot(*change) / jerk
    if time < SHORTEST:
        return v, to
    j = _times(change, 1 / time)
    stages.append(tuple(Segment(time, *start, 0.0) for start in zip(v, a, j, strict=True)))
    return _plus(v, _times(_plus(a, to), time / 2)), to


def _on_line(part: Segment, start: Vector, line: Vector) -> Stage:
    return tuple(
        Segment(part.duration, v, part.a0 * n, part.j0 * n, part.half_snap * n)
        for v, n in zip(start, line, strict=True)
    )


@dataclass(slots=True)
class VectorRamp:
    """A velocity vector that moves to a target, with its position: `Ramp` for several axes."""

    limits: Limits  # of the norms
    position: Vector
    target: Vector
    since: float = 0.0  # [s]
    stages: tuple[Stage, ...] = ()

    def at(self, t: float) -> tuple[Sample, ...]:
        """The reference of each axis at `t` [s] ≥ the last change of target."""
        elapsed, position = t - self.since, self.position
        for stage in self.stages:
            duration, here = stage[0].duration, list[Sample]()
            for x, segment in zip(position, stage, strict=True):
                s = segment.at(min(elapsed, duration))
                here.append(s._replace(position=x + s.position))
            if elapsed < duration:
                return tuple(here)
            position = tuple(s.position for s in here)
            elapsed -= duration
        pairs = zip(position, self.target, strict=True)
        return tuple(Sample(x + v * elapsed, v, 0.0, 0.0) for x, v in pairs)

    def rest(self, t: float) -> None:
        """Rest at zero from `t` [s] on; discards the plan."""
        self.position = self.target = (0.0,) * len(self.target)
        self.since, self.stages = t, ()

    def aim(self, target: Vector, t: float, limits: Limits | None = None) -> None:
        """From `t` [s] on, go to velocity `target`, within other limits if given. Without limits,
        no effect if that is the target already."""
        if target == self.target and limits is None:
            return
        here = self.at(t)
        v, a = tuple(s.velocity for s in here), tuple(s.acceleration for s in here)
        self.stages = tuple(bounded_plan(v, a, target, limits or self.limits))
        self.position, self.target, self.since = tuple(s.position for s in here), target, t


def _check(v: Vector, a: Vector, target: Vector, limits: Limits) -> None:
    if not len(v) == len(a) == len(target) > 0:
        raise ValueError(
            f"velocity, acceleration and target need one number per axis each, found "
            f"{len(v)}, {len(a)} and {len(target)}"
        )
    if not all(map(isfinite, (*v, *a, *target, limits.jerk))):
        raise ValueError("velocity, acceleration, target and jerk must be finite")
    if not (limits.jerk > 0 and limits.acceleration > 0):
        raise ValueError(f"limits must be above 0, found {limits.jerk} and {limits.acceleration}")


def _plus(a: Vector, b: Vector) -> Vector:
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _minus(a: Vector, b: Vector) -> Vector:
    return tuple(x - y for x, y in zip(a, b, strict=True))


def _times(a: Vector, by: float) -> Vector:
    return tuple(x * by for x in a)


def _dot(a: Vector, b: Vector) -> float:
    return plain_sum(x * y for x, y in zip(a, b, strict=True))
