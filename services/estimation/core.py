"""Sensor samples in, `VehicleState` out: one state for each IMU sample.

What is valid when:

- calibrating: nothing. Depth is given as the depth at which the vehicle floats, because it should
  be floating, but that is not a measurement.
- running: attitude, headings and yaw rate as long as the IMU is heard; depth and depth rate for
  two seconds after an accepted pressure sample.
- IMU silent: nothing new is said at first, and whoever listens sees the state grow old. From
  `imu_patience` on, states come at the topic's rate with everything the IMU gives marked invalid.
  Depth and depth rate go on from pressure alone, with the spread of a filter that has no
  accelerometer. `sensor_ns` stays at the last IMU sample.
"""

from math import degrees, pi, sqrt
from typing import Annotated, Literal

import msgspec

from messages import topics
from messages.message import Estimate, Finite, Ns, Positive
from messages.reference import Reference
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.estimation import plausible
from services.estimation.asked_motion import asked_acceleration
from services.estimation.attitude_filter import AttitudeSettings, Vec3
from services.estimation.attitude_observer import AttitudeObserver
from services.estimation.calibration import (
    Calibrated,
    Calibration,
    CalibrationSettings,
    Countdown,
)
from services.estimation.depth_filter import DepthSettings
from services.estimation.depth_observer import Atmosphere, DepthObserver
from services.estimation.horizontal_hull import Hull
from services.estimation.horizontal_observer import HorizontalObserver, Motion
from services.estimation.horizontal_settings import HorizontalSettings
from services.estimation.resting_bias import RestingBias
from services.estimation.sensor_watch import SensorWatch, WatchSettings
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER, Vehicle
from services.marine.water import Density, density_of

