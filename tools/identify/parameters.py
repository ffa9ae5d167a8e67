"""The numbers that are fitted, as one vector, and the vehicle that they describe.

Of each axis the logarithm of the inertia, and both drag coefficients over a typical size of their
own; then the net buoyancy over one newton, and the logarithm of the lag.
"""

from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import Vehicle
from tools.identify.motion_model import ROWS
from tools.identify.thrust import Floats

AXES = ("surge", "sway", "heave", "yaw")  # in the order of the motion model
COUNT = 14
BUOYANCY, LAG = 12, 13
LEAST = 0.05  # [-] of the mean drag of an axis: a drag coefficient is not scaled by less
UNLIKELY = 0.15, 0.4, 0.4, 2.0, 0.5  # std of what is not fitted: ln M, drags, [N], ln lag


class Beginning(NamedTuple):
    """The vehicle file, and the scales of its numbers."""

    vehicle: Vehicle
    linear: Floats  # (4,) scale of each axis
    quadratic: Floats  # (4,)

    @property
    def vector(self) -> Floats:
        """(COUNT,) The vehicle file's own numbers."""
        inertia = system_inertia(self.vehicle)
        found = np.zeros(COUNT)
        for axis, row in enumerate(ROWS):
            found[inertia_of(axis)] = np.log(inertia[row])
            found[linear_of(axis)] = self.vehicle.linear_damping[row] / self.linear[axis]
            found[quadratic_of(axis)] = self.vehicle.quadratic_damping[row] / self.quadratic[axis]
        found[BUOYANCY] = self.vehicle.net_buoyancy
        found[LAG] = np.log(np.median([t.time_constant for t in self.vehicle.thruster]))
        return found

    @property
    def prior(self) -> Floats:
        """(COUNT,) Standard deviations of what the data do not tell."""
        inertia, linear, quadratic, buoyancy, lag = UNLIKELY
        return np.array([inertia, linear, quadratic] * 4 + [buoyancy, lag])


def inertia_of(axis: int) -> int:
    return 3 * axis


def linear_of(axis: int) -> int:
    return 3 * axis + 1


def quadratic_of(axis: int) -> int:
    return 3 * axis + 2


def indices_of(axis: str) -> list[int]:
    """Parameters that belong to an axis."""
    first = 3 * AXES.index(axis)
    return [first, first + 1, first + 2, *([BUOYANCY] if axis == "heave" else [])]


def start_of(vehicle: Vehicle) -> Beginning:
    """A coefficient that the file has as zero is scaled by the axis' other one."""
    linear = np.array([vehicle.linear_damping[row] for row in ROWS])
    quadratic = np.array([vehicle.quadratic_damping[row] for row in ROWS])
    both = np.maximum(linear + quadratic, 1e-3)
    return Beginning(vehicle, np.maximum(linear, LEAST * both), np.maximum(quadratic, LEAST * both))


def inertia_at(x: Floats, axis: int) -> float:
    return float(np.exp(x[inertia_of(axis)]))


def vehicle_of(start: Beginning, x: Floats, axes: tuple[str, ...] = AXES) -> Vehicle:
    """The file's vehicle with these numbers. Of the inertia, the mass stays and the added mass
    changes; it may become negative here, and so may drag."""
    v = start.vehicle
    added, linear, quadratic = map(list, (v.added_mass, v.linear_damping, v.quadratic_damping))
    dry = system_inertia(replace(v, added_mass=(0.0,) * 6))
    for axis in map(AXES.index, axes):
        row = ROWS[axis]
        added[row] = inertia_at(x, axis) - dry[row]
        linear[row] = float(x[linear_of(axis)] * start.linear[axis])
        quadratic[row] = float(x[quadratic_of(axis)] * start.quadratic[axis])
    return replace(
        v,
        added_mass=six(added),
        linear_damping=six(linear),
        quadratic_damping=six(quadratic),
        net_buoyancy=float(x[BUOYANCY]) if "heave" in axes else v.net_buoyancy,
    )


def six(values: list[float]) -> tuple[float, float, float, float, float, float]:
    a, b, c, d, e, f = values
    return a, b, c, d, e, f
