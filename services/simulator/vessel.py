"""The vehicle in the water: six degrees of freedom, thrusters with lag, current, surroundings.

    M ν̇ᵣ = τ − C(νᵣ)νᵣ − D(νᵣ)νᵣ − g(η)        (Fossen 2011, eq. 6.1 to 6.3, §8.3)

νᵣ is the velocity through the water. In a steady, irrotational current the equations are those of
still water written in νᵣ (Fossen 2011, Property 8.1), so the current appears only where the
position is integrated. They are integrated by the explicit midpoint rule, of second order, at
200 Hz, with quaternion kinematics; the thrusters' lag is solved exactly. Plain floats throughout:
at this size that is several times faster than NumPy.
"""

from collections.abc import Callable, Sequence

import numpy as np

from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import attitude_rate, down_in_body, normalised, to_body, to_world
from services.marine.hydrodynamics import (
    full_buoyancy,
    submerged_share,
    system_inertia,
    wake_fins,
)
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY, Vehicle
from services.simulator.hull import NOWHERE, in_the_water, lean
from services.simulator.propulsion import SimulatedThrusters
from services.simulator.settings import Settings
from services.simulator.surroundings import Current, Surroundings
from services.simulator.waves import Sea, WaveMotion

# Position NED [m], attitude q_NB (w, x, y, z), velocity over the ground FRD [m/s], angular rate
# FRD [rad/s].
State = tuple[float, ...]  # 13 numbers
# (depth [m], q_NB, νᵣ, τ) → ν̇ᵣ [m/s², rad/s²]
Acceleration = Callable[[float, Quaternion, Vec6, Vec6], Vec6]

STEP = 0.005  # [s] longest step in open water
STEP_AT_FLOOR = 0.001  # [s] longest step near the floor, because it is stiff
ABSURD = 1e6  # [m/s, rad/s] a larger velocity means divergence


