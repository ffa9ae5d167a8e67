"""Where the vehicle is, by its state: its motion over the ground; depth and heading to tell."""

from math import cos, sin
from typing import NamedTuple

from msgspec import UNSET, UnsetType

from messages.state import VehicleState
from services.marine.attitude import level_velocity, north_offset, wrapped

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


def turned(vector: Pair, angle: float) -> Pair:
    """A horizontal vector rotated clockwise seen from above: body to NED by the heading."""
    x, y = vector
    c, s = cos(angle), sin(angle)
    return c * x - s * y, s * x + c * y


class Whereabouts(NamedTuple):
    """In the two numbers that whoever watches many drones is told of each."""

    depth: float | UnsetType = UNSET  # [m] positive down; absent: not known
    heading: float | UnsetType = UNSET  # [rad] clockwise from north, ±π; absent: not known


def whereabouts(state: VehicleState | None) -> Whereabouts:
    """Of the newest state; nothing where there is none."""
    if state is None:
        return Whereabouts()
    return Whereabouts(
        state.depth.value if state.depth.valid else UNSET,
        wrapped(state.heading.value + north_offset(state)) if state.heading.valid else UNSET,
    )
