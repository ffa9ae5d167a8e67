"""All thrusters together: allocation, monitoring, and adaptation to faulty thrusters."""

from dataclasses import dataclass, field

from messages.units import Ns, Vec6
from messages.vehicle import Actuation
from services.control.allocation.allocation import Allocated, Allocation, AllocationSettings
from services.control.allocation.layout import AXES, AxisName, require_pilotable
from services.control.allocation.thruster_watch import ThrusterWatch
from services.marine.vehicle import Vehicle


@dataclass(slots=True)
class Propulsion:
    """`conditions` names saturations and faults, after each `allocate`.

    Raises:
        ValueError: the thrusters cannot drive the axes a pilot needs.
    """

    vehicle: Vehicle
    settings: AllocationSettings = field(default_factory=AllocationSettings)
    conditions: set[str] = field(default_factory=set[str])
    _allocation: Allocation = field(init=False)
    _watch: ThrusterWatch = field(init=False)

    def __post_init__(self) -> None:
        require_pilotable(self.vehicle)
        self._allocation = Allocation(self.vehicle, self.settings)
        self._watch = ThrusterWatch(self.vehicle)

    @property
    def axes(self) -> frozenset[str]:
        """Axes that the trusted thrusters can drive independently."""
        return self._allocation.axes

    @property
    def distrusted(self) -> tuple[str, ...]:
        """Names of the thrusters that do not follow their commands."""
        return self._allocation.distrusted

    def allocate(self, wrench: Vec6, sensor_ns: Ns | None, now: Ns) -> Allocated:
        """Commands for a wrench [N, N m], body frame, from the sensor sample at `sensor_ns`.
        `wrench` must be finite."""
        done = self._allocation.allocate(wrench)
        # A zero wrench stops all thrusters: the vehicle may be disarmed.
        thrust = self._watch.probing(done.thrust, now) if any(wrench) else done.thrust
        self._watch.sent(sensor_ns, thrust)
        self.conditions = {f"saturated:{name}" for name in done.saturated}
        self.conditions |= {f"distrusted:{name}" for name in self._allocation.distrusted}
        self.conditions |= {f"lost_axis:{axis}" for axis in self._allocation.lost}
        self.conditions |= {
            f"undriven:{axis}"
            for axis, value in zip(AXES, wrench, strict=True)
            if value and axis not in self.axes
        }
        return Allocated(thrust, done.achieved, done.saturated)

    def smallest(self, axis: AxisName) -> tuple[Vec6, ...]:
        """See `Allocation.smallest`."""
        return self._allocation.smallest(axis)

    def forget(self) -> None:
        """For disarming. Thruster verdicts stay: disarming repairs nothing."""
        self._allocation.forget()

    def heard(self, actuation: Actuation, depth: float) -> None:
        """Update the thruster verdicts from the driver's report.

        Args:
            depth: [m] of the vehicle.
        """
        self._watch.heard(actuation, depth)
        for index, gain in enumerate(self._watch.gains):
            self._allocation.trust(index, gain)
