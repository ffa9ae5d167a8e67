"""The control law of the vehicle: each axis is held, or takes the pilot's force. And what is done
in the place of a silent `reference`."""

from dataclasses import dataclass, field
from math import isfinite
from typing import cast

import msgspec

from messages import events, topics
from messages.control import ThrusterCommand, Wrench
from messages.events import Event, Outbox
from messages.pilot import PilotAnswer, PilotRequest
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Ns, Vec6
from services.control.allocation import AXES, Allocation, require_pilotable
from services.control.laws import Laws
from services.control.laws import Settings as Settings
from services.control.stability import require_stable
from services.marine.rhythm import SensorTime
from services.marine.vehicle import Vehicle
from services.vehicle.actuator_gate import DisarmLatch

PERIOD_S = 1 / topics.REFERENCE.hz  # [s] for which a wrench is held
LONGEST_STEP_S = 0.05  # [s] a longer step counts as this long
LONGEST_NS = 100_000_000  # [ns] no reference is extrapolated over more
PATIENCE_NS = 100_000_000  # [ns] in which `reference` goes disarmed by itself; several of its steps
AGAIN_NS = 200_000_000  # [ns] between two times that a disarm is handed on
LARGEST_WRENCH = 1e6  # [N, N m] more than any vehicle has; keeps sums within the range of messages
NO_WRENCH: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(slots=True)
class Controller:
    """Steps at the rate of the reference, in sensor time: the delay of handling has no effect.
    What it tells is the onset of each clamp, saturation or missing input, not every step of it.

    Raises:
        ValueError: gains that make the sampled loop of an axis unstable, gains of an axis without
            thrust, or thrusters that cannot drive the axes a pilot needs.
    """

    settings: Settings
    vehicle: Vehicle
    outbox: Outbox
    latch: DisarmLatch = field(init=False)
    _laws: Laws = field(init=False)
    _allocation: Allocation = field(init=False)
    _time: SensorTime = field(default_factory=SensorTime)
    _last: Ns | None = None  # sensor time of the step before
    _newest: Reference | None = None
    _now_true: set[Event] = field(default_factory=set[Event])  # conditions of this step …
    _was_true: set[Event] = field(default_factory=set[Event])  # … and of the previous one

    def __post_init__(self) -> None:
        self.latch = DisarmLatch(self.outbox)
        require_stable(self.settings, self.vehicle, PERIOD_S)
        require_pilotable(self.vehicle)
        self._allocation = Allocation(self.vehicle, self.settings.allocation)
        self._laws = Laws(self.settings, self.vehicle, PERIOD_S, self._note)
        for name, gains in (("roll", self.settings.roll), ("pitch", self.settings.pitch)):
            if (gains.kp or gains.kd) and name not in self._allocation.axes:
                raise ValueError(
                    f"control.{name}: kp = {gains.kp:g} and kd = {gains.kd:g}, but the thrusters "
                    f"of this vehicle cannot drive {name}; allowed are 0 and 0"
                )

    def step(  # noqa: C901 - one step, in its order
        self, reference: Reference | None, state: VehicleState | None, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        """One wrench and the thruster commands for it.

        Args:
            reference: None: timed out; the last position is held.
            state: None: stale; the thrusters stop.
        """
        # The time since the last step, by the sensor's stamps.
        at = self._time.step(None if state is None else state.sensor_ns, now)
        dt, self._last = 0.0 if self._last is None else (at - self._last) / 1e9, at
        if dt > LONGEST_STEP_S:
            self._note(events.GAP("state"))
            self._laws.pause()
            dt = LONGEST_STEP_S
        # The reference, disarmed where the pilot has disarmed it and it has not heard that.
        if reference is None:
            reference = self._hold()
        else:
            r = reference
            self.latch.see(r.epoch, r.stamp_ns, r.armed_ns, armed=r.armed)
        self._newest = reference
        if reference is not None and reference.armed and self.latch.forbids(reference.armed_ns):
            reference = msgspec.structs.replace(reference, armed=False)
        # The wrench, if there may be one.
        armed = reference is not None and reference.armed
        wanted: Vec6 | None = None
        if reference is not None and armed and state is not None:
            wanted = self._laws.wrench(at_sample(reference, state.sensor_ns), state, dt)
            if not all(map(isfinite, wanted)):
                self._note(events.NOT_FINITE("wrench"))
                wanted = None
            elif max(map(abs, wanted)) > LARGEST_WRENCH:
                self._note(events.CLAMPED("wrench"))
                within = [max(-LARGEST_WRENCH, min(LARGEST_WRENCH, part)) for part in wanted]
                wanted = cast(Vec6, tuple(within))
        # No thrust without one; disarming also resets integrals, observers and allocation.
        if wanted is None:
            self._laws.stop()
            if not armed:
                self._laws.forget()
                self._allocation.forget()
            elif state is None:
                self._note(events.STALE(topics.STATE.key))
        result = self._command(reference, state, wanted or NO_WRENCH, now)
        # Of each condition its onset.
        for event in sorted(self._now_true - self._was_true):
            self.outbox.tell(event)
        self._was_true, self._now_true = self._now_true, set()
        return result

    def _note(self, what: Event) -> None:
        self._now_true.add(what)

    def _hold(self) -> Reference | None:
        """The last reference at rest: its positions, without velocity or pilot force. Held axes
        stay held; no others are."""
        if (last := self._newest) is None:
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
            north=last.north and _at_rest(last.north),
            east=last.east and _at_rest(last.east),
            gripper=0.0,
        )

    def _command(
        self, reference: Reference | None, state: VehicleState | None, wanted: Vec6, now: Ns
    ) -> tuple[Wrench, ThrusterCommand]:
        sensor_ns = None if state is None else state.sensor_ns
        armed = reference if reference is not None and reference.armed else None
        done = self._allocation.allocate(wanted)
        self._now_true.update(map(events.SATURATED, done.saturated))
        for axis, value in zip(AXES, wanted, strict=True):
            if value and axis not in self._allocation.axes:
                self._note(events.UNDRIVEN(axis))
        self._laws.done(wanted, done.achieved, saturated=bool(done.saturated))
        x, y, z, k, m, n = self._laws.standing
        wrench = Wrench(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            wanted=wanted,
            achieved=done.achieved,
            depth_integral=z,
            heading_integral=n,
            saturated=bool(done.saturated),
            disturbance=(-x, -y, -z, -k, -m, -n),
        )
        command = ThrusterCommand(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            pilot_ns=None if reference is None else reference.pilot_ns,
            epoch=0 if reference is None else reference.epoch,
            thrust=done.thrust,
            armed=armed is not None,
            armed_ns=None if armed is None else armed.armed_ns,
            gripper=0.0 if armed is None else armed.gripper,
        )
        return wrench, command


