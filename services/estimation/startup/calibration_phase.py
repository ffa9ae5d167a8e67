"""Calibration before the dive: the vehicle floats at rest, and the pilot sees the time left.

It does not end while a sensor cannot be right: its unit or stamps, the specific force at rest
(first_samples.py), an IMU without usable samples. Each cause is counted, is one
warning, and is in the state as `blocked_by`. Once it is gone, the rest starts anew.
"""

from typing import NamedTuple

from msgspec import UNSET

from messages import events, topics
from messages.events import Event, Outbox, sentence
from messages.message import Estimate
from messages.sensors import ImuSample
from messages.state import VehicleState
from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_observer import AttitudeEstimates
from services.estimation.startup.calibration import (
    MOST_FORCE_STD,
    MOST_RATE_STD,
    Calibrated,
    Calibration,
    CalibrationSettings,
    Countdown,
)
from services.estimation.startup.first_samples import Allowed, ArrivalCheck, wrong_at_rest

PATIENCE_NS = 5_000_000_000  # [ns] without a usable IMU sample; drivers may start a little later
UNREST_NS = 15_000_000_000  # [ns] longer than it takes to lay a vehicle down and let go of it
# [ns] without any rest, or with little: a log begins in mid-dive, or the boat rocks. The dive goes
# on with what is known then.
MOVING_NS, RESTLESS_NS = 2_000_000_000, 4_000_000_000
FELT = 0.06  # [m/s²] of the specific force within half a second: more than noise
LITTLE = 0.3  # [-] of the rest that is needed


class StartLimits(NamedTuple):
    """What sensors may say before the dive."""

    force_tolerance: float  # [m/s²] of the specific force at rest
    sensors: tuple[Allowed, ...]
    needed: tuple[str, ...] = (topics.IMU.key, topics.PRESSURE.key)  # judged before it ends


