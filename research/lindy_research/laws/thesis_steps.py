"""The thesis' own loops, step by step, and its two ways to limit the acceleration: kept to show
what they do. Source: Andrén 2023, chapter 5."""

from math import sqrt

State = tuple[float, float, float, float]  # position, velocity, acceleration, jerk


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
