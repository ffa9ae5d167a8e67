"""The bounded law for many axes at once, with NumPy: Monte Carlo, sweeps, the long law check.

Same law and same closed forms as `minimum_jerk`, agreeing to rounding. All arrays have one entry
per axis, shape (n,); any argument may be a single number for all axes. Units as there.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Numbers = float | Floats  # the same for all axes, or one each
Motion = tuple[Floats, Floats, Floats, Floats]  # position, velocity, acceleration, jerk, each (n,)
# Axes worked on together. The intermediate arrays of many more are given back to the operating
# system and fetched again at every step, which costs more than the arithmetic.
BLOCK = 5000


@dataclass(frozen=True, slots=True)
class Plans:
    """One transition per axis: always five stretches, of which some have no length.

    In order: acceleration to zero or to a_max; cubic or parabola up; cruise at a_max; parabola
    down; target held for ever. Arrays are (5, n); a(t) = a0 + j0 t + half_snap t² from `begin`.
    """

    durations: Floats  # [s] (4, n); the fifth stretch has no end
    begin: Floats  # [s]
    position: Floats  # from the start of the plan
    v0: Floats
    a0: Floats
    j0: Floats
    half_snap: Floats

    @property
    def duration(self) -> Floats:
        """[s] (n,) From start to arrival."""
        return self.begin[4]

    def at(self, t: Numbers) -> Motion:
        """The references `t` [s] after the start; one time for all axes, or one each."""
        n = len(self.duration)
        time = np.broadcast_to(np.asarray(t, float), (n,))
        out = np.empty((4, n))
        for block in _blocks(n):
            out[:, block] = self._read(time[block], block)
        return out[0], out[1], out[2], out[3]

    def _read(self, time: Floats, block: slice) -> Motion:
        n = len(self.duration)
        first: int = block.start
        part: NDArray[np.intp] = np.arange(first, first + len(time))
        for k in (1, 2, 3, 4):
            later: NDArray[np.bool_] = time >= self.begin[k, block]
            np.add(part, n, out=part, where=later)
        rows = (self.begin, self.position, self.v0, self.a0, self.j0, self.half_snap)
        start, x0, v0, a0, j0, half_snap = (row.ravel().take(part) for row in rows)
        return _along(time - start, x0, v0, a0, j0, half_snap)


def solve(
    velocity: Numbers, acceleration: Numbers, target: Numbers, jerk: Numbers,
    a_max: Numbers = np.inf,
) -> Plans:  # fmt: skip
    """Plans from (velocity, acceleration) to (target, 0). See `minimum_jerk.solve`.

    Raises:
        ValueError: a limit is not above 0, or a state or target is not finite.
    """
    v, a, target, jerk, a_max = _arrays(velocity, acceleration, target, jerk, a_max)
    _check(v, a, target, jerk, a_max)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return _plans(v, a, target, jerk, a_max)


def step(
    x: Floats, v: Floats, a: Floats, target: Numbers, jerk: Numbers, a_max: Numbers, dt: float
) -> Motion:
    """All axes `dt` [s] further, re-solved from their states: for targets that change every step.

    Exact like `stepping.step`. Axes whose step lies inside one part of the law go the short way,
    the others are solved. Only the shapes must fit; nothing is checked.
    """
    n = len(v)
    rows = [np.broadcast_to(np.asarray(z, float), (n,)) for z in (x, v, a, target, jerk, a_max)]
    out = np.empty((4, n))
    for block in _blocks(n):
        out[:, block] = _step([row[block] for row in rows], dt)
    return out[0], out[1], out[2], out[3]


def _step(block: list[Floats], dt: float) -> Motion:
    x, v, a, target, jerk, a_max = block
    e = target - v
    sign = np.copysign(1.0, e)
    b = a * sign  # seen towards the target
    with np.errstate(divide="ignore", invalid="ignore"):
        end, bend, j, inside = _one_part(b, np.abs(e), jerk, a_max, dt)
    end *= sign
    v_end = v + dt / 2 * (a + end - sign * bend / 3)
    x_end = x + dt / 2 * (v + v_end) + dt * dt / 12 * (a - end)
    j *= sign
    rest = np.flatnonzero(~inside)
    if rest.size:
        args = (z[rest] for z in (v, a, target, jerk, a_max))
        moved, v_end[rest], end[rest], j[rest] = solve(*args).at(dt)
        x_end[rest] = x[rest] + moved
    return x_end, v_end, end, j


def _blocks(n: int) -> Iterator[slice]:
    for begin in range(0, n, BLOCK):
        yield slice(begin, min(n, begin + BLOCK))


def _one_part(
    b: Floats, e: Floats, jerk: Floats, a_max: Floats, dt: float
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Acceleration after dt, its bend (half snap times dt²), jerk; and whether they are right.

    For b and e ≥ 0 seen towards the target. Wrong where a part of the law ends inside dt.
    """
    gain = jerk * dt
    reach = np.sqrt(b * b + 6 * jerk * e) - b  # J times the time to go
    share = 1 - gain / reach  # of the time to go, left after this step
    m = b * share + gain
    end, bend, j = share * m, (gain / reach) * (b - m), jerk - 2 * jerk * m / reach
    inside = share > 0
    over = reach - 2 * a_max
    near = np.flatnonzero((over > 0) & (over * over > 4 * a_max * (a_max - b)))
    if near.size:  # the cubic would pass a_max: parabola up to it, or cruise
        b_, e_, g, top = (z[near] for z in (b, e, gain, a_max))
        y = 2 * np.sqrt((top - b_) * top) - g  # J times the time left to a_max
        cruise = (b_ == top) & (e_ > 2 * top * top / (3 * g) * 2 * dt + top * dt)
        end[near] = np.where(cruise, b_, b_ + g * (y + g / 2) / (2 * top))
        bend[near] = np.where(cruise, 0.0, -g * g / (4 * top))
        j[near] = np.where(cruise, 0.0, g / dt * y / (2 * top))
        inside[near] = cruise | (y > 0)
    undo = np.flatnonzero((b < 0) | (b > reach))
    if undo.size:
        b_, g = b[undo], gain[undo]
        back = np.copysign(g, b_)
        end[undo], bend[undo], j[undo] = b_ - back, 0.0, -back / dt
        inside[undo] = np.abs(b_) >= g
    return end, bend, j, inside & (np.abs(b) <= a_max)