Level = Literal["info", "warning"]
LONGEST_STEP = 0.1  # [s] the newest angular rate says nothing about a longer gap
STANDARD = Atmosphere(ATMOSPHERE, 2000.0)  # weather moves it by about this


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table [estimation] of a vehicle file."""

    water_density: Density = SEA_WATER  # [kg/m³], "fresh", "sea" or { temperature, salinity }
    imu_patience: Annotated[float, msgspec.Meta(ge=0.05, le=5.0)] = 0.2  # [s] of a silent IMU
    depth: DepthSettings = DepthSettings()
    attitude: AttitudeSettings = AttitudeSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    horizontal: HorizontalSettings = HorizontalSettings()
    watch: WatchSettings = WatchSettings()


class Remembered(msgspec.Struct, frozen=True, kw_only=True):
    """What a restart in mid-dive cannot learn again."""

    stamp_ns: Ns  # [ns] when this was true
    atmosphere: Positive  # [Pa]
    atmosphere_std: Positive  # [Pa]
    gyro_bias: tuple[Finite, Finite, Finite]  # [rad/s] FRD
    accelerometer_bias: Finite  # [m/s²] along down
    heading: Finite  # [rad] control heading, accumulated
    heading_std: Positive  # [rad] drift since calibration
    north: Finite | None = None  # [rad] navigation minus control heading
    field_strength: Positive | None = None  # [µT] normal
    field_dip: Finite | None = None  # [rad] normal


class Estimator:
    """The state of the vehicle. `noted` fills with what happened, by name, for the counters, and
    `lines` with words for people; whoever calls empties both."""

    def __init__(
        self,
        settings: Settings,
        floating_depth: float,
        remembered: Remembered | None = None,
        vehicle: Vehicle | None = None,
    ) -> None:
        """Depth [m] of the origin when the vehicle floats; what an earlier run remembered; the
        vehicle, for what thrust and drag tell of the current: without it that stays unknown.

        Raises:
            ValueError: a thruster without direction.
        """
        self.noted: list[str] = []
        self.lines: list[tuple[Level, str]] = []
        self._settings = settings
        self._floating_depth = floating_depth
        self._calibration: Calibration | None = Calibration(settings.calibration)
        self._countdown = Countdown()
        self._asked_for_pressure = False
        self._asked: float | None = None  # [m/s²] acceleration down that the reference asks for
        self._imu_ns: int | None = None  # [ns] newest IMU sample used
        self._attitude = AttitudeObserver(settings.attitude, (0.0, 0.0, 0.0), 0.0, pi)
        self._depth = self._depth_observer(STANDARD, 0.0)
        self._resting = RestingBias(settings.calibration, (0.0, 0.0, 0.0))
        hull = None if vehicle is None else Hull(vehicle, settings.horizontal.wake_share)
        self._horizontal = HorizontalObserver(settings.horizontal, hull)
        self._kept_ns: int | None = None  # [ns] when what was remembered was true
        self._watch()
        if remembered is not None:
            self._continue(remembered)

    # What the sensors say.

    def imu(self, sample: ImuSample, now: int) -> VehicleState | None:
        """The state at this sample. A sample that cannot be used is as good as none."""
        if not self._usable_imu(sample):
            return self.silence(now)
        dt = self._step_to(sample.stamp_ns)
        if self._calibration is not None:
            self._calibrate(self._calibration, sample, dt)
        else:
            self._run(sample, dt)
        return self._state(now)

    def silence(self, now: int) -> VehicleState | None:
        """No IMU sample has come in time: a prediction, or None while it is too early for one."""
        if self._imu_ns is None:
            return None
        if self._calibration is None:
            self._note(self._depth.predict(None, now))
            self._note(self._predict_horizontal(None, now))
        if self._hears_imu(now):
            return None
        self.noted.append("predicted:state")
        return self._state(now)

    def pressure(self, sample: PressureSample) -> None:
        if not plausible.pressure(sample):
            self.noted.append("implausible:sensor/pressure")
        elif not self._pressure_watch.usable((sample.pressure,), sample.stamp_ns):
            return
        elif self._calibration is not None:
            self._calibration.pressure(sample.pressure)
        else:
            self._note(self._depth.pressure(sample.pressure, sample.stamp_ns))

    def magnetometer(self, sample: MagnetometerSample) -> None:
        if not plausible.magnetometer(sample):
            self.noted.append("implausible:sensor/magnetometer")
        elif not self._field_watch.usable(sample.field, sample.stamp_ns):
            return
        elif self._calibration is not None:
            self._calibration.magnetometer(sample.field)
        else:
            self._note(self._attitude.magnetometer(sample.field, sample.stamp_ns))

    def dvl(self, sample: DvlSample) -> None:
        if not plausible.dvl(sample):
            self.noted.append("implausible:sensor/dvl")
        elif not self._dvl_watch.usable(sample.velocity, sample.stamp_ns):
            return
        elif self._calibration is None:
            self._note(self._horizontal.dvl(sample))

    def usbl(self, sample: UsblSample) -> None:
        if not plausible.usbl(sample):
            self.noted.append("implausible:sensor/usbl")
        elif not self._usbl_watch.usable((sample.north, sample.east), sample.stamp_ns):
            return
        elif self._calibration is None:
            self._note(self._horizontal.usbl(sample))

    def reference(self, newest: Reference | None) -> None:
        """The fresh reference, for the depth observer of that name; None: there is none."""
        self._asked = asked_acceleration(newest)

    def actuation(self, sample: Actuation) -> None:
        """What the thrusters really do: with the hull's drag, the only thing that tells the
        current."""
        self._note(self._horizontal.actuation(sample))

    @property
    def horizontal_surprise(self) -> dict[str, float]:
        """Newest normalised innovation squared of "dvl" and "usbl", for whoever judges them."""
        return self._horizontal.surprise

    def remembered(self, now: int) -> Remembered | None:
        """What to keep for a restart; None while there is nothing worth keeping."""
        if self._calibration is not None:
            return None
        control, compass = self._attitude.control, self._attitude.compass
        return Remembered(
            stamp_ns=now,
            atmosphere=self._depth.atmosphere.pressure,
            atmosphere_std=self._depth.atmosphere.std,
            gyro_bias=self._attitude.gyro_bias,
            accelerometer_bias=self._depth.bias,
            heading=control.heading,
            heading_std=control.std,
            north=compass.offset,
            field_strength=compass.field.strength,
            field_dip=compass.field.dip,
        )

    # How the state moves on.

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
        self.noted.append("gap:sensor/imu")
        self._resting.moved()
        self._attitude.blind(dt - LONGEST_STEP)
        return LONGEST_STEP

    def _usable_imu(self, sample: ImuSample) -> bool:
        if plausible.saturated(sample):
            self.noted.append("saturated:sensor/imu")
            return False
        if not plausible.imu(sample):
            self.noted.append("implausible:sensor/imu")
            return False
        content = (*sample.specific_force, *sample.angular_rate)
        return self._imu_watch.usable(content, sample.stamp_ns)

    def _run(self, sample: ImuSample, dt: float) -> None:
        force, at_ns = sample.specific_force, sample.stamp_ns
        self._note(self._attitude.step(sample.angular_rate, force, dt))
        self._note(self._resting.imu(sample.angular_rate, force, dt))
        self._attitude.gyro_bias = self._resting.bias
        measured = self._attitude.acceleration_down(force)
        follows = self._settings.depth.observer == "reference"
        input_ = self._asked if follows else measured
        self._note(self._depth.predict(input_, at_ns, self._attitude.forward_down))
        self._note(self._predict_horizontal(force, at_ns))

    def _predict_horizontal(self, force: Vec3 | None, at_ns: int) -> str | None:
        seen, north = self._attitude, self._attitude.compass.offset
        _, depth_rate, _ = self._depth.estimates(at_ns)
        return self._horizontal.predict(
            Motion(
                attitude=seen.attitude,
                offset=north,
                heading_std=seen.north_std,
                specific_force=force,
                yaw_rate=seen.control.yaw_rate,
                depth_rate=depth_rate.value,
                depth_rate_std=depth_rate.std,
            ),
            at_ns,
        )

    def _calibrate(self, calibration: Calibration, sample: ImuSample, dt: float) -> None:
        self._attitude.start(sample.specific_force)
        if calibration.imu(sample.angular_rate, sample.specific_force, dt):
            self.noted.append("moved:calibration")
            self._warn("the vehicle moves: calibration waits until it is still")
            self._countdown = Countdown()
        learnt = calibration.result()
        if learnt is not None:
            self._begin(learnt, sample.stamp_ns)
        elif calibration.lacks_pressure and not self._asked_for_pressure:
            self._asked_for_pressure = True
            self.noted.append("waiting:sensor/pressure")
            self._warn("calibration waits for the pressure sensor")
        elif (line := self._countdown.line(calibration.seconds_left)) is not None:
            self.lines.append(("info", line))

    def _begin(self, learnt: Calibrated, at_ns: int) -> None:
        """From calibrating to running."""
        self._calibration = None
        settings, atmosphere = self._settings, self._atmosphere(learnt)
        heading = 0.0 if learnt.heading is None else learnt.heading
        self._attitude = AttitudeObserver(settings.attitude, learnt.gyro_bias, heading, 0.0)
        self._attitude.start(learnt.specific_force)
        self._resting = RestingBias(settings.calibration, learnt.gyro_bias)
        if learnt.field is not None and not self._attitude.agree(at_ns, learnt.field):
            self.noted.append("disturbed:sensor/magnetometer")
            self._warn("the magnetic field here is not the Earth's: the compass is not used")
        self._depth = self._depth_observer(atmosphere, learnt.accelerometer_bias)
        self._depth.start(learnt.pressure, learnt.pressures, at_ns)
        bias = ", ".join(f"{degrees(rate):+.3f}" for rate in learnt.gyro_bias)
        air = f"{atmosphere.pressure / 100.0:.1f} hPa"
        self.lines.append(("info", f"calibrated: gyroscope bias {bias} deg/s, atmosphere {air}"))

    def _atmosphere(self, learnt: Calibrated) -> Atmosphere:
        """The air above the floating vehicle."""
        water = density_of(self._settings.water_density) * GRAVITY * self._floating_depth
        if plausible.atmosphere(learnt.pressure - water):
            std = self._settings.depth.pressure_std / sqrt(learnt.pressures)
            return Atmosphere(learnt.pressure - water, std)
        self.noted.append("implausible:atmosphere")
        self._warn(
            f"{learnt.pressure / 100.0:.0f} hPa is not the air above a floating vehicle: "
            f"the standard atmosphere is used, depth may be wrong by 0.3 m"
        )
        return STANDARD

    def _continue(self, kept: Remembered) -> None:
        """Go on with the dive: no calibration under water."""
        self._calibration = None
        self._kept_ns = kept.stamp_ns
        atmosphere = Atmosphere(kept.atmosphere, kept.atmosphere_std)
        self._attitude = AttitudeObserver(
            self._settings.attitude, kept.gyro_bias, kept.heading, min(pi, kept.heading_std)
        )
        self._resting = RestingBias(self._settings.calibration, kept.gyro_bias)
        strength, dip = kept.field_strength, kept.field_dip
        if kept.north is not None and strength is not None and dip is not None:
            self._attitude.compass.go_on(kept.north, strength, dip)
        self._depth = self._depth_observer(atmosphere, kept.accelerometer_bias)
        self._warn(
            f"goes on with the dive: atmosphere {kept.atmosphere / 100.0:.1f} hPa, "
            f"heading {degrees(kept.heading):.0f} deg from before the restart"
        )

    def _watch(self) -> None:
        """One watch for each sensor."""
        limits, noted, like = self._settings.watch, self.noted, self._settings.watch.rate_tolerance
        imu, field, pressure = topics.IMU, topics.MAGNETOMETER, topics.PRESSURE
        self._imu_watch = SensorWatch(imu.key, limits.imu_frozen, noted, imu.hz, like)
        self._field_watch = SensorWatch(
            field.key,
            limits.magnetometer_frozen,
            noted,
            field.hz,
            like,
            limits.magnetometer_silent,
        )
        self._pressure_watch = SensorWatch(
            pressure.key, limits.pressure_frozen, noted, limits.pressure_rate, like
        )
        self._dvl_watch = SensorWatch(
            topics.DVL.key, limits.dvl_frozen, noted, silent_after=limits.dvl_silent
        )
        self._usbl_watch = SensorWatch(
            topics.USBL.key, limits.usbl_frozen, noted, silent_after=limits.usbl_silent
        )
        self._may_fall_silent = self._field_watch, self._dvl_watch, self._usbl_watch

    def _depth_observer(self, atmosphere: Atmosphere, bias: float) -> DepthObserver:
        density = density_of(self._settings.water_density)
        return DepthObserver(self._settings.depth, atmosphere, density, bias)

    # What is said.

    def _state(self, now: int) -> VehicleState:
        assert self._imu_ns is not None
        for watch in self._may_fall_silent:
            watch.listen(now)
        running = self._calibration is None
        known = running and self._hears_imu(now)
        attitude = self._attitude
        depth, rate, acceleration = self._depth.estimates(now) if running else self._floating()
        roll, pitch = attitude.tilt(known)
        place = self._horizontal.position(now) or (None, None)
        over_ground = self._horizontal.velocity(now) or (None, None)
        current = self._horizontal.current(now) or (None, None)
        return VehicleState(
            stamp_ns=now,
            sensor_ns=self._imu_ns,
            phase="running" if running else "calibrating",
            calibration_left=self._calibration.seconds_left if self._calibration else None,
            depth=depth,
            depth_rate=rate,
            depth_acceleration=acceleration,
            attitude=attitude.attitude,
            roll=roll,
            pitch=pitch,
            heading=attitude.heading(known),
            heading_navigation=attitude.heading_navigation(known, now),
            yaw_rate=attitude.yaw_rate(known),
            surge_velocity=over_ground[0],
            sway_velocity=over_ground[1],
            north=place[0],
            east=place[1],
            current_north=current[0],
            current_east=current[1],
            pressure_age_ms=self._depth.pressure_age_ms(now),
        )

    def _floating(self) -> tuple[Estimate, Estimate, Estimate]:
        return (
            Estimate(self._floating_depth, 0.5, valid=False),
            Estimate(0.0, 0.5, valid=False),
            Estimate(0.0, 1.0, valid=False),
        )

    def _hears_imu(self, now: int) -> bool:
        return self._imu_ns is not None and now - self._imu_ns <= self._settings.imu_patience * 1e9

    def _note(self, what: str | None) -> None:
        if what is not None:
            self.noted.append(what)

    def _warn(self, text: str) -> None:
        self.lines.append(("warning", text))
