"""Sensor samples in, `VehicleState` out: one state per IMU sample, or for the newest of several
that arrive at once.

    IMU            attitude and headings, depth between pressure samples, position between fixes
    pressure       depth
    magnetometer   north
    DVL, USBL      position and velocity over the ground
    actuation      with the hull's drag, the velocity that shows the tilt error, and the current

Samples arrive in the sensors' own axes and positions; this class transforms them to the vehicle's
origin and body axes (services/vehicle/mounting.py).

While calibrating, the first three are only averaged, and judged: a sensor that cannot be right
keeps the calibration from ending. What was made of each measurement: messages/aiding.py.
"""

from collections.abc import Iterator
from math import hypot
from typing import Any

from msgspec import UNSET

from messages import events, topics
from messages.aiding import AidSource
from messages.events import Event, Outbox
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.units import Vec3
from messages.vehicle import Actuation
from services.estimation import initialisation
from services.estimation.aiding import Aiding
from services.estimation.attitude.attitude_observer import ImuNoise
from services.estimation.depth.thrust_speed import ThrustSpeed
from services.estimation.horizontal.horizontal_observer import (
    HorizontalObserver,
    VehicleMotion,
    from_north,
)
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.initialisation import IMU_PATIENCE_NS, EstimationCheckpoint
from services.estimation.sensor_watch import NUMBERS, ThrustWatch, watches_of
from services.estimation.settings import Settings
from services.estimation.startup.calibration import Calibration
from services.estimation.startup.calibration_phase import CalibrationPhase
from services.marine.mounting import Mounting
from services.marine.vehicle import Vehicle
from services.marine.water import density_of
from services.vehicle.mounting import AtOrigin, Moment

DRIVEN = 0.1  # [N] of a thruster that is commanded; one that runs down has less and less
AIDING_NS = round(1e9 / topics.AIDING.hz)
LONGEST_STEP = 0.1  # [s] a longer one is a gap, in which the vehicle may have turned …
LONGEST_TURN = 0.3  # [s] … and the angular rate is not integrated over more of it

DOUBTED = events.DOUBTED_GYROSCOPE()
LACKS = {topics.IMU.key: events.UNUSABLE_IMU, topics.PRESSURE.key: events.UNUSABLE_PRESSURE}


