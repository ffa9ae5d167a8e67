"""The bounded law as feedback: one step ahead from any state, for a target that always changes.

The law of `minimum_jerk` picks its jerk from the present state alone, so no plan has to be kept
between steps: re-solving at every step follows the same motion as one plan, whatever dt is.
Source: Andrén 2023, ch. 5, with the corrections named in `minimum_jerk`.
"""

from collections.abc import Callable
from math import inf, sqrt

from lindy.api.references import Limits, solve
from services.reference.trajectory.minimum_jerk import State

TINY = 1e-150  # a velocity change that is none


def step(
    x: float, v: float, a: float, target: float, jerk: float, a_max: float, dt: float
) -> State:
    """The reference `dt` seconds later, exact also where parts of the law end inside dt.

    Args:
        x, v, a: position, velocity and acceleration now; any finite values.
        target: wanted velocity.
        jerk, a_max: limits, > 0; a_max may be `math.inf`.
        dt: [s] ≥ 0.

    Nothing is checked here. With dt always the same, `stepper` is several times faster.
    """
    for part in solve(v, a, target, Limits(jerk, a_max)):
        if dt < part.duration:
            here = part.at(dt)
            return x + here.position, here.velocity, here.acceleration, here.jerk
        x += part.at(part.duration).position
        dt -= part.duration
    return x + target * dt, target, 0.0, 0.0


def stepper(  # noqa: C901 - one function call per step is what the speed allows
    limits: Limits, dt: float
) -> Callable[[float, float, float, float], State]:
    """`step` with limits and dt [s] fixed: a function of x, v, a and target.

    Written for speed: whatever depends on limits and dt alone is computed here, once, and signs
    are carried along instead of mirroring. A step inside one part of the law costs one square
    root; what is left over goes to `step`.

    Raises:
        ValueError: a limit or dt is not above 0.
    """
    jerk, a_max = limits
    if not (jerk > 0 and a_max > 0 and 0 < dt < inf):
        raise ValueError(f"jerk, a_max and dt must be above 0, found {jerk}, {a_max}, {dt}")
    gain = jerk * dt  # the most that the acceleration changes in a step
    six_jerk, half, twelfth = 6 * jerk, dt / 2, dt * dt / 12
    minus_jerk, minus_gain, minus_six = -jerk, -gain, -six_jerk
    two_a, four_a, half_gain = 2 * a_max, 4 * a_max, gain / 2
    fade = four_a * a_max / (3 * jerk) + a_max * dt  # velocity change that leaves room to cruise
    bow = gain * dt / (24 * a_max)
    near = 1 - gain / two_a  # with a smaller share of the way left, a_max is not met

    def advance(x: float, v: float, a: float, target: float) -> State:  # noqa: C901
        e = target - v
        if e > TINY:
            j, w, six_j = jerk, gain, six_jerk
            reach = sqrt(a * a + six_j * e) - a  # j T, with T the largest root of (5.12)
            if a < 0.0 or a > reach or a > a_max:
                return undo(x, v, a, target)
        elif e < -TINY:
            j, w, six_j = minus_jerk, minus_gain, minus_six
            reach = -sqrt(a * a + six_j * e) - a
            if a > 0.0 or a < reach or -a > a_max:
                return undo(x, v, a, target)
        else:
            return step(x, v, a, target, jerk, a_max, dt)
        left = reach - w
        share = left / reach
        if share > near:
            if e > 0.0:
                gap = a_max - a
                over = reach - two_a
            else:
                gap = a_max + a
                over = -reach - two_a
            if over * over > four_a * gap:  # the cubic would pass a_max
                if gap == 0.0 and (e > fade or -e > fade):
                    return x + dt * (v + half * a), v + dt * a, a, 0.0
                y = sqrt(gap * four_a) - gain  # J times the time left to a_max
                if y < 0.0:
                    return step(x, v, a, target, jerk, a_max, dt)
                end = a + w * (y + half_gain) / two_a
                v_end = v + half * (a + end) + w * bow
                return x + half * (v + v_end) + twelfth * (a - end), v_end, end, j * y / two_a
        if share <= 0.0:
            return step(x, v, a, target, jerk, a_max, dt)
        m = a * share + w
        end = share * m
        v_end = target - left * (left + end + end) / six_j
        return x + half * (v + v_end) + twelfth * (a - end), v_end, end, j - (j + j) * m / reach

    def undo(x: float, v: float, a: float, target: float) -> State:
        """The acceleration works against the change, would overshoot, or is above a_max."""
        if a > a_max or -a > a_max:
            return step(x, v, a, target, jerk, a_max, dt)
        if a > gain:
            w, j = minus_gain, minus_jerk
        elif a < minus_gain:
            w, j = gain, jerk
        else:
            return _through_zero(x, v, a, target, jerk, a_max, dt)
        end = a + w
        v_end = v + half * (a + end)
        return x + half * (v + v_end) - twelfth * w, v_end, end, j

    return advance


def _through_zero(
    x: float, v: float, a: float, target: float, jerk: float, a_max: float, dt: float
) -> State:
    """`step` where the acceleration comes to zero inside dt, and the law begins from there."""
    t = abs(a) / jerk
    x += t * (v + t * a / 3)
    v += t * a / 2
    t = dt - t
    e = target - v
    whole = min(sqrt(6 * abs(e) / jerk), 4 * a_max / jerk)  # with a_max: of the two parabolas
    if 2 * t >= whole:
        return step(x, v, 0.0, target, jerk, a_max, t)
    j = jerk if e > 0 else -jerk
    u = t / whole
    return (
        x + t * (v + t * t * j * (1 / 6 - u / 12)),
        v + t * t * j * (1 / 2 - u / 3),
        t * j * (1 - u),
        j * (1 - 2 * u),
    )
