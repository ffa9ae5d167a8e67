"""Motion of many vehicles at once, the thrust that drives it, and the numbers that are fitted.

The motion is that in surge, sway, heave and yaw, with roll and pitch as measured: rows 1, 2, 3 and
6 of the simulator's equations (services/simulator/vessel.py; Fossen 2011, eq. 6.1 to 6.3), the
wake's fins included. Roll and pitch rate and attitude come from the gyroscopes, so that the
righting moment need not be known. Many vehicles at once, because a derivative by every parameter
needs one each: arrays are (columns, windows, …).

The thrusters' wrench over time is from the commands: dead-band, limits, lag.

The numbers are one vector: of each axis the logarithm of the inertia, and both drag coefficients
over a typical size of their own; then the net buoyancy over one newton, and the logarithm of the
lag.
"""

from cmath import exp as complex_exp
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from messages.units import Vec6
from services.marine.hydrodynamics import system_inertia, wake_fins
from services.marine.vehicle import (
    GRAVITY,
    LagMode,
    Vehicle,
    driven,
    first_order,
    wrench_per_newton,
)

Floats = NDArray[np.float64]
LOST = 20.0  # [-] decay, as an exponent, over which steps are added up at once


class Lagged(NamedTuple):
    value: Floats  # (m, k)
    integral: Floats  # (m, k) since the first command


class CommandedThrust:
    """Commands, each of which holds until the next one."""

    def __init__(self, vehicle: Vehicle, t: Floats, commands: Floats) -> None:
        """
        Args:
            t: (n,) [s] rising.
            commands: (n, thrusters) [N]
        """
        self.t = t
        effect = np.array([wrench_per_newton(thruster) for thruster in vehicle.thruster])
        settles = np.array(
            [
                [driven(thruster, newtons) for thruster, newtons in zip(vehicle.thruster, row)]  # noqa: B905
                for row in commands.tolist()
            ]
        )
        self._whole = settles @ effect  # (n, 6) [N, N m]
        # Thrusters of the same lag together.
        self._groups = [
            (modes, settles[:, same] @ effect[same]) for modes, same in _by_lag(vehicle)
        ]

    def wrench(self, at: Floats, lag: float | None = None) -> Lagged:
        """(m, 6) [N, N m] at these times [s], and its integral.

        Args:
            lag: [s] of all thrusters, first order; None: as the vehicle file says.
        """
        if lag is not None:
            return lagged(self.t, self._whole, first_order(lag), at)
        parts = [lagged(self.t, whole, modes, at) for modes, whole in self._groups]
        return Lagged(*(np.sum(part, axis=0) for part in zip(*parts, strict=True)))


def lagged(t: Floats, settles: Floats, modes: Sequence[LagMode], at: Floats) -> Lagged:
    """A quantity that follows `settles` (n, k), set at the times t (n,), from rest, at the times
    `at` (m,); exact (services/marine/vehicle.py). A gap decays by g' = pole g + share s',
    which also gives its integral."""
    steps = np.diff(settles, axis=0, prepend=0.0)
    index = np.clip(np.searchsorted(t, at, side="right") - 1, 0, None)
    since = np.maximum(at - t[index], 0.0)[:, None]
    now = settles[index]
    held = np.cumsum(settles[:-1] * np.diff(t)[:, None], axis=0)
    value, integral = now.copy(), np.vstack([np.zeros_like(settles[:1]), held])[index]
    integral += now * since
    for pole, share in modes:
        gap = np.exp(pole * since) * _gaps(t, (share * steps).astype(np.complex128), pole)[index]
        value -= np.real(gap)
        integral -= np.real((gap - share * now) / pole)
    return Lagged(value, integral)


def _gaps(t: Floats, steps: NDArray[np.complex128], pole: complex) -> NDArray[np.complex128]:
    """(n, k) The sum of all steps so far, each decayed since its time. Added up within stretches in
    which little of the first is lost, so that no quotient overflows."""
    found = np.empty(steps.shape, dtype=np.complex128)
    gap = np.zeros(steps.shape[1], dtype=np.complex128)  # at the time before
    first, before = 0, float(t[0])
    while first < len(t):
        until = float(t[first]) + LOST / abs(pole)
        last = int(np.searchsorted(t, until, side="right"))
        decayed: NDArray[np.complex128] = np.exp(pole * (t[first:last] - t[first]))[:, None]
        begin = gap * complex_exp(pole * (float(t[first]) - before))
        found[first:last] = decayed * (begin + np.cumsum(steps[first:last] / decayed, axis=0))
        gap, before, first = found[last - 1], float(t[last - 1]), last
    return found


def _by_lag(vehicle: Vehicle) -> list[tuple[list[LagMode], list[int]]]:
    """Lags, and the indices of the thrusters that have them."""
    found: list[tuple[list[LagMode], list[int]]] = []
    for index, thruster in enumerate(vehicle.thruster):
        for modes, same in found:
            if modes == thruster.modes:
                same.append(index)
                break
        else:
            found.append((thruster.modes, [index]))
    return found


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


def vehicle_of(start: Beginning, x: Floats, axes: tuple[str, ...] = AXES) -> Vehicle:
    """The file's vehicle with these numbers. Of the inertia, the mass stays and the added mass
    changes; it may become negative here, and so may drag."""
    v = start.vehicle
    added, linear, quadratic = map(list, (v.added_mass, v.linear_damping, v.quadratic_damping))
    dry = system_inertia(replace(v, added_mass=(0.0,) * 6))
    for axis in map(AXES.index, axes):
        row = ROWS[axis]
        added[row] = float(np.exp(x[inertia_of(axis)])) - dry[row]
        linear[row] = float(x[linear_of(axis)] * start.linear[axis])
        quadratic[row] = float(x[quadratic_of(axis)] * start.quadratic[axis])
    return replace(
        v,
        added_mass=cast(Vec6, tuple(added)),
        linear_damping=cast(Vec6, tuple(linear)),
        quadratic_damping=cast(Vec6, tuple(quadratic)),
        net_buoyancy=float(x[BUOYANCY]) if "heave" in axes else v.net_buoyancy,
    )
