"""A rigid body with added mass: inertia, Coriolis and centripetal forces, kinetic energy.

The centre of gravity is the vehicle's origin and added mass is diagonal, so the system inertia
matrix M = M_RB + M_A is diagonal and is kept as six numbers.
"""

from messages.units import Vec6
from services.marine.summation import plain_sum
from services.marine.vehicle import Vehicle


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


def kinetic_energy(M: Vec6, nu: Vec6) -> float:
    """½ νᵀMν [J], of the body and of the water it moves (Fossen 2011, §6.3.1)."""
    return 0.5 * plain_sum(m * n * n for m, n in zip(M, nu, strict=True))
