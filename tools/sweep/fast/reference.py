"""The reference of many dives with the same sticks: `services/reference/` in lanes.

What the sticks make of velocities and forces is planned once, by the scalar laws, for all lanes
that ask for the same. What differs from lane to lane is where it began, what the guards do
(`services/reference/guidance/guards.py`), and how much of surge and sway a tilted vehicle gets.
"""

import copy
from typing import Any, NamedTuple

import numpy as np

from services.piloting.sticks import Sticks
from services.reference.guidance import guards
from services.reference.guidance.axes import LOOK_AHEAD_S
from services.reference.guidance.guidance import TURN_SHORT
from services.reference.settings import Settings, VelocityAxis
from services.reference.trajectory.minimum_jerk import Ramp, Sample, solve
from services.reference.trajectory.position import travelled
from services.reference.trajectory.vector import VectorRamp
from tools.sweep.fast.lanes import Lanes, Mask, where

STILL = (0.0, 0.0)


class LaneMotion(NamedTuple):
    """As `Motion`; the position is of each lane, the rest of all."""

    position: Lanes
    velocity: float
    acceleration: float
    jerk: float


class LaneReference(NamedTuple):
    depth: LaneMotion  # [m]
    heading: LaneMotion  # [rad]
    surge_force: Lanes  # [N]
    sway_force: Lanes  # [N]


class HeldAxis:
    """A ramp of all lanes, and where it began in each."""

    def __init__(self, axis: VelocityAxis, count: int) -> None:
        self.ramp = Ramp(axis.limits)
        self._begin = np.zeros(count)
        self.blocked = np.zeros(count, bool)  # by the governor
        self._most = axis.max_error

    def rest(self, position: Lanes, t: float) -> None:
        self.ramp.rest(0.0, t)
        self._begin = position

    def now(self, t: float) -> LaneMotion:
        here = self.ramp.at(t)
        return LaneMotion(self._begin + here.position, *here[1:])

    def shift(self, by: Lanes) -> None:
        self._begin = self._begin + by

    def keep(self, position: Lanes, t: float, dt: float, most: Any = None) -> Lanes:
        """[position units] By how much the governor moves the reference now, towards a vehicle at
        this position that is held back."""
        here = self.now(t)
        error = here.position - position
        size, most = np.abs(error), self._most if most is None else most
        speeding_up = here.velocity * here.acceleration
        released = speeding_up < 0.0 or here.velocity == 0.0 == here.acceleration
        beyond = size > most
        back = self.blocked & ~beyond & released
        stays = where(back, size >= most / 10, self.blocked & (size >= most / 2))
        share = where(beyond, most / where(beyond, size, 1.0), 1.0)
        share = where(back, 1.0 - min(1.0, dt / guards.RETURN_S), share)
        self.blocked = beyond | stays
        return error * (share - 1.0)


class Standstills:
    """Where a stop of heave ends (guards.py)."""

    def __init__(self, most: float, count: int) -> None:
        self._most = most
        self._stops, self._rests = np.zeros(count, bool), np.full(count, np.nan)
        self._way = np.zeros(count)

    def step(
        self, error: Lanes, rate: Lanes, here: Any, t: float, *, resting: bool, apart: Mask
    ) -> Lanes:
        """By how much to move what is held; `apart`: lanes in which it is left where it is."""
        self._stops, self._rests = self._stops & ~apart, where(apart, np.nan, self._rests)
        if not resting:
            self._stops, self._rests = ~apart, np.full(len(apart), np.nan)
            if here.velocity != 0.0:
                self._way = where(apart, self._way, here.velocity)
            return np.zeros(len(apart))
        self._rests = where(self._stops & np.isnan(self._rests), t, self._rests)
        runs_on = (rate * self._way > 0.0) & (t - self._rests < guards.PATIENCE_S)
        ends = self._stops & ~runs_on
        self._stops, self._rests = self._stops & ~ends, where(ends, np.nan, self._rests)
        by = np.clip(error, -self._most, self._most)
        return where(ends & (np.abs(by) >= guards.WORTH * self._most), by, 0.0)


class TiltLimits:
    """How much of surge and sway a tilted vehicle gets (guards.py)."""

    def __init__(self, most: float, count: int) -> None:
        self.share = np.ones(count)
        self._most = most
        self._mean: Lanes | None = None

    def step(self, roll: Lanes, pitch: Lanes, dt: float) -> None:
        tilt = np.arccos(np.clip(np.cos(roll) * np.cos(pitch), -1.0, 1.0))
        mean = tilt if self._mean is None else self._mean
        self._mean = tilt + (mean - tilt) * np.exp(-dt / guards.SMOOTH_S)
        soon = np.maximum(0.0, tilt + (tilt - self._mean) * (guards.AHEAD_S / guards.SMOOTH_S))
        room = 1.0 - soon / self._most
        by = dt * room / where(room > 0.0, guards.RISE_S, guards.FALL_S)
        self.share = np.clip(self.share + by, 0.0, 1.0)


