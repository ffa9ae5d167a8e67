"""All thrusters together: allocation, monitoring, adaptation to faulty thrusters, and a model of
the wrench, which follows the command with a lag."""

from dataclasses import dataclass, field
from math import exp

from messages import events
from messages.events import Event
from messages.units import Ns, Vec6
from messages.vehicle import Actuation
from services.control.allocation.allocation import Allocated, Allocation, AllocationSettings
from services.control.allocation.layout import AXES, require_pilotable
from services.control.allocation.thruster_watch import ThrusterWatch
from services.marine.vehicle import Vehicle, wrench_per_newton

REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
Lags = tuple[float, ...]


@dataclass(slots=True)
class Propulsion:
    """`conditions` are saturations and faults, after each `allocate`.

    Raises:
        ValueError: the thrusters cannot drive the axes a pilot needs.
    """

    vehicle: Vehicle
    settings: AllocationSettings = field(default_factory=AllocationSettings)
    conditions: set[Event] = field(default_factory=set[Event])
    allocation: Allocation = field(init=False)
    _watch: ThrusterWatch = field(init=False)

    def __post_init__(self) -> None:
        require_pilotable(self.vehicle)
        self.allocation = Allocation(self.vehicle, self.settings)
        self._watch = ThrusterWatch(self.vehicle)

    def allocate(self, wrench: Vec6, sensor_ns: Ns | None, now: Ns) -> Allocated:
        """Commands for a wrench [N, N m], body frame, from the sensor sample at `sensor_ns`.
        `wrench` must be finite."""
        done = self.allocation.allocate(wrench)
        # A zero wrench stops all thrusters: the vehicle may be disarmed.
        thrust = self._watch.probing(done.thrust, now) if any(wrench) else done.thrust
        self._watch.sent(sensor_ns, thrust)
        self.conditions = set(map(events.SATURATED, done.saturated))
        self.conditions.update(map(events.DISTRUSTED, self.allocation.distrusted))
        self.conditions.update(map(events.LOST_AXIS, self.allocation.lost))
        for axis, value in zip(AXES, wrench, strict=True):
            if value and axis not in self.allocation.axes:
                self.conditions.add(events.UNDRIVEN(axis))
        return Allocated(thrust, done.achieved, done.saturated)

    def heard(self, actuation: Actuation, depth: float) -> None:
        """Update the thruster verdicts from the driver's report. They stay when the vehicle is
        disarmed: disarming repairs nothing.

        Args:
            depth: [m] of the vehicle.
        """
        self._watch.heard(actuation, depth)
        for index, watched in enumerate(self._watch.thrusters):
            self.allocation.trust(index, watched.gain)


@dataclass(slots=True)
class ActuatorModel:
    """A model of the wrench, axis by axis, with the lag of each axis' slowest thruster."""

    lags: Lags  # [s] of the six axes
    _now: Vec6 = REST  # [N, N m]
    settles_at: Vec6 = REST  # [N, N m] at which the thrusters settle from now on

    def mean(self, dt: float) -> Vec6:
        """Advance by `dt` [s]; returns the mean wrench [N, N m] over that time."""
        if dt <= 0.0:
            return self._now
        means: list[float] = []
        after: list[float] = []
        for force, end, lag in zip(self._now, self.settles_at, self.lags, strict=True):
            left = exp(-dt / lag)
            means.append(end + (force - end) * (1 - left) * lag / dt)
            after.append(end + (force - end) * left)
        a, b, c, d, e, f = after
        self._now = a, b, c, d, e, f
        a, b, c, d, e, f = means
        return a, b, c, d, e, f


def lags_of(vehicle: Vehicle) -> Lags:
    """[s] Of each axis: the longest of the thrusters that act on it."""
    columns = [wrench_per_newton(thruster) for thruster in vehicle.thruster]
    slowest = max(thruster.time_constant for thruster in vehicle.thruster)
    lags = [
        [t.time_constant for t, column in zip(vehicle.thruster, columns, strict=True) if column[k]]
        for k in range(6)
    ]
    return tuple(max(acting, default=slowest) for acting in lags)
