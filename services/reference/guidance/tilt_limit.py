"""How much of surge and sway the pilot gets while the vehicle pitches or rolls far.

Fast ahead, a hull pitches: its added mass turns it across the flow, and only its low centre of
gravity keeps it level. Past some angle its heave thrusters can no longer hold the depth against
what surge and sway push and what the flow lifts. The speed is the cause, and the force the pilot
asks for is the cause of the speed.
"""

from dataclasses import dataclass
from math import acos, cos, exp

from messages.state import VehicleState

AHEAD_S = 0.5  # [s] a tilt that grows is taken as it will be then, because speed is lost slowly
BAND = 0.5  # [-] of the limit: so far beyond it nothing is left of surge and sway
FALL_S = 0.3  # [s] time constant of a share that gets smaller …
RISE_S = 2.0  # [s] … and larger: slower than the hull pitches, so that the two do not swing
WHOLE = 0.999  # [-] a share that rises to here is 1 again


def tilt_of(state: VehicleState) -> float | None:
    """[rad] 0 … π, of the vehicle's down axis from the vertical; None: not known."""
    if not (state.roll.valid and state.pitch.valid):
        return None
    level = cos(state.roll.value) * cos(state.pitch.value)
    return acos(max(-1.0, min(1.0, level)))


def admissible(tilt: float, most: float) -> float:
    """The share, 0 … 1, of surge and sway at a lasting tilt [rad]; `most` [rad] takes nothing."""
    return max(0.0, min(1.0, 1.0 - (tilt - most) / (BAND * most)))


@dataclass(slots=True)
class TiltLimit:
    """Follows the admissible share: quickly down, slowly up."""

    most: float  # [rad]
    share: float = 1.0  # [-] 0 … 1, exactly 1 while nothing is taken away
    _mean: float | None = None  # [rad] tilt, over the last `AHEAD_S`

    def step(self, tilt: float | None, dt: float) -> float:
        """The share after `dt` [s] ≥ 0 at this tilt [rad]; an unknown tilt limits nothing."""
        goal = 1.0 if tilt is None else admissible(self._soon(tilt, dt), self.most)
        self._mean = None if tilt is None else self._mean
        rises = goal >= self.share
        share = goal + (self.share - goal) * exp(-dt / (RISE_S if rises else FALL_S))
        self.share = 1.0 if rises and share >= WHOLE else share
        return self.share

    def _soon(self, tilt: float, dt: float) -> float:
        """[rad] In `AHEAD_S`, if it goes on to grow as it does; the tilt itself if it does not."""
        mean = tilt if self._mean is None else self._mean
        self._mean = tilt + (mean - tilt) * exp(-dt / AHEAD_S)
        return tilt + max(0.0, tilt - self._mean)