class Vessel:
    """Advances in time by `advance`; `propulsion` takes its inputs."""

    def __init__(
        self,
        vehicle: Vehicle,
        place: Settings,
        state: State,
        thrust: Sequence[float],
        seed: int = 0,
    ) -> None:
        """
        Args:
            vehicle: of the vehicle file; what `place.hull` says is different.
            thrust: [N] per thruster at the start.
            seed: [-] 0 or more, of current and waves.
        """
        hull = place.hull
        self.vehicle = vehicle = in_the_water(vehicle, hull)
        self.current: Vec3 = (0.0, 0.0, 0.0)  # [m/s] NED
        self._water = Current(place.current, seed) if place.current is not None else None
        self.sea = Sea(place.waves, seed) if place.waves is not None else None
        self._wave: WaveMotion | None = None  # at the hull; None: no waves
        self._carried: Vec3 = (0.0, 0.0, 0.0)  # [m/s²] NED, of the hull by the water in the waves
        self.elapsed = 0.0  # [s]
        self._leaning = hull if hull is not None and hull.gravity_shift != NOWHERE else None
        self._acceleration = equations_of_motion(vehicle, place.wake_share)
        self.propulsion = SimulatedThrusters(vehicle, thrust, hull.thrust_scale if hull else 1.0)
        self.around = Surroundings(place, vehicle.size, system_inertia(vehicle)[2], seed)
        self._always_wet_below = max(plain_sum(map(abs, t.position)) for t in vehicle.thruster)
        x, y, z, qw, qx, qy, qz, u, v, w, p, q, r = state
        self.position: Vec3 = (x, y, z)  # [m] NED
        self.attitude = normalised((qw, qx, qy, qz))  # q_NB
        self.through_water: Vec6 = (u, v, w, p, q, r)  # [m/s, rad/s] FRD
        if self.sea is not None:
            self._wave = self.sea.at(0.0, self.position)
            a, b, c = to_body(self.attitude, self._wave.velocity)
            self.through_water = (u - a, v - b, w - c, p, q, r)
        if self._water is not None:
            self._flow(self._water.at(0.0))
        self._look_around()

    def advance(self, seconds: float) -> None:
        """Advance by `seconds`.

        Raises:
            FloatingPointError: the motion has diverged; the vehicle's parameters are wrong.
        """
        steps = int(seconds / STEP - 1e-9) + 1
        for _ in range(steps):
            h = seconds / steps
            # Divided into shorter ones near the floor.
            parts = int(h / STEP_AT_FLOOR - 1e-9) + 1 if self._near else 1
            for _ in range(parts):
                self._step(h / parts)
        if not plain_sum(map(abs, self.through_water)) < ABSURD:  # NaN is not smaller than anything
            raise FloatingPointError(f"the vehicle's motion has diverged: {self.state}")

    # Outputs.

    @property
    def state(self) -> State:
        return *self.position, *self.attitude, *self.velocity

    @property
    def velocity(self) -> Vec6:
        """[m/s, rad/s] FRD over the ground."""
        return self._over_ground(self.attitude, self.through_water)

    @property
    def acceleration(self) -> Vec6:
        """[m/s², rad/s²] dνᵣ/dt now, of `through_water`, as seen in the turning body frame, and in
        waves the acceleration of the water that the hull moves through."""
        if self._wave is None:
            return self._nu_dot
        return add(self._nu_dot, (*to_body(self.attitude, self._carried), 0.0, 0.0, 0.0))

    # Integration.

    def _step(self, h: float) -> None:
        """The explicit midpoint rule: the slope of the step [s] is that in its middle."""
        half = h / 2
        x, y, z = self.position
        qw, qx, qy, qz = self.attitude
        u, v, w, p, q, r = self.through_water

        # To the middle, by the slope at the beginning.
        du, dv, dw, dp, dq, dr = self._nu_dot
        nu = (u + half * du, v + half * dv, w + half * dw,
              p + half * dp, q + half * dq, r + half * dr)  # fmt: skip
        ew, ex, ey, ez = attitude_rate(self.attitude, (p, q, r))
        q_NB = (qw + half * ew, qx + half * ex, qy + half * ey, qz + half * ez)
        a, b, c = down_in_body(self.attitude)
        middle = (x, y, z + half * (a * u + b * v + c * w))
        if self._near:
            north, east, _ = to_world(
                self.attitude, self._over_ground(self.attitude, self.through_water)[:3]
            )
            middle = (x + half * north, y + half * east, middle[2])

        # Across the whole step, by the slope in the middle.
        du, dv, dw, dp, dq, dr = self._slope(half, middle, q_NB, nu)
        ew, ex, ey, ez = attitude_rate(q_NB, (nu[3], nu[4], nu[5]))
        north, east, down = to_world(q_NB, (nu[0], nu[1], nu[2]))
        set_north, set_east, _ = self.current
        x, y, z = x + h * (north + set_north), y + h * (east + set_east), z + h * down
        if self._wave is not None:
            a, b, c = self._wave.velocity
            x, y, z = x + h * a, y + h * b, z + h * c
        self.position = (x, y, z)
        self.attitude = normalised((qw + h * ew, qx + h * ex, qy + h * ey, qz + h * ez))
        self.through_water = (u + h * du, v + h * dv, w + h * dw,
                              p + h * dp, q + h * dq, r + h * dr)  # fmt: skip

        self.propulsion.age += h
        if self._water is not None:
            self._flow(self._water.at(self.elapsed + h))
        self.elapsed += h
        if self.sea is not None:
            self._ride(self.sea, h)
        self._look_around()

    def _slope(self, ahead: float, position: Vec3, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """dνᵣ/dt with the thrust `ahead` [s] from now."""
        tau = self.propulsion.wrench(ahead)
        if self._near:
            over_ground = self._over_ground(q_NB, nu)
            tau = add(tau, self.around.push(self._near, position, q_NB, over_ground))
        if self.around.tether is not None:
            tau = add(tau, self.around.pull(position[2], q_NB, nu))
        depth = position[2]
        if self._wave is not None:
            depth += self._wave.rise
            tau = add(tau, self._wave_push(self._wave, depth, q_NB))
        if self._leaning is not None:
            tau = add(tau, lean(self.vehicle, self._leaning, q_NB))
        return self._acceleration(depth, q_NB, nu, tau)

    def _look_around(self) -> None:
        """Update floor, dry thrusters and acceleration for the new position."""
        self._near = self.around.near(self.position)
        if self.position[2] < self._always_wet_below:
            a, b, c = down_in_body(self.attitude)
            depth = self.position[2] + (0.0 if self._wave is None else self._wave.rise)
            places = enumerate(thruster.position for thruster in self.vehicle.thruster)
            in_air = [i for i, (x, y, z) in places if depth + a * x + b * y + c * z < 0]
            self.propulsion.leave_water(in_air)
        self._nu_dot = self._slope(0.0, self.position, self.attitude, self.through_water)

    def _flow(self, current: Vec3) -> None:
        """Set the current [m/s]; a change does not alter the velocity over the ground."""
        if current != self.current:
            (a, b, _), (c, d, _) = self.current, current
            change = to_body(self.attitude, (c - a, d - b, 0.0))
            self.through_water = add(
                self.through_water, (-change[0], -change[1], -change[2], 0.0, 0.0, 0.0)
            )
            self.current = current

    def _ride(self, sea: Sea, h: float) -> None:
        """Take along the water's motion in the waves, after a step [s]. A body as heavy as its
        water, and small beside the waves, moves as that water would: its pressure gradient
        accelerates both alike (Faltinsen 1990, ch. 3, Froude-Kriloff and added-mass force). So νᵣ
        stays as it is, but for `_wave_push`."""
        before, self._wave = self._wave, sea.at(self.elapsed, self.position)
        if before is not None:
            (a, b, c), (d, e, f) = before.velocity, self._wave.velocity
            self._carried = (d - a) / h, (e - b) / h, (f - c) / h

    def _wave_push(self, wave: WaveMotion, depth: float, q_NB: Quaternion) -> Vec6:
        """[N, N m] Froude-Kriloff force on what the hull is lighter than its water, and its moment:
        it acts at the centre of buoyancy, so that the hull leans as the water's surface does."""
        wet = submerged_share(self.vehicle.size[2], depth) * full_buoyancy(self.vehicle) / GRAVITY
        a, b, c = to_body(q_NB, wave.acceleration)
        lighter, arm = wet - self.vehicle.mass, wet * self.vehicle.metacentric_height
        return lighter * a, lighter * b, lighter * c, arm * b, -arm * a, 0.0

    def _over_ground(self, q_NB: Quaternion, nu: Vec6) -> Vec6:
        """ν = νᵣ + ν_c (Fossen 2011, §8.3)."""
        if self._wave is not None:
            nu = add(nu, (*to_body(q_NB, self._wave.velocity), 0.0, 0.0, 0.0))
        if self._water is None:
            return nu
        return add(nu, (*to_body(q_NB, self.current), 0.0, 0.0, 0.0))


def equations_of_motion(vehicle: Vehicle, wake_share: float) -> Acceleration:
    """The acceleration function of this vehicle: one sequence of formulas with precomputed
    hydrodynamic derivatives, because it is called four hundred times per simulated second.

    Derivatives are named as in SNAME notation: `X_vr` is the surge force per (sway velocity × yaw
    rate), `Y_vv` per |v| v, `Y_uv` per |u| v. Textbook forms of the single terms are in
    services/marine/hydrodynamics.py; tests compare this function with them.

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


def add(a: Vec6, b: Vec6) -> Vec6:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]
