"""What Andrén 2023 says in numbers about its rule, sections 5.2 to 5.2.3 and (7.1)."""

from collections.abc import Iterator
from itertools import pairwise
from math import hypot, sqrt

import numpy as np

from lindy.api.references import Limits, Segment, thesis_rule
from lindy_research.laws import thesis_steps
from lindy_research.papers.claims import Claim, judged
from lindy_research.papers.claims_common import STATES, State, peak_jerk, random_states, total_time
from lindy_research.papers.setups import CLAMPED, JERK
from lindy_research.papers.thesis_comparison import peak_acceleration
from services.reference.trajectory import minimum_jerk

RETARGETED = "holds from rest; a stick that moves during a transition asks for more"


def rule_claims() -> list[Claim]:
    """The rule, its equations, its smoothness."""
    return [*_rule(), *_equations(), *_smoothness(), *_position()]


def _recalculated(bounded: bool) -> float:
    """Greatest relative change of the arrival time when the rest is planned again on the way."""
    worst = 0.0
    for v, a, target in random_states(1):
        first = _plan(v, a, target, bounded)
        whole = total_time(first)
        for share in (0.1, 0.3, 0.5, 0.7, 0.9):
            here = minimum_jerk.along(first, share * whole, target)
            rest = total_time(_plan(here.velocity, here.acceleration, target, bounded))
            worst = max(worst, abs(share * whole + rest - whole) / whole)
    return worst


def _plan(v: float, a: float, target: float, bounded: bool, jerk: float = 1.0) -> list[Segment]:
    if bounded:
        return minimum_jerk.solve(v, a, target, Limits(jerk, 1.5))
    plan = thesis_rule.plan(v, a, target, jerk)
    return [plan] if plan else []


def _retargeted_jerk(bounded: bool) -> float:
    """Greatest jerk in units of J, over accelerations met when the stick moves (Δv = J = 1)."""
    limits = Limits(1.0)
    worst = 0.0
    for a in (*np.linspace(-3.0, 3.0, 1201), sqrt(6.0) * (1 - 1e-9)):
        solved = minimum_jerk.solve(0, float(a), 1, limits) if bounded else None
        worst = max(worst, peak_jerk(solved or _plan(0, float(a), 1, False)))
    return worst


def _time_jump(bounded: bool) -> float:
    """Ratio of the arrival times of two sticks that differ by a billionth, where a² = 6 J Δv."""
    a = sqrt(6.0)
    near, far = (
        total_time(minimum_jerk.solve(0, a, target, Limits(1.0)))
        if bounded
        else thesis_rule.duration(0, a, target, 1.0)
        for target in (1 + 1e-9, 1 - 1e-9)
    )
    return far / near


def _rule() -> Iterator[Claim]:
    source = "Andrén 2023, 5.2 and 5.2.2, figure 5.4"
    text = "property 1: relative change of the arrival time when recalculated on the way"
    note = f"{STATES} random states, 5 instants each"
    yield judged("andren-5.2.2-property-1", source, text, 0, _recalculated(False), "-", 1e-8,
                 note=note)  # fmt: skip
    yield judged("andren-5.2.2-property-1-bounded", source, text + ", Lindy's bounded law",
                 0, _recalculated(True), "-", 1e-8, note=note)  # fmt: skip
    source, text = "Andrén 2023, 5.2", "stays within the design jerk: peak jerk over design jerk"
    yield judged("andren-5.2-design-jerk", source, text, 1, _retargeted_jerk(False), "-", 1e-9,
                 "at most", why=RETARGETED + ", up to 1 + 2 sqrt(2) times as much")  # fmt: skip
    yield judged("andren-5.2-design-jerk-bounded", source, text + ", Lindy's bounded law",
                 1, _retargeted_jerk(True), "-", 1e-9, "at most")  # fmt: skip
    source = "Andrén 2023, 5.2.2, property 2"
    text = "predictable response: ratio of the arrival times of two almost equal sticks"
    yield judged("andren-5.2.2-property-2", source, text, 1, _time_jump(False), "-", 1e-3,
                 why="where a² passes 6 J Δv the largest real root jumps by 1 + sqrt(2)"
                 )  # fmt: skip
    yield judged("andren-5.2.2-property-2-bounded", source, text + ", Lindy's bounded law",
                 1, _time_jump(True), "-", 1e-3)  # fmt: skip


