"""Motion in surge, sway, heave and yaw of many vehicles at once, with roll and pitch as measured.

These are rows 1, 2, 3 and 6 of the simulator's equations (services/simulator/vessel.py; Fossen
2011, eq. 6.1 to 6.3), the wake's fins included. Roll and pitch rate and attitude come from the
gyroscopes, so that the righting moment need not be known. Many vehicles at once, because a
derivative by every parameter needs one each: arrays are (columns, windows, …).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from services.marine.hydrodynamics import system_inertia, wake_fins
from services.marine.vehicle import GRAVITY, Vehicle
from tools.identify.thrust import Floats

U, V, W, R = range(4)  # surge, sway, heave, yaw
ROWS = (0, 1, 2, 5)  # of six-vectors


class Measured(NamedTuple):
    """What drives the model; at the times of the grid, twice per step of the integration."""

    period: float  # [s] between two times
    wrench: Floats  # (columns or 1, windows, n, 4) [N, N m]
    mean: Floats  # (columns or 1, windows, n / 2, 4) [N, N m] over each step
    rates: Floats  # (windows, n, 2) [rad/s] roll and pitch rate
    down: Floats  # (columns or 1, windows, n, 3) [-] the world's down axis in body axes


class Predicted(NamedTuple):
    velocity: Floats  # (columns, windows, n, 4) [m/s, rad/s]
    acceleration: Floats  # (columns, windows, n, 4) [m/s², rad/s²], in the turning body frame
    depth: Floats  # (columns, windows, n) [m] from that at the beginning
    force: Floats  # (columns, windows, n, 3) [m/s²] specific force at the origin


class MotionCoefficients(NamedTuple):
    """Arrays over the columns."""

    inverse: Floats  # (c, 1, 4) of the inertia
    linear: Floats  # (c, 1, 4)
    drag: Floats  # (c, 4, 4) per |ν| of the column's axis, the fins' part included
    by_p: Floats  # (c, 4, 4) Coriolis forces per roll rate,
    by_q: Floats  # pitch rate
    by_r: Floats  # and yaw rate
    munk: Floats  # (c, 1) yaw moment per surge times sway velocity
    rolling: Floats  # (c, 1) yaw moment per roll times pitch rate
    sinks: Floats  # (c, 1, 1) [N] weight minus buoyancy


def coefficients(vehicles: Sequence[Vehicle], wake_share: float) -> MotionCoefficients:
    """Of submerged vehicles, one per column."""
    every = [_of_one(vehicle, wake_share) for vehicle in vehicles]
    return MotionCoefficients(*(np.array(part) for part in zip(*every, strict=True)))


def _of_one(vehicle: Vehicle, wake_share: float) -> tuple[Floats, ...]:
    inertia = system_inertia(vehicle)
    m_u, m_v, m_w, i_p, i_q, _ = inertia
    munk, brake = np.zeros((3, 3)), np.zeros((6, 3))
    for fin in wake_fins(vehicle, wake_share):
        munk[fin.across, fin.along] = fin.grip * fin.arm
        brake[fin.across, fin.along] = fin.grip
        brake[fin.moment, fin.along] = fin.grip * fin.arm**2
    drag = np.zeros((4, 4))
    drag[:, :3] = brake[list(ROWS)]
    drag += np.diag([vehicle.quadratic_damping[row] for row in ROWS])
    by_p, by_q, by_r = np.zeros((4, 4)), np.zeros((4, 4)), np.zeros((4, 4))
    by_r[U, V], by_q[U, W] = m_v - munk[0, 1], -(m_w - munk[0, 2])
    by_p[V, W], by_r[V, U] = m_w - munk[1, 2], -(m_u - munk[1, 0])
    by_q[W, U], by_p[W, V] = m_u - munk[2, 0], -(m_v - munk[2, 1])
    turning = m_u - m_v + munk[1, 0] - munk[0, 1]
    return (
        np.array([[1.0 / inertia[row] for row in ROWS]]),
        np.array([[vehicle.linear_damping[row] for row in ROWS]]),
        drag, by_p, by_q, by_r,
        np.array([turning]), np.array([i_p - i_q]), np.array([[-vehicle.net_buoyancy]]),
    )  # fmt: skip


def predict(c: MotionCoefficients, begin: Floats, measured: Measured) -> Predicted:
    """Integrate by Kutta's rule of third order, with steps of two periods: yaw settles in a few.

    Args:
        begin: (columns, windows, 4) [m/s, rad/s] velocities.
    """
    h = 2.0 * measured.period
    n = measured.rates.shape[1] // 2 * 2
    nu, z = begin.astype(float), np.zeros(begin.shape[:2])
    velocity = np.empty((*begin.shape[:2], n, 4))
    slope = np.empty_like(velocity)
    depth = np.empty((*begin.shape[:2], n))
    wrench, down = measured.wrench, measured.down
    for k in range(0, n, 2):
        end = min(k + 2, n - 1)
        velocity[:, :, k], depth[:, :, k] = nu, z
        slope[:, :, k] = first = _acceleration(c, nu, measured, k)
        slope[:, :, k + 1] = second = _acceleration(c, nu + (h / 2) * first, measured, k + 1)
        third = _acceleration(c, nu - h * first + (2 * h) * second, measured, end)
        middle = nu + (h / 24) * (5 * first + 8 * second - third)
        # The thrust changes within a step, so its mean counts for the whole of it.
        rule = (wrench[:, :, k] + 4 * wrench[:, :, k + 1] + wrench[:, :, end]) / 6
        mean = (first + 4 * second + third) / 6 + (measured.mean[:, :, k // 2] - rule) * c.inverse
        velocity[:, :, k + 1] = middle
        depth[:, :, k + 1] = z + (h / 2) * _sinking(nu + (h / 4) * first, down[:, :, k])
        nu = nu + h * mean
        z = z + h * _sinking(middle, down[:, :, k + 1])
    return Predicted(velocity, slope, depth, _specific_force(velocity, slope, measured, n))


def _acceleration(c: MotionCoefficients, nu: Floats, measured: Measured, k: int) -> Floats:
    """(columns, windows, 4) dν/dt."""
    p, q = measured.rates[:, k, 0], measured.rates[:, k, 1]
    r = nu[..., R]
    force = measured.wrench[:, :, k] - (c.linear + np.abs(nu) @ np.swapaxes(c.drag, 1, 2)) * nu
    force += (nu @ np.swapaxes(c.by_p, 1, 2)) * p[:, None]
    force += (nu @ np.swapaxes(c.by_q, 1, 2)) * q[:, None]
    force += (nu @ np.swapaxes(c.by_r, 1, 2)) * r[..., None]
    force[..., :3] += c.sinks * measured.down[:, :, k]
    force[..., R] += c.munk * nu[..., U] * nu[..., V] + c.rolling * (p * q)
    return force * c.inverse


def _sinking(nu: Floats, down: Floats) -> Floats:
    """(columns, windows) [m/s] Depth rate."""
    return nu[..., 0] * down[..., 0] + nu[..., 1] * down[..., 1] + nu[..., 2] * down[..., 2]


def _specific_force(velocity: Floats, slope: Floats, measured: Measured, n: int) -> Floats:
    """f = dv/dt + ω × v − R_BN g (Fossen 2011, §11.5)."""
    p, q = measured.rates[:, :n, 0], measured.rates[:, :n, 1]
    u, v, w, r = (velocity[..., axis] for axis in range(4))
    turning = np.stack([q * w - r * v, r * u - p * w, p * v - q * u], axis=-1)
    return slope[..., :3] + turning - GRAVITY * measured.down[:, :, :n]
