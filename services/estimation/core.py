"""Sensor samples in, `VehicleState` out: one state for each IMU sample, or for the newest of
several that come at once.

    IMU            attitude and headings, depth between pressure samples, place between fixes
    pressure       depth
    magnetometer   north
    DVL, USBL      place and velocity over the ground
    actuation      with the hull's drag, the current
    reference      depth, for the one observer that asks for it

Samples are of the sensors' own axes and places; inside this class they are of the
vehicle's origin, in body axes (services/vehicle/mounting.py).

While calibrating, the first three are only averaged. What is valid when: status.py.
"""

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
from services.estimation.checkpoint import EstimationCheckpoint, worth_keeping
from services.estimation.checks.sample_validation import SampleValidation
from services.estimation.depth.reference_input import asked_acceleration
from services.estimation.events import Events
from services.estimation.horizontal.horizontal_observer import (
    HorizontalObserver,
    VehicleMotion,
    from_north,
)
from services.estimation.horizontal.hull_model import HullModel
from services.estimation.initialisation import Observers
from services.estimation.settings import Settings
from services.estimation.startup.calibration_phase import CalibrationPhase
from services.marine.mounting import Mounting
from services.marine.vehicle import Vehicle
from services.marine.water import density_of
from services.vehicle.mounting import AtOrigin, Moment

LONGEST_STEP = 0.1  # [s] the newest angular rate says nothing about a longer gap


