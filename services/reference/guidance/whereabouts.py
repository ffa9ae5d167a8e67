"""Where the drone is, in the two numbers that whoever watches many drones is told of each."""

from typing import NamedTuple

from msgspec import UNSET, UnsetType

from messages.state import VehicleState
from services.reference.guidance.ground_motion import north_offset
from services.reference.paths.heading import wrap


class Whereabouts(NamedTuple):
    depth: float | UnsetType = UNSET  # [m] positive down; absent: not known
    heading: float | UnsetType = UNSET  # [rad] clockwise from north, ±π; absent: not known


def whereabouts(state: VehicleState | None) -> Whereabouts:
    """Of the newest state; nothing where there is none."""
    if state is None:
        return Whereabouts()
    return Whereabouts(
        state.depth.value if state.depth.valid else UNSET,
        wrap(state.heading.value + north_offset(state)) if state.heading.valid else UNSET,
    )
