"""The horizontal plane: the reference in NED, resolved along the body axes."""

from math import hypot
from typing import NamedTuple

from msgspec.structs import replace

from messages.message import Estimate
from messages.reference import Motion
from messages.state import VehicleState
from messages.units import Vec6
from services.marine.attitude import level_velocity, turned

Place = tuple[float, float]  # [m] north, east
STILL_WATER = (0.0, 0.0)  # [m/s]


class HorizontalSetpoint(NamedTuple):
    """Reference in body axes: positions are errors, velocities are over the ground."""

    surge: Motion
    sway: Motion


def limited_error(north: Motion, east: Motion, place: Place, most: float) -> tuple[Motion, Motion]:
    """The reference with its position error limited to `most` [m], in the same direction: the first
    anti-windup guard. Clamping each axis alone would change the direction."""
    away = north.position - place[0], east.position - place[1]
    if hypot(*away) <= most:
        return north, east
    share = most / hypot(*away)
    return (
        replace(north, position=place[0] + share * away[0]),
        replace(east, position=place[1] + share * away[1]),
    )


class MeasuredMotion(NamedTuple):
    """Feedback of the horizontal law, all of it valid."""

    heading: float  # [rad] clockwise from north
    north: float  # [m] NED
    east: float  # [m]
    ahead: float  # [m/s] over the ground, horizontal, as the heading points
    starboard: float  # [m/s] to the right of it

    def through_water(self, state: VehicleState) -> tuple[float, float]:
        """[m/s] Ahead and to starboard relative to the water."""
        along, across = water_velocity(state, self.heading)
        return self.ahead - along, self.starboard - across


def measured(state: VehicleState) -> MeasuredMotion | None:
    """None when position, velocity or heading are not valid."""
    heading = state.heading if state.heading_navigation is None else state.heading_navigation
    north, east, level = state.north, state.east, level_velocity(state)
    if north is None or east is None or level is None:
        return None
    if not (heading.valid and north.valid and east.valid):
        return None
    return MeasuredMotion(heading.value, north.value, east.value, *level)


def water_velocity(state: VehicleState, heading: float) -> tuple[float, float]:
    """[m/s] Of the water over the ground along surge and sway; zero where unknown."""
    return known_water(state, heading) or STILL_WATER


def known_water(state: VehicleState, heading: float) -> tuple[float, float] | None:
    """[m/s] Of the water over the ground along surge and sway; None: unknown."""
    north, east = _known(state.current_north), _known(state.current_east)
    return None if north is None or east is None else to_body(heading, north, east)


def seen_from_body(north: Motion, east: Motion, heading: float, place: Place) -> HorizontalSetpoint:
    """The reference resolved along the body axes.

    Args:
        heading: [rad] clockwise from north.
        place: measured north and east [m].
    """
    error = to_body(heading, north.position - place[0], east.position - place[1])
    velocity = to_body(heading, north.velocity, east.velocity)
    acceleration = to_body(heading, north.acceleration, east.acceleration)
    jerk = to_body(heading, north.jerk, east.jerk)
    surge, sway = zip(error, velocity, acceleration, jerk, strict=True)
    return HorizontalSetpoint(Motion(*surge), Motion(*sway))


def turning_force(inertia: Vec6, velocity: tuple[float, float], turn: float) -> tuple[float, float]:
    """[N] Surge and sway forces that a turning vehicle needs in addition to M times its
    acceleration over the ground, because added mass differs between the axes.

    In turning axes u' = a_x + r v, and M ν' + C(ν) ν = τ (Fossen 2011, eq. 3.46) leaves
    X = m_x (a_x + r v) - m_y r v, and likewise in sway.

    Args:
        inertia: diagonal of M [kg, kg m²].
        velocity: surge and sway relative to the water [m/s].
        turn: r [rad/s].
    """
    difference = (inertia[0] - inertia[1]) * turn
    return difference * velocity[1], difference * velocity[0]


def to_body(heading: float, north: float, east: float) -> tuple[float, float]:
    """Surge and sway components of a horizontal NED vector of a level vehicle."""
    return turned((north, east), -heading)


def _known(estimate: Estimate | None) -> float | None:
    return estimate.value if estimate is not None and estimate.valid else None