class HorizontalForces:
    """Surge and sway [N]: one plan for all lanes that have asked for the same so far."""

    def __init__(self, settings: Settings, count: int) -> None:
        self._full = settings.horizontal.max_surge, settings.horizontal.max_sway
        ramp = VectorRamp(settings.horizontal.limits, STILL, STILL)
        self._plans: list[tuple[VectorRamp, Any]] = [(ramp, np.arange(count))]
        self._now = np.zeros((2, count))

    def aim(self, sticks: Sticks, share: Lanes, t: float) -> None:
        plans = list[tuple[VectorRamp, Any]]()
        moves = sticks.surge != 0.0 or sticks.sway != 0.0
        for ramp, lanes in self._plans:
            shares = np.unique(share[lanes]) if moves else [1.0]
            for n, size in enumerate(shares):
                these = lanes[share[lanes] == size] if len(shares) > 1 else lanes
                own = ramp if n == len(shares) - 1 else copy.copy(ramp)
                surge, sway = float(size) * sticks.surge, float(size) * sticks.sway
                own.aim((surge * self._full[0], sway * self._full[1]), t)
                plans.append((own, these))
        self._plans = plans

    def now(self, t: float) -> Lanes:
        """(2, lanes)"""
        for ramp, lanes in self._plans:
            surge, sway = ramp.at(t)
            self._now[0, lanes], self._now[1, lanes] = surge.velocity, sway.velocity
        return self._now


class References:
    """Stabilised: depth and heading are held. Times `t` [s] never decrease."""

    def __init__(self, settings: Settings, count: int) -> None:
        s = settings
        self._settings = s
        self.lost = np.zeros(count, bool)  # lanes that come close to the depth limit
        self._depth, self._heading = HeldAxis(s.heave, count), HeldAxis(s.yaw, count)
        self._standstill = Standstills(s.standstill, count)
        self._tilt = TiltLimits(s.most_tilt, count)
        self._force = HorizontalForces(s, count)
        self._t: float | None = None  # of the step before
        fast, limits = s.heave.max_velocity, s.heave.limits
        there_and_back = (*solve(0.0, 0.0, fast, limits), *solve(fast, 0.0, 0.0, limits))
        zone = 2.0 * travelled(there_and_back) + fast * LOOK_AHEAD_S
        self._deepest = s.failsafe.depth_limit - zone  # [m] beyond it, a stick may act otherwise

    def step(
        self, state: Any, sticks: Sticks, turn_short: Mask, t: float, *, armed: bool
    ) -> LaneReference:
        """One reference.

        Args:
            state: `depth` and `rate` [m, m/s], `heading`, `roll` and `pitch` [rad], of each lane.
            turn_short: lanes in which all the thrust there is turns the vehicle.
        """
        dt, self._t = 0.0 if self._t is None else t - self._t, t
        self._tilt.step(state.roll, state.pitch, dt)
        s, depth, heading = self._settings, self._depth, self._heading
        if not armed:
            depth.rest(state.depth, t)
            heading.rest(state.heading, t)
        depth.ramp.aim(sticks.heave * s.heave.max_velocity, t)
        heading.ramp.aim(sticks.yaw * s.yaw.max_velocity, t)
        self._force.aim(sticks, self._tilt.share, t)
        if armed:
            self._wait(state, turn_short, t, dt)
        surge, sway = self._force.now(t)
        now = depth.now(t)
        self.lost |= now.position > self._deepest
        return LaneReference(now, heading.now(t), surge, sway)

    def _wait(self, state: Any, turn_short: Mask, t: float, dt: float) -> None:
        """Hold where a stop ends, and keep the reference close to a vehicle that is held back."""
        depth, heading = self._depth, self._heading
        here: Sample = depth.ramp.at(t)
        resting = here.velocity == 0.0 == here.acceleration and depth.ramp.settles() <= t
        error = state.depth - depth.now(t).position
        by = self._standstill.step(error, state.rate, here, t, resting=resting, apart=depth.blocked)
        depth.shift(by)
        depth.shift(depth.keep(state.depth, t, dt))
        most = self._settings.yaw.max_error
        heading.shift(
            heading.keep(state.heading, t, dt, where(turn_short, min(most, TURN_SHORT), most))
        )
