"""The piloted axes, and the generator that moves each: a ramp to the velocity or the force of a
stick, a move to a position, a path (`Ramp.ride`), or a plan to rest that follows the vehicle."""

from dataclasses import dataclass
from typing import NamedTuple

from messages.events import Outbox
from messages.pilot import FlightMode, PilotCommand
from messages.reference import Motion
from messages.state import VehicleState
from messages.units import Ns
from services.reference.guidance.bottom import RETURN_S
from services.reference.guidance.station_keeping import StationKeeping, ground_of
from services.reference.settings import Settings, VelocityAxis
from services.reference.trajectory.minimum_jerk import Ramp, Sample, go, solve, travelled
from services.reference.trajectory.own_law import Law, LawRamp
from services.reference.trajectory.vector import VectorRamp

# The axes held in each mode, and what each mode requires.


class HeldAxes(NamedTuple):
    """Axes the drone holds: their sticks are velocities, the others' are forces."""

    depth: bool
    heading: bool
    place: bool
    height: bool = False  # above the bottom, by way of the depth


HELD_AXES: dict[FlightMode, HeldAxes] = {
    "manual": HeldAxes(depth=False, heading=False, place=False),
    "depth_hold": HeldAxes(depth=True, heading=False, place=False),
    "heading_hold": HeldAxes(depth=False, heading=True, place=False),
    "stabilised": HeldAxes(depth=True, heading=True, place=False),
    "station_keeping": HeldAxes(depth=True, heading=True, place=True),
    "altitude_hold": HeldAxes(depth=True, heading=True, place=False, height=True),
}


def safe(flight_mode: FlightMode) -> FlightMode:
    """The mode for a drone without a pilot: depth and heading are held, and position if it was
    held before. The depth is: nobody watches what a height above the bottom leads to."""
    held = HELD_AXES[flight_mode]
    return flight_mode if held.depth and held.heading and not held.height else "stabilised"


def lacking(
    flight_mode: FlightMode, state: VehicleState | None, *, armed: bool, bottom: bool
) -> str:
    """What the mode requires and the drone lacks; empty when it lacks nothing.

    While disarmed, a mode can be chosen before depth and heading are known, because arming
    requires them. `bottom`: its depth is known.
    """
    held = HELD_AXES[flight_mode]
    if held.place and (state is None or ground_of(state) is None):
        return "this drone does not know its position and velocity over the ground"
    if held.height and not bottom:
        return "the drone does not measure its height above the bottom"
    if armed and state is not None:
        if held.depth and not state.depth.valid:
            return "the drone does not know its depth"
        if held.heading and not state.heading.valid:
            return "the drone does not know its heading"
    return ""


FADE = 1.0  # [m] above the limit in which a downward heave force fades out
CENTRED = 0.05  # [-] a stick this close to the middle counts as centred


