"""A hull in the water: M ν̇ = τ - C(ν) ν - D(ν) ν + lift - g(η)       (Fossen 2011, eq. 6.1 to 6.3)

ν is the velocity through the water and the angular rate, τ the thrust.

The centre of gravity is the vehicle's origin and added mass is diagonal, so the system inertia
matrix M = M_RB + M_A is diagonal and is kept as six numbers. The centre of buoyancy lies the
metacentric height above the origin. Buoyancy acts there also when part of the hull is out of the
water: the shift of the submerged volume's centre, which matters for a boat, is neglected.

The lift is that of the wake. In ideal flow, C_A(ν)ν turns a moving hull broadside on (the Munk
moment, e.g. (Zẇ − Xu̇) u w in pitch; Fossen 2011, §6.3.1). With that alone, a small vehicle without
pitch thrusters tumbles above about 0.7 m/s, unlike real ones: flow separation at the downstream end
causes a restoring lift. The model is a fin there for each pair of axes, whose moment is −share
times Munk's, after the body-lift terms of Prestero 2001. A fin only dissipates energy.
"""

from typing import NamedTuple

from messages.units import Vec3, Vec6
from services.marine.vehicle import GRAVITY, Vehicle

ARM_SHARE = 0.4  # [-] the fin's lever arm over the hull's length along the flow; assumed
PAIRS = ((0, 1, 2, 1), (0, 2, 1, -1), (1, 2, 0, 1))  # axes i, j, the third axis k, sign of i j k


def system_inertia(vehicle: Vehicle) -> Vec6:
    """Diagonal of M = M_RB + M_A [kg, kg m²] about the origin (Fossen 2011, eq. 3.44, 6.48)."""
    m, (ix, iy, iz) = vehicle.mass, vehicle.inertia
    a = vehicle.added_mass
    return m + a[0], m + a[1], m + a[2], ix + a[3], iy + a[4], iz + a[5]


def coriolis(M: Vec6, nu: Vec6) -> Vec6:
    """C(ν)ν [N, N m] for a diagonal M (Fossen 2011, Theorem 3.2, eq. 3.46).

    With M = M_RB + M_A it is C_RB(ν)ν + C_A(ν)ν at once, since C is linear in M. It does no
    work: νᵀC(ν)ν = 0.
    """
    u, v, w, p, q, r = nu
    a, b, c = M[0] * u, M[1] * v, M[2] * w  # linear momentum
    i, j, k = M[3] * p, M[4] * q, M[5] * r  # angular momentum
    return (
        q * c - r * b,
        r * a - p * c,
        p * b - q * a,
        v * c - w * b + q * k - r * j,
        w * a - u * c + r * i - p * k,
        u * b - v * a + p * j - q * i,
    )


def damping(linear: Vec6, quadratic: Vec6, nu: Vec6) -> Vec6:
    """D(ν)ν [N, N m]: diagonal linear plus quadratic drag (Fossen 2011, §6.4)."""
    u, v, w, p, q, r = nu
    return (
        (linear[0] + quadratic[0] * abs(u)) * u,
        (linear[1] + quadratic[1] * abs(v)) * v,
        (linear[2] + quadratic[2] * abs(w)) * w,
        (linear[3] + quadratic[3] * abs(p)) * p,
        (linear[4] + quadratic[4] * abs(q)) * q,
        (linear[5] + quadratic[5] * abs(r)) * r,
    )


def full_buoyancy(vehicle: Vehicle) -> float:
    """[N] Buoyancy of the fully submerged hull."""
    return vehicle.mass * GRAVITY + vehicle.net_buoyancy


def submerged_share(height: float, depth: float) -> float:
    """[-] Share of an upright box of this height [m], its middle at `depth` [m], under water."""
    return max(0.0, min(1.0, 0.5 + depth / height))


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
        speed = nu[along]
        lever = -sign * arm if speed >= 0 else sign * arm
        force = -grip * abs(speed) * (nu[across] + lever * nu[moment])
        wrench[across] += force
        wrench[moment] += lever * force
    return wrench


class Translation:
    """How thrust moves a hull along its own axes, without weight and buoyancy: who uses this learns
    them otherwise. A steady current changes nothing."""

    def __init__(self, vehicle: Vehicle, wake_share: float) -> None:
        """
        Args:
            vehicle: of the vehicle file.
            wake_share: [-] of the Munk moment that the wake cancels, see `wake_fins`.
        """
        self.inertia = system_inertia(vehicle)
        self._linear, self._quadratic = vehicle.linear_damping, vehicle.quadratic_damping
        self._fins = wake_fins(vehicle, wake_share)

    def acceleration(self, nu: Vec6, thrust: Vec6) -> Vec3:
        """[m/s²] ν̇ along surge, sway and heave.

        Args:
            nu: [m/s, rad/s] ν.
            thrust: [N, N m] τ.
        """
        turned = coriolis(self.inertia, nu)
        drag = damping(self._linear, self._quadratic, nu)
        lift = wake_lift(self._fins, nu)
        return (
            (thrust[0] - turned[0] - drag[0] + lift[0]) / self.inertia[0],
            (thrust[1] - turned[1] - drag[1] + lift[1]) / self.inertia[1],
            (thrust[2] - turned[2] - drag[2] + lift[2]) / self.inertia[2],
        )


def flow(surge: float, sway: float, depth_rate: float, down: Vec3, rate: Vec3) -> Vec6:
    """ν [m/s, rad/s], with the heave velocity that belongs to a depth rate.

    Args:
        surge, sway: [m/s] through the water.
        depth_rate: [m/s].
        down: [-] the world's down axis in body axes; its third part is not zero.
        rate: [rad/s] in body axes.
    """
    a, b, c = down
    return surge, sway, (depth_rate - a * surge - b * sway) / c, *rate
