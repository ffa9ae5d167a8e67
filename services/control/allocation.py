"""From a wrench to thruster commands, for any layout of thrusters.

Surge, sway, heave and yaw are allocated; roll and pitch are left to the vehicle's own stability.
When thrusters saturate, heave and yaw are served first (losing depth or heading disorients the
pilot, losing speed does not), and what is left of the horizontal force keeps its direction.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.marine.vehicle import Vehicle

Array = NDArray[np.float64]
ROUNDING = 1 + 1e-9  # a thruster this little over its limit is full, not overloaded
PILOTED = [0, 1, 2, 5]  # surge, sway, heave, yaw rows of a wrench


@dataclass(frozen=True, slots=True)
class Allocated:
    thrust: tuple[float, ...]  # [N] per thruster, within its limits
    achieved: tuple[float, float, float, float, float, float]  # [N, N m] what they add up to
    saturated: tuple[str, ...]  # names of the thrusters that could not give more


class Allocation:
    """Built once per vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._names = [t.name for t in vehicle.thruster]
        self._limits = np.array([t.max_thrust for t in vehicle.thruster])
        self.effect: Array = effect_matrix(vehicle)
        inverse: Array = np.asarray(np.linalg.pinv(self.effect[PILOTED]), dtype=np.float64)
        self._first: Array = inverse * np.array([0.0, 0.0, 1.0, 1.0])
        self._second: Array = inverse * np.array([1.0, 1.0, 0.0, 0.0])

    def allocate(self, wrench: tuple[float, float, float, float]) -> Allocated:
        """Thrust for surge, sway, heave [N] and yaw [N m], body frame.

        `wrench` must be finite.
        """
        wanted = np.array(wrench)
        first, second = self._first @ wanted, self._second @ wanted
        share_first, full = _share_that_fits(np.zeros_like(first), first, self._limits)
        first = first * share_first
        share_second, also_full = _share_that_fits(first, second, self._limits)
        thrust = first + second * share_second
        limiting = tuple(self._names[index] for index in sorted({*full, *also_full}))
        # Rounding may leave a thruster a hair above its limit.
        thrust = np.clip(thrust, -self._limits, self._limits)
        x, y, z, k, m, n = (self.effect @ thrust).tolist()
        return Allocated(tuple(thrust.tolist()), (x, y, z, k, m, n), limiting)


def effect_matrix(vehicle: Vehicle) -> Array:
    """(6, n) wrench about the origin per newton of each thruster (Fossen 2011, 12.3)."""
    columns: list[Array] = []
    for thruster in vehicle.thruster:
        force: Array = np.array(thruster.direction) / np.linalg.norm(thruster.direction)
        moment: Array = np.cross(np.array(thruster.position), force)
        columns.append(np.concatenate([force, moment]))
    return np.stack(columns, axis=1)


def _share_that_fits(base: Array, more: Array, limits: Array) -> tuple[float, list[int]]:
    """Largest share s in [0, 1] with |base + s more| ≤ limits, for |base| ≤ limits, and the
    thruster that does not allow more (none when all of it fits)."""
    share, limiting = 1.0, list[int]()
    rows = zip(base.tolist(), more.tolist(), limits.tolist(), strict=True)
    for index, (b, m, limit) in enumerate(rows):
        if abs(b + m) > limit * ROUNDING:
            room = max(0.0, ((limit if m > 0 else -limit) - b) / m)
            if room < share:
                share, limiting = room, [index]
    return share, limiting