class Axes:
    """Times `t` in seconds, never decreasing."""

    def __init__(self, settings: Settings, outbox: Outbox, law: Law | None = None) -> None:
        """
        Args:
            law: of the user's, by which depth and heading go to the velocity of the stick.
        """

        def held(axis: str, to: VelocityAxis) -> Ramp:
            if law is None:
                return Ramp(to.limits)
            return LawRamp(
                to.limits, axis=axis, law=law, full=to.max_velocity, most=to.stop, outbox=outbox
            )

        self.settings = s = settings
        self.heave = held("heave", s.heave)  # [m] positive down
        self.yaw = held("yaw", s.yaw)  # [rad] accumulated
        self.place = StationKeeping(s.place.limits)  # [m] north and east
        self.tilt = Ramp(s.tilt.limits)  # [rad]
        # [m] along a path in dead reckoning, and what is left of that speed afterwards
        self.pace = Ramp(s.place.limits)
        self.force = VectorRamp(s.horizontal.limits)  # [N] surge and sway, as a "velocity"
        self.heave_force = Ramp(s.heave_force.limits)  # [N] as a "velocity"
        self.yaw_moment = Ramp(s.yaw_moment.limits)  # [N m] as a "velocity"
        # The stick points down, and the reference comes to rest at the depth limit, or the force of
        # the stick fades out above it.
        self.limited = False
        self._tilting = 0.0  # [-] newest tilt stick

    def rest(self, depth: float, heading: float, t: float) -> None:
        """All axes at rest here, no force, no station keeping. The camera tilt is unchanged."""
        self.heave.rest(depth, t)
        self.yaw.rest(heading, t)
        self.force.rest(t)
        for ramp in (self.pace, self.heave_force, self.yaw_moment):
            ramp.rest(0.0, t)
        self.place.held = False

    def follow(self, state: VehicleState, held: HeldAxes, t: float) -> None:
        """Follow the vehicle on the axes that are not held.

        Every step replans a stop from the measured state, so engaging hold causes no jump. In depth
        this includes the measured acceleration: the feed-forward then equals the force that already
        moves the vehicle. An axis whose measurement is invalid follows its last plan to rest.
        """
        depth, rate, heading, turning = state.depth, state.depth_rate, state.heading, state.yaw_rate
        if not held.depth and depth.valid and rate.valid:
            most, measured = self.settings.heave.max_acceleration, state.depth_acceleration
            a = max(-most, min(most, measured.value)) if measured.valid else 0.0
            self.heave.take(Sample(depth.value, rate.value, a, 0.0), t)
        if not held.heading and heading.valid and turning.valid:
            self.yaw.take(Sample(heading.value, turning.value, 0.0, 0.0), t)

    def aim(self, stick: PilotCommand, held: HeldAxes, t: float, share: float, sink: float) -> None:
        """Set targets from the sticks: velocities on held axes, forces on the others, of which
        surge and sway get a `share`, 0 … 1. `sink` [m/s]: of the depth, as the stick or a height
        that is held wants it."""
        s, heave = self.settings, self.heave
        here = heave.at(t)
        room = s.failsafe.depth_limit - here.position
        self.limited = False
        if held.depth and sink > 0.0:
            stops = travelled(solve(here.velocity, here.acceleration, 0.0, heave.limits))
            most = max(0.0, room - stops) / RETURN_S
            self.limited = sink > most
            sink = min(sink, most)
        if self.limited:
            heave.take(here, t, sink)
        else:
            heave.aim(sink if held.depth else 0.0, t)
        self.yaw.aim(stick.yaw * s.yaw.max_velocity if held.heading else 0.0, t)
        force = stick.heave * s.heave_force.full
        if not held.depth and force > 0.0 and room < FADE:
            self.limited, force = True, force * max(0.0, room / FADE)
        self.heave_force.aim(0.0 if held.depth else force, t)
        self.yaw_moment.aim(0.0 if held.heading else stick.yaw * s.yaw_moment.full, t)
        surge, sway = share * stick.surge, share * stick.sway
        if held.place:
            self.place.aim((surge * s.place.max_velocity, sway * s.place.max_velocity), t)
            surge = sway = 0.0
        self.force.aim((surge * s.horizontal.max_surge, sway * s.horizontal.max_sway), t)

    def go_to_depth(self, depth: float, t: float, speed: float | None = None) -> None:
        """Go to a depth [m], ending at rest, at most as fast as `speed` [m/s]."""
        axis, self.limited = self.settings.heave, False
        go(self.heave, depth, axis.limits, speed or axis.max_velocity, t)

    def turn_camera(self, stick: float, t: float) -> None:
        """Tilt up or down, with a smooth stop at the end of the range."""
        tilt, s = self.tilt, self.settings.tilt
        if stick == 0.0:
            if self._tilting != 0.0:
                tilt.brake(t)
        elif stick != self._tilting:
            end = s.highest if stick > 0 else s.lowest
            go(tilt, end, s.limits, abs(stick) * s.max_velocity, t)
        self._tilting = stick

    def brake(self, t: float, *, hard: bool = False) -> None:
        """Bring depth, heading and position to rest; `hard`: within the limits of an emergency
        stop."""
        s, self.limited = self.settings, False
        heave, yaw, place = (
            axis.stop if hard else axis.limits for axis in (s.heave, s.yaw, s.place)
        )
        self.heave.brake(t, heave)
        self.yaw.brake(t, yaw)
        if self.place.held:
            self.place.brake(t, place)

    def settles(self) -> float:
        """[s] When depth, heading and a held position reach their targets."""
        place = self.place.settles() if self.place.held else 0.0
        return max(self.heave.settles(), self.yaw.settles(), place)


def motion_of(ramp: Ramp, t: float, *, held: bool = True) -> Motion:
    """Of an axis; of one that follows the vehicle the jerk is unknown."""
    here = ramp.at(t)
    if not held:
        return Motion(*here._replace(jerk=0.0))
    return Motion(*here, jerk_limit=None if ramp.rides else ramp.in_force.jerk)


def centred(command: PilotCommand) -> bool:
    return max(map(abs, (command.surge, command.sway, command.heave, command.yaw))) < CENTRED


CENTRED_NS = 300_000_000  # [ns]


@dataclass(slots=True)
class CentredSticks:
    """Judged by both clocks: a single command stays fresh for a while and proves nothing, and nor
    do many that were held up on the way and arrive at once."""

    _since: tuple[Ns, Ns, int] | None = None  # [ns] here, [ns] stamp of the command; its epoch

    def step(self, command: PilotCommand | None, now: Ns) -> bool:
        """
        Args:
            command: the newest fresh one; None: there is none, or nothing can be given back now.
        """
        if command is None or command.pilot != "present" or not centred(command):
            self._since = None
            return False
        if self._since is None or self._since[2] != command.epoch:
            self._since = (now, command.stamp_ns, command.epoch)
        here, stamp, _ = self._since
        return min(now - here, command.stamp_ns - stamp) >= CENTRED_NS
