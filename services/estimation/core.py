"""Sensor samples in, `VehicleState` out: one state per IMU sample, or for the newest of several
that arrive at once.

    IMU            attitude and headings, depth between pressure samples, position between fixes
    pressure       depth
    magnetometer   north
    DVL, USBL      position and velocity over the ground
    actuation      with the hull's drag, the velocity that shows the tilt error, and the current
    reference      depth, for the observer "reference" only

Samples arrive in the sensors' own axes and positions; this class transforms them to the vehicle's
origin and body axes (services/vehicle/mounting.py).

While calibrating, the first three are only averaged, and judged: a sensor that cannot be right
keeps the calibration from ending. Validity: see state_message.py.
"""

from collections.abc import Mapping
from math import hypot

import msgspec

from messages import topics
from messages.reference import Reference
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.state import VehicleState
from messages.units import Vec3
from messages.vehicle import Actuation
from services.estimation import initialisation, state_message
from services.estimation.announcements import Announcements
from services.estimation.checkpoint import EstimationCheckpoint, worth_keeping
from services.estimation.checks import range_checks
from services.estimation.checks.sample_validation import SampleValidation
from services.estimation.depth.depth_observer import LATEST_AGE
from services.estimation.depth.reference_input import reference_acceleration
from services.estimation.depth.thrust_speed import ThrustSpeed
from services.estimation.events import Events
from services.estimation.horizontal.horizontal_observer import HorizontalObserver
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.horizontal.vehicle_motion import VehicleMotion, from_north
from services.estimation.initialisation import Observers
from services.estimation.settings import Settings
from services.estimation.startup import arrival_check
from services.estimation.startup.calibration_phase import CalibrationPhase, StartLimits
from services.marine.mounting import Mounting
from services.marine.vehicle import Vehicle
from services.marine.water import density_of
from services.vehicle.mounting import AtOrigin, Moment

DRIVEN = 0.1  # [N] of a thruster that is commanded; one that runs down has less and less
LONGEST_STEP = 0.1  # [s] the angular rate is not integrated over a longer gap


