"""The laws of all axes together: from reference and state to the required wrench. And the tables
[control…] of a vehicle file.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, hypot, sin
from typing import Annotated, NamedTuple

import msgspec
from msgspec.structs import replace

from messages import events
from messages.events import Event
from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import NotNegativeSetting, Ns, Vec6
from services.control.allocation import AXES, AllocationSettings
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import REST, ActuatorModel, lags_of, plant_of
from services.control.heave_coupling import HeaveCoupling
from services.marine.attitude import level_velocity, turned
from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import Vehicle


class RollPitchGains(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Roll or pitch held at zero, if the thrusters can drive it. 0, 0: hydrostatic only."""

    kp: NotNegativeSetting = 0.0  # [N m/rad]
    kd: NotNegativeSetting = 0.0  # [N m s/rad]


class CouplingSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What surge, sway and tilt do to heave (heave_coupling.py)."""

    heave: bool = False  # fed forward; False: left to the disturbance observer
    wake_share: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 1.0  # [-] of the Munk moment


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    depth: Gains = Gains(kp=60.0, kd=65.0, ki=12.0, max_error=0.3, max_integral=15.0)
    heading: Gains = Gains(
        kp=8.0, kd=3.0, ki=1.0, max_error=0.6, max_integral=1.0, decay_threshold=0.2
    )
    surge: Gains = Gains(kp=20.0, kd=25.0, ki=3.0, max_error=0.5, max_integral=15.0)
    sway: Gains = Gains(kp=20.0, kd=25.0, ki=3.0, max_error=0.5, max_integral=15.0)
    roll: RollPitchGains = RollPitchGains()
    pitch: RollPitchGains = RollPitchGains()
    allocation: AllocationSettings = AllocationSettings()
    coupling: CouplingSettings = CouplingSettings()
    transfer: Annotated[float, msgspec.Meta(ge=0.05, le=5.0)] = 0.3  # [s] fade between modes


Pair = tuple[float, float]  # north and east, or surge and sway
STILL_WATER: Pair = (0.0, 0.0)  # [m/s]
SHORT_OF_YAW = 0.01  # [-] of the moment that is wanted; a smaller lack is a dead-band's


@dataclass(slots=True)
class RollPitchHold:
    gains: RollPitchGains
    _angle: float = 0.0  # [rad] at the last step
    _at: Ns | None = None  # [ns] stamp of its sensor sample; None: not known
    rate: float = 0.0  # [rad/s] of the angle; 0 while it is not known

    def step(self, angle: Estimate, sensor_ns: Ns) -> float:
        """Moment [N m]. The rate is the difference of two angles of the attitude filter, which
        integrates the gyroscope and so adds little noise."""
        if not angle.valid:
            self.forget()
            return 0.0
        if self._at is None:
            self.rate = 0.0
        elif sensor_ns > self._at:
            self.rate = (angle.value - self._angle) / ((sensor_ns - self._at) * 1e-9)
        self._angle, self._at = angle.value, sensor_ns
        return -self.gains.kp * angle.value - self.gains.kd * self.rate

    def forget(self) -> None:
        """Restart the rate with the next sample."""
        self._at, self.rate = None, 0.0


class Laws:
    """Surge, sway, heave and yaw, each with its own law, and roll and pitch held level."""

    def __init__(
        self,
        settings: Settings,
        vehicle: Vehicle,
        period: float,
        count: Callable[[Event], None],
    ) -> None:
        """
        Args:
            period: [s] for which a wrench is held.
            count: called with a condition, at every step while it lasts.
        """
        self._inertia = system_inertia(vehicle)
        self._lags = lags_of(vehicle)
        self._count = count
        self._actuators = ActuatorModel(self._lags)
        self._short: frozenset[str] = frozenset()  # axes with less force than required
        self._turn_short = 0.0  # [N m] of the moment that is wanted, for lack of thrust
        self._water: Pair | None = None  # [m/s] along surge and sway, if known

        def axis(name: str, gains: Gains, row: int, *, own: bool = True) -> Axis:
            plant, lag = plant_of(vehicle, row), self._lags[row]
            return Axis(gains, plant, lag, period, name, count, settings.transfer, own=own)

        self.surge = axis("surge", settings.surge, 0)
        self.sway = axis("sway", settings.sway, 1)
        self.depth = axis("depth", settings.depth, 2)
        self.heading = axis("heading", settings.heading, 5, own=False)
        self._axes = self.surge, self.sway, self.depth, self.heading
        self._max_error = min(settings.surge.max_error, settings.sway.max_error)  # [m]
        self._roll, self._pitch = RollPitchHold(settings.roll), RollPitchHold(settings.pitch)
        self._coupling: HeaveCoupling | None = None
        if settings.coupling.heave:
            self._coupling = HeaveCoupling(vehicle, self._lags[2], settings.coupling.wake_share)

    def wrench(self, reference: Reference, state: VehicleState, dt: float) -> Vec6:
        """The required wrench [N, N m], `dt` [s] after the last one."""
        r, s = reference, state
        # Roll and pitch level: first, because what follows uses their rates.
        roll = self._roll.step(s.roll, s.sensor_ns)
        pitch = self._pitch.step(s.pitch, s.sensor_ns)
        self._learn(s, dt)
        surge, sway = self._horizontal(r, s, dt)
        # Heave, along the body's down axis.
        if r.heave_force is not None:
            heave = self.depth.forced(r.heave_force, dt)
        else:
            late = s.depth.valid and not s.depth_acceleration.valid
            extra, upright = 0.0, 1.0
            if self._coupling is not None:
                extra = -self._coupling.ahead(r.depth.velocity, self._actuators.settles_at)
                upright = self._coupling.upright
            heave = self.depth.held(
                r.depth, s.depth, s.depth_rate, dt, late=late, extra=extra, upright=upright
            )
        # Yaw, about the body's down axis.
        if r.yaw_moment is not None:
            yaw = self.heading.forced(r.yaw_moment, dt)
        else:
            motion = along_body(r.heading, s.roll, s.pitch)
            rate = of_heading(s.yaw_rate, s.roll, self._pitch.rate)
            yaw = self.heading.held(motion, s.heading, rate, dt)
        return surge, sway, heave, roll, pitch, yaw

    def done(self, wanted: Vec6, achieved: Vec6, *, saturated: bool) -> None:
        """Take in the achieved wrench. An axis short of force by saturation does not learn; the
        heading, of which more is known, learns what asks for less."""
        self._actuators.settles_at = achieved
        self._short, self._turn_short = frozenset(), 0.0
        if not saturated:
            return
        pairs = zip(AXES, wanted, achieved, strict=True)
        self._short = frozenset(name for name, want, got in pairs if abs(want - got) > 1e-6)
        lack = wanted[5] - achieved[5]
        if lack * wanted[5] > SHORT_OF_YAW * wanted[5] ** 2:
            self._turn_short = lack

    @property
    def standing(self) -> Vec6:
        """[N, N m] Compensation of lasting disturbances; part of the wrench."""
        x, y = self.surge.standing, self.sway.standing
        return x, y, self.depth.standing, 0.0, 0.0, self.heading.standing

    def pause(self) -> None:
        """Learn nothing from the time since the last step."""
        for axis in self._axes:
            axis.pause()

    def stop(self) -> None:
        """The thrusters are stopped: what was learnt stays, transfers and rates are reset."""
        self._actuators.settles_at = REST
        for axis in self._axes:
            axis.pause(stopped=True)
        self._roll.forget()
        self._pitch.forget()

    def forget(self) -> None:
        """Reset integrals and disturbance observers."""
        self._water = None
        if self._coupling is not None:
            self._coupling.forget()
        for axis in self._axes:
            axis.forget()

    def _learn(self, state: VehicleState, dt: float) -> None:
        force = self._actuators.mean(dt)
        coupling, upright = 0.0, 1.0  # [N], [-] of heave
        if self._coupling is not None:
            self._coupling.step(state, (self._roll.rate, self._pitch.rate), force, dt)
            coupling, upright = self._coupling.force, self._coupling.upright
        surge = sway = heave = None
        if (here := measured(state)) is not None:
            water = known_water(state, here.heading)
            self._switch_current(here, water)
            along, across = water or STILL_WATER
            surge, sway = here.ahead - along, here.starboard - across
        # Without the accelerometer the depth rate comes a third of a second late, and a fast
        # observer would be unstable.
        if state.depth_rate.valid and state.depth_acceleration.valid:
            heave = state.depth_rate.value
        for name, axis, velocity, pushed in (
            ("surge", self.surge, surge, force[0]),
            ("sway", self.sway, sway, force[1]),
            ("heave", self.depth, heave, upright * force[2] + coupling),
        ):
            axis.learn(None if name in self._short else velocity, pushed, dt)
        yaw = state.yaw_rate.value if state.yaw_rate.valid else None
        self.heading.learn(yaw, force[5], dt, short=self._turn_short)

    def _switch_current(self, here: "MeasuredMotion", water: Pair | None) -> None:
        """An unknown current is learnt as a disturbance force. Once it is known, the feed-forward
        compensates it, so the learnt force is reduced by that much, and vice versa; otherwise the
        current is compensated twice, or briefly not at all."""
        before, self._water = self._water, water
        if (before is None) == (water is None):
            return
        currents = before or water or STILL_WATER
        pairs = zip((here.ahead, here.starboard), currents, strict=True)
        for axis, (velocity, current) in zip((self.surge, self.sway), pairs, strict=True):
            force = axis.plant.drag(velocity - current) - axis.plant.drag(velocity)
            if water is None:
                axis.take_over(force)
            else:
                axis.give_up(force)

    def _horizontal(self, reference: Reference, state: VehicleState, dt: float) -> Pair:
        """Surge and sway [N]: the pilot's force, and the position law's if it has a reference."""
        surge, sway = reference.surge_force, reference.sway_force
        north, east = reference.north, reference.east
        if reference.surge is not None:
            surge += self.surge.feed_forward(reference.surge)
        if north is None or east is None:
            return self.surge.forced(surge, dt), self.sway.forced(sway, dt)
        here = measured(state)
        if here is None:
            self._count(events.INVALID_POSITION())
            psi = reference.heading.position
            ahead, aside = seen_from_body(north, east, psi, (0.0, 0.0))
            return self.surge.blind(ahead, dt, surge), self.sway.blind(aside, dt, sway)
        # The first anti-windup guard: the error is limited in its own direction.
        place, most = (here.north, here.east), self._max_error
        away = north.position - place[0], east.position - place[1]
        if hypot(*away) > most:
            self._count(events.CLAMPED("control.place"))
            share = most / hypot(*away)
            north = replace(north, position=place[0] + share * away[0])
            east = replace(east, position=place[1] + share * away[1])
        ahead, aside = seen_from_body(north, east, here.heading, place)
        along, across = known_water(state, here.heading) or STILL_WATER
        through = ahead.velocity - along, aside.velocity - across
        turn_x, turn_y = turning_force(self._inertia, through, reference.heading.velocity)
        return (
            self.surge.fed_back(ahead, 0.0, here.ahead, dt, water=along, extra=surge + turn_x),
            self.sway.fed_back(aside, 0.0, here.starboard, dt, water=across, extra=sway + turn_y),
        )


# The horizontal plane: the reference in NED, resolved along the body axes.


class MeasuredMotion(NamedTuple):
    """Feedback of the horizontal law, all of it valid."""

    heading: float  # [rad] clockwise from north
    north: float  # [m] NED
    east: float  # [m]
    ahead: float  # [m/s] over the ground, horizontal, as the heading points
    starboard: float  # [m/s] to the right of it


def measured(state: VehicleState) -> MeasuredMotion | None:
    """None when position, velocity or heading are not valid."""
    heading = state.heading if state.heading_navigation is None else state.heading_navigation
    north, east, level = state.north, state.east, level_velocity(state)
    if north is None or east is None or level is None:
        return None
    if not (heading.valid and north.valid and east.valid):
        return None
    return MeasuredMotion(heading.value, north.value, east.value, *level)


def known_water(state: VehicleState, heading: float) -> Pair | None:
    """[m/s] Of the water over the ground along surge and sway; None: unknown."""
    north, east = state.current_north, state.current_east
    if north is None or east is None or not (north.valid and east.valid):
        return None
    return to_body(heading, north.value, east.value)


def seen_from_body(
    north: Motion, east: Motion, heading: float, place: Pair
) -> tuple[Motion, Motion]:
    """The reference along surge and sway: positions are errors, velocities over the ground.

    Args:
        heading: [rad] clockwise from north.
        place: measured north and east [m].
    """
    error = to_body(heading, north.position - place[0], east.position - place[1])
    velocity = to_body(heading, north.velocity, east.velocity)
    acceleration = to_body(heading, north.acceleration, east.acceleration)
    jerk = to_body(heading, north.jerk, east.jerk)
    surge, sway = zip(error, velocity, acceleration, jerk, strict=True)
    return Motion(*surge), Motion(*sway)


def turning_force(inertia: Vec6, velocity: Pair, turn: float) -> Pair:
    """[N] Surge and sway forces that a turning vehicle needs in addition to M times its
    acceleration over the ground, because added mass differs between the axes.

    In turning axes u' = a_x + r v, and M ν' + C(ν) ν = τ (Fossen 2011, eq. 3.46) leaves
    X = m_x (a_x + r v) - m_y r v, and likewise in sway.

    Args:
        inertia: diagonal of M [kg, kg m²].
        velocity: surge and sway relative to the water [m/s].
        turn: r [rad/s].
    """
    difference = (inertia[0] - inertia[1]) * turn
    return difference * velocity[1], difference * velocity[0]


def to_body(heading: float, north: float, east: float) -> Pair:
    """Surge and sway components of a horizontal NED vector of a level vehicle."""
    return turned((north, east), -heading)


# Heave and yaw of a vehicle that is not level.


def along_body(heading: Motion, roll: Estimate, pitch: Estimate) -> Motion:
    """The heading's reference as a motion about the body's down axis: ψ̇ cos φ cos θ. Its position
    stays the heading [rad]. Unchanged while the tilt is not known.

    The heading turns about the vertical; the gyroscope, the hull's drag and the thrusters' moment
    are about the body's down axis. With the rates of Euler angles (Fossen 2011, eq. 2.28)

        r = ψ̇ cos φ cos θ - θ̇ sin φ.

    A vehicle that surges and dives at once pitches by more than twenty degrees: then r is less than
    ψ̇ by a tenth, which a law that compares them takes for an error.
    """
    if not (roll.valid and pitch.valid):
        return heading
    share = cos(roll.value) * cos(pitch.value)
    return replace(
        heading,
        velocity=share * heading.velocity,
        acceleration=share * heading.acceleration,
        jerk=share * heading.jerk,
    )


def of_heading(yaw_rate: Estimate, roll: Estimate, pitch_rate: float) -> Estimate:
    """The part of the rate r [rad/s] that turns the heading, r + θ̇ sin φ."""
    if not roll.valid:
        return yaw_rate
    return replace(yaw_rate, value=yaw_rate.value + pitch_rate * sin(roll.value))
