"""The law of one held axis of many vehicles: `services/control/axis/` in lanes, with a disturbance
observer, for a rate that is known and not late."""

from collections.abc import Sequence
from math import exp, expm1, inf
from typing import Any

import numpy as np

from messages.reference import Motion
from services.control.axis import rest_pulse as pulses
from services.control.axis.axis_law import BLOCKED, MOVING, AxisLaw, Gains
from services.control.axis.plant import DRAG_DECAY, Plant
from tools.sweep.fast.lanes import Lanes, Mask, clamped, where


class LaneObserver:
    """The disturbance, at rest and as a drag (`DisturbanceObserver`)."""

    def __init__(self, plant: Plant, gains: Gains, count: int) -> None:
        self._plant, self._bandwidth = plant, gains.observer
        self._limit, self._doubt = gains.max_integral, gains.drag_doubt
        self._drag_speed = gains.drag_speed or inf
        self.estimate, self.drag = np.zeros(count), np.zeros(count)
        self._velocity = np.full(count, np.nan)  # not known

    def expected(self, reference: Any) -> Lanes:
        return clamped(self.estimate + self.drag * reference, self._most(reference))

    def _most(self, reference: Any) -> Any:
        return self._limit + self._doubt * abs(self._plant.drag(reference))

    def learn(
        self, velocity: Lanes, force: Lanes, dt: float, most: Lanes, reference: Any, short: Any
    ) -> None:
        """Take in one step; a velocity of NaN is not known."""
        before, self._velocity = self._velocity, velocity
        known = ~(np.isnan(before) | np.isnan(velocity))
        plant, middle = self._plant, (before + velocity) / 2
        inertia = plant.sampled_inertia(dt) * (velocity - before) / dt
        drag = plant.linear * before + plant.quadratic * middle * np.abs(middle)
        observed = clamped(inertia + drag - force, self._most(reference))
        change = -expm1(-self._bandwidth * dt) * (observed - self.expected(reference))
        change = where(known & ~(change * short < 0.0), clamped(change, most), 0.0)
        if not np.any(reference):
            self.drag = where(known, self.drag * exp(-dt / DRAG_DECAY), self.drag)
            self.estimate = self.estimate + change
        else:
            size = reference / self._drag_speed
            self.drag = self.drag + change / self._drag_speed * size / (1.0 + size * size)
            self.estimate = self.estimate + change / (1.0 + size * size)


class LaneAxis:
    """`AxisLaw` with its observer; the feed-forward is the scalar law's."""

    def __init__(self, gains: Gains, plant: Plant, lag: float, period: float, count: int) -> None:
        self._gains, self._lag, self._period = gains, lag, period
        self._law = AxisLaw(gains, plant, lag, period)
        self._observer = LaneObserver(plant, gains, count)
        self._blend, self._disturbed = np.zeros(count), np.zeros(count, bool)
        self._still, self._slow = np.zeros(count), np.zeros(count)
        self._reference_rate: Any = 0.0
        self._soon: Any = 0.0

    def step(self, reference: Any, position: Lanes, rate: Lanes, dt: float) -> Lanes:
        """Effort [N] or [N m] for a `LaneMotion` and an estimate at the same instant."""
        g, r = self._gains, reference
        self._reference_rate = r.velocity
        self._soon = g.drag_lead_percent / 100 * self._lag * r.acceleration
        error = r.position - position
        near = clamped(error, g.max_error)
        moves = bool(np.any(np.abs(r.velocity) > MOVING) or np.any(np.abs(r.acceleration) > MOVING))
        kp, kd, zone = self._feedback(near, dt, moves=moves)
        outside = near - clamped(near, zone)
        self._slow = np.zeros_like(near) if moves else g.ki * np.abs(outside)
        self._still = where(
            np.abs(error) > g.decay_threshold, inf, g.still + BLOCKED * np.abs(r.velocity)
        )
        fed_forward = self._law.feed_forward(Motion(0.0, r.velocity, r.acceleration, r.jerk))
        standing = -self._observer.expected(self._reference_rate + self._soon)
        return kp * outside + kd * (r.velocity - rate) + fed_forward + standing

    def learn(
        self, velocity: Lanes, force: Lanes, dt: float, freely: Any = False, short: Any = 0.0
    ) -> None:
        slowly = (np.abs(velocity) < self._still) & ~np.asarray(freely)
        most = where(slowly, self._slow * dt, inf)
        self._observer.learn(velocity, force, dt, most, self._reference_rate, short)

    def _feedback(self, error: Lanes, dt: float, *, moves: bool) -> tuple[Any, Any, Any]:
        """kp, kd and zone of this step (`GainBlend`)."""
        g, static = self._gains, self._gains.static
        if static is None:
            return g.kp, g.kd, 0.0
        share = self._blend * self._blend * (3 - 2 * self._blend)
        kp, kd = static.kp + share * (g.kp - static.kp), static.kd + share * (g.kd - static.kd)
        size = np.abs(error)
        self._disturbed = (size > static.leave) | (self._disturbed & (size > static.leave / 2))
        target = np.ones_like(size) if moves else self._disturbed.astype(float)
        self._blend = self._blend + clamped(target - self._blend, dt / static.blend)
        return kp, kd, static.zone * (1 - share)


