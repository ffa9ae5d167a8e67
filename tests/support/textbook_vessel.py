"""The vessel as textbooks write it: term by term, with the classic fourth-order Runge-Kutta method.

What services/simulator/vessel.py is timed against, and held against in its tests: open, still
water, thrusters of first order that are always wet.
"""

from math import exp

from messages.units import Vec3, Vec6
from services.marine.attitude import attitude_rate, down_in_body, normalised, to_world
from services.marine.hydrodynamics import (
    coriolis,
    damping,
    full_buoyancy,
    submerged_share,
    system_inertia,
    wake_fins,
    wake_lift,
)
from services.marine.vehicle import GRAVITY, Vehicle, total_wrench, wrench_per_newton

# Position NED [m], attitude q_NB (w, x, y, z), velocity FRD [m/s], angular rate FRD [rad/s].
State = tuple[float, ...]  # 13 numbers


class TextbookVessel:
    def __init__(
        self, vehicle: Vehicle, wake_share: float, state: State, settles_at: list[float]
    ) -> None:
        """
        Args:
            wake_share: [-] of the Munk moment that the wake takes back, see `wake_fins`.
            settles_at: [N] per thruster; they begin at nothing.
        """
        self.state = state
        self._vehicle = vehicle
        self._settles_at = settles_at
        self._thrust = [0.0] * len(settles_at)
        self._fins = wake_fins(vehicle, wake_share)
        self._M = system_inertia(vehicle)
        self._weight = vehicle.mass * GRAVITY
        self._full_buoyancy = full_buoyancy(vehicle)
        self._columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]

    def aim(self, settles_at: list[float]) -> None:
        """[N] per thruster, from now on."""
        self._settles_at = settles_at

    def step(self, seconds: float) -> None:
        half = seconds / 2
        thrust = self._thrust_after(seconds)
        tau_half = total_wrench(self._columns, self._thrust_after(half))
        s = self.state
        k1 = self.rates(s, total_wrench(self._columns, self._thrust))
        k2 = self.rates(_moved(s, k1, half), tau_half)
        k3 = self.rates(_moved(s, k2, half), tau_half)
        k4 = self.rates(_moved(s, k3, seconds), total_wrench(self._columns, thrust))
        sixth = seconds / 6
        x, y, z, qw, qx, qy, qz, *nu = (
            x + sixth * (a + 2 * (b + c) + d)
            for x, a, b, c, d in zip(s, k1, k2, k3, k4, strict=True)
        )
        self.state = (x, y, z, *normalised((qw, qx, qy, qz)), *nu)
        self._thrust = thrust

    def rates(self, state: State, tau: Vec6) -> State:
        """Time derivative of the state under the thrusters' wrench (Fossen 2011, eq. 6.1)."""
        _, _, z, qw, qx, qy, qz, u, v, w, p, q, r = state
        q_NB, nu, vehicle = (qw, qx, qy, qz), (u, v, w, p, q, r), self._vehicle
        buoyancy = self._full_buoyancy * submerged_share(vehicle.size[2], z)
        cor = coriolis(self._M, nu)
        drag = damping(vehicle.linear_damping, vehicle.quadratic_damping, nu)
        g = restoring(self._weight, buoyancy, vehicle.metacentric_height, down_in_body(q_NB))
        lift = wake_lift(self._fins, nu)
        acceleration = [
            (a + e - c - d - f) / m
            for m, a, e, c, d, f in zip(self._M, tau, lift, cor, drag, g, strict=True)
        ]
        return (*to_world(q_NB, (u, v, w)), *attitude_rate(q_NB, (p, q, r)), *acceleration)

    def _thrust_after(self, seconds: float) -> list[float]:
        return [
            goal + (now - goal) * exp(-seconds / thruster.time_constant)
            for now, goal, thruster in zip(
                self._thrust, self._settles_at, self._vehicle.thruster, strict=True
            )
        ]


def _moved(state: State, rate: State, seconds: float) -> State:
    return tuple([x + seconds * dx for x, dx in zip(state, rate, strict=True)])


def restoring(weight: float, buoyancy: float, metacentric_height: float, down_B: Vec3) -> Vec6:
    """g(η) [N, N m] on the left-hand side, as Fossen writes it (Fossen 2011, eq. 4.6) with
    r_g = 0 and r_b = (0, 0, −metacentric_height).

    Args:
        weight, buoyancy: [N].
        metacentric_height: [m].
        down_B: the world's down axis in body axes.
    """
    a, b, c = down_B
    surplus = buoyancy - weight
    arm = buoyancy * metacentric_height
    return surplus * a, surplus * b, surplus * c, arm * b, -arm * a, 0.0


def kinetic_energy(M: Vec6, nu: Vec6) -> float:
    """½ νᵀMν [J], of the body and of the water it moves (Fossen 2011, §6.3.1)."""
    return 0.5 * sum(m * n * n for m, n in zip(M, nu, strict=True))
