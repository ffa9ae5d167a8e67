"""The cruise speed of the reference model in closed form, and what to do when there is none.

Speeding up from v_i to x and slowing down from x to v_f covers a distance that is quadratic in x,
where Fernandes et al. 2015 search x on a grid.
"""

from math import sqrt

from tools.generators.fernandes.model_phases import SpeedChange
from tools.generators.fernandes.model_request import MotionRequest

MARGIN = 1e-5  # relative; a limit that is quoted is still feasible after rounding to 6 digits


def cruise_speed(request: MotionRequest, up: SpeedChange, down: SpeedChange) -> float:
    """v_c > 0: all of the length but ε_L is used up by speeding up to v_c and slowing down again.

    Raises:
        ValueError: even without speeding up above the initial and final speed it is not enough.
    """
    v_i, v_f = abs(request.initial), abs(request.final)
    usable = abs(request.length) * (1 - request.epsilon)
    if up.distance(v_i, max(v_i, v_f)) > usable:
        raise ValueError(_too_fast(request, up, usable))
    if down.distance(max(v_i, v_f), v_f) > usable:
        raise ValueError(_too_slow(request, down, usable))
    root = _larger_root(
        up.weight_to / up.rate + down.weight_from / down.rate,
        (up.weight_from - up.weight_to) * v_i / up.rate
        + (down.weight_to - down.weight_from) * v_f / down.rate,
        -up.weight_from * v_i * v_i / up.rate - down.weight_to * v_f * v_f / down.rate - usable,
    )
    return max(root, v_i, v_f)


def _larger_root(q2: float, q1: float, q0: float) -> float:
    """Of q2 x² + q1 x + q0 = 0, without loss of digits, for q2 > 0 > q0 (so it is positive)."""
    root = sqrt(q1 * q1 - 4 * q2 * q0)
    return -2 * q0 / (q1 + root) if q1 > 0 else (root - q1) / (2 * q2)


def _too_fast(request: MotionRequest, up: SpeedChange, usable: float) -> str:
    v_i, v_f = abs(request.initial), abs(request.final)
    fastest = _larger_root(
        up.weight_to,
        (up.weight_from - up.weight_to) * v_i,
        -up.weight_from * v_i * v_i - up.rate * usable,
    )
    return (
        f"a final speed of {v_f:g} cannot be reached from an initial speed of {v_i:g} within a "
        f"length of {abs(request.length):g}: expected a final speed of at most "
        f"{fastest * (1 - MARGIN):.6g}, or a length of at least "
        f"{up.distance(v_i, v_f) / (1 - request.epsilon) * (1 + MARGIN):.6g}"
    )


def _too_slow(request: MotionRequest, down: SpeedChange, usable: float) -> str:
    v_i, v_f = abs(request.initial), abs(request.final)
    # distance(v_i, x) falls through `usable` between v_f and v_i: the larger root of a parabola
    # that opens downwards, here with all signs changed.
    half = (down.weight_to - down.weight_from) * v_i / 2
    rest = down.rate * usable - down.weight_from * v_i * v_i
    slowest = (half + sqrt(half * half - down.weight_to * rest)) / down.weight_to
    return (
        f"an initial speed of {v_i:g} cannot be brought down to a final speed of {v_f:g} within a "
        f"length of {abs(request.length):g}: expected a final speed of at least "
        f"{slowest * (1 + MARGIN):.6g}, or a length of at least "
        f"{down.distance(v_i, v_f) / (1 - request.epsilon) * (1 + MARGIN):.6g}"
    )
