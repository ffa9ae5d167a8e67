"""Naive reference, the thesis' way and Lindy's on the identified plant (Andrén 2023, 6.1), against
the same disturbance of three sines; and what a step of the controller costs."""

from lindy_research.bench.control_cost import MOST, microseconds
from lindy_research.bench.drag_runs import SPEED, worst_errors
from lindy_research.bench.table import Figure
from lindy_research.papers.identified_inputs import STEP_ON
from lindy_research.papers.identified_plant import END_JERK, Sums, ratios, rise_time, sums
from lindy_research.papers.identified_runs import NAIVE, improved, improved_equal_rise_jerk, run

BANDWIDTHS = (1.0, 3.0, 10.0)  # [rad/s]
CHOSEN = 3.0  # [rad/s] whose numbers are judged
LEAST_ERROR = 450.0  # [-] times smaller than naive
LEAST_JERK = 19.0  # [-] likewise, where the vehicle rises as fast
THESIS_JERK = 3.0  # [m/s³] which the thesis calls as fast
MOST_DRAG = 0.01  # [-] of the error that linearised drag leaves


def figures() -> list[Figure]:
    return [*_errors(), *_equal_rise(), _drag(), *_cost()]


def _errors() -> list[Figure]:
    naive = sums(run(NAIVE))
    found = [_times("thesis' way", "position", naive, sums(run(END_JERK)))]
    for bandwidth in BANDWIDTHS:
        name, ours = f"observer {bandwidth:g} rad/s", sums(improved(END_JERK, bandwidth))
        goal = LEAST_ERROR if bandwidth == CHOSEN else None
        found.append(_times(f"sines, {name}", "position", naive, ours, goal))
    return found


def _equal_rise() -> list[Figure]:
    """The plan's end jerk chosen so that the vehicle comes to 90 % of its speed as fast as with the
    naive reference: exactly, and as the thesis rounds it."""
    naive = sums(run(NAIVE))
    rise = rise_time(run(NAIVE, disturbed=False), STEP_ON)
    found: list[Figure] = []
    for jerk in (improved_equal_rise_jerk(CHOSEN), THESIS_JERK):
        ours = sums(improved(jerk, CHOSEN))
        ours_rise = rise_time(improved(jerk, CHOSEN, disturbed=False), STEP_ON)
        rises = f"{1e3 * ours_rise:.1f} ms, naive {1e3 * rise:.1f} ms"
        name = f"equal rise, end jerk {jerk:.4g} m/s³"
        found += [
            _times(name, "position", naive, ours, LEAST_ERROR, f"rises in {rises}"),
            _times(name, "jerk", naive, ours, LEAST_JERK),
        ]
    return found


def _times(
    name: str, of: str, naive: Sums, ours: Sums, least: float | None = None, note: str = ""
) -> Figure:
    """A sum of squares beside the naive one; `least` times smaller is the goal."""
    words, unit = {"position": ("position error", "m²"), "jerk": ("jerk of thrust", "N²/s²")}[of]
    times = f"{getattr(ratios(naive, ours), of):.4g} times smaller than naive"
    return Figure(
        section="control",
        name=f"squared {words}, {name}",
        unit=unit,
        ours=getattr(ours, of),
        baseline_name="naive reference",
        baseline=getattr(naive, of),
        goal=None if least is None else 1.0 / least,
        note="; ".join(filter(None, (note, times))),
    )


def _drag() -> Figure:
    _, linearised, known = worst_errors()
    return Figure(
        section="control",
        name=f"largest position error at {SPEED:g} m/s, quadratic drag known",
        unit="m",
        ours=known,
        baseline_name="linearised drag",
        baseline=linearised,
        goal=MOST_DRAG,
    )


def _cost() -> list[Figure]:
    return [
        Figure(
            section="control",
            name=f"one step with allocation, {name}",
            unit="µs",
            ours=cost,
            baseline_name="at most",
            baseline=MOST,
            goal=1.0,
        )
        for name, cost in microseconds().items()
    ]
