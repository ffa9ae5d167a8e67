"""What guidance does about a vehicle that does not do what the reference says: the reference waits
for one that is blocked, a stop ends where it stands, one that pitches or rolls too far gets less
surge and sway, and what is not measured is not held.
"""

from dataclasses import dataclass
from math import acos, cos, exp
from typing import Literal

from messages.state import VehicleState
from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import Sample

RETURN_S = 0.5  # [s] time constant of the reference's return to a vehicle that is blocked
PATIENCE_S = 0.8  # [s] a vehicle that creeps on in one direction is held where it is after that
LEARNS_S = 6.0  # [s] from a stop on, in which the estimate of its place gets better
WORTH = 0.02  # [-] of the furthest; a smaller move is not made
# [rad] of roll and pitch together; beyond it a vehicle that holds its depth gets less surge and
# sway than the pilot asks for. Tuned on a Pioneer that is lighter and less damped than its file.
MOST_TILT = 0.5
AHEAD_S = 1.0  # [s] what counts is the tilt then, if it goes on as it does: speed is lost slowly
SMOOTH_S = 0.5  # [s] in which it is seen how the tilt goes on
FALL_S = 1.0  # [s] in which the share would fall by 1 at twice the limit of the tilt
RISE_S = 10.0  # [s] in which the share would rise by 1 at no tilt: slowly, so that it settles
BLIND_S = 0.5  # [s] control goes on without feedback for so long before anybody is told


@dataclass(slots=True)
class ReferenceGovernor:
    """First anti-windup guard (Andrén 2023, 5.4.1): keeps the reference within `most` of a vehicle
    that is blocked, by the sea floor or by its tether. Once the stick is released the reference
    returns to the vehicle, so that the thrusters do not push against the obstacle for ever."""

    most: float  # position units
    blocked: bool = False

    def keep(self, size: float, dt: float, *, released: bool) -> float:
        """The share, 0 … 1, of an error of this size that may remain after `dt` [s].

        Args:
            released: the reference slows down or is at rest.
        """
        if size > self.most:
            self.blocked = True
            return self.most / size
        if self.blocked and released:
            self.blocked = size >= self.most / 10
            return 1.0 - min(1.0, dt / RETURN_S)
        self.blocked = self.blocked and size >= self.most / 2
        return 1.0


def is_released(*motions: Sample) -> bool:
    """Whether the reference slows down or is at rest; one motion per axis."""
    speeding_up = plain_sum(motion.velocity * motion.acceleration for motion in motions)
    at_rest = all(motion.velocity == 0.0 == motion.acceleration for motion in motions)
    return speeding_up < 0.0 or at_rest


@dataclass(slots=True)
class Standstill:
    """Where a stop of one axis ends: when the reference rests, what is held moves to where the
    vehicle then stands, and for some seconds with the estimate of that place. Time `t` in seconds,
    never decreasing.

    A stop ends where its plan says, and the vehicle runs past that point by some millimetres.
    Nobody asked for that very point, only for a stop, so to be pulled back to it is a motion that
    the pilot did not want. Nor must the vehicle move because its estimate of the depth gets better.
    """

    most: float  # position units; furthest that what is held is moved
    moved: float = 0.0  # position units; by how much it was, at the newest stop
    _way: float | None = None  # newest velocity of a reference that comes to rest; None: at rest
    _rests: float | None = None  # [s] since when the reference rests after that; None: no stop
    _corrected: float | None = None  # position units; at the step before
    _by: float = 0.0  # position units; by how much it was moved since the reference rests

    def cancel(self) -> None:
        """The end of this motion was asked for, or the vehicle is held back: leave it there."""
        self._way = self._rests = None

    def step(
        self,
        error: float,
        rate: float,
        t: float,
        *,
        resting: bool,
        velocity: float = 0.0,
        corrected: float | None = None,
    ) -> float:
        """By how much to move what is held, now. A vehicle that still runs on is waited for; one
        that has come to a standstill before, or comes back already, is held where it is.

        Args:
            error: position units; from what is held to the vehicle.
            rate: position units per second; of the vehicle.
            resting: the reference rests.
            velocity: position units per second; of the reference.
            corrected: position units; sum of corrections of where it came to rest; None: none.
        """
        before, self._corrected = self._corrected, corrected
        if not resting:
            self._way, self._rests, self._by = velocity or self._way or 0.0, None, 0.0
            return 0.0
        if self._way is not None and self._rests is None:
            self._rests = t
        if self._rests is None or t - self._rests > LEARNS_S:
            return 0.0
        by = 0.0 if before is None or corrected is None else corrected - before
        stands = rate * (self._way or 0.0) <= 0.0 or t - self._rests >= PATIENCE_S
        if self._way is not None and stands:
            self._way = None
            by = max(-self.most, min(self.most, error))
            self.moved = by = by if abs(by) >= WORTH * self.most else 0.0
        by = max(-self.most, min(self.most, self._by + by)) - self._by
        self._by += by
        return by


def tilt_of(state: VehicleState) -> float | None:
    """[rad] 0 … π, of the vehicle's down axis from the vertical; None: not known."""
    if not (state.roll.valid and state.pitch.valid):
        return None
    level = cos(state.roll.value) * cos(state.pitch.value)
    return acos(max(-1.0, min(1.0, level)))


@dataclass(slots=True)
class TiltLimit:
    """How much of surge and sway the pilot gets while the vehicle pitches or rolls far: integrates
    how far the tilt is from its limit, so that a tilt that lasts ends there.

    Fast ahead, a hull pitches: its added mass turns it across the flow, and only its low centre of
    gravity keeps it level. Past some angle its heave thrusters can no longer hold the depth against
    what surge and sway push and what the flow lifts. The speed is the cause, and the force the
    pilot asks for is the cause of the speed.
    """

    share: float = 1.0  # [-] 0 … 1, exactly 1 while nothing is taken away
    _mean: float | None = None  # [rad] tilt, over the last `SMOOTH_S`

    def step(self, tilt: float | None, dt: float) -> float:
        """The share after `dt` [s] ≥ 0 at this tilt [rad]; an unknown tilt limits nothing."""
        if tilt is None:
            self._mean, by = None, dt / FALL_S
        else:
            mean = tilt if self._mean is None else self._mean
            self._mean = tilt + (mean - tilt) * exp(-dt / SMOOTH_S)
            soon = max(0.0, tilt + (tilt - self._mean) * AHEAD_S / SMOOTH_S)  # [rad] in `AHEAD_S`
            room = 1.0 - soon / MOST_TILT
            by = dt * (room / (RISE_S if room > 0.0 else FALL_S))
        self.share = max(0.0, min(1.0, self.share + by))
        return self.share


@dataclass(slots=True)
class EstimateWatch:
    """Is one axis measured? What is not is not held, and the pilot reads so as long as it lasts."""

    lost: bool = False
    _valid: float | None = None  # [s] when the estimate was valid last

    def see(self, *, valid: bool, t: float) -> Literal["lost", "back"] | None:
        """The estimate at `t` [s]. Returns what has just changed."""
        if valid or self._valid is None:
            self._valid = t
        if valid and self.lost:
            self.lost = False
            return "back"
        if not self.lost and t - self._valid > BLIND_S:
            self.lost = True
            return "lost"
        return None
