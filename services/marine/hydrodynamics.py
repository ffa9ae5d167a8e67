"""Forces of still water on a hull: drag, buoyancy and righting moment.

The centre of gravity is the origin; the centre of buoyancy lies the metacentric height above it.
Buoyancy acts there also when part of the hull is out of the water: the shift of the submerged
volume's centre, which matters for a boat, is neglected.
"""

from messages.units import Vec3, Vec6
from services.marine.vehicle import GRAVITY, Vehicle


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


def full_buoyancy(vehicle: Vehicle) -> float:
    """[N] Buoyancy of the fully submerged hull."""
    return vehicle.mass * GRAVITY + vehicle.net_buoyancy


def submerged_share(height: float, depth: float) -> float:
    """[-] Share of an upright box of this height [m], its middle at `depth` [m], under water."""
    return max(0.0, min(1.0, 0.5 + depth / height))
