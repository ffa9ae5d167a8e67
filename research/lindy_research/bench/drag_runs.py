"""A vehicle with quadratic drag, driven with and without knowing it (Andrén 2023, 7.2.5)."""

from dataclasses import dataclass

import numpy as np

from lindy.api.references import BaselineReference, Direct, Limits, Ramp
from lindy_research.papers.identified_inputs import SPEED as SLOW
from lindy_research.papers.identified_inputs import step_stick
from lindy_research.papers.identified_plant import DT, END_JERK, KD, KP, UNCLAMPED, follow
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import Plant

SPEED = 1.0  # [m/s]
OFF, END = 5.0, 12.0  # [s] the stick is released, and the run ends
WATER = Plant(13.8, 1.84, 25.0)  # [kg], [N s/m], [N s²/m²] a small ROV in surge, with its tether
LINEARISED = Plant(WATER.inertia, WATER.linear + WATER.quadratic * SLOW)  # right at 0.3 m/s
JERK = END_JERK * SPEED / SLOW  # [m/s³] the quicker stick has the quicker ramp


@dataclass(frozen=True, slots=True)
class QuadraticWater:
    """m v' = f - d v - q v |v| over one step, by a Runge-Kutta step of fourth order."""

    plant: Plant = WATER

    def advance(self, x: float, v: float, force: float) -> tuple[float, float]:
        def slope(velocity: float) -> float:
            return (force - self.plant.drag(velocity)) / self.plant.inertia

        k1 = slope(v)
        k2 = slope(v + DT / 2 * k1)
        k3 = slope(v + DT / 2 * k2)
        k4 = slope(v + DT * k3)
        way = v + DT / 6 * (k1 + k2 + k3)  # the same rule for x' = v, worked out
        return x + DT * way, v + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def worst_errors() -> tuple[float, float, float]:
    """[m] Largest position error: naive and minimum jerk with linearised drag, minimum jerk with
    the drag as it is."""
    limits = Limits(JERK)
    return (
        _worst(Direct(), LINEARISED),
        _worst(Ramp(limits), LINEARISED),
        _worst(Ramp(limits), WATER),
    )


def _worst(reference: BaselineReference, known: Plant) -> float:
    gains = Gains(kp=KP, kd=KD, ki=0.0, max_error=UNCLAMPED, max_integral=UNCLAMPED)
    stick = step_stick(SPEED, OFF, END)
    run = follow(reference, stick, by=Axis(gains, known, period=DT), through=QuadraticWater())
    return float(np.max(np.abs(run.error)))