def _equations() -> Iterator[Claim]:
    yield judged("andren-5.11-end-jerk", "Andrén 2023, (5.11)",
                 "end jerk of a plan: greatest relative error of the formula",
                 0, max(map(_end_jerk_error, random_states(2))), "-", 1e-9)  # fmt: skip
    yield judged("andren-5.12-largest-root", "Andrén 2023, (5.12) and (5.13)",
                 "largest real root of four against the closed form, greatest relative difference",
                 0, max(map(_root_error, random_states(4))), "-", 1e-9)  # fmt: skip
    v1, a1, v2, a2, T = 0.0, 0.5, 1.0, 0.5, 1.0
    coefficients = np.linalg.solve(
        [[1, 0, 0, 0], [0, 1, 0, 0], [1, T, T**2, T**3], [0, 1, 2 * T, 3 * T**2]], [v1, a1, v2, a2]
    )
    printed = abs(6 * (v2 - v1) / T**2 + 2 * (a2 - a1) / T)
    yield judged("andren-5.10-end-jerk", "Andrén 2023, (5.10)",
                 "end jerk from 0 to 1 m/s in 1 s with 0.5 m/s² at both ends",
                 printed, abs(2 * coefficients[2] + 6 * coefficients[3] * T), "m/s³", 1e-9,
                 why="the second term must be (2 a1 + 4 a2)/(t2 − t1) with the sign of −6 Δv; "
                 "with a2 = 0 it makes no difference")  # fmt: skip
    roots = [*np.roots([1.0, 6.0, -6.0]), *np.roots([-1.0, 6.0, -6.0])]
    yield judged("andren-5.12-roots", "Andrén 2023, (5.12) and (5.13)",
                 "real roots among the four, for Δv = 1, a = 3, J = 1",
                 2, sum(abs(np.imag(root)) < 1e-12 for root in roots), "-", 0.0,
                 why="two are complex only while a² < 6 J Δv")  # fmt: skip
    before = x = v = a = 0.0
    while v != 1.0:
        before, (x, v, a, _) = x, thesis_steps.step(x, v, a, 1.0, JERK, 0.01)
    yield judged("andren-5.2.3-last-step", "Andrén 2023, 5.2.3",
                 "position lost when the state is set to the target in the last step",
                 0, x - before, "m", 1e-9,
                 why="the printed loop leaves the rest of the last dt out of the position; Lindy "
                 "integrates it", note="0 → 1 m/s, J = 10 m/s³, dt = 10 ms")  # fmt: skip


def _root_error(state: State) -> float:
    """Of the closed form against all four roots; J = 1."""
    v, a, target = state
    both = [np.roots([sign, 2 * a, -6 * (target - v)]) for sign in (1.0, -1.0)]
    roots = np.concatenate(both)
    largest = float(np.max(roots[np.abs(np.imag(roots)) < 1e-12].real))
    return abs(thesis_rule.duration(v, a, target, 1.0) - largest) / largest


def _end_jerk_error(state: State) -> float:
    """Of (5.11) against the plan itself; J = 1."""
    v, a, target = state
    T = total_time(_plan(v, a, target, False))
    plan = _plan(v, a, target, False)[0]
    return abs(abs(6 * (target - v) / T**2 - 2 * a / T) - abs(plan.at(T).jerk))


def _smoothness() -> Iterator[Claim]:
    """C2 across a change of target: three in the middle of transitions."""
    gap = 0.0
    v = a = 0.0
    for target in (1.0, -0.5, 0.8, 0.0):
        segments = minimum_jerk.solve(v, a, target, CLAMPED)
        for part, following in pairwise(segments):
            end = part.at(part.duration)
            gap = max(gap, hypot(end.velocity - following.v0, end.acceleration - following.a0))
        gap = max(gap, hypot(segments[0].v0 - v, segments[0].a0 - a))
        here = minimum_jerk.along(segments, 0.6 * total_time(segments), target)
        v, a = here.velocity, here.acceleration
    yield judged("andren-5.2-continuous", "Andrén 2023, 5.2",
                 "largest step of velocity or acceleration where segments or targets change",
                 0, gap, "m/s, m/s²", 1e-12, note="Lindy's bounded law")  # fmt: skip
    plans = [minimum_jerk.solve(0, 0, v, Limits(JERK)) for v in (0.1, 0.2, 0.5, 1.0)]
    both = [abs(p[0].j0) for p in plans] + [abs(p[-1].at(p[-1].duration).jerk) for p in plans]
    yield judged("andren-5.5-same-ends", "Andrén 2023, 5.2.2 and figure 5.5",
                 "spread of initial and end jerk over velocity changes from 0.1 to 1 m/s",
                 0, max(both) - min(both), "m/s³", 1e-9)  # fmt: skip
    peaks = [peak_acceleration(plan) for plan in plans]
    yield judged("andren-5.5-acceleration", "Andrén 2023, 5.2.2 and figure 5.5",
                 "maximum acceleration grows with the velocity change: least growth",
                 0, min(b - a for a, b in pairwise(peaks)), "m/s²", 0.0,
                 "more than")  # fmt: skip


def _position() -> Iterator[Claim]:
    """(7.1) solved for the time of the quintic, whose end jerk is then computed."""
    worst = max(_position_error(*state) for state in random_states(5))
    yield judged("andren-7.1-end-jerk", "Andrén 2023, (7.1)",
                 "its roots give the position quintic the end jerk J: greatest relative error",
                 0, worst, "-", 1e-6, note="which root is right is left open there")  # fmt: skip


def _position_error(v: float, a: float, p: float) -> float:
    """From velocity v and acceleration a to rest at a distance p, J = 1; errors are target minus
    present."""
    worst = 0.0
    powers = (3, 4, 5)
    for sign in (1.0, -1.0):
        roots = np.roots([sign, -3 * a, -24 * v, 60 * p])
        for T in roots[(np.abs(np.imag(roots)) < 1e-9) & (roots.real > 0.05)].real:
            rows = [[k * T ** (k - 1) for k in powers], [T**k for k in powers],
                    [k * (k - 1) * T ** (k - 2) for k in powers]]  # fmt: skip
            left = [-v - a * T, p - v * T - a * T * T / 2, -a]
            thirds = [k * (k - 1) * (k - 2) * T ** (k - 3) for k in powers]
            end_jerk = float(np.dot(thirds, np.linalg.solve(rows, left)))
            worst = max(worst, abs(abs(end_jerk) - 1.0))
    return worst