class Estimator:
    """The state of the vehicle."""

    def __init__(
        self,
        settings: Settings,
        floating_depth: float,
        checkpoint: EstimationCheckpoint | None = None,
        vehicle: Vehicle | None = None,
        outbox: Outbox | None = None,
    ) -> None:
        """
        Args:
            floating_depth: [m] of the origin when the vehicle floats.
            checkpoint: of an earlier run; None: calibrate.
            vehicle: for thrust and drag; None: the current stays unknown.
            outbox: for events. Its counts of refused samples name the cause of a missing sensor.
        """
        self.outbox = Outbox() if outbox is None else outbox
        self._lacking: set[str] = set()  # sensors that the state lacks, and the pilot was told so
        self._settings = settings
        self._floating_depth = floating_depth
        thrusters = () if vehicle is None else vehicle.thruster
        self._thrust = ThrustWatch.of(thrusters)
        self._watches = watches_of(
            settings.watch, self.outbox, settings.depth.pressure_std, self._thrust
        )
        density = density_of(settings.water_density)
        if vehicle is None:
            self._at_origin = AtOrigin(Mounting(), density)
        else:
            self._at_origin = AtOrigin(vehicle.mounting, density, vehicle.calibration)
        self._imu_ns: int | None = None  # [ns] newest IMU sample used
        self._now: int | None = None  # [ns] of the newest IMU sample or silence
        self._checkpoint_ns: int | None = None  # [ns] time of validity of the checkpoint
        self._aiding_due_ns = 0  # [ns] when what was made of the measurements is told again
        self._troubles: tuple[str, ...] = ()  # events: which sensors cannot be used now, and why
        wake_share = settings.horizontal.wake_share
        hull = None if vehicle is None else HullModel(vehicle, wake_share)
        self._horizontal = HorizontalObserver(hull)
        self._thrust_speed = None
        if vehicle is not None:
            self._thrust_speed = ThrustSpeed(vehicle, wake_share, at_rest=checkpoint is None)
        self._calibrating: CalibrationPhase | None = None
        # Not None: it has begun without a rest, and looks for one.
        self._improving: Calibration | None = None
        self._driven = False  # the thrusters have run
        self._newest_pressure: PressureSample | None = None  # before the dive
        if checkpoint is None:
            self._calibrating = CalibrationPhase(
                settings.calibration, initialisation.start_limits(settings), self.outbox
            )
            observers = initialisation.unknown(settings)
        else:
            self._checkpoint_ns = checkpoint.stamp_ns
            observers = initialisation.resumed(settings, checkpoint, self.outbox)
        self._attitude, self._resting, self._depth = observers

    # Sensor samples.

    def imu(self, sample: ImuSample, now: int) -> VehicleState | None:
        """The state at this sample. An unusable sample counts as silence, but before the dive it
        has a state that says what is wrong."""
        self._now = now
        if self.follow(sample) or (self._calibrating and self._calibrating.blocked_by):
            return self._state(now, sample.stamp_ns)
        return self.silence(now)

    def follow(self, sample: ImuSample) -> bool:  # noqa: C901 - the way of a sample, top down
        """Use this sample without a state, because newer ones have arrived already. False: it
        cannot be used."""
        if not self._usable(topics.IMU, sample, hypot(*sample.specific_force)):
            return False
        sample, tell = self._at_origin.imu(sample), self.outbox.tell
        attitude, force, at_ns = self._attitude, sample.specific_force, sample.stamp_ns

        # How long since the sample before, and what a gap means.
        dt, before, self._imu_ns = 0.0, self._imu_ns, at_ns
        if before is not None:
            dt = (at_ns - before) * 1e-9
        elif self._checkpoint_ns is not None:
            attitude.blind(abs(at_ns - self._checkpoint_ns) * 1e-9)
        if dt > LONGEST_STEP:
            tell(events.GAP(topics.IMU.key))
            self._resting.moved()
            if self._thrust_speed is not None:
                self._thrust_speed.lost()
            attitude.blind(dt - LONGEST_STEP)
            dt = min(dt, LONGEST_TURN)

        noise = self._imu_noise()
        if self._calibrating is not None:
            self._calibrate(self._calibrating, sample, dt, noise)
        else:
            if self._improving is not None:
                self._improve(self._improving, sample, dt)
            # Attitude and headings.
            felt = (0.0, 0.0) if self._thrust_speed is None else self._thrust_speed.felt
            event = attitude.step(sample.angular_rate, force, dt, noise, felt)
            attitude.note(at_ns)
            tell(event)
            if event == DOUBTED:  # so it is not known which acceleration is vertical
                tell(self._depth.doubt_accelerometer())
            # The gyroscope's bias, at rest or while it is learnt anew.
            resting = self._resting
            if attitude.relearns:
                resting.relearn(attitude.gyro_bias)
            before_rest = resting.bias = attitude.gyro_bias
            tell(resting.imu(sample.angular_rate, force, dt))
            if resting.bias is not before_rest:
                attitude.rested(resting.bias)
            # Depth, with the velocity that the thrust makes expect, and position.
            axes = attitude.axes(force, noise.force * dt)
            if self._thrust_speed is not None:
                (p, q, r), (a, b, c) = sample.angular_rate, attitude.gyro_bias
                rate, depth_rate = (p - a, q - b, r - c), self._depth.rate[0]
                tell(self._thrust_speed.silence(at_ns))
                axes = self._thrust_speed.step(axes, rate, depth_rate, dt)
            tell(self._depth.predict(axes.acceleration, at_ns, axes))
            tell(self._predict_horizontal(force, at_ns))

        if self._at_origin.needs_motion:  # sensors with a lever arm
            attitude = self._attitude
            (p, q, r), (a, b, c) = sample.angular_rate, attitude.gyro_bias
            north = from_north(attitude.filter.q, attitude.compass.offset or 0.0)
            self._at_origin.moved(Moment(at_ns, (p - a, q - b, r - c), north))
        return True

    def silence(self, now: int) -> VehicleState | None:
        """No IMU sample in time: a predicted state, or None before `IMU_PATIENCE_NS` has passed."""
        self._now = now
        if self._calibrating is not None:
            self._calibrating.judge(now)
        if self._imu_ns is None:
            return None
        if self._calibrating is None:
            self.outbox.tell(self._depth.predict(None, now))
            self.outbox.tell(self._predict_horizontal(None, now))
        if self._hears_imu(now):
            return None
        self.outbox.tell(events.PREDICTED(topics.STATE.key))
        return self._state(now, self._imu_ns)

    def pressure(self, sample: PressureSample) -> None:
        if not self._usable(topics.PRESSURE, sample, sample.pressure):
            return
        sample = self._at_origin.pressure(sample)
        if self._calibrating is not None:
            self._calibrating.pressure(sample.pressure)
            self._newest_pressure = sample
        else:
            if self._improving is not None:
                self._improving.pressure(sample.pressure)
            self.outbox.tell(self._depth.pressure(sample.pressure, sample.stamp_ns))

    def magnetometer(self, sample: MagnetometerSample) -> None:
        if not self._usable(topics.MAGNETOMETER, sample, hypot(*sample.field)):
            return
        sample = self._at_origin.magnetometer(sample)
        if self._calibrating is not None:
            self._calibrating.magnetometer(sample.field)
        elif self._hears_imu(sample.stamp_ns):  # without attitude, a field says nothing
            self.outbox.tell(self._attitude.magnetometer(sample.field, sample.stamp_ns))

    def dvl(self, sample: DvlSample) -> None:
        if sample.velocity is None:
            self._watches[topics.DVL.key].excused(events.NO_BOTTOM(topics.DVL.key), sample.stamp_ns)
        if self._usable(topics.DVL, sample) and self._calibrating is None:
            self.outbox.tell(self._horizontal.dvl(self._at_origin.dvl(sample)))

    def usbl(self, sample: UsblSample) -> None:
        if self._usable(topics.USBL, sample) and self._calibrating is None:
            self.outbox.tell(self._horizontal.usbl(self._at_origin.usbl(sample)))

    def actuation(self, sample: Actuation) -> None:
        """Thrust as reported: with the hull's drag, the only measurement of the current."""
        if max(map(abs, sample.thrust), default=0.0) > DRIVEN:
            self._driven = True
            if self._calibrating is not None:
                self._calibrating.drive()
            elif self._improving is not None:
                # Who holds the heading by a wrong bias turns so that the gyroscope reads just that.
                self._improving = Calibration(self._settings.calibration)
        self._thrust.see(sample.thrust, sample.stamp_ns)
        self.outbox.tell(self._horizontal.actuation(sample))
        if self._thrust_speed is not None:
            self.outbox.tell(self._thrust_speed.actuation(sample))

    # Monitoring and restart.

    def aid_sources(self, now: int) -> Iterator[tuple[str, AidSource]]:
        """What was made of each measured quantity, by its name; nothing before a tenth of a second
        has passed since the last time."""
        if now < self._aiding_due_ns:
            return
        self._aiding_due_ns = now + AIDING_NS
        for key, each in self._aiding().items():
            trouble = next((name for name in self._troubles if name.endswith(key)), None)
            for aiding in each:
                if (source := aiding.message(trouble)) is not None:
                    yield aiding.name, source

    def checkpoint(self, now: int) -> EstimationCheckpoint | None:
        """State for a restart; None while calibrating."""
        if self._calibrating is not None:
            return None
        return initialisation.worth_keeping(self._attitude, self._depth, now)

    # Steps.

    def _calibrate(
        self, phase: CalibrationPhase, sample: ImuSample, dt: float, noise: ImuNoise
    ) -> None:
        """Before the dive. In motion the attitude is followed as in the dive, so that a gyroscope
        which contradicts gravity does not begin one."""
        attitude, force = self._attitude, sample.specific_force
        learnt = phase.imu(sample, dt)
        if phase.at_rest:
            attitude.begin_roughly(force)
        else:
            attitude.step(sample.angular_rate, force, dt, noise)
        if learnt is not None:
            self._calibrating = None
            self._attitude, self._resting, self._depth = initialisation.calibrated(
                self._settings, learnt, self._floating_depth, sample.stamp_ns, self.outbox
            )
        elif not attitude.gyroscope.learning and phase.gives_up():
            self._calibrating, self._improving = None, Calibration(self._settings.calibration)
            # A bias that was never measured has not changed: no push makes it doubted at once.
            attitude.gyroscope.patient = True
            self._resting, self._depth = initialisation.roughly(
                self._settings, attitude, self.outbox
            )
            if (newest := self._newest_pressure) is not None:
                self._depth.pressure(newest.pressure, newest.stamp_ns)

    def _improve(self, calibration: Calibration, sample: ImuSample, dt: float) -> None:
        """After a beginning without rest: what a first rest measures."""
        calibration.imu(sample.angular_rate, sample.specific_force, dt)
        learnt = calibration.result()
        if learnt is None:
            return
        self._improving = None
        self._attitude.gyroscope.rested(learnt.gyro_bias)
        self._attitude.rested(learnt.gyro_bias)
        self._resting = initialisation.resting(self._settings, learnt.gyro_bias)
        said = "the gyroscope"
        if not self._driven:
            air = initialisation.atmosphere_of(
                self._settings, learnt, self._floating_depth, self.outbox
            )
            self._depth.correct_atmosphere(air)
            said += f" and the air, {air.pressure / 100.0:.1f} hPa,"
        self.outbox.say("info", f"at rest: {said} calibrated")

    def _imu_noise(self) -> ImuNoise:
        x, y, z, p, q, r = self._watches[topics.IMU.key].noise
        return ImuNoise((x + y + z) / 3.0, (p + q + r) / 3.0)

    def _usable(self, topic: AnyTopic, sample: Any, magnitude: float | None = None) -> bool:
        """May this sample be used? Before the dive it is also judged whether a sensor of this
        `magnitude` can be right, be the sample usable or not."""
        key = topic.key
        content, refused = NUMBERS[key](sample)
        if refused is None:
            refused = self._watches[key].judge(content, sample.stamp_ns)
        else:
            self.outbox.tell(refused)
        if self._calibrating is not None:
            if self._now is not None and magnitude is not None:
                self._calibrating.arrived(key, magnitude, sample.stamp_ns, self._now)
        elif refused is not None:
            for aiding in self._aiding()[key]:
                aiding.refuse(refused, sample.stamp_ns)
        return refused is None

    def _aiding(self) -> dict[str, tuple[Aiding, ...]]:
        """By the key of the samples."""
        attitude, depth = self._attitude, self._depth
        return {
            topics.IMU.key: attitude.imu_aiding,
            topics.MAGNETOMETER.key: (attitude.compass_aiding,),
            topics.PRESSURE.key: depth.pressure_aiding,
            topics.ACTUATION.key: (
                *self._horizontal.aiding[topics.ACTUATION.key],
                *depth.thrust_aiding,
            ),
            topics.DVL.key: self._horizontal.aiding[topics.DVL.key],
            topics.USBL.key: self._horizontal.aiding[topics.USBL.key],
        }

    def _predict_horizontal(self, force: Vec3 | None, at_ns: int) -> Event | None:
        observer, (depth_rate, depth_rate_std) = self._attitude, self._depth.rate
        motion = VehicleMotion(
            attitude=observer.filter.q,
            offset=observer.compass.offset,
            heading_std=observer.north_std,
            specific_force=force,
            yaw_rate=observer.control.yaw_rate,
            depth_rate=depth_rate,
            depth_rate_std=depth_rate_std,
        )
        return self._horizontal.predict(motion, at_ns)

    # Messages.

    def _state(  # noqa: C901 - one message, top down
        self, now: int, sensor_ns: int
    ) -> VehicleState:
        """The estimates as one message. Valid are, once it is calibrated:

        - attitude, headings and yaw rate while IMU samples arrive; depth and depth rate for two
          seconds after an accepted pressure sample. The depth rate also for as long after it as the
          accelerometer alone keeps it known.
        - gyroscope's bias changed: attitude is learnt anew from gravity; headings and yaw rate are
          not valid until the magnetometer has measured them, or the bias is as before.
        - IMU back after half a second or more: headings are not valid until the magnetometer has
          measured how far the vehicle turned meanwhile. Without one, north is never known, and the
          control heading goes on from where it was, with its standard deviation.
        - vertical acceleration and pressure disagree: depth and rate from pressure alone, the
          acceleration is not valid.
        - IMU silent: at first no states, so receivers see the last one age. After 0.2 s, states
          come at the topic's rate with everything from the IMU invalid. Depth and depth rate
          continue from pressure alone, with the standard deviation of a filter without
          accelerometer. `sensor_ns` stays at the last IMU sample.
        """
        attitude, depth = self._attitude, self._depth
        found = list[
            str
        ]()  # names of the events that say which sensors cannot be used now, and why
        for watch in self._watches.values():
            if (event := watch.trouble(now)) is not None:
                found.append(event.name)
        if self._calibrating is not None:
            estimates = attitude.estimates(valid=False, now=now)
            q, floating = attitude.filter.q, self._floating_depth
            return self._calibrating.state(now, sensor_ns, q, estimates, floating)
        imu = self._hears_imu(now)
        down, rate, acceleration = depth.estimates(now)
        roll, pitch, heading, compass, yaw_rate = attitude.estimates(imu, now)
        north, east, surge, sway, current_north, current_east = self._horizontal.estimates(now)
        origin = self._horizontal.origin

        # A sensor that the state lacks, and when it is back, is told once.
        for topic, used in ((topics.IMU, imu), (topics.PRESSURE, down.valid)):
            key = topic.key
            if used:
                if key in self._lacking:
                    self._lacking.remove(key)
                    self.outbox.tell(events.REGAINED(key))
                continue
            if key not in self._lacking:
                self._lacking.add(key)
                self.outbox.tell(LACKS[key]())
            if not any(name.endswith(key) for name in found):
                found.append(LACKS[key].name)
        if depth.trial is not None and imu:
            found.append(events.DISTRUSTED_IMU.name)
        if self._improving is not None:
            found.append(events.ROUGH_CALIBRATION.name)
        if attitude.gyroscope.learning:
            found.append(DOUBTED.name)
        field, key = attitude.compass.field, topics.MAGNETOMETER.key
        if field.disturbed and not any(name.endswith(key) for name in found):
            found.append(events.DISTURBED(key).name)
        self._troubles = tuple(found)
        return VehicleState(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            phase="running",
            calibration_left=None,
            troubles=self._troubles or UNSET,
            depth_moved=depth.moved or UNSET,
            depth=down,
            depth_rate=rate,
            depth_acceleration=acceleration,
            attitude=attitude.filter.q,
            roll=roll,
            pitch=pitch,
            heading=heading,
            heading_navigation=None if compass is None else self._horizontal.heading(compass),
            yaw_rate=yaw_rate,
            surge_velocity=surge,
            sway_velocity=sway,
            north=north,
            east=east,
            current_north=current_north,
            current_east=current_east,
            pressure_age_ms=depth.pressure_age_ms(now),
            origin=UNSET if origin is None else origin,
        )

    def _hears_imu(self, now: int) -> bool:
        return self._imu_ns is not None and now - self._imu_ns <= IMU_PATIENCE_NS
