"""How thrust moves many hulls along their own axes, and what the estimators and the controllers of
them make of it: the horizontal velocity for the depth filter
(`services/estimation/depth/thrust_speed.py`), and the coupling into heave
(`services/control/heave_coupling.py`)."""

from typing import Any

import numpy as np

from services.control.heave_coupling import HEAVE, LEVEL, HeaveCoupling
from services.control.heave_coupling import STEEPEST as STEEPEST_COUPLING
from services.estimation.attitude_axes import MOVING_STD, AttitudeAxes
from services.estimation.depth.thrust_speed import FASTEST, SHARE, STEEPEST, STILL_STD, TRUST_TIME
from services.marine.attitude import down_in_body
from services.marine.hydrodynamics import Translation, coriolis, damping, flow
from services.marine.vehicle import Vehicle, wrench_per_newton
from tools.sweep.fast.lanes import Lanes, Lanes3, total, where


class LaneTranslation(Translation):
    def acceleration(self, nu: Any, thrust: Any) -> Any:
        """[m/s²] ν̇ along surge, sway and heave. Arguments as of the scalar law."""
        turned = coriolis(self.inertia, nu)
        drag = damping(self._linear, self._quadratic, nu)
        lift = [0.0, 0.0, 0.0]
        for along, across, moment, sign, arm, grip in self._fins:
            speed = nu[along]
            lever = where(speed >= 0, -sign * arm, sign * arm)
            lift[across] = lift[across] - grip * np.abs(speed) * (nu[across] + lever * nu[moment])
        return tuple(
            [(thrust[k] - turned[k] - drag[k] + lift[k]) / self.inertia[k] for k in range(3)]
        )


class ThrustSpeeds:
    """From the rest of the calibration on; the reports of thrust never stop."""

    def __init__(self, vehicle: Vehicle, wake_share: float, count: int) -> None:
        self.felt: tuple[Lanes, Lanes] = (np.zeros(count), np.zeros(count))  # [m/s²]
        self.surge: Lanes = np.zeros(count)  # [m/s]
        self.sway: Lanes = np.zeros(count)  # [m/s]
        self._unknown = np.zeros(count)  # [-]
        self._hull = LaneTranslation(vehicle, wake_share)
        self._columns = np.array([wrench_per_newton(t) for t in vehicle.thruster]).T
        self._limits = np.array([t.limits for t in vehicle.thruster]).T[:, :, None]
        self._thrust = np.zeros((6, count))

    def actuation(self, thrust: Lanes) -> None:
        """[N] As reported, (thrusters, lanes)."""
        low, high = self._limits
        self._thrust = total(self._columns, np.clip(thrust, low, high))

    def step(self, axes: Any, rate: Lanes3, depth_rate: Lanes, dt: float) -> AttitudeAxes:
        """Advance by `dt` [s]. Returns the axes with the velocity to be expected."""
        axis = axes.down
        upright, share = axis[2] > STEEPEST, dt / (TRUST_TIME + dt)
        down = axes.forward[2], axes.starboard[2], where(upright, axis[2], 1.0)
        self._unknown = self._unknown + share * (where(upright, 0.0, 1.0) - self._unknown)
        trust = 1.0 - self._unknown
        nu = flow(self.surge, self.sway, depth_rate, down, rate)
        along, across, _ = self._hull.acceleration(nu, self._thrust)
        u, v, w, p, q, r = nu
        forward, starboard = trust * (along + q * w - r * v), trust * (across + r * u - p * w)
        self.felt = where(upright, forward, 0.0), where(upright, starboard, 0.0)
        self.surge, self.sway = (
            where(upright, np.clip(old + gained * dt, -FASTEST, FASTEST), old - share * old)
            for old, gained in ((self.surge, along), (self.sway, across))
        )
        heave = where(upright, w, 0.0)
        (fn, fe, _), (sn, se, _), (dn, de, _) = axes.forward, axes.starboard, axis
        north = trust * (self.surge * fn + self.sway * sn + heave * dn)
        east = trust * (self.surge * fe + self.sway * se + heave * de)
        std = np.sqrt(STILL_STD**2 + SHARE**2 * (north * north + east * east))
        std = np.minimum(MOVING_STD, trust * std + self._unknown * MOVING_STD)
        return axes._replace(velocity=(north, east), velocity_std=std)


class LaneCoupling(HeaveCoupling):
    """What surge, sway and tilt do to heave, of many vehicles; `ahead` is the scalar law's."""

    __slots__ = ()

    @classmethod
    def of(cls, vehicle: Vehicle, lag: float, wake_share: float) -> "LaneCoupling":
        coupling = cls(vehicle, lag, wake_share)
        coupling._hull = LaneTranslation(vehicle, wake_share)
        return coupling

    def follow(
        self,
        attitude: Any,
        angles: tuple[Lanes, Lanes],
        rates: tuple[Lanes, Lanes],
        yaw_rate: Lanes,
        depth_rate: Lanes,
        thrust: Any,
        dt: float,
    ) -> None:
        """`step`, with what it needs of the state: q_NB, roll and pitch [rad] and their rates
        [rad/s], yaw rate [rad/s] and depth rate [m/s]."""
        (a, b, c), (roll, pitch), (roll_rate, pitch_rate) = down_in_body(attitude), angles, rates
        upright = c > STEEPEST_COUPLING
        cos_roll, cos_pitch = np.cos(roll), np.cos(pitch)
        sin_roll, sin_pitch = np.sin(roll), np.sin(pitch)
        level = where(upright, cos_roll * cos_pitch, 1.0)
        heading_rate = (yaw_rate + pitch_rate * sin_roll) / level
        p = roll_rate - heading_rate * sin_pitch
        q = pitch_rate * cos_roll + heading_rate * cos_pitch * sin_roll
        down: Any = tuple(
            [where(upright, e, flat) for e, flat in zip((a, b, c), LEVEL, strict=True)]
        )
        turning: Any = tuple([where(upright, rate, 0.0) for rate in (p, q, yaw_rate)])
        self._down, self._rate, self.upright = down, turning, down[HEAVE]
        nu = flow(self.surge, self.sway, depth_rate, down, turning)
        along, across, sinking = self._hull.acceleration(nu, thrust)
        force: Any = (along, across, sinking)
        self.force = self._coupling(nu, force, thrust, depth_rate, down)
        self.surge = self.surge + along * dt
        self.sway = self.sway + across * dt
