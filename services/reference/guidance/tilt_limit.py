"""How much of surge and sway the pilot gets while the vehicle pitches or rolls far.

Fast ahead, a hull pitches: its added mass turns it across the flow, and only its low centre of
gravity keeps it level. Past some angle its heave thrusters can no longer hold the depth against
what surge and sway push and what the flow lifts. The speed is the cause, and the force the pilot
asks for is the cause of the speed.
"""

from dataclasses import dataclass
from math import acos, cos, exp

from messages.state import VehicleState

AHEAD_S = 1.0  # [s] what counts is the tilt then, if it goes on as it does: speed is lost slowly
SMOOTH_S = 0.5  # [s] in which it is seen how the tilt goes on
FALL_S = 1.0  # [s] in which the share would fall by 1 at twice the limit …
RISE_S = 10.0  # [s] … and rise by 1 at no tilt: slowly, so that it settles where the tilt does


def tilt_of(state: VehicleState) -> float | None:
    """[rad] 0 … π, of the vehicle's down axis from the vertical; None: not known."""
    if not (state.roll.valid and state.pitch.valid):
        return None
    level = cos(state.roll.value) * cos(state.pitch.value)
    return acos(max(-1.0, min(1.0, level)))


def rate(tilt: float, most: float) -> float:
    """[1/s] Of the share, by the tilt and its limit [rad]: none at the limit."""
    room = 1.0 - tilt / most
    return room / (RISE_S if room > 0.0 else FALL_S)


@dataclass(slots=True)
class TiltLimit:
    """Integrates how far the tilt is from its limit, so that a tilt that lasts ends there."""

    most: float  # [rad]
    share: float = 1.0  # [-] 0 … 1, exactly 1 while nothing is taken away
    _mean: float | None = None  # [rad] tilt, over the last `SMOOTH_S`

    def step(self, tilt: float | None, dt: float) -> float:
        """The share after `dt` [s] ≥ 0 at this tilt [rad]; an unknown tilt limits nothing."""
        if tilt is None:
            self._mean, by = None, dt / FALL_S
        else:
            by = dt * rate(self._soon(tilt, dt), self.most)
        self.share = max(0.0, min(1.0, self.share + by))
        return self.share

    def _soon(self, tilt: float, dt: float) -> float:
        """[rad] In `AHEAD_S`."""
        mean = tilt if self._mean is None else self._mean
        self._mean = tilt + (mean - tilt) * exp(-dt / SMOOTH_S)
        return max(0.0, tilt + (tilt - self._mean) * AHEAD_S / SMOOTH_S)
