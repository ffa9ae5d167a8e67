"""The part of the Munk moment cancelled by a real hull's wake.

In ideal flow, C_A(ν)ν turns a moving hull broadside on (the Munk moment, e.g. (Zẇ − Xu̇) u w in
pitch; Fossen 2011, §6.3.1). With that alone, a small vehicle without pitch thrusters tumbles above
about 0.7 m/s, unlike real ones: flow separation at the downstream end causes a restoring lift. The
model is a fin there for each pair of axes, whose moment is −share times Munk's, after the body-lift
terms of Prestero 2001. A fin only dissipates energy.
"""

from typing import NamedTuple

from messages.units import Vec6
from services.marine.vehicle import Vehicle

ARM_SHARE = 0.4  # [-] the fin's lever arm over the hull's length along the flow; assumed
PAIRS = ((0, 1, 2, 1), (0, 2, 1, -1), (1, 2, 0, 1))  # axes i, j, the third axis k, sign of i j k


class Fin(NamedTuple):
    """A fin at the downstream end of axis `along`, that resists motion along axis `across`."""

    along: int
    across: int
    moment: int  # index of its moment in a six-vector
    sign: int  # of the moment about the third axis: along × across = sign · third
    arm: float  # [m] from the origin
    grip: float  # [kg/m] newtons per (m/s along · m/s across)


def wake_fins(vehicle: Vehicle, share: float) -> list[Fin]:
    """One fin per pair of axes, along the axis of the lesser added mass: there Munk's moment is
    unstable.

    Args:
        share: [-] of the Munk moment that is cancelled, 0 … 1.
    """
    fins = list[Fin]()
    for i, j, third, sign in PAIRS:
        if vehicle.added_mass[i] > vehicle.added_mass[j]:
            i, j, sign = j, i, -sign
        arm = ARM_SHARE * vehicle.size[i]
        grip = share * (vehicle.added_mass[j] - vehicle.added_mass[i]) / arm
        fins.append(Fin(i, j, 3 + third, sign, arm, grip))
    return fins


def wake_lift(fins: list[Fin], nu: Vec6) -> list[float]:
    """Wrench [N, N m] of all fins on the vehicle, about the origin."""
    wrench = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    for along, across, moment, sign, arm, grip in fins:
        flow = nu[along]
        lever = -sign * arm if flow >= 0 else sign * arm
        force = -grip * abs(flow) * (nu[across] + lever * nu[moment])
        wrench[across] += force
        wrench[moment] += lever * force
    return wrench