def at_sample(reference: Reference, sensor_ns: Ns) -> Reference:
    """The reference extrapolated to a sensor sample [ns], every axis at constant jerk. Unchanged if
    it has no sample stamp, or one too far away.

    On a busy computer the newest state may belong to a later sensor sample than the newest
    reference. The motion in between would then count as a control error.
    """
    r = reference
    if r.sensor_ns is None or abs(sensor_ns - r.sensor_ns) > LONGEST_NS:
        return r
    t = (sensor_ns - r.sensor_ns) / 1e9
    if t == 0.0:
        return r
    axes = {
        "depth": r.depth,
        "heading": r.heading,
        "surge": r.surge,
        "north": r.north,
        "east": r.east,
    }
    return msgspec.structs.replace(
        r, **{name: motion and _extrapolated(motion, t) for name, motion in axes.items()}
    )


def _extrapolated(motion: Motion, t: float) -> Motion:
    """A motion `t` [s] later, at constant jerk."""
    p, v, a, j = motion.position, motion.velocity, motion.acceleration, motion.jerk
    return msgspec.structs.replace(
        motion,
        position=p + t * (v + t * (a / 2 + t * j / 6)),
        velocity=v + t * (a + t * j / 2),
        acceleration=a + t * j,
    )


class DisarmFallback:
    """What control does with the pilot's requests: it obeys a disarm at once, and answers disarm
    and stop in the place of `reference` while that is silent. The requests it has answered are
    handed on when `reference` speaks again, so that it neither stays armed nor goes on with what it
    was doing.
    """

    def __init__(self, latch: DisarmLatch, outbox: Outbox) -> None:
        self._outbox = outbox
        self._latch = latch
        self._silent = True  # `reference`
        self._stop: PilotRequest | None = None  # answered here, not handed on yet
        self._again_ns: Ns = 0  # [ns] a disarm is not handed on before

    def hear(self, request: PilotRequest, now: Ns) -> tuple[bool, PilotAnswer | None]:
        """A request of a pilot. Returns whether it is a disarm obeyed just now, and the answer if
        `reference` is silent."""
        repeated = self._latch.obeyed(request)
        self._latch.hear(request, now)
        obeyed = self._latch.obeyed(request)
        disarms = obeyed and not repeated
        if disarms:
            self._again_ns = now + PATIENCE_NS
        stops = request.kind == "stop" and self._latch.epoch is not None  # anybody may
        if not self._silent or not (obeyed or stops):
            return disarms, None
        if stops:
            self._stop = request
        answer = PilotAnswer(stamp_ns=now, id=request.id, accepted=True, cause_ns=request.stamp_ns)
        return disarms, answer

    def heard(self, reference: Reference | None, now: Ns) -> list[PilotRequest]:
        """A reference has arrived; None: it is silent. Returns the requests to hand on."""
        self._silent = reference is None
        if reference is None:
            return []
        stop, self._stop = self._stop, None
        due = [] if stop is None else [stop]
        disarm = self._latch.request
        if disarm is None or not reference.armed or not self._latch.forbids(reference.armed_ns):
            return due
        if now >= self._again_ns:
            self._again_ns = now + AGAIN_NS
            self._outbox.tell(events.OVERRULED_REFERENCE())
            due.append(disarm)
        return due


def _at_rest(motion: Motion) -> Motion:
    return Motion(motion.position, 0.0, 0.0, 0.0)
