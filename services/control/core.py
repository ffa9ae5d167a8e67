"""The control law of the vehicle: depth and heading are held, surge and sway are passed on."""

from dataclasses import dataclass, field
from math import isfinite

import msgspec

from messages.control import ThrusterCommand, Wrench
from messages.message import Ns
from messages.reference import Motion, Reference
from messages.state import VehicleState
from services.control.allocation import Allocation
from services.control.axis_law import AxisLaw, Effort, Gains, Plant
from services.marine.vehicle import Vehicle

LONGEST_STEP_S = 0.05  # [s] after a pause the integrators go on as if it had been this long


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: Gains = Gains(kp=60.0, kd=65.0, ki=12.0, max_error=0.3, max_integral=15.0)
    heading: Gains = Gains(
        kp=8.0, kd=3.0, ki=1.0, max_error=0.6, max_integral=1.0, decay_threshold=0.2
    )


@dataclass(slots=True)
class Controller:
    """Steps at the rate of the reference. `happened` collects what must be counted: each passage
    into a clamp, a saturation or a missing input, not each step of it."""

    settings: Settings
    vehicle: Vehicle
    happened: list[str] = field(default_factory=list[str])
    _depth: AxisLaw = field(init=False)
    _heading: AxisLaw = field(init=False)
    _surge: AxisLaw = field(init=False)
    _allocation: Allocation = field(init=False)
    _last: Ns | None = None
    _held: Reference | None = None
    _now_true: set[str] = field(default_factory=set[str])  # conditions of this step …
    _was_true: set[str] = field(default_factory=set[str])  # … and of the one before

    def __post_init__(self) -> None:
        self._depth = AxisLaw(self.settings.depth, plant_of(self.vehicle, 2))
        self._heading = AxisLaw(self.settings.heading, plant_of(self.vehicle, 5))
        self._surge = AxisLaw(self.settings.depth, plant_of(self.vehicle, 0))
        self._allocation = Allocation(self.vehicle)

    def step(
        self, reference: Reference | None, state: VehicleState | None, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        """One wrench and the thruster commands for it.

        Args:
            reference: None when none has come for too long: the last position is held.
            state: None when it is stale: then nothing can be held and the thrusters stop.
        """
        dt = 0.0 if self._last is None else min((now - self._last) / 1e9, LONGEST_STEP_S)
        self._last = now
        if reference is None:
            reference = self._hold()
        self._held = reference
        result = self._act(reference, state, dt, now)
        self.happened.extend(sorted(self._now_true - self._was_true))
        self._was_true, self._now_true = self._now_true, set()
        return result

    def _act(
        self, reference: Reference | None, state: VehicleState | None, dt: float, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        if reference is None or not reference.armed or state is None:
            return self._off(reference, state, now)
        depth, heading = self._efforts(reference, state, dt)
        surge = reference.surge_force + self._along_path(reference)
        wanted = (surge, reference.sway_force, depth.total, heading.total)
        if not all(map(isfinite, wanted)):
            self._now_true.add("not_finite:wrench")
            return self._off(reference, state, now)
        return self._command(reference, state, wanted, (depth.integral, heading.integral), now)

    def _efforts(
        self, reference: Reference, state: VehicleState, dt: float
    ) -> tuple[Effort, Effort]:
        """An estimate that is not valid is not fed back: only the feed-forward of it remains."""
        laws = (
            ("depth", self._depth, reference.depth, state.depth, state.depth_rate),
            ("heading", self._heading, reference.heading, state.heading, state.yaw_rate),
        )
        efforts: list[Effort] = []
        for name, law, wanted, position, rate in laws:
            if position.valid and rate.valid:
                effort = law.step(wanted, position.value, rate.value, dt)
                if effort.clamped:
                    self._now_true.add(f"clamped:control.{name}")
            else:
                self._now_true.add(f"invalid:state.{name}")
                effort = Effort(law.feed_forward(wanted) + law.integral, law.integral, False)
            efforts.append(effort)
        return efforts[0], efforts[1]

    def _along_path(self, reference: Reference) -> float:
        """[N] Surge force that drives the vehicle along a path: no horizontal velocity is
        measured, so it is feed-forward alone."""
        return 0.0 if reference.surge is None else self._surge.feed_forward(reference.surge)

    def _hold(self) -> Reference | None:
        """The last reference brought to rest where it was: no velocity, no horizontal force."""
        if self._held is None:
            return None
        return msgspec.structs.replace(
            self._held,
            sensor_ns=None,
            pilot_ns=None,
            depth=Motion(self._held.depth.position, 0.0, 0.0, 0.0),
            heading=Motion(self._held.heading.position, 0.0, 0.0, 0.0),
            surge_force=0.0,
            sway_force=0.0,
            surge=None,
        )

    def _off(
        self, reference: Reference | None, state: VehicleState | None, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        """Thrusters stopped. Disarmed also forgets what the integrators learnt."""
        if reference is None or not reference.armed:
            self._depth.forget()
            self._heading.forget()
        elif state is None:
            self._now_true.add("stale:state")
        return self._command(reference, state, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0), now)

    def _command(
        self,
        reference: Reference | None,
        state: VehicleState | None,
        wanted: tuple[float, float, float, float],
        integrals: tuple[float, float],
        now: Ns,
    ) -> tuple[Wrench, ThrusterCommand]:
        done = self._allocation.allocate(wanted)
        self._now_true.update(f"saturated:{name}" for name in done.saturated)
        sensor_ns = None if state is None else state.sensor_ns
        x, y, z, n = wanted
        wrench = Wrench(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            wanted=(x, y, z, 0.0, 0.0, n),
            achieved=done.achieved,
            depth_integral=integrals[0],
            heading_integral=integrals[1],
            saturated=bool(done.saturated),
        )
        command = ThrusterCommand(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            pilot_ns=None if reference is None else reference.pilot_ns,
            thrust=done.thrust,
        )
        return wrench, command


def plant_of(vehicle: Vehicle, axis: int) -> Plant:
    """Inertia with added mass and the damping of one axis (0 … 5: X, Y, Z, K, M, N)."""
    dry = vehicle.mass if axis < 3 else vehicle.inertia[axis - 3]
    return Plant(
        inertia=dry + vehicle.added_mass[axis],
        linear=vehicle.linear_damping[axis],
        quadratic=vehicle.quadratic_damping[axis],
    )
