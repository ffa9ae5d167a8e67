"""Where the drone was first armed: the place that it goes back to by request."""

from dataclasses import dataclass

import msgspec

from messages.state import VehicleState
from messages.units import Finite
from services.reference.guidance.ground_motion import GroundMotion, Pair

# [s] without a position; after a longer gap nobody knows where a new origin is.
MOST_GAP_S = 1.0


class HomePlace(msgspec.Struct, frozen=True):
    """What a restart in mid-dive needs."""

    north: Finite  # [m]
    east: Finite  # [m]
    origin: int  # of the position, as the state names it


@dataclass(slots=True)
class Home:
    """The first position that is measured while the drone is armed. It moves with the origin of the
    positions as long as they do not break off; then it is lost. Times `t` in seconds."""

    place: HomePlace | None = None
    lost: bool = False  # the positions began anew at a place that nobody knows
    _newest: tuple[float, Pair] | None = None  # [s], [m]

    def see(
        self, state: VehicleState | None, ground: GroundMotion | None, t: float, *, armed: bool
    ) -> None:
        if state is None or ground is None or not isinstance(state.origin, int):
            return
        before, self._newest = self._newest, (t, ground.position)
        if self.lost or (self.place is None and not armed):
            return
        (north, east), old = ground.position, self.place
        if old is None:
            self.place = HomePlace(north, east, state.origin)
        elif old.origin != state.origin:
            self.place, self.lost = None, before is None or t - before[0] > MOST_GAP_S
            if before is not None and not self.lost:
                by = north - before[1][0], east - before[1][1]
                self.place = HomePlace(old.north + by[0], old.east + by[1], state.origin)

    @property
    def missing(self) -> str:
        """Why it cannot be gone to; empty: it can."""
        if self.place is not None:
            return ""
        if self.lost:
            return (
                "home is not known any more: the position was lost on the way, and began anew; the "
                "next place where the drone is armed will be home"
            )
        return "home is not known: no position has been measured since the drone was armed"