class Estimator:
    """The state of the vehicle. `events` collects names to count, `lines` texts to log; the caller
    empties both."""

    def __init__(
        self,
        settings: Settings,
        floating_depth: float,
        checkpoint: EstimationCheckpoint | None = None,
        vehicle: Vehicle | None = None,
        refused: Mapping[str, int] | None = None,
    ) -> None:
        """
        Args:
            floating_depth: [m] of the origin when the vehicle floats.
            checkpoint: of an earlier run; None: calibrate.
            vehicle: for thrust and drag; None: the current stays unknown.
            refused: counts of refused samples as they grow, to name the cause of a missing sensor.

        Raises:
            ValueError: a thruster without direction.
        """
        self._events = Events()
        self.events, self.lines = self._events.names, self._events.lines
        self._announcements = Announcements(self._events)
        self._settings = settings
        self._floating_depth = floating_depth
        self._validation = SampleValidation(
            settings.watch,
            self.events,
            settings.depth.pressure_std,
            () if vehicle is None else vehicle.thruster,
        )
        density = density_of(settings.water_density)
        if vehicle is None:
            self._at_origin = AtOrigin(Mounting(), density)
        else:
            self._at_origin = AtOrigin(vehicle.mounting, density, vehicle.calibration)
        self._reference_acceleration: float | None = None  # [m/s²] along down
        self._imu_ns: int | None = None  # [ns] newest IMU sample used
        self._now: int | None = None  # [ns] of the newest IMU sample or silence
        self._checkpoint_ns: int | None = None  # [ns] time of validity of the checkpoint
        hull_settings = settings.horizontal
        hull = None if vehicle is None else HullModel(vehicle, hull_settings.wake_share)
        self._horizontal = HorizontalObserver(hull_settings, hull)
        self._thrust_speed = None
        if vehicle is not None:
            wake_share, patience = hull_settings.wake_share, hull_settings.actuation_patience
            self._thrust_speed = ThrustSpeed(
                vehicle, wake_share, patience, at_rest=checkpoint is None
            )
        self._calibrating: CalibrationPhase | None = None
        if checkpoint is None:
            self._calibrating = CalibrationPhase(
                settings.calibration,
                start_limits(settings),
                {} if refused is None else refused,
                self._events,
            )
            self._start(initialisation.unknown(settings))
        else:
            self._checkpoint_ns = checkpoint.stamp_ns
            self._start(initialisation.resumed(settings, checkpoint, self._events))

    # Sensor samples.

    def imu(self, sample: ImuSample, now: int) -> VehicleState | None:
        """The state at this sample. An unusable sample counts as silence, but before the dive it
        has a state that says what is wrong."""
        self._now = now
        if self.follow(sample) or self._blocked:
            return self._state(now, sample.stamp_ns)
        return self.silence(now)

    def follow(self, sample: ImuSample) -> bool:
        """Use this sample without a state, because newer ones have arrived already. False: it
        cannot be used."""
        usable = self._validation.imu(sample)
        self._judge(topics.IMU.key, hypot(*sample.specific_force), sample.stamp_ns)
        if not usable:
            return False
        sample = self._at_origin.imu(sample)
        dt = self._step_to(sample.stamp_ns)
        if self._calibrating is not None:
            self._calibrate(self._calibrating, sample, dt)
        else:
            self._run(sample, dt)
        self._note_motion(sample)
        return True

    def silence(self, now: int) -> VehicleState | None:
        """No IMU sample in time: a predicted state, or None before `imu_patience` has passed."""
        self._now = now
        if self._calibrating is not None:
            self._calibrating.judge(now)
        if self._imu_ns is None:
            return None
        if self._calibrating is None:
            self._events.note(self._depth.predict(None, now))
            self._events.note(self._predict_horizontal(None, now))
        if self._hears_imu(now):
            return None
        self._events.note("predicted:state")
        return self._state(now, self._imu_ns)

    def pressure(self, sample: PressureSample) -> None:
        self._judge(topics.PRESSURE.key, sample.pressure, sample.stamp_ns)
        if not self._validation.pressure(sample):
            return
        sample = self._at_origin.pressure(sample)
        if self._calibrating is not None:
            self._calibrating.pressure(sample.pressure)
        else:
            self._announcements.tell(self._depth.pressure(sample.pressure, sample.stamp_ns))

    def magnetometer(self, sample: MagnetometerSample) -> None:
        self._judge(topics.MAGNETOMETER.key, hypot(*sample.field), sample.stamp_ns)
        if not self._validation.magnetometer(sample):
            return
        sample = self._at_origin.magnetometer(sample)
        if self._calibrating is not None:
            self._calibrating.magnetometer(sample.field)
        elif self._hears_imu(sample.stamp_ns):  # without attitude, a field says nothing
            self._announcements.tell(self._attitude.magnetometer(sample.field, sample.stamp_ns))

    def dvl(self, sample: DvlSample) -> None:
        if self._validation.dvl(sample) and self._calibrating is None:
            self._events.note(self._horizontal.dvl(self._at_origin.dvl(sample)))

    def usbl(self, sample: UsblSample) -> None:
        if self._validation.usbl(sample) and self._calibrating is None:
            self._events.note(self._horizontal.usbl(self._at_origin.usbl(sample)))

    def actuation(self, sample: Actuation) -> None:
        """Thrust as reported: with the hull's drag, the only measurement of the current."""
        if self._calibrating is not None and max(map(abs, sample.thrust), default=0.0) > DRIVEN:
            self._calibrating.drive()
        self._validation.actuation(sample)
        self._events.note(self._horizontal.actuation(sample))
        if self._thrust_speed is not None:
            self._events.note(self._thrust_speed.actuation(sample))

    def reference(self, newest: Reference | None) -> None:
        """The fresh reference, for the depth observer "reference"; None: there is none."""
        self._reference_acceleration = reference_acceleration(newest)

    # Monitoring and restart.

    @property
    def horizontal_surprise(self) -> dict[str, float]:
        """Newest normalised innovation squared of "dvl" and "usbl"."""
        return self._horizontal.surprise

    def checkpoint(self, now: int) -> EstimationCheckpoint | None:
        """State for a restart; None while calibrating."""
        if self._calibrating is not None:
            return None
        return worth_keeping(self._attitude, self._depth, now)

    # Steps.

    @property
    def _blocked(self) -> bool:
        return self._calibrating is not None and self._calibrating.blocked_by is not None

    def _judge(self, key: str, magnitude: float, stamp_ns: int) -> None:
        """Before the dive: can this sample be right? Judged whether it is usable or not."""
        if self._calibrating is not None and self._now is not None:
            self._calibrating.arrived(key, magnitude, stamp_ns, self._now)

    def _start(self, observers: Observers) -> None:
        self._attitude, self._resting, self._depth = observers

    def _step_to(self, stamp_ns: int) -> float:
        """[s] Integration time, from the previous sample to this one."""
        before, self._imu_ns = self._imu_ns, stamp_ns
        if before is None:
            if self._checkpoint_ns is not None:
                self._attitude.blind(abs(stamp_ns - self._checkpoint_ns) * 1e-9)
            return 0.0
        dt = (stamp_ns - before) * 1e-9
        if dt <= LONGEST_STEP:
            return dt
        self._events.note("gap:sensor/imu")
        self._resting.moved()
        if self._thrust_speed is not None:
            self._thrust_speed.lost()
        self._attitude.blind(dt - LONGEST_STEP)
        return LONGEST_STEP

    def _calibrate(self, calibrating: CalibrationPhase, sample: ImuSample, dt: float) -> None:
        self._attitude.start(sample.specific_force)
        result = calibrating.imu(sample, dt)
        if result is not None:
            self._calibrating = None
            depth, at_ns = self._floating_depth, sample.stamp_ns
            self._start(
                initialisation.calibrated(self._settings, result, depth, at_ns, self._events)
            )

    def _run(self, sample: ImuSample, dt: float) -> None:
        force, at_ns, note = sample.specific_force, sample.stamp_ns, self._events.note
        event = self._attitude.step(sample.angular_rate, force, dt)
        self._announcements.tell(event)
        if event == "doubted:gyroscope":  # so it is not known which acceleration is vertical
            self._announcements.tell(self._depth.doubt_accelerometer())
        note(self._resting.imu(sample.angular_rate, force, dt))
        if self._attitude.relearns:
            self._resting.relearn(self._attitude.gyro_bias)
        else:
            self._attitude.gyro_bias = self._resting.bias
        follows = self._settings.depth.observer == "reference"
        measured = self._attitude.acceleration_down(force)
        input_ = self._reference_acceleration if follows else measured
        lean = self._attitude.lean(force)
        if self._thrust_speed is not None:
            note(self._thrust_speed.silence(at_ns))
            rate, depth_rate = self._rate_of(sample), self._depth.rate[0]
            lean = self._thrust_speed.step(lean, rate, depth_rate, dt)
        self._announcements.tell(self._depth.predict(input_, at_ns, lean))
        note(self._predict_horizontal(force, at_ns))

    def _note_motion(self, sample: ImuSample) -> None:
        """Attitude and angular rate, for sensors with a lever arm."""
        if not self._at_origin.needs_motion:
            return
        observer = self._attitude
        attitude = from_north(observer.attitude, observer.compass.offset or 0.0)
        self._at_origin.moved(Moment(sample.stamp_ns, self._rate_of(sample), attitude))

    def _rate_of(self, sample: ImuSample) -> Vec3:
        """[rad/s] Without the gyroscope's bias."""
        (p, q, r), (a, b, c) = sample.angular_rate, self._attitude.gyro_bias
        return p - a, q - b, r - c

    def _predict_horizontal(self, force: Vec3 | None, at_ns: int) -> str | None:
        observer, (depth_rate, depth_rate_std) = self._attitude, self._depth.rate
        motion = VehicleMotion(
            attitude=observer.attitude,
            offset=observer.compass.offset,
            heading_std=observer.north_std,
            specific_force=force,
            yaw_rate=observer.control.yaw_rate,
            depth_rate=depth_rate,
            depth_rate_std=depth_rate_std,
        )
        return self._horizontal.predict(motion, at_ns)

    # Messages.

    def _state(self, now: int, sensor_ns: int) -> VehicleState:
        self._validation.listen(now)
        if self._calibrating is not None:
            left, blocked_by = self._calibrating.seconds_left, self._calibrating.blocked_by
            return state_message.calibrating(
                now, sensor_ns, self._attitude, self._floating_depth, left, blocked_by
            )
        imu = self._hears_imu(now)
        state = state_message.running(
            now, sensor_ns, imu, self._attitude, self._depth, self._horizontal
        )
        self._announcements.see(imu=imu, pressure=state.depth.valid)
        self._announcements.see_frozen(self._validation.frozen)
        troubles = self._troubles(imu=imu, pressure=state.depth.valid)
        return msgspec.structs.replace(state, troubles=troubles) if troubles else state

    def _troubles(self, *, imu: bool, pressure: bool) -> tuple[str, ...]:
        """Names of the counts that say which sensors cannot be used now, and why."""
        found = list(self._validation.troubles)
        for key, used in (("sensor/imu", imu), ("sensor/pressure", pressure)):
            if not used and not any(name.endswith(key) for name in found):
                found.append(f"lost:{key}")
        if self._depth.distrusts_accelerometer and imu:
            found.append("distrusted:sensor/imu")
        if self._attitude.gyroscope.learning:
            found.append("doubted:gyroscope")
        compass = "sensor/magnetometer"
        if self._attitude.compass.field.disturbed and not any(n.endswith(compass) for n in found):
            found.append(f"disturbed:{compass}")
        return tuple(found)

    def _hears_imu(self, now: int) -> bool:
        return self._imu_ns is not None and now - self._imu_ns <= self._settings.imu_patience * 1e9


def start_limits(settings: Settings) -> StartLimits:
    """What the sensors may say before the dive: as much as the observers can use in it."""
    least, most = range_checks.LEAST_PRESSURE, range_checks.MOST_PRESSURE
    late = LATEST_AGE - settings.depth.pressure_latency
    sensors = (
        arrival_check.of_imu(settings.imu_patience),
        arrival_check.of_pressure(least, most, late),
        arrival_check.of_magnetometer(LATEST_AGE),
    )
    return StartLimits(settings.attitude.gravity_tolerance, sensors)
