"""From IMU and magnetometer samples to attitude, headings and yaw rate, each with its std."""

from math import hypot, isfinite, pi

from messages.message import Estimate
from messages.units import Quaternion, Vec3
from services.estimation.attitude.attitude_filter import AttitudeFilter, AttitudeSettings
from services.estimation.attitude.gyro_check import GyroCheck
from services.estimation.attitude.heading import (
    Compass,
    ControlHeading,
    down_along,
    horizontal,
    strength_and_dip,
    wrapped,
)
from services.estimation.attitude.unseen_turn import UnseenTurn
from services.estimation.attitude.yaw_bias import YawBias
from services.estimation.lean import Lean
from services.marine.attitude import to_euler, to_world
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY

STEEPEST = 1.4  # [rad] of pitch; closer to the vertical, heading is invalid
LARGE_TILT_STD = 0.04  # [rad] beyond it, the tilt is corrected faster
UNSURE = 0.1  # [rad] 1σ of a tilt taken from the accelerometer of a moving vehicle
UNSURE_AFTER = 0.2  # [rad/s] growth of the tilt's std without IMU samples
FORWARD, STARBOARD = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)  # body
COMPASS_HOLD_NS = 60_000_000_000  # [ns] north stays valid on the gyroscope for this long


class AttitudeObserver:
    """Attitude, control heading and navigation heading of a calibrated vehicle."""

    def __init__(self, settings: AttitudeSettings, gyro_bias: Vec3, heading: float, std: float):
        """
        Args:
            gyro_bias: [rad/s] FRD.
            heading, std: [rad] control heading at the start and its standard deviation. It counts
                turns since calibration, so `std` is gyroscope drift, not the uncertainty of north.
        """
        self.gyro_bias = gyro_bias
        self.control = ControlHeading(settings, heading, std)
        self.compass = Compass(settings)
        self._settings = settings
        self._filter = AttitudeFilter(settings)
        self.gyroscope = GyroCheck()
        self._yaw_bias = YawBias()
        self._unseen = UnseenTurn()
        self._started = False
        self._rate: Vec3 | None = None  # [rad/s] newest, bias removed
        self._euler: Vec3 = (0.0, 0.0, wrapped(heading))
        self._tilt_std = settings.tilt_std
        self._field_ns: int | None = None  # [ns] newest magnetometer sample
        self._compass_ns: int | None = None  # [ns] newest of them used

    @property
    def attitude(self) -> Quaternion:
        """q_NB as w, x, y, z; yaw is the control heading."""
        return self._filter.q

    def start(self, specific_force: Vec3) -> None:
        """Take roll and pitch from the specific force [m/s²]; the heading stays."""
        self._filter.start(specific_force, self.control.heading)
        self._euler = to_euler(self._filter.q)
        self._started = True

    def agree(self, at_ns: int, field: Vec3) -> bool:
        """Align both headings now [ns]: the control heading is the bearing of this field [T], FRD,
        measured at rest. False: the field cannot be the Earth's, north is not known."""
        if not self.compass.field.learn(*strength_and_dip(self._filter.q, field)):
            return False
        self.compass.offset = 0.0
        self._compass_ns = at_ns
        return True

    def step(self, angular_rate: Vec3, specific_force: Vec3, dt: float) -> str | None:
        """One IMU sample [rad/s, m/s²], `dt` [s] after the previous one. Returns an event."""
        if not self._started:
            self.start(specific_force)
            self._tilt_std = UNSURE
        p, q, r = angular_rate
        bp, bq, br = self.gyro_bias
        rate = (p - bp, q - bq, r - br)
        # The mean of both ends: the newest sample alone would lead by half a step.
        before, self._rate = self._rate or rate, rate
        (a, b, c), (d, e, f) = before, rate
        mean = (0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f))
        check, beta, event = self.gyroscope, self._gain, None
        if check.learning:
            mean = check.corrected(mean)
        used = self._filter.step(mean, specific_force, dt, beta)
        if used:
            q = self._filter.q
            self.gyro_bias, event = check.step(q, specific_force, self.gyro_bias, dt, rate[2])
        if event == "trusted:gyroscope":
            self._trust()
        elif not check.trusted:
            self.control.blind(dt)
            self.compass.blind(dt)
        self._euler = to_euler(self._filter.q)
        self.control.step(self._euler[2], rate[2], dt)
        self.compass.drift(dt)
        self._spread(beta if used else None, dt)
        if not self._is_sound():
            return self._reset(specific_force)
        return event if used else "accelerating:sensor/imu"

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self.control.blind(seconds)
        self.compass.blind(seconds)
        if self.compass.offset is not None:  # else nothing can tell
            self._unseen.blind(seconds)
        if self._unseen.matters:
            self._started = False  # the accelerometer alone knows the tilt better
        self._tilt_std = min(pi, self._tilt_std + UNSURE_AFTER * seconds)

    def magnetometer(self, field: Vec3, stamp_ns: int) -> str | None:
        """One validated sample [T], FRD. Returns an event to count."""
        if not self._started:
            return None
        before, self._field_ns = self._field_ns, stamp_ns
        dt = 0.0 if before is None else min(0.1, max(0.0, (stamp_ns - before) * 1e-9))
        if not self.gyroscope.trusted:
            return self._relearn(field, stamp_ns, dt)
        if self._unseen.matters:
            return self._find(field, stamp_ns, dt)
        event = self.compass.step(self._filter.q, field, dt)
        if event != "steep" and self.compass.field.trusted:
            self._compass_ns = stamp_ns
        return None if event is None else f"{event}:sensor/magnetometer"

    def _relearn(self, field: Vec3, stamp_ns: int, dt: float) -> str | None:
        """While the gyroscope is not trusted, the magnetometer measures its bias about z."""
        measured = self.compass.measure(self._filter.q, field)
        if measured is None:
            self._yaw_bias.miss()
            return None
        x, y, z = self.gyro_bias
        self.gyro_bias = x, y, z + self._yaw_bias.step(measured, dt)
        if self.gyroscope.learning or not self._yaw_bias.learnt:
            return None
        self._compass_ns = stamp_ns
        self._trust()
        return self.gyroscope.trust()

    def _trust(self) -> None:
        """The gyroscope measures turns again. North, if it was measured meanwhile, is known as well
        as the compass is; otherwise the vehicle may have turned unseen."""
        if self._yaw_bias.offset is not None:
            self._correct(self._yaw_bias.offset)
        self._yaw_bias.forget()

    def _find(self, field: Vec3, stamp_ns: int, dt: float) -> str | None:
        """After a silence of the IMU, the magnetometer measures the heading."""
        offset = self._unseen.measure(self.compass.measure(self._filter.q, field), dt)
        if offset is None:
            return None
        self._compass_ns = stamp_ns
        self._correct(offset)
        return "found:heading"

    def _correct(self, offset: float) -> None:
        """The compass has measured this offset [rad]. What it differs by from the one before is a
        turn that the gyroscope did not measure."""
        std, before = self._settings.compass_std, self.compass.offset
        turned = 0.0 if before is None else wrapped(offset - before)
        self._filter.turn(turned)
        self._euler = to_euler(self._filter.q)
        self.control.turn(turned, std)
        self.compass.restart(offset if before is None else before)
        self._unseen.forget()

    @property
    def knows_turns(self) -> bool:
        """Whether the heading includes every turn since calibration, as far as its std says."""
        return self.gyroscope.trusted and not self._unseen.matters

    @property
    def relearns(self) -> bool:
        """Whether the bias is learnt anew, in motion."""
        by_compass = not self.gyroscope.trusted and self._yaw_bias.offset is not None
        return self.gyroscope.learning or by_compass

    def acceleration_down(self, specific_force: Vec3) -> float:
        """[m/s²] NED, of a specific force [m/s²] in FRD, accelerometer bias included."""
        return down_along(self._filter.q, specific_force) + GRAVITY

    def lean(self, specific_force: Vec3) -> Lean:
        """How the accelerometer lies in the world, with its newest sample [m/s²], FRD."""
        q = self._filter.q
        return Lean(
            to_world(q, FORWARD),
            to_world(q, STARBOARD),
            horizontal(q, specific_force),
            self._filter.levelled,
            self._tilt_std,
        )

    def tilt(self, valid: bool) -> tuple[Estimate, Estimate]:
        """Roll and pitch [rad]."""
        roll, pitch, _ = self._euler
        return Estimate(roll, self._tilt_std, valid), Estimate(pitch, self._tilt_std, valid)

    def heading(self, valid: bool) -> Estimate:
        """Control heading [rad], accumulated past ±π."""
        upright = abs(self._euler[1]) < STEEPEST
        std = min(pi, self._settings.heading_std + self.control.std)
        if not self.knows_turns:
            valid, std = False, pi
        return Estimate(self.control.heading, std, valid and upright)

    def heading_navigation(self, valid: bool, now: int) -> Estimate | None:
        """Navigation heading [rad] in (-π, π]; None without a magnetometer."""
        if self.compass.offset is None or self._compass_ns is None:
            return None
        recent = now - self._compass_ns <= COMPASS_HOLD_NS and abs(self._euler[1]) < STEEPEST
        heading = wrapped(self.control.heading + self.compass.offset)
        valid = valid and self.knows_turns
        return Estimate(heading, self.compass.std, valid and recent)

    @property
    def north_std(self) -> float:
        """[rad] 1σ of the heading from north; of the control heading without a compass."""
        if not self.knows_turns:
            return pi
        return self.control.std if self.compass.offset is None else self.compass.std

    def yaw_rate(self, valid: bool) -> Estimate:
        """[rad/s] about the body's down axis."""
        valid = valid and self.gyroscope.trusted
        std = hypot(self._settings.yaw_rate_std, self.control.lag)
        return Estimate(self.control.yaw_rate, std, valid)

    @property
    def _gain(self) -> float:
        """[rad/s] Low while the tilt is known: the accelerometer is only right on average."""
        s = self._settings
        if self.gyroscope.learning:  # which corrects the tilt, and must see all of the bias
            return s.correction
        return s.recovery if self._tilt_std > LARGE_TILT_STD else s.correction

    def _spread(self, beta: float | None, dt: float) -> None:
        """Update the tilt's std; `beta` [rad/s] is the gain used, None: no correction."""
        least, drift = self._settings.tilt_std, self._settings.tilt_drift
        if self.gyroscope.learning:
            self._tilt_std = UNSURE
        elif beta is None:
            self._tilt_std = min(pi, self._tilt_std + drift * dt)
        else:
            self._tilt_std = max(least, self._tilt_std - beta * dt)

    def _is_sound(self) -> bool:
        return isfinite(plain_sum(self._filter.q) + self.control.heading + self.control.yaw_rate)

    def _reset(self, specific_force: Vec3) -> str:
        """Start again after a number that is not finite."""
        self.control = ControlHeading(self._settings, 0.0, pi)
        self.start(specific_force)
        self._tilt_std = UNSURE
        return "not_finite:attitude"
