"""A stand-in for the service `control`: the law and the gains of Fernandes et al. 2015, (127).

    tau = M dnu_d + C nu_d + D(nu_d) nu_d + K_P e + K_I int e dt + K_D (nu_d - nu)

with errors in body axes and every weight of (128) at 1, at the paper's sampling frequency. It
knows nothing of the water's motion but what its integral learns, which is never paused.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from lindy.api.dives import Stack
from lindy.api.messages import (
    Motion,
    Reference,
    ThrusterCommand,
    Vec6,
    VehicleState,
    Wrench,
    topics,
)
from lindy.api.service import Node
from lindy.api.vehicle import Allocation, Vehicle, system_inertia
from messages.units import Ns
from services.control.axis.plant import plant_of
from services.control.laws import measured, seen_from_body, turning_force

PERIOD_NS = 150_000_000  # [ns] 6.67 Hz
K_P = (52.6, 83.8, 53.3, 69.2)  # [N/m], [N m/rad] surge, sway, heave, yaw
K_I = (5.0, 10.0, 5.0, 20.0)  # per second
K_D = (420.3, 533.8, 432.5, 182.0)  # [N s/m], [N m s/rad]
ROWS = (0, 1, 2, 5)  # of these in a wrench
OFF: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Errors(NamedTuple):
    """Of one axis, with what is asked for."""

    position: float  # [m], [rad]
    rate: float
    velocity: float  # asked for
    acceleration: float  # asked for


@dataclass(slots=True)
class PrintedLaw:
    """`integral` [N, N m] is what has been learnt of surge, sway, heave and yaw."""

    vehicle: Vehicle
    integral: list[float]
    _allocation: Allocation = field(init=False)
    _wanted: Vec6 = OFF
    _due: Ns = 0

    def __post_init__(self) -> None:
        self._allocation = Allocation(self.vehicle)

    def step(
        self, reference: Reference, state: VehicleState, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        """A new wrench every PERIOD_NS, the same again in between."""
        if not reference.armed:
            self._wanted = OFF
        elif now >= self._due:
            self._wanted, self._due = self._wrench(reference, state), now + PERIOD_NS
        done = self._allocation.allocate(self._wanted)
        wrench = Wrench(
            stamp_ns=now, sensor_ns=state.sensor_ns, wanted=self._wanted, achieved=done.achieved,
            depth_integral=self.integral[2], heading_integral=self.integral[3],
            saturated=bool(done.saturated),
        )  # fmt: skip
        return wrench, ThrusterCommand(
            stamp_ns=now,
            sensor_ns=state.sensor_ns,
            pilot_ns=None,
            thrust=done.thrust,
            armed=reference.armed,
        )

    def _wrench(self, reference: Reference, state: VehicleState) -> Vec6:
        here = measured(state)
        if here is None or reference.north is None or reference.east is None:
            return self._wanted
        place = here.north, here.east
        surge, sway = seen_from_body(reference.north, reference.east, here.heading, place)
        turning = turning_force(
            system_inertia(self.vehicle),
            (surge.velocity, sway.velocity),
            reference.heading.velocity,
        )
        errors = (
            _errors(surge, 0.0, here.ahead),
            _errors(sway, 0.0, here.starboard),
            _errors(reference.depth, state.depth.value, state.depth_rate.value),
            _errors(reference.heading, state.heading.value, state.yaw_rate.value),
        )
        x, y, z, n = [self._force(axis, error) for axis, error in enumerate(errors)]
        return x + turning[0], y + turning[1], z, 0.0, 0.0, n

    def _force(self, axis: int, error: Errors) -> float:
        """[N] or [N m] Of surge, sway, heave or yaw."""
        plant = plant_of(self.vehicle, ROWS[axis])
        self.integral[axis] += K_I[axis] * error.position * PERIOD_NS / 1e9
        forward = plant.inertia * error.acceleration + plant.drag(error.velocity)
        back = K_P[axis] * error.position + K_D[axis] * error.rate
        return forward + back + self.integral[axis]


def wire(node: Node, stack: Stack) -> None:
    """In the place of `services.control.service.wire`. It comes from station keeping: the
    integral of heave has the buoyancy."""
    vehicle = stack.section("vehicle", Vehicle)
    law = PrintedLaw(vehicle, [0.0, 0.0, vehicle.net_buoyancy, 0.0])
    state = node.latest(topics.STATE)
    wrenches, thrusters = node.publisher(topics.WRENCH), node.publisher(topics.THRUSTERS)

    def on_reference(reference: Reference, now: int) -> None:
        newest = state.fresh(now)
        if newest is not None:
            wrench, command = law.step(reference, newest, now)
            wrenches.put(wrench)
            thrusters.put(command)

    node.each(topics.REFERENCE, on_reference)


def _errors(wanted: Motion, position: float, rate: float) -> Errors:
    return Errors(
        wanted.position - position, wanted.velocity - rate, wanted.velocity, wanted.acceleration
    )
