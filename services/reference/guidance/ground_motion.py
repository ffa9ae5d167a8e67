"""Where the vehicle is, by its state: its motion over the ground; depth and heading to tell."""

from dataclasses import dataclass
from typing import NamedTuple

import msgspec
from msgspec import UNSET, UnsetType

from messages.state import VehicleState
from messages.units import Finite
from services.marine.attitude import level_velocity, north_offset, turned, wrapped

Pair = tuple[float, float]  # north and east, or surge and sway


class GroundMotion(NamedTuple):
    """Position and velocity over the ground, NED."""

    position: Pair  # [m] north, east
    velocity: Pair  # [m/s] north, east
    offset: float  # [rad] north heading minus control heading


def ground_of(state: VehicleState) -> GroundMotion | None:
    """None when any part is unknown or invalid."""
    north, east, level = state.north, state.east, level_velocity(state)
    if north is None or east is None or level is None or not (north.valid and east.valid):
        return None
    offset = north_offset(state)
    velocity = turned(level, state.heading.value + offset)
    return GroundMotion((north.value, east.value), velocity, offset)


def whereabouts(state: VehicleState | None) -> tuple[float | UnsetType, float | UnsetType]:
    """Depth [m] and heading [rad] clockwise from north, ±π, for the list of drones; absent: not
    known."""
    if state is None:
        return UNSET, UNSET
    return (
        state.depth.value if state.depth.valid else UNSET,
        wrapped(state.heading.value + north_offset(state)) if state.heading.valid else UNSET,
    )


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