def _arrays(*values: Numbers) -> list[Floats]:
    return list(np.broadcast_arrays(*(np.atleast_1d(np.asarray(z, float)) for z in values)))


def _check(v: Floats, a: Floats, target: Floats, jerk: Floats, a_max: Floats) -> None:
    if not (np.isfinite(v) & np.isfinite(a) & np.isfinite(target) & np.isfinite(jerk)).all():
        raise ValueError("velocity, acceleration, target and jerk must be finite on every axis")
    if not ((jerk > 0) & (a_max > 0)).all():
        raise ValueError("jerk and a_max must be above 0 on every axis")


def _plans(v: Floats, a: Floats, target: Floats, jerk: Floats, a_max: Floats) -> Plans:
    sign = np.copysign(1.0, target - v + 0.0)
    b = a * sign
    undo = (b < 0) | (a * a > 2 * jerk * np.abs(target - v))
    to = np.where(undo, 0.0, np.where(b > a_max, sign * a_max, a))
    first = np.abs(a - to) / jerk
    first_jerk = np.where(first > 0, np.copysign(jerk, to - a), 0.0)
    v1 = v + (a + to) / 2 * first
    e = target - v1
    sign = np.copysign(1.0, e + 0.0)
    b, e = to * sign, np.abs(e)
    q = jerk * jerk / (4 * a_max)
    ramp_time, fade_time = np.sqrt(np.maximum(0.0, a_max - b) / q), 2 * a_max / jerk
    ramp, fade = a_max * ramp_time - q * ramp_time**3 / 3, 4 * a_max * a_max / (3 * jerk)
    clamped = e > ramp + fade  # False where a_max is inf: ramp is not a number there
    whole = np.where(e > 0, 6 * e / (b + np.sqrt(b * b + 6 * jerk * e)), 0.0)
    moves = whole > 0
    zero = np.zeros_like(v)
    top = np.where(clamped, sign * a_max, 0.0)
    cubic_j0 = np.where(moves, jerk - 2 * b / whole, 0.0)
    cubic_snap = np.where(moves, (b / whole - jerk) / whole, 0.0)
    down = np.where(clamped, -sign * q, 0.0)
    durations = (
        first,
        np.where(clamped, ramp_time, whole),
        np.where(clamped, (e - ramp - fade) / a_max, 0.0),
        np.where(clamped, fade_time, 0.0),
    )
    return _lined_up(
        durations,
        v0=(
            v,
            v1,
            v1 + np.where(clamped, sign * ramp, 0.0),
            target - np.where(clamped, sign * fade, 0.0),
            target,
        ),
        a0=(a, to, top, top, zero),
        j0=(first_jerk, sign * np.where(clamped, 2 * q * ramp_time, cubic_j0), zero, zero, zero),
        half_snap=(zero, np.where(clamped, down, sign * cubic_snap), zero, down, zero),
    )


def _lined_up(
    durations: tuple[Floats, ...], v0: tuple[Floats, ...], a0: tuple[Floats, ...],
    j0: tuple[Floats, ...], half_snap: tuple[Floats, ...],
) -> Plans:  # fmt: skip
    """Begin times and positions of the stretches follow from their lengths."""
    begin, position = np.zeros((5, len(v0[0]))), np.zeros((5, len(v0[0])))
    for k, duration in enumerate(durations):
        begin[k + 1] = begin[k] + duration
        moved = _along(duration, position[k], v0[k], a0[k], j0[k], half_snap[k])[0]
        position[k + 1] = moved
    return Plans(
        np.stack(durations),
        begin,
        position,
        np.stack(v0),
        np.stack(a0),
        np.stack(j0),
        np.stack(half_snap),
    )


def _along(t: Floats, x0: Floats, v0: Floats, a0: Floats, j0: Floats, half_snap: Floats) -> Motion:
    """Quadratic acceleration; both integrals follow from the ends and the bend."""
    bend = t * half_snap
    j = j0 + 2 * bend
    bend *= t
    a = a0 + t * j0
    a += bend
    v = v0 + t / 2 * (a0 + a - bend / 3)
    return x0 + t * ((v0 + v) / 2 + t * (a0 - a) / 12), v, a, j
