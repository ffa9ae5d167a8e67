"""The control law of the vehicle: each axis is held, or takes the pilot's force."""

from dataclasses import dataclass, field
from math import isfinite

import msgspec

from messages import topics
from messages.control import ThrusterCommand, Wrench
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Ns, Vec6
from messages.vehicle import Actuation
from services.control.allocation.propulsion import Propulsion
from services.control.laws import Laws
from services.control.same_instant import at_sample
from services.control.settings import Settings as Settings
from services.control.stability import require_stable
from services.marine.sensor_time import SensorTime
from services.marine.vehicle import Vehicle
from services.vehicle.disarm_latch import DisarmLatch

PERIOD_S = 1 / topics.REFERENCE.hz  # [s] for which a wrench is held
LONGEST_STEP_S = 0.05  # [s] a longer step counts as this long
YAW = 5  # row of a six-vector
MOST = 1e6  # [N, N m] more than any vehicle has; keeps sums within the range of messages
NOTHING: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(slots=True)
class Controller:
    """Steps at the rate of the reference, in sensor time: the delay of handling has no effect.
    `events` collects names to count: the onset of each clamp, saturation or missing input, not
    every step of it.

    Raises:
        ValueError: gains that make the sampled loop of an axis unstable, gains of an axis without
            thrust, pulses of the heading without linear damping, or thrusters that cannot drive the
            axes a pilot needs.
    """

    settings: Settings
    vehicle: Vehicle
    events: list[str] = field(default_factory=list[str])
    latch: DisarmLatch = field(default_factory=DisarmLatch)
    _laws: Laws = field(init=False)
    _propulsion: Propulsion = field(init=False)
    _time: SensorTime = field(default_factory=SensorTime)
    _last: Ns | None = None  # sensor time of the step before
    _newest: Reference | None = None
    _now_true: set[str] = field(default_factory=set[str])  # conditions of this step …
    _was_true: set[str] = field(default_factory=set[str])  # … and of the previous one

    def __post_init__(self) -> None:
        require_stable(self.settings, self.vehicle, PERIOD_S)
        self._propulsion = Propulsion(self.vehicle, self.settings.allocation)
        pushes = self._propulsion.smallest("yaw")
        self._laws = Laws(self.settings, self.vehicle, PERIOD_S, self._note, pushes)
        _require_possible(self.settings, self.vehicle, self._propulsion.axes)

    def step(
        self, reference: Reference | None, state: VehicleState | None, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        """One wrench and the thruster commands for it.

        Args:
            reference: None: timed out; the last position is held.
            state: None: stale; the thrusters stop.
        """
        dt = self._elapsed(state, now)
        if reference is None:
            reference = self._hold()
        else:
            r = reference
            self.latch.see(r.epoch, r.stamp_ns, r.armed_ns, armed=r.armed)
        self._newest = reference
        result = self._act(self._obeyed(reference), state, dt, now)
        self.events.extend(sorted(self._now_true - self._was_true))
        self._was_true, self._now_true = self._now_true, set()
        return result

    def heard(self, actuation: Actuation | None, state: VehicleState | None) -> None:
        """Take in the driver's report of the thrust; used only while the depth is known."""
        if actuation is not None and state is not None and state.depth.valid:
            self._propulsion.heard(actuation, state.depth.value)

    def _obeyed(self, reference: Reference | None) -> Reference | None:
        """The reference, disarmed where the pilot has disarmed it and it has not heard that."""
        if reference is None or not reference.armed or not self.latch.forbids(reference.armed_ns):
            return reference
        return msgspec.structs.replace(reference, armed=False)

    def _elapsed(self, state: VehicleState | None, now: Ns) -> float:
        """[s] Between the sensor samples of this step and of the previous one."""
        at = self._time.step(None if state is None else state.sensor_ns, now)
        dt, self._last = 0.0 if self._last is None else (at - self._last) / 1e9, at
        if dt > LONGEST_STEP_S:
            self._note("gap:state")
            self._laws.pause()
        return min(dt, LONGEST_STEP_S)

    def _note(self, what: str) -> None:
        self._now_true.add(what)

    def _act(
        self, reference: Reference | None, state: VehicleState | None, dt: float, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        if reference is None or not reference.armed or state is None:
            return self._off(reference, state, now)
        wanted = self._laws.wrench(at_sample(reference, state.sensor_ns), state, dt)
        if not all(map(isfinite, wanted)):
            self._note("not_finite:wrench")
            return self._off(reference, state, now)
        if max(map(abs, wanted)) > MOST:
            self._note("clamped:wrench")
            x, y, z, k, m, n = [max(-MOST, min(MOST, part)) for part in wanted]
            wanted = x, y, z, k, m, n
        return self._command(reference, state, wanted, now)

    def _hold(self) -> Reference | None:
        """The last reference at rest: its positions, without velocity or pilot force. Held axes
        stay held; no others are."""
        last = self._newest
        if last is None:
            return None
        return msgspec.structs.replace(
            last,
            sensor_ns=None,
            pilot_ns=None,
            depth=_at_rest(last.depth),
            heading=_at_rest(last.heading),
            surge_force=0.0,
            sway_force=0.0,
            heave_force=None if last.heave_force is None else 0.0,
            yaw_moment=None if last.yaw_moment is None else 0.0,
            surge=None,
            north=None if last.north is None else _at_rest(last.north),
            east=None if last.east is None else _at_rest(last.east),
        )

    def _off(
        self, reference: Reference | None, state: VehicleState | None, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        """Thrusters stopped. Disarming also resets integrals, observers and allocation."""
        self._laws.stop()
        if reference is None or not reference.armed:
            self._laws.forget()
            self._propulsion.forget()
        elif state is None:
            self._note("stale:state")
        return self._command(reference, state, NOTHING, now)

    def _command(
        self, reference: Reference | None, state: VehicleState | None, wanted: Vec6, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        sensor_ns = None if state is None else state.sensor_ns
        done = self._propulsion.allocate(wanted, sensor_ns, now)
        self._now_true |= self._propulsion.conditions
        self._laws.done(wanted, done.achieved, saturated=bool(done.saturated))
        standing = self._laws.standing
        x, y, z, k, m, n = standing
        wrench = Wrench(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            wanted=wanted,
            achieved=done.achieved,
            depth_integral=z,
            heading_integral=n,
            saturated=bool(done.saturated),
            disturbance=(-x, -y, -z, -k, -m, -n),
            distrusted=self._propulsion.distrusted,
            heave=self._laws.adaptation.heave.learnt,
            yaw=self._laws.adaptation.yaw.learnt,
        )
        command = ThrusterCommand(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            pilot_ns=None if reference is None else reference.pilot_ns,
            epoch=0 if reference is None else reference.epoch,
            thrust=done.thrust,
            armed=reference is not None and reference.armed,
            armed_ns=None if reference is None or not reference.armed else reference.armed_ns,
        )
        return wrench, command


def _require_possible(settings: Settings, vehicle: Vehicle, axes: frozenset[str]) -> None:
    if settings.heading_pulse > 0.0 and vehicle.linear_damping[YAW] == 0.0:
        raise ValueError(
            f"control.heading_pulse is {settings.heading_pulse:g}, but without linear damping of "
            f"yaw nobody can say what a pulse does; allowed is 0"
        )
    for name, gains in (("roll", settings.roll), ("pitch", settings.pitch)):
        if (gains.kp or gains.kd) and name not in axes:
            raise ValueError(
                f"control.{name}: kp = {gains.kp:g} and kd = {gains.kd:g}, but the thrusters of "
                f"this vehicle cannot drive {name}; allowed are 0 and 0"
            )


def _at_rest(motion: Motion) -> Motion:
    return Motion(motion.position, 0.0, 0.0, 0.0)
