"""Two sets of feedback gains, for holding still and for moving, with a smooth blend.

The moving gains make a thruster with a dead-band start and stop for ever at rest; the static gains
follow a moving reference badly (Andrén 2023, 5.4.2). The share of the moving set goes from 0 to 1
along a curve with zero slope at both ends.
"""

from dataclasses import dataclass
from typing import Annotated

import msgspec

from messages.units import NotNegativeSetting, Positive


class StaticGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Gains while the reference rests. Units: N or N m per position unit, m or rad."""

    kp: NotNegativeSetting  # per position unit
    kd: NotNegativeSetting  # per position unit per second
    zone: NotNegativeSetting = 0.0  # position units; dead zone of the error
    leave: Positive = 0.1  # position units; a larger error switches to the moving gains
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
        """Restoring force, zero inside the zone. It is continuous at the edge and passive, so it
        cannot sustain an oscillation."""
        return self.kp * (error - max(-self.zone, min(self.zone, error)))


@dataclass(slots=True)
class GainBlend:
    """The gains in force. Begins with the static gains."""

    moving: FeedbackGains
    static: StaticGains | None
    _blend: float = 0.0  # [-] from static to moving, before smoothing
    _disturbed: bool = False  # the error has switched to the moving gains

    def step(self, moves: bool, error: float, dt: float) -> FeedbackGains:
        """Gains of this step; the arguments take effect from the next step on."""
        static = self.static
        if static is None:
            return self.moving
        now = self._mixed(static, self._blend)
        if abs(error) > static.leave:
            self._disturbed = True
        elif abs(error) <= static.leave / 2:
            self._disturbed = False
        target = 1.0 if moves or self._disturbed else 0.0
        most = dt / static.blend
        self._blend += max(-most, min(most, target - self._blend))
        return now

    def _mixed(self, static: StaticGains, blend: float) -> FeedbackGains:
        share = blend * blend * (3 - 2 * blend)
        return FeedbackGains(
            static.kp + share * (self.moving.kp - static.kp),
            static.kd + share * (self.moving.kd - static.kd),
            static.zone * (1 - share),
        )
