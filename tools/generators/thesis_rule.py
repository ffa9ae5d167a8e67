"""The thesis' own rule for velocity references, kept to be compared with.

Source: Andrén 2023, "Online Minimum-Jerk Velocity", chapter 5: one cubic in velocity per
transition, its duration T chosen so that the jerk at arrival has size J, (5.12) and (5.13). The
bounded law in `minimum_jerk` is the one that flies; this rule is what it improves on.

What holds: re-solving on the way changes nothing, from any state (property 1).

What does not: only the arrival jerk is bounded. With the acceleration and the wanted change seen
in the same direction, |j(0)|/J is at most 1 for 0 ≤ a ≤ sqrt(2 J e), but up to 2 when a opposes
the change, up to 3.83 for sqrt(2 J e) < a < sqrt(6 J e), and from 2 to 3 beyond. Accelerations are
not bounded either. And the rule is discontinuous in the state: where a² passes 6 J e, T jumps by
a factor 1 + sqrt 2, so two nearly equal sticks can give quite different motions.
"""

from math import isfinite, sqrt

from services.reference.trajectory.minimum_jerk import Segment

State = tuple[float, float, float, float]  # position, velocity, acceleration, jerk
SHORTEST = 1e-100  # [s] what takes less is already there


def duration(velocity: float, acceleration: float, target: float, jerk: float) -> float:
    """[s] The largest real root of (5.12) and (5.13), in closed form; 0 when already there."""
    return _root(acceleration, target - velocity, jerk)[0]


def plan(velocity: float, acceleration: float, target: float, jerk: float) -> Segment | None:
    """The whole transition; None when already there.

    Raises:
        ValueError: a number is not finite, or jerk is not above 0.
    """
    if not all(map(isfinite, (velocity, acceleration, target))):
        raise ValueError(
            f"velocity, acceleration and target must be finite, found {velocity}, "
            f"{acceleration}, {target}"
        )
    if not (isfinite(jerk) and jerk > 0):
        raise ValueError(f"jerk must be finite and above 0, found {jerk}")
    T, alpha = _root(acceleration, target - velocity, jerk)
    if T < SHORTEST:
        return None
    a = acceleration
    return Segment(T, velocity, a, alpha - 2 * a / T, (a / T - alpha) / T)


def _root(a: float, e: float, jerk: float) -> tuple[float, float]:
    """T and alpha, which is minus the jerk at arrival.

    In time to go τ = T - t every plan is a = τ (α + β τ), so no 4x4 system has to be solved.
    """
    forward = e > 0 or (e == 0 and a < 0)
    b, k = (a, 6 * jerk * e) if forward else (-a, -6 * jerk * e)
    alpha = jerk if forward else -jerk
    if b <= 0:
        return (sqrt(b * b + k) - b) / jerk, alpha
    if b * b >= k:  # overshoots, and arrives from the other side
        return (b + sqrt(b * b - k)) / jerk, -alpha
    return k / jerk / (b + sqrt(b * b + k)), alpha


def step(x: float, v: float, a: float, target: float, jerk: float, dt: float) -> State:
    """The thesis' loop: solve from the present state, go `dt` > 0 [s] along. x is exact also in the
    last, partial step, of which the thesis drops the position (5.2.3). Nothing is checked, and
    the root is inlined: this is what the bounded law's speed is measured against."""
    e = target - v
    alpha = jerk if e > 0.0 or (e == 0.0 and a < 0.0) else -jerk
    k, aa = 6 * alpha * e, a * a
    if aa >= k and a * alpha > 0.0:
        whole = (a + sqrt(aa - k) if alpha > 0.0 else a - sqrt(aa - k)) / alpha
        alpha = -alpha
    elif a * alpha > 0.0:
        whole = 6 * e / (a + sqrt(aa + k) if alpha > 0.0 else a - sqrt(aa + k))
    else:
        whole = (sqrt(aa + k) - a if alpha > 0.0 else -sqrt(aa + k) - a) / alpha
    if dt >= whole:
        return (
            x + whole * ((v + target) / 2 + a * whole / 12) + target * (dt - whole),
            target,
            0.0,
            0.0,
        )
    slope = a / whole
    j0, s = alpha - slope - slope, (slope - alpha) / whole
    p, q = dt * j0, dt * dt * s
    return (
        x + dt * (v + dt * (a / 2 + p / 6 + q / 12)),
        v + dt * (a + p / 2 + q / 3),
        a + p + q,
        j0 + 2 * dt * s,
    )


def clamped_step(
    x: float, v: float, a: float, target: float, jerk: float, a_max: float, dt: float
) -> State:
    """`step` with the acceleration cut at ±a_max afterwards (Fig. 5.8).

    Flaws: the jerk falls to zero at once where the cut begins; the ramp up differs from the ramp
    down; the arrival moves, so property 1 does not hold; the result depends on dt.
    """
    x_free, v_free, a_free, j = step(x, v, a, target, jerk, dt)
    if abs(a_free) <= a_max:
        return x_free, v_free, a_free, j
    cut = a_max if a_free > 0 else -a_max
    return _linear(x, v, a, cut, dt)


def planned_clamp_step(
    x: float, v: float, a: float, target: float, jerk: float, a_max: float, dt: float
) -> State:
    """The thesis' recipe for approaching a_max without a step in jerk, (5.17) to (5.20), Fig. 5.9.

    Of the plain plan and the parabola up to a_max, whichever has the lower acceleration towards
    the target. (5.17) is read with a minus sign, as (5.19) demands, and half the snap is s.

    Flaws: the parabola is not left in time at its top, so the acceleration chatters by s dt² below
    a_max; from an acceleration that opposes the change the jerk reaches sqrt 2 J; from one that
    overshoots, the direction flips on the way and the arrival moves.

    Raises:
        ValueError: the acceleration is already above a_max (the thesis takes a negative root).
    """
    sign = 1.0 if target > v else -1.0
    if a * sign > a_max:
        raise ValueError(f"the thesis' clamp has no answer for {a * sign} above a_max = {a_max}")
    free = step(x, v, a, target, jerk, dt)
    s = jerk * jerk / (4 * a_max)
    t = dt - sqrt((a_max - a * sign) / s)  # time after the top, (5.17)
    clamped = (a_max - s * t * t) * sign  # (5.18)
    if free[2] * sign <= clamped * sign:
        return free
    return _linear(x, v, a, clamped, dt)


def _linear(x: float, v: float, a: float, end: float, dt: float) -> State:
    """The acceleration runs straight from `a` to `end`."""
    j = (end - a) / dt
    return x + dt * (v + dt * (a / 3 + end / 6)), v + dt * (a + end) / 2, end, j
