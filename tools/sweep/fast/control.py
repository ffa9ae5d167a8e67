"""From references and states of many vehicles to their thrusters' commands: `services/control/` in
lanes, for the stabilised mode. Thrust and drag are those of the vehicle file; they are not learnt.
"""

from typing import Any

import numpy as np

from services.control.allocation.propulsion import lags_of
from services.control.axis.axis import RollPitchGains
from services.control.axis.plant import plant_of
from services.control.core import PERIOD_S, YAW
from services.control.laws import IDLE, SHORT
from services.control.settings import Settings
from services.marine.vehicle import Vehicle
from tools.sweep.fast.allocation import LaneAllocated, LaneAllocation
from tools.sweep.fast.axis import LaneAxis, LanePulse
from tools.sweep.fast.lanes import Lanes, Mask, where
from tools.sweep.fast.reference import LaneReference
from tools.sweep.fast.translation import LaneCoupling

HEAVE, ENOUGH = 2, 1e-6  # [N, N m] a smaller lack is rounding


class ActuatorModels:
    """Of the wrench (6, lanes), axis by axis (`ActuatorModel`)."""

    def __init__(self, lags: tuple[float, ...], count: int) -> None:
        self._lags = np.array(lags)[:, None]
        self._now, self.settles_at = np.zeros((6, count)), np.zeros((6, count))

    def mean(self, dt: float) -> Lanes:
        left, end = np.exp(-dt / self._lags), self.settles_at
        gap = self._now - end
        self._now = end + gap * left
        return end + gap * (1 - left) * self._lags / dt


class Levels:
    """Roll or pitch held at zero (`RollPitchHold`)."""

    def __init__(self, gains: RollPitchGains) -> None:
        self.rate: Any = 0.0
        self._gains, self._angle = gains, None

    def step(self, angle: Any, dt: float) -> Lanes:
        self.rate = np.zeros_like(angle) if self._angle is None else (angle - self._angle) / dt
        self._angle = angle
        return -self._gains.kp * angle - self._gains.kd * self.rate


class Controllers:
    """From arming on."""

    def __init__(self, settings: Settings, vehicle: Vehicle, count: int) -> None:
        s, lags = settings, lags_of(vehicle)
        self._heave = LaneAxis(s.depth, plant_of(vehicle, HEAVE), lags[HEAVE], PERIOD_S, count)
        yaw = plant_of(vehicle, YAW)
        self._yaw = LaneAxis(s.heading, yaw, lags[YAW], PERIOD_S, count)
        self._roll, self._pitch = Levels(s.roll), Levels(s.pitch)
        self._actuators = ActuatorModels(lags, count)
        self._coupling: LaneCoupling | None = None
        if s.coupling.heave:
            self._coupling = LaneCoupling.of(vehicle, lags[HEAVE], s.coupling.wake_share)
        self._allocation = LaneAllocation(vehicle, s.allocation, count)
        pushes = self._allocation.smallest("yaw")
        self._pushes = np.array(pushes)
        self._pulse: LanePulse | None = None
        if s.heading_pulse > 0.0 and pushes:
            moments = [push[YAW] for push in pushes]
            zone = s.heading_pulse
            self._pulse = LanePulse(yaw, lags[YAW], PERIOD_S, moments, zone, count)
        self._effective = np.zeros(count, bool)  # the last moment
        self._heave_short = np.zeros(count, bool)
        self._turn_lack = np.zeros(count)  # [N m]
        self.turn_short = np.zeros(count, bool)  # as the reference hears of it, a step later

    def step(self, reference: LaneReference, state: Any, dt: float) -> LaneAllocated:
        """One step, `dt` [s] after the last one.

        Args:
            state: as of `References.step`, and `attitude`, `yaw_rate` [rad/s].
        """
        r, s, zero = reference, state, np.zeros_like(state.depth)
        roll, pitch = self._roll.step(s.roll, dt), self._pitch.step(s.pitch, dt)
        self._learn(s, dt)
        # Heave, along the body's down axis.
        heave = self._heave.step(r.depth, s.depth, s.rate, dt)
        if (coupling := self._coupling) is not None:
            thrust: Any = tuple(self._actuators.settles_at)
            velocity = r.depth.velocity
            ahead = coupling.ahead(velocity, thrust)
            heave = (heave - ahead) / coupling.upright
        # Yaw, about it.
        share = np.cos(s.roll) * np.cos(s.pitch)
        _, velocity, acceleration, jerk = r.heading
        motion = r.heading._replace(
            velocity=share * velocity, acceleration=share * acceleration, jerk=share * jerk
        )
        rate = s.yaw_rate + self._pitch.rate * np.sin(s.roll)
        yaw = self._yaw.step(motion, s.heading, rate, dt)
        wrench = np.array((r.surge_force, r.sway_force, heave, roll, pitch, yaw + zero))
        if self._pulse is not None:
            resting = velocity == 0.0 == acceleration
            error = r.heading.position - s.heading
            given = self._pulse.step(error, s.yaw_rate, self._effective, resting=resting)
            pulses = ~np.isnan(given)
            if np.any(pulses):
                wrench[YAW, pulses] = 0.0
                wrench[:, pulses] += (given * self._pushes[self._pulse.turn].T)[:, pulses]
        done = self._allocation.allocate_all(wrench)
        self._take_in(wrench, done)
        return done

    def _learn(self, state: Any, dt: float) -> None:
        s, force = state, self._actuators.mean(dt)
        pushed = force[HEAVE]
        if self._coupling is not None:
            rates = self._roll.rate, self._pitch.rate
            self._coupling.follow(
                s.attitude, (s.roll, s.pitch), rates, s.yaw_rate, s.rate, tuple(force), dt
            )
            pushed = self._coupling.upright * pushed + self._coupling.force
        self._heave.learn(where(self._heave_short, np.nan, s.rate), pushed, dt)
        idle: Any = False
        if self._pulse is not None:
            idle = np.abs(force[YAW]) < IDLE * self._pulse.smallest
        self._yaw.learn(s.yaw_rate, force[YAW], dt, freely=idle, short=self._turn_lack)

    def _take_in(self, wanted: Lanes, done: LaneAllocated) -> None:
        """What was achieved: an axis short of force by saturation does not learn."""
        self._actuators.settles_at = done.achieved
        self._effective = done.achieved[YAW] != 0.0
        lack = wanted - done.achieved
        self._heave_short = done.saturated & (np.abs(lack[HEAVE]) > ENOUGH)
        short = self._short(lack[YAW], wanted[YAW])
        self._turn_lack = where(done.saturated & short, lack[YAW], 0.0)
        self.turn_short = done.saturated & (np.abs(lack[YAW]) > SHORT * np.abs(wanted[YAW]))

    @staticmethod
    def _short(lack: Lanes, wanted: Lanes) -> Mask:
        return lack * wanted > SHORT * wanted**2
