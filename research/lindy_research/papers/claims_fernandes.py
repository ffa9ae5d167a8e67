"""What Fernandes et al. 2015 say in numbers about the reference model and its paths."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import degrees, exp, factorial, floor, pi, radians

from lindy.api.references import ReferenceModel, plan
from lindy_research.laws.model_as_printed import basic_as_printed
from lindy_research.papers.claims import Claim, judged
from lindy_research.papers.fernandes_model import optimal, optimal_times, same_limits_pair
from lindy_research.papers.fernandes_paths import edges
from lindy_research.papers.fernandes_turns import (
    even_lane_changes,
    longer_by,
    odd_lane_changes,
    odd_pair_angle,
    radius_ratio,
    shortest_even_change,
)
from lindy_research.papers.setups import (
    LANE_OFFSET,
    MIN_RADIUS,
    SEA_TRIAL,
    TABLE_2_BEGIN,
    TABLE_3_BEGIN,
    XI,
    paper_path,
    paper_route,
    table_2,
    table_3,
)
from lindy_research.papers.unwrapped import accumulate
from services.reference.paths.path import Path
from tools.generators.route import ProfileSequence, Route, TwinClothoids, sequence

PAPER = "Fernandes et al. 2015"
TABLE_3_TIMES = (50.0, 140.3, 313.1, 430.6, 603.5, 731.5)  # [s]
OPEN = f"ξ = {XI:g}; the paper allows 10 to 15"


def fernandes_claims() -> list[Claim]:
    """All of them; about a second."""
    return [*_basic(), *_steps(), *_tables(), *_turns(), *_lanes(), *_path(), *_yaw(), *_optimum()]


def _basic() -> Iterator[Claim]:
    model, printed = plan(SEA_TRIAL), basic_as_printed(SEA_TRIAL)
    yield judged("fernandes-4.1-cruise", f"{PAPER}, 4.1, (30)", "cruise velocity of the trial",
                 0.3, model.v_m, "m/s", 1e-12, note=f"{OPEN}; v_c = {model.v_c:.6f} m/s"
                 )  # fmt: skip
    yield judged("fernandes-33-acceleration", f"{PAPER}, (33) and (34)",
                 "acceleration V_d/T_a and deceleration −V_d/T_d", [0.3 / 20, -0.3 / 20],
                 [model.a_m, model.d_m], "m/s²", 1e-12)  # fmt: skip
    times = ", ".join(f"{t:.6f}" for t in model.t)
    yield judged(
        "fernandes-24-arrival-as-printed", f"{PAPER}, (24), (39) and (42)",
        "position just before t5 is L, with the times as printed",
        SEA_TRIAL.length, printed.P[4], "m", 1e-9,
        why="κ_a, κ_d and T_3 belong to T_1 = (ξ_a − e^−ξ_a) τ_11 and T_4 = (ξ_d − e^−ξ_d) τ_31, "
        "not to (39) and (42)",
        note=OPEN,
    )  # fmt: skip
    yield judged("fernandes-24-arrival", f"{PAPER}, (24)",
                 "position just before t5 is L, with the corrected times",
                 SEA_TRIAL.length, model.P[4], "m", 1e-9,
                 note=f"{OPEN}; t1 to t5 = {times} s")  # fmt: skip
    yield judged("fernandes-39-times", f"{PAPER}, (39) to (44)", "t1 to t5 of the sea trial",
                 printed.t, model.t, "s", 1e-6,
                 why="T_1 and T_4 as printed are longer by e^−ξ τ, which moves every later time",
                 note=f"paper: its formulas as printed; {OPEN}")  # fmt: skip


def _steps() -> Iterator[Claim]:
    """The remark of 2.1.2 on what the cut exponentials leave."""
    source = f"{PAPER}, 2.1.2"
    model = plan(replace(SEA_TRIAL, cruise=1.0, accel_time=1.0, decel_time=1.0, theta_0=exp(-7)))
    before, after = model.at(model.t[1] - 1e-9), model.at(model.t[1])
    yield judged("fernandes-2.1.2-steps", source,
                 "steps at t2 for θ_0 = exp(−7), a_m = 1 m/s², v_m = 1 m/s: a, v, p below",
                 [9.12e-4] * 3,
                 [abs(before.acceleration), abs(after.velocity - before.velocity),
                  abs(after.position - before.position)], "m/s², m/s, m", 0.0, "at most",
                 note="the position has no step at all: P_2 is defined by continuity")  # fmt: skip
    yield judged("fernandes-2.1.2-theta", source, "θ_0 of the sea trial is about",
                 1.5e-5, SEA_TRIAL.theta_0, "-", 0.05e-5)  # fmt: skip


def _tables() -> Iterator[Claim]:
    motion = table_2()
    begins = [TABLE_2_BEGIN + t for t in (*motion.begins, motion.duration)]
    source = f"{PAPER}, 4.2, Table 2 and figure 9"
    yield judged("fernandes-table-2-times", source, "runs begin and end at",
                 [15, 78, 128, 224], begins, "s", 0.5, note=OPEN)  # fmt: skip
    yield judged("fernandes-table-2-length", source, "length of the whole motion",
                 250, motion.at(motion.duration).position, "m", 1e-9)  # fmt: skip
    speeds = [part.v_m for part in motion.parts if isinstance(part, ReferenceModel)]
    yield judged("fernandes-table-2-cruise", source, "v_m = V_d in every run",
                 [2, 1, 1.5], speeds, "m/s", 1e-9)  # fmt: skip
    yield from _table_3()


def _table_3() -> Iterator[Claim]:
    requests = table_3(paper_path())
    models = [plan(request) for request in requests]
    source = f"{PAPER}, 4.3, Table 3 and figure 12"
    yield judged("fernandes-table-3-cruise", source, "v_m of the first part",
                 0.372, models[0].v_m, "m/s", 0.0005,
                 why="0.93 V_d is the first speed that fits on a grid of 1 % of V_d; the greatest "
                 "one that fits is the root of a quadratic", note=OPEN)  # fmt: skip
    cruise = models[0].phases[2].length / models[0].length
    yield judged("fernandes-74-fraction", f"{PAPER}, (74)",
                 "fraction of the first part at cruise velocity, at least ε_L",
                 0.05, cruise, "-", 1e-9, "more than")  # fmt: skip
    grid = floor(100 * models[0].v_c / requests[0].cruise) / 100
    yield judged("fernandes-table-3-grid", source, "v_m of the first part, searched in 1 % steps",
                 0.372, grid * requests[0].cruise, "m/s", 1e-9, note=OPEN)  # fmt: skip
    yield judged("fernandes-table-3-others", source, "v_m = V_d in the other parts",
                 [0.25, 0.4, 0.25, 0.4], [model.v_m for model in models[1:]], "m/s", 1e-9
                 )  # fmt: skip
    yield judged("fernandes-table-3-times", source, "parts begin and end at",
                 TABLE_3_TIMES, edges(paper_route()), "s", 0.6,
                 note=f"{OPEN}; 10 is nearest: at most {_off(10.0):.2f} s off, "
                 f"{_off(12.0):.2f} s with 12, {_off(15.0):.2f} s with 15; exact v_m, no rounding "
                 "to samples")  # fmt: skip


def _off(xi: float) -> float:
    """[s] How far the printed times of Table 3 are from ours with another ξ."""
    motion = sequence([plan(request) for request in table_3(paper_path(), xi)])
    ours = [TABLE_3_BEGIN + t for t in (*motion.begins, motion.duration)]
    return max(abs(a - b) for a, b in zip(ours, TABLE_3_TIMES, strict=True))


def _turns() -> Iterator[Claim]:
    source = f"{PAPER}, 3.3 and figure 3"
    yield judged("fernandes-3-longer", source, "L_c is 10 % longer than L_r from",
                 105.4, degrees(longer_by(1.1)), "°", 0.05)  # fmt: skip
    yield judged("fernandes-3-radius", source, "for θ_c below 20° the radius ratio is about 2",
                 [2, 2], [radius_ratio(radians(x)) for x in (1.0, 20.0)], "-", 0.02)  # fmt: skip
    yield judged("fernandes-96-length", f"{PAPER}, (96)", "2 θ_c/κ_max against the curve's length",
                 2 * radians(100.0) * MIN_RADIUS, _measured(radians(100.0)), "m", 1e-3)  # fmt: skip
    yield judged("fernandes-101-terms", f"{PAPER}, (101) and (102)",
                 "error of 13 terms, at worst, θ_c = π, r = 10 m", 0, _series_error(13), "m", 1e-12,
                 note=f"8 terms: {_series_error(8):.1e} m, 5 terms: {_series_error(5):.1e} m"
                 )  # fmt: skip
    turn = TwinClothoids(2.0, MIN_RADIUS)
    yield judged("fernandes-97-end", f"{PAPER}, (97) and (98)",
                 "end of a pair, ϖ = 1, from its start: along and aside, θ_c = 2 rad",
                 [0, 0], turn.at(turn.length)[:2], "m", 1e-9,
                 why="the printed intervals are half open, so at ϖ = 1 only the start point is "
                 "left")  # fmt: skip
    yield judged("fernandes-algorithm-1", f"{PAPER}, Algorithm 1", "heading that begins with −10°",
                 350, degrees(accumulate([radians(-10.0)])[0]), "°", 1e-9,
                 why="lines 1 to 3 add a turn to negative headings; it also leaves its counter "
                 "undefined where nothing wraps")  # fmt: skip


def _measured(angle: float) -> float:
    """[m] Length of a pair as a polygon of 2000 sides."""
    turn = TwinClothoids(angle, MIN_RADIUS)
    points = [turn.at(turn.length * k / 2000) for k in range(2001)]
    return sum(((b.x - a.x) ** 2 + (b.y - a.y) ** 2) ** 0.5 for a, b in pairwise(points))


def _series_error(terms: int) -> float:
    """[m] (101), (102) at the middle of the sharpest turn, against the closed form."""
    theta = pi
    c = sum(
        (-1) ** k * theta ** (2 * k + 1) / (factorial(2 * k) * (4 * k + 1) * 4**k)
        for k in range(terms)
    )
    s = sum(
        (-1) ** k * theta ** (2 * k + 2) / (factorial(2 * k + 1) * (4 * k + 3) * 2 ** (2 * k + 1))
        for k in range(terms)
    )
    middle = TwinClothoids(theta, MIN_RADIUS).middle
    return max(abs(MIN_RADIUS * c - middle.x), abs(MIN_RADIUS * s - middle.y))


def _lanes() -> Iterator[Claim]:
    odd, even = odd_lane_changes(), even_lane_changes()
    source = f"{PAPER}, 3.4 and figure 5"
    steps = [abs(b - a) for a, b in pairwise(odd.curvature)]
    yield judged("fernandes-5-odd-jump", source,
                 "curvature jumps in the middle of an antisymmetric pair, by 2 κ_max",
                 2 / MIN_RADIUS, max(steps), "1/m", 1e-9, note="not printed; (105), (106)"
                 )  # fmt: skip
    s = [even.length * k / 20000 for k in range(20001)]
    bends = [even.at(x).curvature for x in s]
    steepest = max(abs(b - a) for a, b in pairwise(bends)) / (s[1] - s[0])
    yield judged("fernandes-5-even-continuous", source,
                 "two symmetric pairs: curvature never jumps, its steepest rise",
                 _steepest(even), steepest, "1/m²", 1e-6,
                 note="paper: of a clothoid, κ_max over half its length")  # fmt: skip
    angle, forward, length = shortest_even_change()
    odd_length = 2 * odd_pair_angle(LANE_OFFSET) * MIN_RADIUS
    yield judged("fernandes-5-shorter", source,
                 "two symmetric pairs instead of an antisymmetric one: path length at most",
                 odd_length, length, "m", 0.0, "at most",
                 note=f"lane change of {LANE_OFFSET:g} m; {degrees(angle):.2f}°, {forward:.2f} m "
                 f"forward, against {degrees(odd_length / 2 / MIN_RADIUS):.2f}°")  # fmt: skip


def _steepest(path: Path) -> float:
    """[1/m²] The constant curvature rate of its clothoids."""
    turns = [part.turn for part in path.parts if part.turn]
    return max(turn.at(0.0).curvature_rate for turn in turns)


def _path() -> Iterator[Claim]:
    path = paper_path()
    source = f"{PAPER}, 4.3, Table 3 and figure 10"
    lengths = [part.length for part in path.parts]
    yield judged("fernandes-10-lengths", source, "lengths of the five parts",
                 [27.4457, 43.1760, 43.0579, 43.1760, 27.4457], lengths, "m", 0.00005)  # fmt: skip
    yield judged("fernandes-13-length", f"{PAPER}, 4.3 and (118)", "length of the whole path",
                 184.3, path.length, "m", 0.05)  # fmt: skip
    source = f"{PAPER}, 4.3 and figure 11"
    points = [path.at(path.length * k / 20000) for k in range(20001)]
    bends = [abs(point.curvature) for point in points]
    yield judged("fernandes-11-curvature", source, "greatest curvature, 1/r_min",
                 0.1, max(*bends, path.max_curvature), "1/m", 1e-9)  # fmt: skip
    steepest = max(abs(b - a) for a, b in pairwise(bends))
    yield judged("fernandes-11-continuous", source,
                 "curvature is continuous: largest step between 20001 samples",
                 _steepest(path) * path.length / 20000, steepest, "1/m", 1e-9, "at most",
                 note="paper: what a clothoid's constant rate allows")  # fmt: skip
    route = paper_route()
    profile = route.profile
    assert isinstance(profile, ProfileSequence)
    yield judged("fernandes-120-speed", f"{PAPER}, (120)",
                 "path speed at the first sample of the second part, where p = 0",
                 0, profile.parts[1].at(0.0).velocity, "m/s", 1e-9,
                 why="sgn(p) is 0 for p = 0, so the speed drops out for one sample; the direction "
                 "of travel is meant")  # fmt: skip


def _yaw() -> Iterator[Claim]:
    source = f"{PAPER}, abstract and 3.4"
    text = "sufficiently smooth references: step of the yaw acceleration in the middle of a turn"
    yield judged("fernandes-yaw-smooth", source, text, 0, _yaw_step(paper_route()), "rad/s²", 1e-8,
                 why="curvature is continuous but its rate is not, so the yaw reference is C1 "
                 "only", note=OPEN)  # fmt: skip
    yield judged("fernandes-yaw-smooth-option", source, text + ", Lindy's smooth turns",
                 0, _yaw_step(paper_route(smooth_yaw=True)), "rad/s²", 1e-8)  # fmt: skip


def _yaw_step(route: Route) -> float:
    """[rad/s²] Across the middle of the first turn."""
    turn = route.path.parts[1]
    goal = turn.begin + turn.length / 2
    low, high = 0.0, route.duration
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if route.at(middle).s < goal else (low, middle)
    return abs(route.at(low + 1e-6).yaw_acceleration - route.at(low - 1e-6).yaw_acceleration)


def _optimum() -> Iterator[Claim]:
    model = plan(SEA_TRIAL)
    times = optimal_times(SEA_TRIAL.length, model.v_m, model.a_m)
    source = f"{PAPER}, appendix A and figure 18"
    yield judged("fernandes-132-distance", source, "distance covered at t3 by (131)",
                 SEA_TRIAL.length, optimal(times[3], times, model.a_m).position, "m", 1e-9
                 )  # fmt: skip
    ours = same_limits_pair(model)
    yield judged("fernandes-18-time", source,
                 "a continuous acceleration takes longer than T_min: reference model, Lindy's pair",
                 [times[3]] * 2, [model.duration, ours.duration], "s", 0.0, "more than",
                 note=f"sea trial, {OPEN}; {model.duration / times[3]:.3f} and "
                 f"{ours.duration / times[3]:.3f} times T_min; equal peak values")  # fmt: skip
