"""Where the vehicle is, by its state: its motion over the ground; depth and heading to tell."""

from math import cos, sin
from typing import NamedTuple

from msgspec import UNSET, UnsetType

from messages.state import VehicleState
from services.marine.attitude import wrapped

Pair = tuple[float, float]  # north and east, or surge and sway


class GroundMotion(NamedTuple):
    """Position and velocity over the ground, NED."""

    position: Pair  # [m] north, east
    velocity: Pair  # [m/s] north, east
    offset: float  # [rad] north heading minus control heading


def ground_of(state: VehicleState) -> GroundMotion | None:
    """None when any part is unknown or invalid.

    Roll and pitch are assumed zero: the relative error of the horizontal velocity is 1 - cos.
    """
    north, east = state.north, state.east
    surge, sway = state.surge_velocity, state.sway_velocity
    if north is None or east is None or surge is None or sway is None:
        return None
    if not (north.valid and east.valid and surge.valid and sway.valid):
        return None
    offset = north_offset(state)
    velocity = turned((surge.value, sway.value), state.heading.value + offset)
    return GroundMotion((north.value, east.value), velocity, offset)


def north_offset(state: VehicleState) -> float:
    """[rad] North heading minus control heading; 0 without a compass, where estimation counts the
    control heading from north too."""
    if state.heading_navigation is None:
        return 0.0
    return wrapped(state.heading_navigation.value - state.heading.value)


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
