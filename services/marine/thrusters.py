"""Thrusters: what each one does to the vehicle, what it can do, and how fast it follows."""

from math import copysign, exp, sqrt

from services.marine.vehicle import Thruster, Vec6


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
    if abs(command) > thruster.max_thrust:
        return copysign(thruster.max_thrust, command)
    return command


def driven(thruster: Thruster, command: float) -> float:
    """[N] Thrust the thruster settles at: nothing inside the dead-band, the whole command just
    outside of it (the aggressive start described in Andrén 2023, §6.2.2)."""
    return 0.0 if abs(command) < thruster.dead_band else limited(thruster, command)


def lagged(thrust: float, settles_at: float, time_constant: float, seconds: float) -> float:
    """[N] Thrust after `seconds` of first-order lag; the exact solution."""
    return settles_at + (thrust - settles_at) * exp(-seconds / time_constant)


def total_wrench(columns: list[Vec6], thrust: list[float]) -> Vec6:
    """τ = T f [N, N m] about the origin (Fossen 2011, §12.3)."""
    surge = sway = heave = roll = pitch = yaw = 0.0
    for (a, b, c, d, e, f), newtons in zip(columns, thrust, strict=True):
        surge += a * newtons
        sway += b * newtons
        heave += c * newtons
        roll += d * newtons
        pitch += e * newtons
        yaw += f * newtons
    return surge, sway, heave, roll, pitch, yaw
