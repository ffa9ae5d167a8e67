"""The laws of the bounded reference over millions of random states: `python research/long/laws.py`.

Writes research/measurements/laws.md and fails when a tolerance is broken. Tolerances are stated
beside each law: they are what rounding can do in double precision, or, where a root of the state is
taken, its root. The quick versions of the same laws are in tests/services/reference.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lindy_research.laws import batch
from lindy_research.laws.batch import Floats, Plans

STATES = 5_000_000
CHUNK = 50_000
SEED = 20230615
PAGE = Path("research/measurements/laws.md")


@dataclass(frozen=True)
class States:
    """One transition each: velocities ±3, accelerations ±4, J 0.1 … 20, a_max 0.05 … 5 or none."""

    v: Floats
    a: Floats
    target: Floats
    jerk: Floats
    a_max: Floats

    def solve(self) -> Plans:
        return batch.solve(self.v, self.a, self.target, self.jerk, self.a_max)


@dataclass
class Law:
    """Something that must hold, with its worst case so far."""

    claim: str
    tolerance: float
    unit: str = "relative"
    worst: float = 0.0
    states: int = 0

    def see(self, errors: Floats) -> None:
        if np.isnan(errors).any():
            raise SystemExit(f"not a number in: {self.claim}")
        self.worst = max(self.worst, float(errors.max(initial=0.0)))
        self.states += len(errors)


def main() -> int:
    rng = np.random.default_rng(SEED)
    laws: dict[str, Law] = {}
    for _ in range(STATES // CHUNK):
        for name, errors in checks(drawn(rng, CHUNK), rng):
            laws.setdefault(name, Law(*LAWS[name])).see(errors)
    PAGE.write_text(page(laws), encoding="utf-8")
    print(page(laws))
    return int(any(law.worst > law.tolerance for law in laws.values()))


ROUNDING, ROOT = 1e-9, 1e-6  # where a border is met, the root of what is left by rounding counts
# name → claim, tolerance, unit
LAWS: dict[str, tuple[str, float, str]] = {
    "jerk": ("The jerk never exceeds J", ROUNDING, "of J"),
    "inside": ("The acceleration never exceeds a_max once inside", ROUNDING, "of a_max"),
    "outside": ("Nor, before that, where it started", ROUNDING, "of its start"),
    "smooth": ("Velocity and acceleration are continuous inside a plan", ROUNDING, "1 + size"),
    "arrival": ("It arrives on the target, with no acceleration left", ROUNDING, "1 + size"),
    "position": ("Position is the integral of velocity (Gauss)", ROUNDING, "1 + size"),
    "retarget": ("Velocity and acceleration run on across any new target", ROUNDING, "1 + size"),
    "again": ("Solving again on the way does not move the arrival", ROOT, "s of 1 + T"),
    "motion": ("Nor the motion to it", ROOT, "1 + size"),
    "dt": ("Ten re-solved steps end where one step ends", ROOT, "1 + size"),
    "continuity": ("A state 1e-12 away has nearly the same T", 1e-5, "s of 1 + T + 1/J + 1/a_max"),
    "mirror": ("The mirrored state has the mirrored plan", 0.0, "absolute"),
    "time": ("With a times 3 and J times 9, time runs three times as fast", ROOT, "1 + size"),
    "thesis": ("It is the thesis' rule where that keeps both limits", ROUNDING, "of T"),
}


def drawn(rng: np.random.Generator, n: int) -> States:
    """A third without a_max; some at rest, without change, or exactly at a limit."""
    v, a, target = rng.uniform(-3, 3, n), rng.uniform(-4, 4, n), rng.uniform(-3, 3, n)
    jerk, a_max = 10 ** rng.uniform(-1, 1.3, n), 10 ** rng.uniform(-1.3, 0.7, n)
    a_max[rng.random(n) < 1 / 3] = np.inf
    corner = rng.random(n)
    a[corner < 0.1] = 0.0
    at_limit = (corner > 0.1) & (corner < 0.15) & np.isfinite(a_max)
    a[at_limit] = a_max[at_limit]
    no_change = (corner > 0.15) & (corner < 0.2)
    target[no_change] = v[no_change]
    near = (corner > 0.2) & (corner < 0.3)  # small changes, as a pilot's
    target[near] = v[near] + rng.normal(0.0, 1e-3, n)[near]
    for k, low in ((2, 0.3), (6, 0.33)):  # the borders of overshoot: of this law, of the thesis
        hub_side = (corner > low) & (corner < low + 0.03)
        e = target[hub_side] - v[hub_side]
        a[hub_side] = np.sign(e) * np.sqrt(k * jerk[hub_side] * np.abs(e))
    return States(v, a, target, jerk, a_max)


def checks(s: States, rng: np.random.Generator) -> Iterator[tuple[str, Floats]]:
    """Errors of each law, one per state."""
    plans = s.solve()
    yield from limits(s, plans)
    yield from smoothness(s, plans)
    yield from repetition(s, plans, rng)
    yield from steps(s, plans, rng)
    yield from symmetry(s, plans)
    yield from thesis(s, plans)
    yield "continuity", continuity(s, plans, rng)


def limits(s: States, plans: Plans) -> Iterator[tuple[str, Floats]]:
    ends = plans.j0[:4] + 2 * plans.half_snap[:4] * plans.durations
    used = plans.durations > 0
    jerk = np.maximum(np.abs(plans.j0[:4]), np.abs(ends)) * used
    yield "jerk", np.maximum(jerk.max(axis=0) / s.jerk - 1, 0.0)
    peaks = peak_accelerations(plans)
    first = np.where(np.abs(s.a) > s.a_max, 0.0, peaks[0])  # from outside it only comes down
    yield "inside", np.maximum(np.maximum(first, np.max(peaks[1:], axis=0)) / s.a_max - 1, 0.0)
    most = np.maximum(np.abs(s.a), s.a_max)
    yield "outside", np.maximum(peaks.max(axis=0) / most - 1, 0.0)


def peak_accelerations(plans: Plans) -> Floats:
    """(4, n) Largest |a| of each stretch: at its ends, or at the top of its parabola."""
    a0, j0, s, t = plans.a0[:4], plans.j0[:4], plans.half_snap[:4], plans.durations
    with np.errstate(divide="ignore", invalid="ignore"):
        top = np.where(s == 0, 0.0, -j0 / (2 * s))
    top = np.clip(np.nan_to_num(top), 0.0, t)
    ends = [np.abs(a0 + u * (j0 + u * s)) for u in (np.zeros_like(t), top, t)]
    return np.max(ends, axis=0) * (t > 0)


def smoothness(s: States, plans: Plans) -> Iterator[tuple[str, Floats]]:
    """Each stretch ends where the next begins; those without length are passed through."""
    v, a, worst = s.v, s.a, np.zeros_like(s.v)
    for k in range(4):
        t = plans.durations[k]
        step = np.maximum(np.abs(plans.v0[k] - v), np.abs(plans.a0[k] - a))
        worst = np.maximum(worst, np.where(t > 0, step, 0.0))
        v_end = v + t * (a + t * (plans.j0[k] / 2 + t * plans.half_snap[k] / 3))
        a_end = a + t * (plans.j0[k] + t * plans.half_snap[k])
        v, a = np.where(t > 0, v_end, v), np.where(t > 0, a_end, a)
    size = 1 + np.abs(s.v) + np.abs(s.a) + np.abs(s.target)
    yield "smooth", worst / size
    yield "arrival", np.maximum(np.abs(v - s.target), np.abs(a)) / size


def repetition(s: States, plans: Plans, rng: np.random.Generator) -> Iterator[tuple[str, Floats]]:
    """From somewhere on the way: the same target again, and another one."""
    t = rng.uniform(0, 1, len(s.v)) * plans.duration
    _, v, a, _ = plans.at(t)
    again = batch.solve(v, a, s.target, s.jerk, s.a_max)
    left = plans.duration - t
    yield "again", np.abs(again.duration - left) / (1 + plans.duration)
    later = rng.uniform(0, 1.2, len(s.v)) * left
    yield "motion", apart(again.at(later)[1:3], plans.at(t + later)[1:3])
    other = batch.solve(v, a, rng.uniform(-3, 3, len(v)), s.jerk, s.a_max)
    yield (
        "retarget",
        np.maximum(
            jump(s, plans.at(np.maximum(t - DELTA, 0.0)), (v, a)), jump(s, other.at(DELTA), (v, a))
        ),
    )


DELTA = 1e-6  # [s] on either side of a new target


def jump(s: States, there: batch.Motion, here: tuple[Floats, Floats]) -> Floats:
    """How much more v and a differ DELTA apart than the acceleration and J allow."""
    _, v, a, _ = there
    most = np.maximum(np.abs(a), np.abs(here[1]))
    too_much = np.maximum(
        np.abs(v - here[0]) - most * DELTA - s.jerk * DELTA**2,
        np.abs(a - here[1]) - s.jerk * DELTA,
    )
    return np.maximum(too_much, 0.0) / (1 + np.abs(v) + np.abs(a))


def steps(s: States, plans: Plans, rng: np.random.Generator) -> Iterator[tuple[str, Floats]]:
    dt = float(10 ** rng.uniform(-2.5, 0.5))
    here = np.zeros_like(s.v), s.v, s.a
    for _ in range(10):
        here = batch.step(*here, s.target, s.jerk, s.a_max, dt / 10)[:3]
    one = batch.step(np.zeros_like(s.v), s.v, s.a, s.target, s.jerk, s.a_max, dt)[:3]
    yield "dt", np.maximum(apart(here, one), apart(here, plans.at(dt)[:3]))
    yield "position", integral(plans)


NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)


def integral(plans: Plans) -> Floats:
    """The position gained in every stretch against Gauss quadrature of its velocity."""
    worst = np.zeros_like(plans.duration)
    for k in range(4):
        t = plans.durations[k]
        gained = np.zeros_like(t)
        for node, weight in zip(NODES, WEIGHTS, strict=True):
            u = t * (1 + node) / 2
            inner = plans.a0[k] + u * (plans.j0[k] / 2 + u * plans.half_snap[k] / 3)
            gained += weight * t / 2 * (plans.v0[k] + u * inner)
        error = np.abs(plans.position[k + 1] - plans.position[k] - gained)
        worst = np.maximum(worst, error / (1 + np.abs(plans.position[k + 1])))
    return worst


def symmetry(s: States, plans: Plans) -> Iterator[tuple[str, Floats]]:
    mirrored = batch.solve(-s.v, -s.a, -s.target, s.jerk, s.a_max)
    t = 0.37 * plans.duration
    here, there = plans.at(t), mirrored.at(t)
    worst = np.max([np.abs(p + q) for p, q in zip(here[:3], there[:3], strict=True)], axis=0)
    yield "mirror", np.maximum(worst, np.abs(plans.duration - mirrored.duration))
    fast = batch.solve(s.v, 3 * s.a, s.target, 9 * s.jerk, 3 * s.a_max)
    x, v, a, _ = fast.at(t / 3)
    scaled = np.maximum(
        apart((3 * x, v, a / 3), here[:3]),
        np.abs(3 * fast.duration - plans.duration) / (1 + plans.duration),
    )
    yield "time", scaled


def continuity(s: States, plans: Plans, rng: np.random.Generator) -> Floats:
    """T goes with the square root of a small change, so 1e-12 in gives about 1e-6 out."""
    step = 1e-12 * rng.choice([-1.0, 1.0], (3, len(s.v)))
    near = batch.solve(s.v + step[0], s.a + step[1], s.target + step[2], s.jerk, s.a_max)
    scale = 1 + plans.duration + 1 / s.jerk + 1 / np.minimum(s.a_max, 1.0)
    return np.abs(near.duration - plans.duration) / scale


def thesis(s: States, plans: Plans) -> Iterator[tuple[str, Floats]]:
    """Only states where the plan of A. 2023, (5.12), keeps |j(0)| ≤ J and |a| ≤ a_max."""
    e = s.target - s.v
    sign = np.copysign(1.0, e)
    b, k = s.a * sign, 6 * s.jerk * np.abs(e)
    with np.errstate(divide="ignore", invalid="ignore"):
        T = k / s.jerk / (b + np.sqrt(b * b + k))
        beta = (b - s.jerk * T) / T**2
        inside = -s.jerk / (2 * beta) < T
        peak = np.where(inside & (beta < 0), -(s.jerk**2) / (4 * beta), b)
        keeps = (
            (b >= 0)
            & (np.abs(s.jerk - 2 * b / T) <= s.jerk * (1 - ROUNDING))
            & (peak <= s.a_max)
            & (k > 0)
        )
    yield "thesis", np.abs(plans.duration - T)[keeps] / T[keeps]


def apart(found: tuple[Floats, ...], expected: tuple[Floats, ...]) -> Floats:
    pairs = zip(found, expected, strict=True)
    errors: list[NDArray[np.float64]] = [np.abs(p - q) / (1 + np.abs(q)) for p, q in pairs]
    return np.max(errors, axis=0)


def page(laws: dict[str, Law]) -> str:
    rows = [
        f"| {law.claim} | {law.states:,} | {law.worst:.1e} | {law.tolerance:.0e} | {law.unit} | "
        f"{'holds' if law.worst <= law.tolerance else '**broken**'} |"
        for law in laws.values()
    ]
    return "\n".join([HEADING, *rows, ""])


HEADING = f"""# Laws of the bounded reference

Written by `research/long/laws.py`; do not edit. {STATES:,} random states, seed {SEED}:
velocities ±3, accelerations ±4, J 0.1 to 20, a_max 0.05 to 5 or none, in any combination, also
far outside a_max; some at rest, exactly at a_max, without any change, or on the borders of
overshoot a² = 2 J e and a² = 6 J e.

| law | states | worst | tolerance | unit | |
|---|---|---|---|---|---|"""


if __name__ == "__main__":
    sys.exit(main())
