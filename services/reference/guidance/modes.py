"""The axes held in each mode, and what each mode requires."""

from typing import NamedTuple

from messages.pilot import FlightMode
from messages.state import VehicleState
from services.reference.guidance.ground_motion import ground_of


class HeldAxes(NamedTuple):
    """Axes the drone holds: their sticks are velocities, the others' are forces."""

    depth: bool
    heading: bool
    place: bool
    height: bool = False  # above the bottom, by way of the depth


HELD_AXES: dict[FlightMode, HeldAxes] = {
    "manual": HeldAxes(depth=False, heading=False, place=False),
    "depth_hold": HeldAxes(depth=True, heading=False, place=False),
    "heading_hold": HeldAxes(depth=False, heading=True, place=False),
    "stabilised": HeldAxes(depth=True, heading=True, place=False),
    "station_keeping": HeldAxes(depth=True, heading=True, place=True),
    "altitude_hold": HeldAxes(depth=True, heading=True, place=False, height=True),
}


def safe(flight_mode: FlightMode) -> FlightMode:
    """The mode for a drone without a pilot: depth and heading are held, and position if it was
    held before. The depth is: nobody watches what a height above the bottom leads to."""
    held = HELD_AXES[flight_mode]
    return flight_mode if held.depth and held.heading and not held.height else "stabilised"


def lacking(
    flight_mode: FlightMode, state: VehicleState | None, *, armed: bool, bottom: bool
) -> str:
    """What the mode requires and the drone lacks; empty when it lacks nothing.

    While disarmed, a mode can be chosen before depth and heading are known, because arming
    requires them. `bottom`: its depth is known.
    """
    held = HELD_AXES[flight_mode]
    if held.place and (state is None or ground_of(state) is None):
        return "this drone does not know its position and velocity over the ground"
    if held.height and not bottom:
        return "the drone does not measure its height above the bottom"
    if armed and state is not None:
        if held.depth and not state.depth.valid:
            return "the drone does not know its depth"
        if held.heading and not state.heading.valid:
            return "the drone does not know its heading"
    return ""
