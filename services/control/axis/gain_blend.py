"""Two sets of feedback gains, one for holding still and one for moving, without a bump between.

Holding still with the gains of motion makes a thruster with a dead-band start and stop for ever;
moving with the gains of rest follows badly (Andrén 2023, 5.4.2). The share of the moving set
goes from 0 to 1 along a smooth curve that leaves its ends at zero speed.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec

from messages.units import NotNegativeSetting, Positive


class StaticGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Gains while the reference rests. Units: N or N m per position unit, m or rad."""

    kp: NotNegativeSetting  # per position unit
    kd: NotNegativeSetting  # per position unit per second
    zone: NotNegativeSetting = 0.0  # position units; an error this small is left alone
    leave: Positive = 0.1  # position units; a larger error calls for the moving gains
    blend: Annotated[float, msgspec.Meta(ge=0.01, le=10.0)] = 0.5  # [s] from one set to the other

    def __post_init__(self) -> None:
        if self.zone >= self.leave:
            raise ValueError(f"zone is {self.zone:g}, it must be smaller than leave {self.leave:g}")


class FeedbackGains(msgspec.Struct, frozen=True, gc=False):
    """The gains in force."""

    kp: float
    kd: float
    zone: float

    def spring(self, error: float) -> float:
        """Restoring force. Inside the zone none; outside it grows from nothing, so that it does
        not step at the edge and, being passive, cannot keep a motion alive."""
        return self.kp * (error - max(-self.zone, min(self.zone, error)))


@dataclass(slots=True)
class GainBlend:
    """Which gains are in force. Begins with those of rest."""

    moving: FeedbackGains
    static: StaticGains | None
    _way: float = 0.0  # [-] of the way from rest to motion, before smoothing
    _stirred: bool = False  # the error has called for the moving gains

    def step(self, moves: bool, error: float, dt: float) -> FeedbackGains:
        """Gains of this step; what has changed shows from the next step on."""
        static = self.static
        if static is None:
            return self.moving
        now = self._mixed(static, self._way)
        if abs(error) > static.leave:
            self._stirred = True
        elif abs(error) <= static.leave / 2:
            self._stirred = False
        target = 1.0 if moves or self._stirred else 0.0
        most = dt / static.blend
        self._way += max(-most, min(most, target - self._way))
        return now

    def _mixed(self, static: StaticGains, way: float) -> FeedbackGains:
        share = way * way * (3 - 2 * way)
        return FeedbackGains(
            static.kp + share * (self.moving.kp - static.kp),
            static.kd + share * (self.moving.kd - static.kd),
            static.zone * (1 - share),
        )
