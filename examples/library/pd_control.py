"""PD on depth and heading in the place of Lindy's controller; surge and sway are the stick's."""

import msgspec

from lindy.api.messages import (
    Reference,
    ThrusterCommand,
    Vec6,
    VehicleState,
    Wrench,
    events,
    topics,
)  # fmt: skip
from lindy.api.service import Node, NotNegativeSetting, Stack
from lindy.api.vehicle import Allocation, Vehicle


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: tuple[NotNegativeSetting, NotNegativeSetting] = (60.0, 65.0)  # [N/m], [N s/m]
    heading: tuple[NotNegativeSetting, NotNegativeSetting] = (8.0, 3.0)  # [N m/rad], [N m s/rad]


def law(to: Reference, at: VehicleState, gains: Settings, buoyancy: float) -> Vec6:
    if not to.armed:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    (kp, kd), deeper = gains.depth, to.depth.position - at.depth.value
    z = buoyancy + kp * deeper + kd * (to.depth.velocity - at.depth_rate.value)
    (kp, kd), turn = gains.heading, to.heading.position - at.heading.value
    n = kp * turn + kd * (to.heading.velocity - at.yaw_rate.value)
    return to.surge_force, to.sway_force, z, 0.0, 0.0, n


def wire(node: Node, stack: Stack) -> None:
    gains, vehicle = stack.section(node.name, Settings), stack.section("vehicle", Vehicle)
    allocation, states = Allocation(vehicle), node.latest(topics.STATE)
    wrenches, thrusters = node.publisher(topics.WRENCH), node.publisher(topics.THRUSTERS)

    def on_reference(to: Reference | None, now: int) -> None:
        at = states.fresh(now)
        if to is None or at is None:  # what was commanded last ends by itself after 0.2 s
            node.tell(events.STALE((topics.REFERENCE if to is None else topics.STATE).key))
            return
        wanted = law(to, at, gains, vehicle.net_buoyancy)
        done, since = allocation.allocate(wanted), at.sensor_ns
        wrenches.put(Wrench(
            stamp_ns=now, sensor_ns=since, wanted=wanted, achieved=done.achieved,
            depth_integral=0.0, heading_integral=0.0, saturated=bool(done.saturated),
        ))  # fmt: skip
        thrusters.put(ThrusterCommand(
            stamp_ns=now, sensor_ns=since, pilot_ns=to.pilot_ns, epoch=to.epoch,
            thrust=done.thrust, armed=to.armed,
        ))  # fmt: skip

    node.trigger(topics.REFERENCE, on_reference, 0.1)
