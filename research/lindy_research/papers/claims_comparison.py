"""What Andrén 2023 says in numbers about figures 4.2 and 4.3."""

from collections.abc import Iterator

import numpy as np

from lindy.api.references import Filter, Limits, Segment, minimum_time
from lindy_research.papers.claims import Claim, judged
from lindy_research.papers.claims_common import peak_jerk, total_time
from lindy_research.papers.curves import steered
from lindy_research.papers.setups import (
    FILTER_DAMPING,
    FILTER_FREQUENCY,
    JERK,
    LARGE_STEP,
    SMALL_STEP,
)
from lindy_research.papers.thesis_comparison import generators, peak_acceleration
from services.reference.trajectory import minimum_jerk

ZETA = f"ω = {FILTER_FREQUENCY:g} rad/s; ζ is not printed, {FILTER_DAMPING:g} here"


def comparison_claims() -> list[Claim]:
    """Four references for a small and for a large step."""
    return [*_small_step(), *_large_step()]


def _transition(step: float) -> tuple[list[Segment], list[Segment]]:
    """From rest: minimum jerk, minimum time."""
    limits = Limits(JERK)
    return minimum_jerk.solve(0, 0, step, limits), minimum_time(0, 0, step, limits)


def _filter_curve(step: float, duration: float = 3.0) -> np.ndarray:
    """Rows of time, position, velocity, acceleration, jerk."""
    reference = Filter(FILTER_FREQUENCY, FILTER_DAMPING)
    curves = steered(reference, ((0.0, step),), np.arange(0.0, duration, 1e-3))
    return np.array(curves)


def _settled(curve: np.ndarray, step: float) -> float:
    """[s] When the velocity is within 1 % for good."""
    outside = np.flatnonzero(np.abs(curve[2] - step) > 0.01 * step)
    return float(curve[0][outside[-1] + 1])


def _small_step() -> Iterator[Claim]:
    jerky, quick = _transition(SMALL_STEP)
    curve = _filter_curve(SMALL_STEP)
    source = "Andrén 2023, 4.3.4 and figure 4.2"
    yield judged("andren-4.2-peak-jerk", source, "peak jerk of minimum jerk and minimum time",
                 [10, 10], [peak_jerk(jerky), peak_jerk(quick)], "m/s³", 1e-9)  # fmt: skip
    yield judged(
        "andren-4.2-peak-acceleration", source,
        "peak acceleration of minimum jerk, in per cent of minimum time's",
        62, 100 * peak_acceleration(jerky) / peak_acceleration(quick), "%", 1.0,
        note="sqrt(6)/4 for every step, which rounds to 61 %",
    )  # fmt: skip
    yield judged(
        "andren-4.2-duration", source, "minimum jerk takes longer than minimum time by",
        15, 100 * (total_time(jerky) / total_time(quick) - 1), "%", 1.0,
        why="the ratio of the two times is sqrt(3/2) for every step",
    )  # fmt: skip
    yield judged("andren-4.2-filter-initial-jerk", source, "jerk with which the filter begins",
                 10, float(curve[4][0]), "m/s³", 1e-9, note=ZETA)  # fmt: skip
    late = curve[4][curve[0] > total_time(jerky) / 2]
    yield judged("andren-4.2-filter-later-jerk", source,
                 "peak jerk of the filter in the second half of the transition is lower than",
                 10, float(np.max(np.abs(late))), "m/s³", 0.0, "at most", note=ZETA)  # fmt: skip
    yield judged("andren-4.2-filter-tail", source,
                 "time of the filter to 1 %, in transition times of minimum jerk",
                 1, _settled(curve, SMALL_STEP) / total_time(jerky), "-", 0.0, "more than",
                 note=ZETA)  # fmt: skip
    yield from _lag(source)


def _lag(source: str) -> Iterator[Claim]:
    """Both ends of a motion, long enough for the filter to settle."""
    stick = ((0.0, SMALL_STEP), (5.0, 0.0))
    t = np.array([0.0, 1.0, 3.0, 5.0, 6.0, 10.0])
    runs = [steered(reference, stick, t) for _, _, reference in generators(SMALL_STEP)]
    direct, jerky = runs[0].position, runs[3].position
    yield judged("andren-4.2-lag", source, "change of the lag while the stick is held",
                 0, float((direct - jerky)[3] - (direct - jerky)[1]), "m", 1e-12,
                 note=f"the lag itself is Δv T/2 = {float((direct - jerky)[1]):.6f} m")  # fmt: skip
    ends = [float(run_.position[-1]) for run_ in runs]
    yield judged("andren-4.2-final-position", source,
                 "spread of the final positions of all references after a stop",
                 0, max(ends) - min(ends), "m", 1e-9)  # fmt: skip


def _large_step() -> Iterator[Claim]:
    jerky, quick = _transition(LARGE_STEP)
    curve = _filter_curve(LARGE_STEP)
    source = "Andrén 2023, 4.3.4 and figure 4.3"
    initial = float(np.max(np.abs(curve[4])))
    yield judged("andren-4.3-filter-jerk", source, "maximum jerk of the filter",
                 100, initial, "m/s³", 1e-9, note=ZETA)  # fmt: skip
    yield judged("andren-4.3-filter-jerk-ratio", source,
                 "maximum jerk of the filter over that of the other methods",
                 [10, 10], [initial / peak_jerk(jerky), initial / peak_jerk(quick)], "-", 1e-9,
                 note=ZETA)  # fmt: skip
    yield judged("andren-4.3-filter-acceleration", source,
                 "maximum acceleration of the filter over that of minimum jerk, more than",
                 2, float(np.max(curve[3])) / peak_acceleration(jerky), "-", 0.0, "more than",
                 note=ZETA + "; it holds for ζ below 0.915")  # fmt: skip
    rise = float(curve[0][int(np.argmax(curve[2] >= 0.9 * LARGE_STEP))])
    whole = jerky[0]
    slow = next(t for t in np.arange(0.0, whole.duration, 1e-3) if whole.at(t).velocity >= 0.9)
    yield judged("andren-4.3-filter-rise", source,
                 "time of the filter to 90 %, in that of minimum jerk, less than",
                 1, rise / float(slow), "-", 0.0, "at most", note=ZETA)  # fmt: skip
    yield judged("andren-4.3-jerk-bounds", source,
                 "minimum time and minimum jerk stay within the jerk bound",
                 [10, 10], [peak_jerk(quick), peak_jerk(jerky)], "m/s³", 1e-9, "at most"
                 )  # fmt: skip