class LanePulse:
    """Pulses for a heading at rest (`RestPulse`)."""

    def __init__(
        self, plant: Plant, lag: float, period: float, pushes: Sequence[float], zone: float,
        count: int,
    ) -> None:  # fmt: skip
        self.smallest = pushes[0]  # [N m]
        self.turn = np.zeros(count, int)  # whose push the newest pulse is
        self._plant, self._lag, self._period, self._zone = plant, lag, period, zone
        self._pushes = np.array(pushes)
        self._coasting = plant.inertia / plant.linear  # [s]
        self._left, self._sign, self._end = np.zeros((3, count))
        self._since, self._before, self._planned = np.zeros((3, count))
        self._patience, self._correction = np.ones(count), np.ones(count)

    def step(self, error: Lanes, rate: Lanes, effective: Mask, *, resting: bool) -> Lanes:
        """What to give instead of the law's effort, in pushes; NaN: the law's effort."""
        given = np.full(len(error), np.nan)
        if not resting:
            self._left[:] = self._since[:] = self._sign[:] = self._planned[:] = 0.0
            self._patience[:] = 1.0
            return given
        pulsing = self._left > 0
        self._left = self._left - pulsing
        given[pulsing] = where(self._left > 0, self._sign, 0.0)[pulsing]
        acts = ~pulsing & effective
        self._since[acts] = self._planned[acts] = 0.0
        waits = ~pulsing & ~effective
        self._since = self._since + where(waits, self._period, 0.0)
        end = error - rate * self._coasting
        share = self._period / np.clip(self._since, self._period, pulses.SMOOTHING)
        self._end = where(waits, self._end + share * (end - self._end), self._end)
        ripe = waits & (self._since >= self._pause)
        self._judge(ripe)
        begins = ripe & (self._since >= self._pause) & (np.abs(self._end) > self._zone)
        if np.any(begins):
            self._begin(begins)
            given[begins] = self._sign[begins]
        return given

    @property
    def _pause(self) -> Lanes:
        pulsed = where(self._sign != 0.0, self._patience, 0.0)
        return pulses.SETTLED * self._lag + pulsed * pulses.DAMPED * self._coasting

    def _judge(self, ripe: Mask) -> None:
        """What did the newest pulse do?"""
        judged = ripe & (self._planned != 0.0)
        moved = (self._before - self._end) / where(judged, self._planned, 1.0)
        self._planned = where(judged, 0.0, self._planned)
        stuck = judged & (moved < pulses.MOVED)
        longer = np.minimum(pulses.PATIENCE, 2.0 * self._patience)
        self._patience = where(stuck, longer, where(judged, 1.0, self._patience))
        by = np.clip(moved, 1.0 / pulses.MOST_AT_ONCE, pulses.MOST_AT_ONCE)
        corrected = np.clip(self._correction * by, 1.0, pulses.MOST)
        self._correction = where(judged & ~stuck, corrected, self._correction)

    def _begin(self, these: Mask) -> None:
        end = self._end
        sign = where(end > 0.0, 1.0, -1.0)
        beyond = where(sign == self._sign, pulses.BEYOND * self._zone, 0.0)
        self.turn = where(these, (self.turn + 1) % len(self._pushes), self.turn)
        one = self._correction * self._pushes[self.turn] * self._period / self._plant.linear
        wanted = np.rint((np.abs(end) + beyond) / one)
        steps = np.maximum(1, np.minimum(pulses.LONGEST, wanted))
        self._left = where(these, steps, self._left)
        self._sign = where(these, sign, self._sign)
        self._since = where(these, 0.0, self._since)
        self._before = where(these, end, self._before)
        self._planned = where(these, sign * steps * one, self._planned)
