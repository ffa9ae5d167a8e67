"""Andrén 2023, figures 6.2 and 6.3: shares of the feed-forward, and rise times."""

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from lindy_research.papers import style
from lindy_research.papers.identified_inputs import SPEED, STEP_ON
from lindy_research.papers.identified_plant import END_JERK, PlantRun, rise_time, sums
from lindy_research.papers.identified_runs import NAIVE, Summed, best_share, equal_rise_jerk, run

SHARES = [k / 5 for k in range(11)]  # [-] of the acceleration feed-forward
FINE = [k / 10 for k in range(21)]
JERKS = [k / 2 for k in range(1, 21)]  # [m/s³]
SUMMED: dict[Summed, str] = {"thrust": style.PAPER, "position": style.FILTER}
BLUE_TO_ORANGE = LinearSegmentedColormap.from_list("shares", ["#0072B2", "#BBBBBB", "#E69F00"])
LIGHT_TO_DARK = LinearSegmentedColormap.from_list("jerks", ["#A5DBC8", "#00402E"])


def feed_forward(figure: Figure) -> str:
    labels = (
        "velocity\n[m/s]",
        "thrust\n[N]",
        "error of\nposition [mm]",
        "sum of squares\n/ largest [-]",
    )
    panels = style.above_each_other(figure, labels, (1, 1, 1, 1), "time [s]", below=1)
    for share in SHARES:
        each = run(share=share)
        look: style.Look = {"color": BLUE_TO_ORANGE(share / 2), "linewidth": 1.1}
        if share == 1.0:
            look = {"color": style.LINDY, "linewidth": 1.8, "zorder": 3}
        name = f"{100 * share:.0f} %" if share in (0.0, 0.6, 1.0, 1.4, 2.0) else None
        panels[0].plot(each.t, each.velocity, label=name, **look)
        panels[1].plot(each.t, each.thrust, **look)
        panels[2].plot(each.t, each.error * 1e3, **look)
    each = run()
    panels[0].plot(each.t, each.reference[:, 1], label="reference", **style.ASKED)
    style.legend(panels[0], 6)
    _parabolas(figure)
    best = {of: 100 * best_share(of) for of in SUMMED}
    others = [100 * best_share("thrust", jerk) for jerk in (0.5, 3.0)]
    return (
        "Share of the exact feed-forward m a in steps of 20 %; the same disturbance for all. "
        "Results are evenly spaced, as the shares are: errors and thrust are affine in the share, "
        "so the sums of squares are parabolas. Below, without disturbance, which on average moves "
        f"neither minimum (dotted): position error at {best['position']:.1f} %, thrust at "
        f"{best['thrust']:.1f} % (thesis: 75 %). The latter is this end jerk's: {others[0]:.0f} % "
        f"for 0.5 and {others[1]:.0f} % for 3 m/s³."
    )


def _parabolas(figure: Figure) -> None:
    below = figure.axes[3]
    found = [sums(run(share=share, disturbed=False)) for share in FINE]
    for of, colour in SUMMED.items():
        totals = np.array([getattr(each, of) for each in found])
        below.plot(100 * np.array(FINE), totals / totals.max(), color=colour, label=of)
        below.axvline(100 * best_share(of), color=colour, linestyle=":", linewidth=1.6)
    below.set(xlabel="share of the acceleration feed-forward [%]", xlim=(0, 200), ylim=(0, 1.05))
    style.legend(below, 2)


def rise_times(figure: Figure) -> str:
    labels = ("position\n[m]", "velocity\n[m/s]", "thrust\n[N]", "peak thrust\n[N]")
    panels = style.above_each_other(figure, labels, (1, 1, 1, 1.1), "time [s]", below=1)
    colours = LIGHT_TO_DARK.resampled(len(JERKS))
    runs = [(jerk, run(jerk, disturbed=False)) for jerk in JERKS]
    for k, (jerk, each) in enumerate(runs):
        name = f"{jerk:g} m/s³" if jerk in (0.5, 10.0) else None
        _show(figure, each, name, {"color": colours(k), "linewidth": 0.9})
    equal = equal_rise_jerk()
    naive, same = run(NAIVE, disturbed=False), run(equal, disturbed=False)
    _show(figure, naive, "naive", {"color": style.DIRECT, "linewidth": 1.8})
    _show(figure, same, f"{equal:.2f} m/s³", {"color": style.PAPER, "linewidth": 1.8})
    panels[0].set(xlim=(0.8, 3.6), ylim=(-0.05, 0.85))
    panels[2].set_ylim(-1.0, 16.5)
    style.legend(panels[0], 4)
    below = panels[3]
    rise = [rise_time(each, STEP_ON) for _, each in runs]
    below.plot(rise, [sums(each).peak for _, each in runs], "-", color=LIGHT_TO_DARK(0.5),
               marker="o", markersize=3.5, label="minimum jerk, 0.5 to 10 m/s³")  # fmt: skip
    _point(figure, naive, {"color": style.DIRECT, "marker": "s", "label": "naive"})
    _point(figure, same, {"color": style.PAPER, "marker": "D", "label": f"{equal:.2f} m/s³"})
    _point(
        figure,
        run(END_JERK, disturbed=False),
        {"color": style.LINDY, "marker": "^", "label": f"Table 6.1, {END_JERK:g} m/s³"},
    )
    below.set_xlabel("rise time to 90 % [s]")
    style.legend(below, 4)
    most = max(float(np.max(each.velocity)) / SPEED - 1 for _, each in runs)
    return (
        f"No disturbance, stick 0 → {SPEED:g} m/s at {STEP_ON:g} s. An end jerk of {equal:.2f} "
        f"m/s³ (thesis: 3) rises as fast as the naive reference, in "
        f"{rise_time(naive, STEP_ON):.2f} s, with {sums(same).peak:.2f} instead of "
        f"{sums(naive).peak:.2f} N. The velocity overshoots by at most {100 * most:.1f} %, naive "
        f"by {100 * (float(np.max(naive.velocity)) / SPEED - 1):.1f} %."
    )


def _show(figure: Figure, each: PlantRun, name: str | None, look: style.Look) -> None:
    for panel, values in zip(
        figure.axes, (each.position, each.velocity, each.thrust), strict=False
    ):
        panel.plot(each.t, values, label=name, **look)


def _point(figure: Figure, each: PlantRun, look: style.Look) -> None:
    figure.axes[3].plot(
        [rise_time(each, STEP_ON)], [sums(each).peak], linestyle="none", markersize=7, **look
    )
