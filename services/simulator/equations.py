"""The equations of motion as one sequence of formulas, with precomputed hydrodynamic derivatives,
because they are evaluated four hundred times per simulated second.

    M ν̇ᵣ = τ − C(νᵣ)νᵣ − D(νᵣ)νᵣ − g(η)        (Fossen 2011, eq. 6.1 to 6.3, §8.3)

νᵣ is the velocity through the water. In a steady, irrotational current the equations are those of
still water written in νᵣ (Fossen 2011, Property 8.1), so the current appears only where the
position is integrated. Derivatives are named as in SNAME notation: `X_vr` is the surge force per
(sway velocity × yaw rate), `Y_vv` per |v| v, `Y_uv` per |u| v. Textbook forms of the single terms
are in services/marine (rigid_body, hydrodynamics, wake); tests compare this file with them.
"""

from collections.abc import Callable

import numpy as np

from messages.units import Quaternion, Vec6
from services.marine.hydrodynamics import full_buoyancy
from services.marine.rigid_body import system_inertia
from services.marine.vehicle import GRAVITY, Vehicle
from services.marine.wake import wake_fins

# (depth [m], q_NB, νᵣ, τ) → ν̇ᵣ [m/s², rad/s²]
Acceleration = Callable[[float, Quaternion, Vec6, Vec6], Vec6]


def equations_of_motion(vehicle: Vehicle, wake_share: float) -> Acceleration:
    """The acceleration function of this vehicle.

    Args:
        wake_share: [-] of the Munk moment cancelled by the wake, see `wake_fins`.
    """
    m_u, m_v, m_w, i_p, i_q, i_r = system_inertia(vehicle)
    # Each fin of the wake subtracts `munk` from the added mass in two products of C, and damps.
    munk, brake = np.zeros((3, 3)), np.zeros((6, 3))
    for fin in wake_fins(vehicle, wake_share):
        munk[fin.across, fin.along] = fin.grip * fin.arm
        brake[fin.across, fin.along] = fin.grip
        brake[fin.moment, fin.along] = fin.grip * fin.arm**2
    (_, X_v, X_w), (Y_u, _, Y_w), (Z_u, Z_v, _) = munk.tolist()

    # −C(νᵣ)νᵣ (eq. 3.46), and the fins' part of it
    X_vr, X_wq = m_v - X_v, m_w - X_w
    Y_ur, Y_wp = m_u - Y_u, m_w - Y_w
    Z_uq, Z_vp = m_u - Z_u, m_v - Z_v
    K_vw, K_qr = m_v - m_w + Z_v - Y_w, i_q - i_r
    M_uw, M_pr = m_w - m_u + X_w - Z_u, i_r - i_p
    N_uv, N_pq = m_u - m_v + Y_u - X_v, i_p - i_q

    # D(νᵣ)νᵣ (§6.4), linear, quadratic, and the fins' part
    X_u, Y_v, Z_w, K_p, M_q, N_r = vehicle.linear_damping
    X_uu, Y_vv, Z_ww, K_pp, M_qq, N_rr = vehicle.quadratic_damping
    (_, X_vu, X_wu), (Y_uv, _, Y_wv), (Z_uw, Z_vw, _) = brake[:3].tolist()
    (_, K_vp, K_wp), (M_uq, _, M_wq), (N_ur, N_vr, _) = brake[3:].tolist()

    # g(η) (eq. 4.6)
    weight, all_buoyancy = vehicle.mass * GRAVITY, full_buoyancy(vehicle)
    arm, height = vehicle.metacentric_height, vehicle.size[2]
    wet_below, size = height / 2, abs

    def acceleration(depth: float, q_NB: Quaternion, nu: Vec6, tau: Vec6) -> Vec6:
        qw, qx, qy, qz = q_NB
        u, v, w, p, q, r = nu
        surge, sway, heave, roll, pitch, yaw = tau
        su, sv, sw, sp, sq, sr = size(u), size(v), size(w), size(p), size(q), size(r)

        # The world's down axis in body axes, the last row of R_NB (§2.2).
        a = 2.0 * (qx * qz - qw * qy)
        b = 2.0 * (qy * qz + qw * qx)
        c = 1.0 - 2.0 * (qx * qx + qy * qy)

        # −g(η) (eq. 4.6): net weight, and righting moment.
        share = 1.0 if depth > wet_below else max(0.0, 0.5 + depth / height)
        sinks = weight - share * all_buoyancy
        rights = share * all_buoyancy * arm

        # −C(νᵣ)νᵣ (eq. 3.46) with the fins' part.
        X_c = X_vr * v * r - X_wq * w * q
        Y_c = Y_wp * w * p - Y_ur * u * r
        Z_c = Z_uq * u * q - Z_vp * v * p
        K_c = K_vw * v * w + K_qr * q * r
        M_c = M_uw * u * w + M_pr * p * r
        N_c = N_uv * u * v + N_pq * p * q

        # The diagonal of D(νᵣ) (§6.4) with the fins' part.
        X_d = X_u + X_uu * su + X_vu * sv + X_wu * sw
        Y_d = Y_v + Y_vv * sv + Y_uv * su + Y_wv * sw
        Z_d = Z_w + Z_ww * sw + Z_uw * su + Z_vw * sv
        K_d = K_p + K_pp * sp + K_vp * sv + K_wp * sw
        M_d = M_q + M_qq * sq + M_uq * su + M_wq * sw
        N_d = N_r + N_rr * sr + N_ur * su + N_vr * sv

        return (
            (surge + X_c - X_d * u + sinks * a) / m_u,
            (sway + Y_c - Y_d * v + sinks * b) / m_v,
            (heave + Z_c - Z_d * w + sinks * c) / m_w,
            (roll + K_c - K_d * p - rights * b) / i_p,
            (pitch + M_c - M_d * q + rights * a) / i_q,
            (yaw + N_c - N_d * r) / i_r,
        )

    return acceleration
