"""Thrusters: wrench per newton, limits and dead-band. Their lag is in thruster_lag.py."""

from collections.abc import Sequence
from math import sqrt
from typing import overload

from messages.units import Vec6
from services.marine.vehicle import Thruster

ComplexVec6 = tuple[complex, complex, complex, complex, complex, complex]


def wrench_per_newton(thruster: Thruster) -> Vec6:
    """The thruster's column of the configuration matrix T: force and moment about the origin of
    one newton, [-, m] (Fossen 2011, eq. 12.226: f, r × f).

    Raises:
        ValueError: its direction has no length.
    """
    dx, dy, dz = thruster.direction
    length = sqrt(dx * dx + dy * dy + dz * dz)
    if not length > 0:
        raise ValueError(f"thruster {thruster.name}: direction must not be (0, 0, 0)")
    x, y, z = thruster.position
    dx, dy, dz = dx / length, dy / length, dz / length
    return dx, dy, dz, y * dz - z * dy, z * dx - x * dz, x * dy - y * dx


def limited(thruster: Thruster, command: float) -> float:
    """[N] The nearest thrust within the thruster's limits."""
    reverse, forward = thruster.limits
    if command > forward:
        return forward
    return command if command >= reverse else reverse


def driven(thruster: Thruster, command: float) -> float:
    """[N] Thrust the thruster settles at: nothing inside the dead-band, the whole command just
    outside of it (the aggressive start described in Andrén 2023, §6.2.2).

    The driver inverts the thrust curve, so only its limits and dead-band remain.
    """
    return limited(thruster, command) if abs(command) >= thruster.dead_band else 0.0


@overload
def total_wrench(columns: Sequence[Vec6], thrust: Sequence[float]) -> Vec6: ...
@overload
def total_wrench(columns: Sequence[Vec6], thrust: Sequence[complex]) -> ComplexVec6: ...
def total_wrench(columns: Sequence[Vec6], thrust: Sequence[complex]) -> ComplexVec6:
    """τ = T f [N, N m] about the origin (Fossen 2011, §12.3)."""
    surge: complex = 0.0
    sway: complex = 0.0
    heave: complex = 0.0
    roll: complex = 0.0
    pitch: complex = 0.0
    yaw: complex = 0.0
    for (a, b, c, d, e, f), newtons in zip(columns, thrust, strict=True):
        surge += a * newtons
        sway += b * newtons
        heave += c * newtons
        roll += d * newtons
        pitch += e * newtons
        yaw += f * newtons
    return surge, sway, heave, roll, pitch, yaw
