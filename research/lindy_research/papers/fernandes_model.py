"""Fernandes et al. 2015, figures 1, 9 and 18: the reference model along one coordinate."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy.api.references import Limits, PositionMove, ReferenceModel, Sample, plan
from lindy.api.references import position_move as pair
from lindy_research.laws.model_as_printed import basic_as_printed
from lindy_research.papers import style
from lindy_research.papers.curves import sampled, show
from lindy_research.papers.setups import SEA_TRIAL, TABLE_2_BEGIN, XI, table_2


def peak_limits(model: ReferenceModel) -> Limits:
    """The greatest jerk and acceleration that the reference model itself uses."""
    pulls = [pull for pull in (model.phases[0], model.phases[3]) if pull.duration > 0]
    return Limits(max(abs(p.a) / p.tau for p in pulls), max(abs(p.a) for p in pulls))


def same_limits_pair(model: ReferenceModel) -> PositionMove:
    """Lindy's motion to the same place within the same limits."""
    return pair(model.length, peak_limits(model), abs(model.v_m))


def shapes(figure: Figure) -> str:
    model, printed = plan(SEA_TRIAL), basic_as_printed(SEA_TRIAL)
    ours = same_limits_pair(model)
    labels = ("position [m]", "velocity [m/s]", "acceleration\n[m/s²]", "position − L\n[µm]")
    *panels, below = style.above_each_other(figure, labels, (1, 1, 1, 1), "time [s]", below=1)
    t = np.linspace(0.0, 245.0, 2500)
    for curves, look in (
        (sampled(model.at, t), {**style.THEIRS, "label": "reference model"}),
        (sampled(ours.at, t), {**style.OURS, "label": "Lindy's pair, same limits"}),
    ):
        show(panels, curves, **look)
    style.legend(panels[0], 2)
    _mark(panels, (0.0, *model.t), "$t_{}$")
    for name, begin, end in zip(
        ("1st phase", "2nd", "3rd phase", "4th"),
        (0.0, model.t[1], model.t[2], model.t[4]),
        (*model.t[1:3], model.t[4], 245.0),
        strict=True,
    ):
        panels[1].text((begin + end) / 2, 0.12, name, ha="center", color=style.LIMIT, fontsize=8.5)
    _arrival(below, printed, model)
    return (
        f"L = 50 m, V_d = 0.3 m/s, T_a = T_d = 20 s, θ_0 = exp(−100/9), ξ = {XI:g} (not printed). "
        f"Reference model {model.duration:.2f} s; Lindy's pair of minimum-jerk transitions with "
        f"the same peak velocity, acceleration and jerk {ours.duration:.2f} s. Below: with T₁ = "
        "ξ_a τ₁₁ and T₄ = ξ_d τ₃₁ as printed in (39), (42) the motion overshoots L and is set "
        "back at t₅."
    )


def _arrival(panel: Axes, printed: ReferenceModel, model: ReferenceModel) -> None:
    """What the misprint does to the end of the motion."""
    t = np.linspace(model.t[4] - 9.0, model.t[4] + 3.0, 1500)
    for label, motion, colour in (
        ("as printed", printed, style.MINIMUM_TIME),
        ("corrected times", model, style.PAPER),
    ):
        gap = [(motion.at(float(x)).position - SEA_TRIAL.length) * 1e6 for x in t]
        panel.plot(t, gap, label=label, color=colour)
    panel.axvline(model.t[4], **style.EDGE)
    panel.text(model.t[4], 28.0, " $t_5$", color=style.LIMIT)
    panel.set(ylim=(-40.0, 40.0), xlabel="time [s]")
    style.legend(panel, 2)


def three_runs(figure: Figure) -> str:
    panels = style.stacked(figure, "position [m]", "velocity [m/s]", "acceleration\n[m/s²]")
    motion = table_2()
    t = np.linspace(0.0, 250.0, 3000)

    def at(moment: float) -> Sample:
        return motion.at(moment - TABLE_2_BEGIN)

    show(panels, sampled(at, t), color=style.PAPER)
    edges = [TABLE_2_BEGIN + x for x in (*motion.begins, motion.duration)]
    for panel in panels:
        for edge in edges:
            panel.axvline(edge, color=style.MINIMUM_TIME, ls="--", lw=1.1)
    for name, begin, end in zip(("1st", "2nd", "3rd"), edges[:-1], edges[1:], strict=True):
        panels[1].text((begin + end) / 2, 0.08, name, ha="center", color=style.MINIMUM_TIME)
    begins = ", ".join(f"{edge:.2f}" for edge in edges)
    return (
        f"Tuning of Table 2, ξ = {XI:g} (not printed). The runs begin and end (dashed) at {begins} "
        "s; the paper reads 15, 78, 128, 224 s. The second run is cruise only."
    )


def optimal_shapes(figure: Figure) -> str:
    model = plan(SEA_TRIAL)
    ours = same_limits_pair(model)
    a_max, v_max, distance = abs(model.a_m), abs(model.v_m), model.length
    times = optimal_times(distance, v_max, a_max)
    panels = style.stacked(figure, "position [m]", "velocity [m/s]", "acceleration\n[m/s²]")
    t = np.linspace(-5.0, 245.0, 5000)
    motions = (
        (sampled(lambda x: optimal(x, times, a_max), t), style.MINIMUM_TIME, "optimal"),
        (sampled(lambda x: model.at(max(0.0, x)), t), style.PAPER, "reference model"),
    )
    for curves, colour, label in motions:
        show(panels, curves, color=colour, label=label)
    show(panels, sampled(lambda x: ours.at(max(0.0, x)), t), label="Lindy's pair", **style.OURS)
    style.legend(panels[0], 3)
    _mark(panels, times, "$t_{}$")
    return (
        f"d = {distance:g} m, v_max = {v_max:g} m/s, a_max = {a_max:g} m/s² (those of the sea "
        f"trial; the paper draws symbols). Arrival: optimal {times[3]:.2f} s, Lindy's pair "
        f"{ours.duration:.2f} s, reference model {model.duration:.2f} s, ξ = {XI:g}. The pair has "
        "the peak jerk of the reference model; the optimum has no limit on jerk."
    )


def optimal_times(distance: float, v_max: float, a_max: float) -> tuple[float, ...]:
    """t0 … t3 [s] of the shortest motion with limited acceleration and velocity."""
    ramp = v_max / a_max
    end = distance / v_max + ramp
    return 0.0, ramp, end - ramp, end


def optimal(t: float, times: Sequence[float], a_max: float) -> Sample:
    """(131) and its integrals."""
    since = [max(0.0, t - begin) for begin in times]
    signs = (1.0, -1.0, -1.0, 1.0)
    return Sample(
        a_max / 2 * sum(s * x * x for s, x in zip(signs, since, strict=True)),
        a_max * sum(s * x for s, x in zip(signs, since, strict=True)),
        a_max * sum(s for s, x in zip(signs, since, strict=True) if x > 0),
        0.0,
    )


def _mark(panels: Sequence[Axes], times: Sequence[float], name: str) -> None:
    """Dotted lines at t0, t1 …, named in the lowest panel."""
    for number, time in enumerate(times):
        for panel in panels:
            panel.axvline(time, **style.EDGE)
        panels[-1].text(
            time, 1.0, name.format(number), transform=panels[-1].get_xaxis_transform(),
            ha="center", va="bottom", fontsize=9, color=style.LIMIT,
        )  # fmt: skip
