"""From a wrench to thruster commands, for any layout of thrusters.

Surge, sway, heave and yaw are allocated; roll and pitch are left to the vehicle's own stability.
When thrusters saturate, heave and yaw are served first (losing depth or heading disorients the
pilot, losing speed does not), and what is left of the horizontal force keeps its direction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.marine.thrusters import wrench_per_newton
from services.marine.vehicle import Vec6, Vehicle

Rows = list[list[float]]
ROUNDING = 1 + 1e-9  # a thruster this little over its limit is full, not overloaded
PILOTED = [0, 1, 2, 5]  # surge, sway, heave, yaw rows of a wrench


@dataclass(frozen=True, slots=True)
class Allocated:
    thrust: tuple[float, ...]  # [N] per thruster, within its limits
    achieved: Vec6  # [N, N m] what they add up to
    saturated: tuple[str, ...]  # names of the thrusters that could not give more


class Allocation:
    """Built once per vehicle. Plain floats: at this size five times faster than NumPy."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._names = [t.name for t in vehicle.thruster]
        self._limits = [t.max_thrust for t in vehicle.thruster]
        effect = effect_matrix(vehicle)
        self._effect: Rows = effect.tolist()
        # Per thruster: its share of each newton of surge, sway, heave and newton metre of yaw.
        self._shares: Rows = np.linalg.pinv(effect[PILOTED]).tolist()

    def allocate(self, wrench: tuple[float, float, float, float]) -> Allocated:
        """Thrust for surge, sway, heave [N] and yaw [N m], body frame.

        `wrench` must be finite.
        """
        x, y, z, n = wrench
        first = [share[2] * z + share[3] * n for share in self._shares]
        second = [share[0] * x + share[1] * y for share in self._shares]
        share_first, full = _share_that_fits([0.0] * len(first), first, self._limits)
        first = [share_first * f for f in first]
        share_second, also_full = _share_that_fits(first, second, self._limits)
        thrust = tuple(
            # Rounding may leave a thruster a hair above its limit.
            max(-limit, min(limit, f + share_second * s))
            for f, s, limit in zip(first, second, self._limits, strict=True)
        )
        limiting = tuple(self._names[index] for index in sorted({*full, *also_full}))
        return Allocated(thrust, self._add_up(thrust), limiting)

    def _add_up(self, thrust: tuple[float, ...]) -> Vec6:
        x, y, z, k, m, n = [
            sum([e * f for e, f in zip(row, thrust, strict=True)]) for row in self._effect
        ]
        return x, y, z, k, m, n


def effect_matrix(vehicle: Vehicle) -> NDArray[np.float64]:
    """(6, n) wrench about the origin per newton of each thruster (Fossen 2011, 12.3)."""
    return np.array([wrench_per_newton(thruster) for thruster in vehicle.thruster]).T


def _share_that_fits(
    base: list[float], more: list[float], limits: list[float]
) -> tuple[float, list[int]]:
    """Largest share s in [0, 1] with |base + s more| ≤ limits, for |base| ≤ limits, and the
    thruster that does not allow more (none when all of it fits)."""
    share, limiting = 1.0, list[int]()
    for index, (b, m, limit) in enumerate(zip(base, more, limits, strict=True)):
        if abs(b + m) > limit * ROUNDING:
            room = max(0.0, ((limit if m > 0 else -limit) - b) / m)
            if room < share:
                share, limiting = room, [index]
    return share, limiting
