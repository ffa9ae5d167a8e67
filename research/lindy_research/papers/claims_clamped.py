"""What Andrén 2023 says in numbers about limited acceleration, section 5.2.5."""

from collections.abc import Iterator
from math import sqrt

import numpy as np

from lindy.api.references import thesis_rule
from lindy_research.laws.thesis_steps import clamped_step, planned_clamp_step
from lindy_research.papers.claims import Claim, judged
from lindy_research.papers.claims_common import STATES, random_states, total_time
from lindy_research.papers.setups import CLAMPED, CLAMPED_TARGETS
from lindy_research.papers.thesis_clamped import run
from services.reference.trajectory import minimum_jerk


def clamped_claims() -> list[Claim]:
    """Acceleration cut off, and acceleration limit planned for."""
    return [*_cut_off(), *_planned()]


def _cut_off() -> Iterator[Claim]:
    target = CLAMPED_TARGETS[-1]
    source = "Andrén 2023, 5.2.5 and figure 5.8"
    cut = run(clamped_step, 0.0, 0.0, target, 1e-3)
    free = thesis_rule.duration(0.0, 0.0, target, CLAMPED.jerk)
    curves = cut.curves
    yield judged("andren-5.8-limit", source, "the acceleration limit is obeyed",
                 CLAMPED.acceleration, float(np.max(np.abs(curves.acceleration))), "m/s²", 1e-12,
                 "at most", note="J = 1 m/s³, 0.5 m/s², 0 → 2 m/s; not printed")  # fmt: skip
    top = np.flatnonzero(curves.acceleration >= CLAMPED.acceleration)
    rise, fade = curves.t[top[0]], cut.time - curves.t[top[-1]]
    yield judged("andren-5.8-asymmetric", source, "fade takes longer than rise, ratio",
                 1, float(fade / rise), "-", 0.0, "more than")  # fmt: skip
    yield judged(
        "andren-5.8-property-1", source, "property 1 with the cut: announced and actual arrival",
        free, cut.time, "s", 1e-3, why="each plan is made without the limit that then delays it",
        note="paper: announced at the start by the rule; ours: reached; planned for, as in "
        f"figure 5.9, {total_time(minimum_jerk.solve(0, 0, target, CLAMPED)):.4f} s",
    )  # fmt: skip


def _planned() -> Iterator[Claim]:
    target, jerk, a_max = CLAMPED_TARGETS[-1], *CLAMPED
    source = "Andrén 2023, 5.2.5 and figure 5.9"
    solved = minimum_jerk.solve(0, 0, target, CLAMPED)
    yield judged("andren-5.9-symmetric", source, "rise and fade take equally long, difference",
                 0, solved[0].duration - solved[-1].duration, "s", 1e-12,
                 note=f"Lindy's bounded law; 0 → 2 m/s in {total_time(solved):.4f} s")  # fmt: skip
    recipe = run(planned_clamp_step, 0.0, 0.0, target, 1e-3).time
    yield judged("andren-5.9-duration", source, "recipe and bounded law from rest: arrival",
                 recipe, total_time(solved), "s", 1e-3, note="paper: the recipe, dt = 1 ms"
                 )  # fmt: skip
    yield judged("andren-5.9-fade", source, "the fade begins with no jerk and ends with j_end",
                 [0, jerk], [abs(solved[-1].j0), abs(solved[-1].at(solved[-1].duration).jerk)],
                 "m/s³", 1e-12)  # fmt: skip
    yield judged("andren-5.17-start", "Andrén 2023, (5.17) and (5.19)",
                 "instant at which the rise begins, where it ends at 0",
                 sqrt(a_max / (jerk**2 / (4 * a_max))), -solved[0].duration, "s", 1e-12,
                 why="(5.19) lets time run up to 0, so the root in (5.17) needs a minus sign"
                 )  # fmt: skip
    yield judged("andren-5.20-snap", "Andrén 2023, (5.20)", "snap of the fade, j_end²/(4 a_max)",
                 jerk**2 / (4 * a_max), abs(2 * solved[-1].half_snap), "m/s⁴", 1e-12,
                 why="the printed s is the coefficient of t², which is half the snap")  # fmt: skip
    coarse = run(planned_clamp_step, 0.0, 0.0, target, 0.05).curves
    on_top = coarse.acceleration[(coarse.t > 1.2) & (coarse.t < 3.4)]
    yield judged("andren-5.18-chatter", "Andrén 2023, (5.18)",
                 "spread of the acceleration while it is clamped, dt = 50 ms",
                 0, float(np.max(on_top) - np.min(on_top)), "m/s²", 1e-9,
                 why="(5.18) is evaluated past the top of its parabola, every second step"
                 )  # fmt: skip
    yield from _planned_property_1(source)


def _planned_property_1(source: str) -> Iterator[Claim]:
    """From an acceleration that overshoots: released stick, almost at the target."""
    v, a, target = 0.0, 0.4, 0.01
    text = "property 1 with planned clamping: announced and actual arrival after a release"
    note = f"v = {v:g}, a = {a:g}, target = {target:g}, J = 1, a_max = 0.5; dt = 1 ms"
    announced = thesis_rule.duration(v, a, target, CLAMPED.jerk)
    yield judged("andren-5.9-property-1", source, text,
                 announced, run(planned_clamp_step, v, a, target, 1e-3).time, "s", 1e-2,
                 why="sgn(v2 − v1) turns round when the velocity passes the target while the "
                 "acceleration is still large", note=note)  # fmt: skip
    worst = 0.0
    for v, a, target in random_states(3):
        first = minimum_jerk.solve(v, a, target, CLAMPED)
        here = minimum_jerk.along(first, total_time(first) / 2, target)
        rest = minimum_jerk.solve(here.velocity, here.acceleration, target, CLAMPED)
        worst = max(worst, abs(total_time(rest) - total_time(first) / 2))
    yield judged("andren-5.9-property-1-bounded", source,
                 "property 1 with a limit, Lindy's bounded law: greatest change of the arrival",
                 0, worst, "s", 1e-8, note=f"{STATES} random states, a up to 4 a_max")  # fmt: skip
