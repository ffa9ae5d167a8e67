"""The laws of all axes together: from reference and state to the required wrench."""

from collections.abc import Callable

from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from messages.units import Vec6
from services.control import horizontal_plane, tilted_turn
from services.control.allocation.actuator_model import ActuatorModel, lags_of
from services.control.allocation.layout import AXES
from services.control.axis.adaptation import Adaptation
from services.control.axis.axis import PilotedAxis
from services.control.axis.axis_law import AxisLaw, Gains
from services.control.axis.bumpless_transfer import BumplessTransfer
from services.control.axis.plant import plant_of
from services.control.axis.rest_pulse import RestPulse
from services.control.axis.roll_pitch_hold import RollPitchHold
from services.control.heave_coupling import HeaveCoupling
from services.control.settings import Settings
from services.marine.rigid_body import system_inertia
from services.marine.vehicle import Vehicle

SHORT = 0.01  # [-] of the moment that is wanted; a smaller lack is a dead-band's
IDLE = 0.03  # [-] of the smallest moment of a thruster; a smaller one only runs down


class Laws:
    """Surge, sway, heave and yaw, each with its own law, and roll and pitch held level."""

    def __init__(
        self,
        settings: Settings,
        vehicle: Vehicle,
        period: float,
        count: Callable[[str], None],
        yaw_pushes: tuple[Vec6, ...] = (),
    ) -> None:
        """
        Args:
            period: [s] for which a wrench is held.
            count: called with the name of a condition, at every step while it lasts.
            yaw_pushes: [N, N m] smallest wrenches of single thrusters that turn the vehicle.
        """
        self._inertia = system_inertia(vehicle)
        self._lags = lags_of(vehicle)
        self._count = count
        self._actuators = ActuatorModel(self._lags)
        self._short: frozenset[str] = frozenset()  # axes with less force than required
        self._turn_short = 0.0  # [N m] of the moment that is wanted, for lack of thrust
        self._water: tuple[float, float] | None = None  # [m/s] along surge and sway, if known

        def axis(name: str, gains: Gains, row: int, *, own: bool = True) -> PilotedAxis:
            law = AxisLaw(gains, plant_of(vehicle, row), self._lags[row], period)
            return PilotedAxis(name, law, BumplessTransfer(settings.transfer), count, own=own)

        self.surge = axis("surge", settings.surge, 0)
        self.sway = axis("sway", settings.sway, 1)
        self.depth = axis("depth", settings.depth, 2)
        self.heading = axis("heading", settings.heading, 5, own=False)
        self.adaptation = Adaptation(settings.adaptation, vehicle)
        self._max_error = min(settings.surge.max_error, settings.sway.max_error)  # [m]
        self._roll, self._pitch = RollPitchHold(settings.roll), RollPitchHold(settings.pitch)
        self._coupling: HeaveCoupling | None = None
        if settings.coupling.heave:
            self._coupling = HeaveCoupling(vehicle, self._lags[2], settings.coupling.wake_share)
        self._yaw_pushes = yaw_pushes
        self._pulse: RestPulse | None = None  # of the heading
        if settings.heading_pulse > 0.0 and yaw_pushes:
            yaw = self.heading.law
            moments = [push[5] for push in yaw_pushes]
            self._pulse = RestPulse(yaw.plant, yaw.lag, period, moments, settings.heading_pulse)

    def wrench(self, reference: Reference, state: VehicleState, dt: float) -> Vec6:
        """The required wrench [N, N m], `dt` [s] after the last one, as commands of thrusters that
        yield what the vehicle file says."""
        r, s = reference, state
        roll = self._roll.step(s.roll, s.sensor_ns)
        pitch = self._pitch.step(s.pitch, s.sensor_ns)
        self._learn(state, dt)
        surge, sway = self._horizontal(reference, state, dt)
        heave = self._heave(r, s, dt)
        wanted = surge, sway, heave, roll, pitch, self._yaw(r, s, dt)
        self.adaptation.asked(reference, wanted)
        return self._pulsed(self.adaptation.scaled(wanted), r, s)

    def _heave(self, r: Reference, s: VehicleState, dt: float) -> float:
        """[N] Along the body's down axis."""
        if r.heave_force is not None:
            return self.depth.forced(r.heave_force, dt)
        late = s.depth.valid and not s.depth_acceleration.valid
        extra, upright = 0.0, 1.0
        if self._coupling is not None:
            thrust = self._actuators.settles_at
            extra, upright = -self._coupling.ahead(r.depth.velocity, thrust), self._coupling.upright
        return self.depth.held(
            r.depth, s.depth, s.depth_rate, dt, late=late, extra=extra, upright=upright
        )

    def _yaw(self, r: Reference, s: VehicleState, dt: float) -> float:
        """[N m] After the pitch of this step, whose rate it uses."""
        if r.yaw_moment is not None:
            return self.heading.forced(r.yaw_moment, dt)
        motion = tilted_turn.along_body(r.heading, s.roll, s.pitch)
        rate = tilted_turn.of_heading(s.yaw_rate, s.roll, self._pitch.rate)
        return self.heading.held(motion, s.heading, rate, dt)

    def _pulsed(self, wrench: Vec6, r: Reference, s: VehicleState) -> Vec6:
        """The wrench with a pulse instead of the moment, where that has no effect at rest."""
        if self._pulse is None:
            return wrench
        held = r.yaw_moment is None and s.heading.valid and s.yaw_rate.valid
        resting = held and r.heading.velocity == 0.0 == r.heading.acceleration
        error = r.heading.position - s.heading.value
        share = self._pulse.step(error, s.yaw_rate.value, resting=resting)
        if share is None:
            return wrench
        x, y, z, k, m, _ = wrench
        a, b, c, d, e, f = [share * part for part in self._yaw_pushes[self._pulse.turn]]
        return x + a, y + b, z + c, k + d, m + e, f

    def done(self, wanted: Vec6, achieved: Vec6, *, saturated: bool) -> None:
        """Take in the achieved wrench. An axis short of force by saturation does not learn; the
        heading, of which more is known, learns what asks for less."""
        self._actuators.command(achieved)
        if saturated:
            self.adaptation.saturated()
        if self._pulse is not None:
            self._pulse.effective = achieved[5] != 0.0
        self._short = frozenset(
            name
            for name, want, got in zip(AXES, wanted, achieved, strict=True)
            if saturated and abs(want - got) > 1e-6
        )
        lack = wanted[5] - achieved[5]
        self._turn_short = lack if saturated and lack * wanted[5] > SHORT * wanted[5] ** 2 else 0.0

    @property
    def standing(self) -> Vec6:
        """[N, N m] Compensation of lasting disturbances; part of the wrench."""
        axes = self.surge, self.sway, self.depth, self.heading
        x, y, z, n = [axis.law.standing for axis in axes]
        return x, y, z, 0.0, 0.0, n

    def pause(self) -> None:
        """Learn nothing from the time since the last step."""
        self.adaptation.pause()
        for axis in (self.surge, self.sway, self.depth, self.heading):
            axis.law.pause()

    def stop(self) -> None:
        """The thrusters are stopped: what was learnt stays, transfers and rates are reset."""
        self._actuators.command((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        self.pause()
        for axis in (self.surge, self.sway, self.depth, self.heading):
            axis.transfer.forget()
        self._roll.forget()
        self._pitch.forget()
        if self._pulse is not None:
            self._pulse.forget()

    def forget(self) -> None:
        """Reset integrals and disturbance observers."""
        self._water = None
        if self._coupling is not None:
            self._coupling.forget()
        for axis in (self.surge, self.sway, self.depth, self.heading):
            axis.forget()

    def _learn(self, state: VehicleState, dt: float) -> None:
        force = self._actuators.mean(dt)
        coupling, upright = 0.0, 1.0  # [N], [-] of heave
        if self._coupling is not None:
            self._coupling.step(state, (self._roll.rate, self._pitch.rate), force, dt)
            coupling, upright = self._coupling.force, self._coupling.upright
        here = horizontal_plane.measured(state)
        if here is not None:
            self._switch_current(here, horizontal_plane.known_water(state, here.heading))
        surge, sway = (None, None) if here is None else here.through_water(state)
        # Without the accelerometer the depth rate comes a third of a second late, and a fast
        # observer would be unstable.
        heave = _known(state.depth_rate) if state.depth_acceleration.valid else None
        yaw = _known(state.yaw_rate)
        self.adaptation.learn(state, (heave, force[2]), (yaw, force[5]), dt)
        self.depth.law.take_model(self.adaptation.heave.model)
        self.heading.law.take_model(self.adaptation.yaw.model)
        thrust = self.adaptation.heave.thrust.value
        for axis, row, velocity, pushed in (
            (self.surge, 0, surge, force[0]),
            (self.sway, 1, sway, force[1]),
            (self.depth, 2, heave, upright * thrust * force[2] + coupling),
        ):
            axis.learn(None if AXES[row] in self._short else velocity, pushed, dt)
        self.heading.learn(
            yaw,
            self.adaptation.yaw.thrust.value * force[5],
            dt,
            freely=self._idle(force[5]),
            short=self._turn_short,
        )

    def _idle(self, moment: float) -> bool:
        """Does the dead-band leave the law of the heading without effect, [N m]?"""
        return self._pulse is not None and abs(moment) < IDLE * self._pulse.pushes[0]

    def _switch_current(
        self, here: horizontal_plane.MeasuredMotion, water: tuple[float, float] | None
    ) -> None:
        """An unknown current is learnt as a disturbance force. Once it is known, the feed-forward
        compensates it, so the learnt force is reduced by that much, and vice versa; otherwise the
        current is compensated twice, or briefly not at all."""
        before, self._water = self._water, water
        if (before is None) == (water is None):
            return
        velocities = here.surge, here.sway
        currents = before or water or horizontal_plane.STILL_WATER
        for axis, velocity, current in zip(
            (self.surge, self.sway), velocities, currents, strict=True
        ):
            plant = axis.law.plant
            force = plant.drag(velocity - current) - plant.drag(velocity)
            if water is None:
                axis.law.take_over(force)
            else:
                axis.law.give_up(force)

    def _horizontal(
        self, reference: Reference, state: VehicleState, dt: float
    ) -> tuple[float, float]:
        """Surge and sway [N]: the pilot's force, and the position law's if it has a reference."""
        surge, sway = reference.surge_force, reference.sway_force
        if reference.surge is not None:
            surge += self.surge.law.feed_forward(reference.surge)
        if reference.north is None or reference.east is None:
            return self.surge.forced(surge, dt), self.sway.forced(sway, dt)
        here = horizontal_plane.measured(state)
        if here is None:
            self._count("invalid:state.position")
            psi = reference.heading.position
            plane = horizontal_plane.seen_from_body(
                reference.north, reference.east, psi, (0.0, 0.0)
            )
            surge = self.surge.blind(plane.surge, dt, surge)
            return surge, self.sway.blind(plane.sway, dt, sway)
        place = here.north, here.east
        north, east = horizontal_plane.limited_error(
            reference.north, reference.east, place, self._max_error
        )
        if (north, east) != (reference.north, reference.east):
            self._count("clamped:control.place")
        plane = horizontal_plane.seen_from_body(north, east, here.heading, place)
        return self._hold_place(plane, here, state, reference.heading, (surge, sway), dt)

    def _hold_place(
        self,
        plane: horizontal_plane.HorizontalSetpoint,
        here: horizontal_plane.MeasuredMotion,
        state: VehicleState,
        heading: Motion,
        extra: tuple[float, float],
        dt: float,
    ) -> tuple[float, float]:
        water = horizontal_plane.water_velocity(state, here.heading)
        through = plane.surge.velocity - water[0], plane.sway.velocity - water[1]
        turning = horizontal_plane.turning_force(self._inertia, through, heading.velocity)
        surge, sway = [
            axis.fed_back(motion, 0.0, velocity, dt, water=current, extra=force + turn_force)
            for axis, motion, velocity, current, force, turn_force in (
                (self.surge, plane.surge, here.surge, water[0], extra[0], turning[0]),
                (self.sway, plane.sway, here.sway, water[1], extra[1], turning[1]),
            )
        ]
        return surge, sway


def _known(estimate: Estimate) -> float | None:
    return estimate.value if estimate.valid else None
