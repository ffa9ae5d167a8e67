"""A stand-in for the service `reference`: it plays a whole route, made beforehand, to the drone.

A pilot's `follow` makes its own timing along a path, with one speed; what Fernandes et al. 2015
tuned, speeds and reference model part by part, cannot be said in a `Course`. So the route is made
by the same generators and published as `Reference` messages, as `reference` would.
"""

from dataclasses import dataclass

from lindy.api.dives import Stack
from lindy.api.messages import Motion, Reference, VehicleState, topics
from lindy.api.service import Node
from messages.units import Ns
from services.marine.attitude import north_offset
from services.reference.guidance.station_keeping import ground_of
from services.reference.paths.path import RoutePoint
from tools.generators.route import Route


@dataclass(slots=True)
class Guide:
    """Armed as soon as the drone knows where it is, which is 0 s; holds the start of the route
    until `begin`."""

    route: Route
    depth: float  # [m] throughout
    begin: float  # [s]
    armed_ns: Ns | None = None

    def step(self, state: VehicleState, now: Ns) -> Reference:
        """Where the drone should be at the sample behind a state."""
        if self.armed_ns is None and _knows_its_place(state):
            self.armed_ns = state.sensor_ns
        here = self.route.at(self.seconds(state.sensor_ns) - self.begin)
        return Reference(
            stamp_ns=now,
            sensor_ns=state.sensor_ns,
            pilot_ns=None,
            armed=self.armed_ns is not None,
            depth=Motion(self.depth, 0.0, 0.0, 0.0),
            heading=_heading(here, north_offset(state)),
            surge_force=0.0,
            sway_force=0.0,
            north=Motion(here.north, here.v_north, here.a_north, 0.0),
            east=Motion(here.east, here.v_east, here.a_east, 0.0),
        )

    def seconds(self, at: Ns) -> float:
        """[s] Since it was armed."""
        return 0.0 if self.armed_ns is None else (at - self.armed_ns) / 1e9

    def wire(self, node: Node, _: Stack) -> None:
        """In the place of `services.reference.service.wire`."""
        publisher = node.publisher(topics.REFERENCE)
        node.each(topics.STATE, lambda state, now: publisher.put(self.step(state, now)))


def _knows_its_place(state: VehicleState) -> bool:
    heading = state.heading_navigation
    return ground_of(state) is not None and heading is not None and heading.valid


def _heading(here: RoutePoint, offset: float) -> Motion:
    """As the drone counts it, from north at every moment: the drift of its gyroscopes in twelve
    minutes does not count. `offset` [rad] is north heading minus control heading."""
    return Motion(here.heading - offset, here.yaw_rate, here.yaw_acceleration, 0.0)
