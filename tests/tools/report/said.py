"""What a drone says in a made-up dive."""

from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.vehicle import Truth

ZERO = Estimate(0.0, 0.0)


def state(stamp: int, sensor: int, depth: Estimate = ZERO, heading: float = 0.0) -> VehicleState:
    return VehicleState(
        stamp_ns=stamp, sensor_ns=sensor, phase="running", depth=depth, depth_rate=ZERO,
        depth_acceleration=ZERO, attitude=(1.0, 0.0, 0.0, 0.0), roll=ZERO, pitch=ZERO,
        heading=Estimate(heading, 0.0), heading_navigation=None, yaw_rate=ZERO,
    )  # fmt: skip


def reference(
    stamp: int,
    sensor: int | None,
    depth: Motion,
    heading: Motion,
    *,
    pilot: int | None = None,
    armed: bool = True,
) -> Reference:
    return Reference(
        stamp_ns=stamp, sensor_ns=sensor, pilot_ns=pilot, armed=armed, depth=depth,
        heading=heading, surge_force=0.0, sway_force=0.0,
    )  # fmt: skip


def truth(stamp: int, depth: float = 0.0, heading: float = 0.0) -> Truth:
    return Truth(
        stamp_ns=stamp, position=(0.0, 0.0, depth), attitude=(1.0, 0.0, 0.0, 0.0),
        velocity=(0.0, 0.0, 0.0), angular_rate=(0.0, 0.0, 0.0), depth_rate=0.0, roll=0.0,
        pitch=0.0, heading=heading, on_floor=False,
    )  # fmt: skip
