"""Section 6.1 with a disturbance observer: what is left of the position error."""

import numpy as np
from matplotlib.figure import Figure

from lindy_research.papers import style
from lindy_research.papers.identified_inputs import sines
from lindy_research.papers.identified_plant import END_JERK, PlantRun, ratios, sums
from lindy_research.papers.identified_runs import NAIVE, improved, run

BANDWIDTHS = ((1.0, style.FILTER), (3.0, style.LINDY), (10.0, style.TARGET))  # [rad/s]


def observed(figure: Figure) -> str:
    """Naive, the thesis' way, and observers of three bandwidths through the step of figure 6.1."""
    force, error, near, thrust = style.stacked(
        figure,
        "disturbance,\nestimates [N]",
        "error of\nposition [mm]",
        "the same,\nnear [mm]",
        "thrust\n[N]",
    )
    naive, thesis = run(NAIVE), run(END_JERK)
    force.plot(naive.t, sines(len(naive.t)), color=style.LIMIT, linewidth=3.0, alpha=0.5,
               label="disturbance")  # fmt: skip
    shown: list[tuple[str, PlantRun, style.Look]] = [
        ("naive", naive, {"color": style.DIRECT}),
        ("thesis: minimum jerk", thesis, style.THEIRS),
    ]
    for bandwidth, colour in BANDWIDTHS:
        each = improved(END_JERK, bandwidth)
        shown.append((f"observer, {bandwidth:g} rad/s", each, {"color": colour, "linewidth": 1.2}))
        force.plot(each.t, -each.learnt, color=colour, linewidth=1.0)
    for name, each, look in shown:
        error.plot(each.t, each.error * 1e3, label=name, **look)
        thrust.plot(each.t, each.thrust, **look)
        if each is not naive:
            near.plot(each.t, each.error * 1e3, **look)
    near.set_ylim(-6.0, 6.0)
    handles, labels = error.get_legend_handles_labels()
    more = force.get_legend_handles_labels()
    force.legend(
        [*more[0], *handles], [*more[1], *labels], ncols=3, loc="lower center",
        bbox_to_anchor=(0.5, 1.0), columnspacing=1.4,
    )  # fmt: skip
    found = [ratios(sums(naive), sums(each)) for _, each, _ in shown[1:]]
    errors = ", ".join(
        f"{ratio.position:.0f} with {bandwidth:g} rad/s"
        for ratio, (bandwidth, _) in zip(found[1:], BANDWIDTHS, strict=True)
    )
    peak = min(ratio.peak for ratio in found)
    worst = 1e3 * float(np.max(np.abs(shown[3][1].error)))
    return (
        f"The step of figure 6.1 against three sines, end jerk {END_JERK:g} m/s³, same gains. The "
        f"squared position error is {found[0].position:.0f} times smaller than naive in the "
        f"thesis' way, and with an observer {errors}. With 3 rad/s the error stays below "
        f"{worst:.1f} mm. The thesis' error is the disturbance's: only what learns it helps. The "
        f"peak thrust stays at least {peak:.2f} times lower than naive. The state is known "
        "perfectly, as in the thesis: with real sensors their noise limits the bandwidth."
    )
