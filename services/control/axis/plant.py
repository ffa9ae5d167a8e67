"""The law's model of one axis of the vehicle: M v' = u - D(v) + w."""

from math import expm1
from typing import NamedTuple

from services.marine.rigid_body import system_inertia
from services.marine.vehicle import Vehicle


class Plant(NamedTuple):
    """Inertia and drag of one axis."""

    inertia: float  # [kg] or [kg m²], added mass included
    linear: float = 0.0  # [N s/m] or [N m s/rad]
    quadratic: float = 0.0  # [N s²/m²] or [N m s²/rad²]

    def drag(self, velocity: float) -> float:
        """D(v) [N] or [N m], linear and quadratic (Andrén 2023, 7.2.5)."""
        return (self.linear + self.quadratic * abs(velocity)) * velocity

    def sampled_inertia(self, dt: float) -> float:
        """[kg] or [kg m²] Effective inertia for a force held over `dt` [s].

        The exact solution of m v' = u - d v over one step, v₊ = φ v + (1 - φ) u / d with
        φ = exp(-d dt / m), reads (v₊ - v) / dt = (u - d v) / m_s with this m_s. It is m + d dt / 2
        to first order.
        """
        x = self.linear * dt / self.inertia
        return self.inertia if x == 0.0 else self.inertia * x / -expm1(-x)


def plant_of(vehicle: Vehicle, axis: int) -> Plant:
    """The axis 0 … 5 (X, Y, Z, K, M, N) of a vehicle, added mass included."""
    return Plant(
        inertia=system_inertia(vehicle)[axis],
        linear=vehicle.linear_damping[axis],
        quadratic=vehicle.quadratic_damping[axis],
    )