class Estimator:
    """The state of the vehicle. `events` fills with what happened, by name, for the counters, and
    `lines` with words for people; whoever calls empties both."""

    def __init__(
        self,
        settings: Settings,
        floating_depth: float,
        checkpoint: EstimationCheckpoint | None = None,
        vehicle: Vehicle | None = None,
    ) -> None:
        """Depth [m] of the origin when the vehicle floats; what an earlier run remembered; the
        vehicle, for what thrust and drag tell of the current: without it that stays unknown.

        Raises:
            ValueError: a thruster without direction.
        """
        self._events = Events()
        self.events, self.lines = self._events.names, self._events.lines
        self._settings = settings
        self._floating_depth = floating_depth
        self._validation = SampleValidation(settings.watch, self.events)
        mounting = Mounting() if vehicle is None else vehicle.mounting
        self._at_origin = AtOrigin(mounting, density_of(settings.water_density))
        self._asked: float | None = None  # [m/s²] acceleration down that the reference asks for
        self._imu_ns: int | None = None  # [ns] newest IMU sample used
        self._kept_ns: int | None = None  # [ns] when what was remembered was true
        hull = None if vehicle is None else HullModel(vehicle, settings.horizontal.wake_share)
        self._horizontal = HorizontalObserver(settings.horizontal, hull)
        self._calibrating: CalibrationPhase | None = None
        if checkpoint is None:
            self._calibrating = CalibrationPhase(settings.calibration, self._events)
            self._take(initialisation.unknown(settings))
        else:
            self._kept_ns = checkpoint.stamp_ns
            self._take(initialisation.going_on(settings, checkpoint, self._events))

    # What the sensors say.

    def imu(self, sample: ImuSample, now: int) -> VehicleState | None:
        """The state at this sample. A sample that cannot be used is as good as none."""
        return self._state(now, sample.stamp_ns) if self.follow(sample) else self.silence(now)

    def follow(self, sample: ImuSample) -> bool:
        """Move on to this sample, as `imu` does, without a state; for a sample that newer ones
        have overtaken already. False: it cannot be used."""
        if not self._validation.imu(sample):
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
        """No IMU sample has come in time: a prediction, or None while it is too early for one."""
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
        if not self._validation.pressure(sample):
            return
        sample = self._at_origin.pressure(sample)
        if self._calibrating is not None:
            self._calibrating.pressure(sample.pressure)
        else:
            self._events.note(self._depth.pressure(sample.pressure, sample.stamp_ns))

    def magnetometer(self, sample: MagnetometerSample) -> None:
        if not self._validation.magnetometer(sample):
            return
        sample = self._at_origin.magnetometer(sample)
        if self._calibrating is not None:
            self._calibrating.magnetometer(sample.field)
        else:
            self._events.note(self._attitude.magnetometer(sample.field, sample.stamp_ns))

    def dvl(self, sample: DvlSample) -> None:
        if self._validation.dvl(sample) and self._calibrating is None:
            self._events.note(self._horizontal.dvl(self._at_origin.dvl(sample)))

    def usbl(self, sample: UsblSample) -> None:
        if self._validation.usbl(sample) and self._calibrating is None:
            self._events.note(self._horizontal.usbl(self._at_origin.usbl(sample)))

    def actuation(self, sample: Actuation) -> None:
        """What the thrusters really do: with the hull's drag, the only thing that tells the
        current."""
        self._events.note(self._horizontal.actuation(sample))

    def reference(self, newest: Reference | None) -> None:
        """The fresh reference, for the depth observer of that name; None: there is none."""
        self._asked = asked_acceleration(newest)

    # What else is asked of it.

    @property
    def horizontal_surprise(self) -> dict[str, float]:
        """Newest normalised innovation squared of "dvl" and "usbl", for whoever judges them."""
        return self._horizontal.surprise

    def checkpoint(self, now: int) -> EstimationCheckpoint | None:
        """What to keep for a restart; None while there is nothing worth keeping."""
        if self._calibrating is not None:
            return None
        return worth_keeping(self._attitude, self._depth, now)

    # How the state moves on.

    def _take(self, observers: Observers) -> None:
        self._attitude, self._resting, self._depth = observers

    def _step_to(self, stamp_ns: int) -> float:
        """[s] To integrate over, from the sample before to this one."""
        before, self._imu_ns = self._imu_ns, stamp_ns
        if before is None:
            if self._kept_ns is not None:
                self._attitude.blind(abs(stamp_ns - self._kept_ns) * 1e-9)
            return 0.0
        dt = (stamp_ns - before) * 1e-9
        if dt <= LONGEST_STEP:
            return dt
        self._events.note("gap:sensor/imu")
        self._resting.moved()
        self._attitude.blind(dt - LONGEST_STEP)
        return LONGEST_STEP

    def _calibrate(self, calibrating: CalibrationPhase, sample: ImuSample, dt: float) -> None:
        self._attitude.start(sample.specific_force)
        learnt = calibrating.imu(sample, dt)
        if learnt is not None:
            self._calibrating = None
            depth, at_ns = self._floating_depth, sample.stamp_ns
            self._take(
                initialisation.calibrated(self._settings, learnt, depth, at_ns, self._events)
            )

    def _run(self, sample: ImuSample, dt: float) -> None:
        force, at_ns, note = sample.specific_force, sample.stamp_ns, self._events.note
        note(self._attitude.step(sample.angular_rate, force, dt))
        note(self._resting.imu(sample.angular_rate, force, dt))
        self._attitude.gyro_bias = self._resting.bias
        follows = self._settings.depth.observer == "reference"
        input_ = self._asked if follows else self._attitude.acceleration_down(force)
        note(self._depth.predict(input_, at_ns, self._attitude.lean))
        note(self._predict_horizontal(force, at_ns))

    def _note_motion(self, sample: ImuSample) -> None:
        """How the vehicle lies and turns, for sensors that sit on an arm."""
        if not self._at_origin.curious:
            return
        seen, (p, q, r) = self._attitude, sample.angular_rate
        a, b, c = seen.gyro_bias
        attitude = from_north(seen.attitude, seen.compass.offset or 0.0)
        self._at_origin.moved(Moment(sample.stamp_ns, (p - a, q - b, r - c), attitude))

    def _predict_horizontal(self, force: Vec3 | None, at_ns: int) -> str | None:
        seen, (depth_rate, depth_rate_std) = self._attitude, self._depth.rate
        motion = VehicleMotion(
            attitude=seen.attitude,
            offset=seen.compass.offset,
            heading_std=seen.north_std,
            specific_force=force,
            yaw_rate=seen.control.yaw_rate,
            depth_rate=depth_rate,
            depth_rate_std=depth_rate_std,
        )
        return self._horizontal.predict(motion, at_ns)

    # What is said.

    def _state(self, now: int, sensor_ns: int) -> VehicleState:
        self._validation.listen(now)
        if self._calibrating is not None:
            left = self._calibrating.seconds_left
            return state_message.calibrating(
                now, sensor_ns, self._attitude, self._floating_depth, left
            )
        return state_message.running(
            now, sensor_ns, self._hears_imu(now), self._attitude, self._depth, self._horizontal
        )

    def _hears_imu(self, now: int) -> bool:
        return self._imu_ns is not None and now - self._imu_ns <= self._settings.imu_patience * 1e9
