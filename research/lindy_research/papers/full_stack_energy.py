"""What the first dive takes from the battery, with ramps and without (Andrén 2023, 6.2.3)."""

from functools import cache
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from lindy.api.messages import topics
from lindy_research.dives import DT, Dive, Floats
from lindy_research.papers import style
from lindy_research.papers.full_stack_runs import NAIVE
from lindy_research.papers.identified_battery import hotel_power
from services.runtime.config.settings import deploy_file

DIVE, SECONDS = "first_dive", 87.0  # [s]
PUSHING = ((22.0, 34.0), (43.0, 51.0), (78.5, 87.0))  # [s] ahead, on the floor, at the surface
SMOOTH = 0.5  # [s] over which power is shown


class Used(NamedTuple):
    t: Floats  # [s] since arming
    depth: Floats  # [m]
    heading: Floats  # [rad]
    power: Floats  # [W] of everything

    @property
    def thrusters(self) -> Floats:
        """[J] Used by the thrusters up to each sample."""
        return np.cumsum(self.power - hotel_power()) * DT

    @property
    def pushing(self) -> float:
        """[J] Used by the thrusters for running ahead, and against floor and surface."""
        rows = [(round(begin / DT), round(end / DT) - 1) for begin, end in PUSHING]
        return float(sum(self.thrusters[end] - self.thrusters[begin] for begin, end in rows))

    @property
    def total(self) -> float:
        """[J]"""
        return float(np.sum(self.power)) * DT


@cache
def used(*, naive: bool) -> Used:
    script = deploy_file("dives", DIVE, ".csv").read_text(encoding="utf-8")
    dive = Dive(script, overrides=NAIVE if naive else ()).until(SECONDS)
    return Used(
        dive.t,
        dive.column(topics.TRUTH, lambda m: m.position[2]),
        dive.column(topics.TRUTH, lambda m: m.heading),
        dive.column(topics.ACTUATION, lambda m: m.power),
    )


def longer() -> float:
    """[%] By how much the battery lasts longer with ramps."""
    return 100.0 * (used(naive=True).total / used(naive=False).total - 1.0)


def thruster_share() -> float:
    """[-] What the thrusters take without ramps, of what they take with."""
    return float(used(naive=True).thrusters[-1] / used(naive=False).thrusters[-1])


def first_dive(figure: Figure) -> str:
    depth, heading, power, energy = style.stacked(
        figure, "depth\n[m]", "heading\n[°]", "power of\nthrusters [W]", "energy of\nthrusters [J]"
    )
    window = np.ones(round(SMOOTH / DT)) * DT / SMOOTH
    ways: tuple[tuple[str, bool, style.Look], ...] = (
        ("naive", True, {"color": style.DIRECT}),
        ("minimum jerk", False, style.THEIRS),
    )
    for name, naive, look in ways:
        dive = used(naive=naive)
        depth.plot(dive.t, dive.depth, label=name, **look)
        heading.plot(dive.t, np.degrees(dive.heading), **look)
        thrusters = np.convolve(dive.power - hotel_power(), window, "same")
        thin: style.Look = {**look, "linewidth": 1.0}
        power.plot(dive.t, thrusters, **thin)
        energy.plot(dive.t, dive.thrusters, **look)
    depth.invert_yaxis()  # down is down
    style.legend(depth, 2)
    naive, jerky = used(naive=True), used(naive=False)
    return (
        f"The dive of deploy/dives/{DIVE}.csv, flown by the whole stack with the simulated "
        "Pioneer: with Lindy's ramps, and with velocities and forces that jump with the stick. "
        f"Power is smoothed over {SMOOTH:g} s. The thrusters take {naive.thrusters[-1]:.0f} J "
        f"without ramps and {jerky.thrusters[-1]:.0f} J with them; beside {hotel_power():.0f} W "
        f"for everything else the battery lasts {longer():.1f} % longer (thesis: 10 to 20 %). "
        f"Running ahead, and pushing against floor and surface, take {naive.pushing:.0f} and "
        f"{jerky.pushing:.0f} J of it: no ramp saves those."
    )
