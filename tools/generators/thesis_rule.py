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