class CalibrationPhase:
    """Runs the calibration; `outbox` is told what it waits for, and its counts name why no sample
    is usable."""

    def __init__(self, settings: CalibrationSettings, limits: StartLimits, outbox: Outbox) -> None:
        self._settings, self._limits, self._outbox = settings, limits, outbox
        self._arrivals = {allowed.key: ArrivalCheck(allowed) for allowed in limits.sensors}
        self._resting: Event | None = None  # what was wrong with the last rest
        self._finding: Event | None = None  # what blocks now
        self._unrest_ns: int | None = None  # [ns] since when it has not been at rest
        self._used_ns: int | None = None  # [ns] when the newest usable IMU sample was judged
        self._now: int | None = None  # [ns]
        self._first_ns: int | None = None  # [ns] first usable IMU sample
        self._felt_ns: int | None = None  # [ns] when the accelerometer felt a motion
        self._begin()

    @property
    def at_rest(self) -> bool:
        """Nothing has moved the vehicle lately."""
        return self._calibration.unrest is None

    def gives_up(self) -> bool:
        """Whether there is no hope of a rest, and the sensors are as they should be: the dive has
        begun, or the boat rocks."""
        now = self._now
        if now is None or self._first_ns is None or self._wrong_sensor(now) or self._resting:
            return False
        if not self._arrivals[topics.IMU.key].judged:
            return False
        if self._calibration.shaken > FELT:
            self._felt_ns = now
        if self._felt_ns is None or now - self._felt_ns > RESTLESS_NS:
            return False  # only the gyroscope says that it moves: its unit may be wrong
        if self._unrest_ns is not None and now - self._unrest_ns > MOVING_NS:
            return True
        little = self._calibration.seconds_left > (1.0 - LITTLE) * self._settings.still_time
        return little and now - self._first_ns > RESTLESS_NS

    @property
    def blocked_by(self) -> str | None:
        """Name of the count of what keeps the calibration from ending."""
        return None if self._finding is None else self._finding.name

    def state(
        self,
        now: int,
        sensor_ns: int,
        attitude: Quaternion,
        estimates: AttitudeEstimates,
        floating_depth: float,
    ) -> VehicleState:
        """State during calibration: nothing is valid. Depth is `floating_depth` [m] of the origin,
        which is not a measurement."""
        left, blocked_by = self._calibration.seconds_left, self.blocked_by
        return VehicleState(
            stamp_ns=now,
            sensor_ns=sensor_ns,
            phase="calibrating",
            calibration_left=left if blocked_by is None else None,
            blocked_by=blocked_by or UNSET,
            depth=Estimate(floating_depth, 0.5, valid=False),
            depth_rate=Estimate(0.0, 0.5, valid=False),
            depth_acceleration=Estimate(0.0, 1.0, valid=False),
            attitude=attitude,
            roll=estimates.roll,
            pitch=estimates.pitch,
            heading=estimates.heading,
            heading_navigation=estimates.heading_navigation,
            yaw_rate=estimates.yaw_rate,
            surge_velocity=None,
            sway_velocity=None,
            north=None,
            east=None,
            current_north=None,
            current_east=None,
            pressure_age_ms=None,
        )

    def arrived(self, key: str, magnitude: float, stamp_ns: int, now: int) -> None:
        """A sample of a sensor, usable or not, with the magnitude of what it measures."""
        self._arrivals[key].see(magnitude, stamp_ns, now)
        self.judge(now)

    def judge(self, now: int) -> None:
        """Look for what is wrong at `now` [ns]; count and say it once."""
        self._now = now
        if self._used_ns is None:
            self._used_ns = now
        sensor = self._wrong_sensor(now)
        if sensor is not None:
            self._begin()
        self._block(sensor or self._resting or self._lack() or self._unrest(now))

    def imu(self, sample: ImuSample, dt: float) -> Calibrated | None:
        """One usable sample, `dt` [s] after the previous one. Returns the result once it is
        complete."""
        self._used_ns = self._now
        if self._first_ns is None:
            self._first_ns = self._now
        calibration, outbox = self._calibration, self._outbox
        if calibration.imu(sample.angular_rate, sample.specific_force, dt):
            outbox.tell(events.MOVED("calibration"))
            self._countdown, self._resting = Countdown(), None
        result = self._sound(calibration.result())
        line = self._countdown.line(calibration.seconds_left)
        if result is None and line is not None and self._finding is None:
            outbox.say("info", line)
        return result

    def pressure(self, pressure: float) -> None:
        """One validated sample [Pa]."""
        self._calibration.pressure(pressure)

    def drive(self) -> None:
        """The thrusters run: it does not float freely."""
        self._calibration.drive()

    def magnetometer(self, field: Vec3) -> None:
        """One validated sample [T], FRD."""
        self._calibration.magnetometer(field)

    def _begin(self) -> None:
        self._calibration, self._countdown = Calibration(self._settings), Countdown()

    def _sound(self, result: Calibrated | None) -> Calibrated | None:
        """The result of a rest in which nothing was wrong."""
        if result is None or not all(self._arrivals[key].judged for key in self._limits.needed):
            return None
        self._resting = wrong_at_rest(result.specific_force, self._limits.force_tolerance)
        if self._resting is not None:
            self._begin()
            return None
        return result

    def _wrong_sensor(self, now: int) -> Event | None:
        """Unit or stamps of a sensor, or an IMU that cannot be used."""
        found = (check.finding(now) for check in self._arrivals.values())
        return next(filter(None, found), None) or self._unusable(now)

    def _unusable(self, now: int) -> Event | None:
        if self._used_ns is None or now - self._used_ns <= PATIENCE_NS:
            return None
        why = self._why(topics.IMU.key) or f"nothing arrives on {topics.IMU.key}"
        return events.UNUSABLE_IMU(detail=why)

    def _unrest(self, now: int) -> Event | None:
        unrest = self._calibration.unrest
        if unrest is None:
            self._unrest_ns = None
            return None
        if self._unrest_ns is None:
            self._unrest_ns = now
        if now - self._unrest_ns <= UNREST_NS:
            return None
        return events.MOVING_CALIBRATION(
            detail=f"the IMU has read no rest for {UNREST_NS / 1e9:.0f} s: rates of "
            f"{unrest.rate:.2g} rad/s that spread by {unrest.rate_std:.2g}, specific forces that "
            f"spread by {unrest.force_std:.2g} m/s², a pressure that changes by "
            f"{unrest.pressure:.0f} Pa, allowed are {self._settings.largest_bias:g}, "
            f"{MOST_RATE_STD:g} and {MOST_FORCE_STD:g}: keep the vehicle still; if it is, its "
            f"driver must say rad/s, not deg/s",
        )

    def _lack(self) -> Event | None:
        if not self._calibration.lacks_pressure:
            return None
        why = self._why(topics.PRESSURE.key)
        return events.WAITING(topics.PRESSURE.key, detail=why)

    def _why(self, key: str) -> str:
        """The most frequent count of a sensor in words, or nothing."""
        counts = {name: n for name, n in self._outbox.counts.items() if name.endswith(f":{key}")}
        if not counts:
            return ""
        name = max(counts, key=lambda name: counts[name])
        return f"{sentence(name)}, {counts[name]} times"

    def _block(self, finding: Event | None) -> None:
        before, self._finding = self._finding, finding
        if finding is None:
            if before is not None:
                self._outbox.say("info", "calibration can finish now")
            return
        if before is not None and before.name == finding.name:
            return
        self._outbox.tell(finding)
