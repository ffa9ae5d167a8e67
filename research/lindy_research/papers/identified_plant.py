"""The vehicle of the thesis' simulations (Andrén 2023, 6.1), identified from its two tables.

The thesis prints results, but neither its plant nor its gains. One linear plant in surge with one
set of gains gives all eight numbers of Table 6.1 within 3 %, and with the same numbers the 75 %
of 6.1.2 and the equal rise time of 6.1.3. Mass and drag are then those of a small ROV in surge.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from lindy.api.messages import Motion
from lindy.api.references import BaselineReference
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import Plant

Floats = NDArray[np.float64]
DT = 0.01  # [s]
MASS = 13.3  # [kg] with the water that moves along
DRAG = 6.5  # [N s/m]
KP, KD = 25.5, 23.6  # [N/m], [N s/m]; natural frequency 1.38 rad/s, damping 0.82
END_JERK = 0.78  # [m/s³] of the minimum-jerk references
UNCLAMPED = 1e9  # the simulations have no guards


class Law(Protocol):
    """What drives the plant, as `Axis` does."""

    def learn(self, velocity: float, force: float, dt: float) -> None: ...

    @property
    def standing(self) -> float: ...

    def step(self, reference: Motion, position: float, rate: float, dt: float) -> float: ...


class PlantWater(Protocol):
    """What moves through it: position [m] and velocity [m/s] one step on, force [N] held."""

    def advance(self, x: float, v: float, force: float) -> tuple[float, float]: ...


@dataclass(frozen=True, slots=True)
class LinearWater:
    """m v' = f - d v over one step of `DT` with f held: exact, not integrated."""

    mass: float = MASS  # [kg]
    drag: float = DRAG  # [N s/m]

    def advance(self, x: float, v: float, force: float) -> tuple[float, float]:
        left = exp(-self.drag / self.mass * DT)  # what is left of a velocity without force
        glide = (1 - left) * self.mass / self.drag  # [s] distance per velocity
        settled = force / self.drag  # [m/s] where this force leads
        return x + glide * v + (DT - glide) * settled, settled + left * (v - settled)


class PlantRun(NamedTuple):
    """One simulation; arrays over its samples."""

    t: Floats  # [s]
    command: Floats  # [m/s] what the stick asks for
    reference: Floats  # (n, 4) position, velocity, acceleration, jerk
    position: Floats  # [m]
    velocity: Floats  # [m/s]
    thrust: Floats  # [N]
    learnt: Floats  # [N] what of it is against a disturbance that an observer has found

    @property
    def error(self) -> Floats:
        """[m] of the position to the run's own reference."""
        return self.reference[:, 0] - self.position


class Sums(NamedTuple):
    """The rows of Tables 6.1 and 6.2. Sums are over samples, as they are printed there."""

    peak: float  # [N] largest thrust
    position: float  # [m²] of squared errors
    thrust: float  # [N²] of squares
    jerk: float  # [N²/s²] of squared changes of thrust per second


def law(share: float = 1.0, observer: float = 0.0, *, sampled: bool = False) -> Axis:
    """u = P e + D ė + d v_r + `share` m a_r, the law of the simulations, and what can be added.

    Args:
        share: [-] of the acceleration feed-forward.
        observer: [rad/s] bandwidth of a disturbance observer; 0 for none, as in the thesis.
        sampled: feed-forward exact for a force that is held in each step, not for one that
            changes all the time.
    """
    gains = Gains(
        kp=KP, kd=KD, ki=0.0, max_error=UNCLAMPED, max_integral=UNCLAMPED,
        observer=observer, acceleration_percent=100 * share,
    )  # fmt: skip
    return Axis(gains, Plant(MASS, DRAG), period=DT if sampled else 0.0)


def follow(
    reference: BaselineReference,
    stick: Sequence[float],
    disturbance: Sequence[float] | None = None,
    by: Law | None = None,
    through: PlantWater | None = None,
) -> PlantRun:
    """Drive along a stick [m/s], one value per sample, against a force [N] held in each step.

    The state is known perfectly, as in the thesis. A sample sees a new command at once.
    """
    by, through = by or law(), through or LinearWater()
    forces = [0.0] * len(stick) if disturbance is None else disturbance
    x = v = thrust = 0.0
    rows: list[tuple[float, ...]] = []
    for k, (target, force) in enumerate(zip(stick, forces, strict=True)):
        reference.aim(target, k * DT)
        wanted = reference.at(k * DT)
        by.learn(v, thrust, DT)
        thrust = by.step(Motion(*wanted), x, v, DT)
        rows.append((k * DT, target, *wanted, x, v, thrust, by.standing))
        x, v = through.advance(x, v, thrust + force)
    table = np.array(rows)
    return PlantRun(table[:, 0], table[:, 1], table[:, 2:6], *table[:, 6:].T)


def sums(run: PlantRun) -> Sums:
    rate = np.diff(run.thrust) / DT
    return Sums(
        float(np.max(np.abs(run.thrust))),
        float(np.sum(run.error**2)),
        float(np.sum(run.thrust**2)),
        float(np.sum(rate**2)),
    )


def ratios(naive: Sums, other: Sums) -> Sums:
    """How many times more the naive reference takes."""
    return Sums(*(a / b for a, b in zip(naive, other, strict=True)))


def rise_time(run: PlantRun, begin: float, share: float = 0.9) -> float:
    """[s] From `begin` to when the velocity first has this share of the stick, between samples."""
    wanted = share * float(np.max(run.command))
    k = int(np.argmax(run.velocity >= wanted))
    before, after = run.velocity[k - 1], run.velocity[k]
    return float(run.t[k - 1] + DT * (wanted - before) / (after - before)) - begin
