"""The simulation's state for a restart, and its initial state."""

import msgspec

from messages.units import Finite, NotNegative
from services.marine.attitude import from_euler, to_body
from services.marine.vehicle import Vehicle
from services.simulator.faults import Fault
from services.simulator.hull import in_the_water
from services.simulator.settings import Settings


class WorldCheckpoint(msgspec.Struct, frozen=True):
    """State for a restart in mid-dive."""

    state: tuple[Finite, ...]  # 13 numbers, see vessel.State
    thrust: tuple[Finite, ...]  # [N] per thruster
    heading: Finite  # [rad] accumulated past ±π
    used_wh: NotNegative  # [Wh]
    faults: dict[str, Fault] = {}  # in force, by part

    def fits(self, vehicle: Vehicle) -> bool:
        return len(self.state) == 13 and len(self.thrust) == len(vehicle.thruster)


def at_the_surface(vehicle: Vehicle, settings: Settings) -> WorldCheckpoint:
    """At rest in the water, floating, level, carried along by the mean current.

    Raises:
        ValueError: the sea is too shallow for the vehicle.
    """
    vehicle = in_the_water(vehicle, settings.hull)
    depth = vehicle.floating_depth
    keel = depth + vehicle.size[2] / 2
    if settings.floor_depth <= keel:
        raise ValueError(
            f"simulator.floor_depth: found {settings.floor_depth} m, but the vehicle floats with "
            f"its bottom at {keel:.2f} m; must be more"
        )
    attitude = from_euler(0.0, 0.0, settings.start_heading)
    flow = settings.current
    carried = (0.0, 0.0, 0.0)
    if flow is not None:
        carried = to_body(attitude, (flow.north, flow.east, 0.0))
    return WorldCheckpoint(
        state=(0.0, 0.0, depth, *attitude, *carried, 0.0, 0.0, 0.0),
        thrust=(0.0,) * len(vehicle.thruster),
        heading=settings.start_heading,
        used_wh=0.0,
    )
