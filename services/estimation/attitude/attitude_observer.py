"""From IMU and magnetometer samples to attitude, headings and yaw rate, each with its std."""

from math import hypot, inf, isfinite, pi, sqrt
from typing import NamedTuple

from messages import events, topics
from messages.events import Event
from messages.message import Estimate
from messages.units import Vec3
from services.estimation.aiding import Aiding
from services.estimation.attitude.attitude_filter import AttitudeFilter, AttitudeSettings
from services.estimation.attitude.gyroscope import GyroCheck, UnseenTurn, YawBias
from services.estimation.attitude.heading import (
    Compass,
    ControlHeading,
    down_along,
    horizontal,
    strength_and_dip,
    wrapped,
)
from services.estimation.attitude.tilt_spread import MEMORY as TILT_MEMORY
from services.estimation.attitude.tilt_spread import UNKNOWN_BIAS, TiltSpread
from services.estimation.attitude_axes import AttitudeAxes
from services.marine.attitude import to_euler, to_world
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY

STEEPEST = 1.4  # [rad] of pitch; closer to the vertical, heading is invalid
STEEP, DISTURBED = (row(topics.MAGNETOMETER.key) for row in (events.STEEP, events.DISTURBED))
ACCELERATING, DOUBTED = events.ACCELERATING(topics.IMU.key), events.DOUBTED_GYROSCOPE()
LENGTH_MEMORY = 0.5  # [s] of the mean length of the specific force
UNFELT = 0.15  # [m/s²] 1σ of an acceleration that nothing makes expect
DOUBTFUL = 0.5  # [-] of an expected acceleration that may be wrong
OFF_CENTRE = 0.1  # [m] from the centre of the turn to where the IMU is thought to be
CLIP = 2.0  # [σ] a larger deviation counts as that
LEVELLED_STD = 0.002  # [rad] of a tilt taken from the accelerometer at rest, beside its own error
CALIBRATED_BIAS = 1e-4  # [rad/s] 1σ of the gyroscope's bias after rest
ROUGH_BIAS = 0.1  # [rad/s] of a gyroscope that has never rested
UNSURE_BIAS = 0.03  # [rad/s] and without it
RESTART = 0.3  # [rad] of the tilt: after a silence, it is taken from the accelerometer anew
UNSURE = 0.1  # [rad] 1σ of a tilt taken from the accelerometer of a moving vehicle
UNSURE_AFTER = 0.2  # [rad/s] growth of the tilt's std without IMU samples
SLOW_INTEGRAL = 0.01  # [1/s²] with the compass' ten seconds: settles in about as long
HEADING_STD = 0.002  # [rad] of the control heading while pitching, without drift
FORWARD, STARBOARD = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)  # body
COMPASS_HOLD_NS = 60_000_000_000  # [ns] north stays valid on the gyroscope for this long


class ImuNoise(NamedTuple):
    """Variance of one number of one sample, now."""

    force: float  # [m²/s⁴]
    rate: float  # [rad²/s²]


QUIET = ImuNoise(0.0, 0.0)


class AttitudeEstimates(NamedTuple):
    roll: Estimate  # [rad]
    pitch: Estimate  # [rad]
    heading: Estimate  # [rad] control heading, accumulated past ±π
    heading_navigation: Estimate | None  # [rad] in (-π, π]; None without a magnetometer
    yaw_rate: Estimate  # [rad/s] about the body's down axis


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
        self.filter = AttitudeFilter()  # its q_NB has the control heading as yaw
        self.gyroscope = GyroCheck()
        self.compass_aiding = Aiding("compass", "rad")
        # Of the accelerometer, its magnitude at rest; of the gyroscope, the attitude's down beside
        # the accelerometer's.
        self._force_aiding = Aiding("accelerometer", "m/s²")
        self._down_aiding = Aiding("gyroscope_roll", "rad"), Aiding("gyroscope_pitch", "rad")
        self._yaw_bias = YawBias()
        self._unseen = UnseenTurn()
        self._started = False
        self._rough = False  # the gyroscope's bias about the vertical is not known
        self._rate: Vec3 | None = None  # [rad/s] newest, bias removed
        self._spread = UNFELT  # [m/s²] 1σ by which the accelerometer may be off from gravity
        self._length = GRAVITY  # [m/s²] mean magnitude of the specific force
        self._euler: Vec3 = (0.0, 0.0, wrapped(heading))
        self.tilt = TiltSpread(LEVELLED_STD, CALIBRATED_BIAS)
        self._field_ns: int | None = None  # [ns] newest magnetometer sample
        self._compass_ns: int | None = None  # [ns] newest of them used

    def start(self, specific_force: Vec3) -> None:
        """Take roll and pitch from the specific force [m/s²]; the heading stays."""
        self.filter.start(specific_force, self.control.heading)
        self._euler = to_euler(self.filter.q)
        self._started = True

    def begin_roughly(self, specific_force: Vec3) -> None:
        """As `start`, of a vehicle that may move and whose gyroscope is not calibrated."""
        self.start(specific_force)
        self.tilt = TiltSpread(UNSURE, ROUGH_BIAS)
        self._rough = True
        self.control.begin_roughly()

    def agree(self, at_ns: int, field: Vec3) -> bool:
        """Align both headings now [ns]: the control heading is the bearing of this field [T], FRD,
        measured at rest. False: the field cannot be the Earth's, north is not known."""
        if not self.compass.field.learn(*strength_and_dip(self.filter.q, field)):
            return False
        self.compass.offset = 0.0
        self._compass_ns = at_ns
        return True

    def step(
        self,
        angular_rate: Vec3,
        specific_force: Vec3,
        dt: float,
        noise: ImuNoise = QUIET,
        felt: tuple[float, float] = (0.0, 0.0),
    ) -> Event | None:
        """One IMU sample [rad/s, m/s²], `dt` [s] after the previous one. Returns an event.

        Args:
            noise: of one sample, now.
            felt: [m/s²] forward and starboard, the acceleration that the thrust makes expect.
        """
        if not self._started:
            self.start(specific_force)
            self.tilt = TiltSpread(UNSURE, UNSURE_BIAS)
        p, q, r = angular_rate
        bp, bq, br = self.gyro_bias
        rate = (p - bp, q - bq, r - br)
        # The mean of both ends: the newest sample alone would lead by half a step.
        before, self._rate = self._rate or rate, rate
        (a, b, c), (d, e, f) = before, rate
        mean = (0.5 * (a + d), 0.5 * (b + e), 0.5 * (c + f))
        check, tilt, event = self.gyroscope, self.tilt, None
        turning = sqrt(p * p + q * q + r * r)  # a turn about one axis leaks into the others
        # A turn that changes between two samples is not quite their mean's.
        between = 0.25 * dt * sqrt((d - a) ** 2 + (e - b) ** 2 + (f - c) ** 2)
        tilt.predict(dt, turning, noise.rate, between * between, check.learning)
        if check.learning:  # what is expected of a wrong attitude is wrong
            felt = (0.0, 0.0)
        # What the accelerometer is worth: how far its mean is from gravity's magnitude, how wrong
        # the expected acceleration may be, and its noise.
        fx, fy, fz = specific_force
        expected = fx - felt[0], fy - felt[1], fz
        share = min(1.0, dt / LENGTH_MEMORY)
        self._length += share * (sqrt(fx * fx + fy * fy + fz * fz) - self._length)
        swing = OFF_CENTRE * (p * p + q * q + r * r)
        spread = self._spread = hypot(
            UNFELT, DOUBTFUL * felt[0], DOUBTFUL * felt[1], self._length - GRAVITY, swing
        )
        lasting = 2.0 * TILT_MEMORY * spread * spread / dt if dt > 0.0 else inf
        variance = (lasting + noise.force) / (GRAVITY * GRAVITY)
        most = pi if check.learning else CLIP * hypot(spread / GRAVITY, tilt.std)
        slack = CLIP * (spread - UNFELT + 0.3 * sqrt(noise.force)) / GRAVITY
        gain, bias_gain = tilt.correct(variance)
        ex, ey, ez = self.filter.step(mean, expected, dt, gain, most)
        a, b, c = self.gyro_bias
        self.gyro_bias = a + bias_gain * ex, b + bias_gain * ey, c + bias_gain * ez
        self.gyro_bias, event = check.step(
            self.filter.q, specific_force, self.gyro_bias, dt, rate[2], felt, slack, tilt.std
        )
        if event == events.DOUBTED_GYROSCOPE():
            tilt.doubt(UNSURE, UNKNOWN_BIAS)
        if event == events.TRUSTED_GYROSCOPE():
            tilt.rest(CALIBRATED_BIAS)
            self._trust()
        elif not check.trusted:
            self.control.blind(dt)
            self.compass.blind(dt)
        self._euler = to_euler(self.filter.q)
        self.control.step(self._euler[2], rate[2], dt, noise.rate)
        self.compass.drift(dt, noise.rate)
        if isfinite(plain_sum(self.filter.q) + self.control.heading + self.control.yaw_rate):
            return event
        # Start again after a number that is not finite.
        self.control = ControlHeading(self._settings, 0.0, pi)
        self.start(specific_force)
        self.tilt = TiltSpread(UNSURE, UNSURE_BIAS)
        return events.NOT_FINITE("attitude")

    def note(self, at_ns: int) -> None:
        """Keep what was made of the newest IMU sample: the accelerometer's weight beside that of a
        vehicle that does not accelerate, and where the gyroscope is doubted."""
        check, limit = self.gyroscope, self._settings.gravity_tolerance
        force = self.filter.force
        off, variance = force - GRAVITY, (limit / 3.0) ** 2
        weight = (UNFELT / self._spread) ** 2
        self._force_aiding.verdict = ACCELERATING.name if abs(off) > limit else None
        self._force_aiding.compare(
            at_ns, force, off, variance, (off / limit) ** 2, used=weight * off
        )
        doubted = DOUBTED if check.learning else None
        verdict = doubted or (events.STEPPED_GYROSCOPE() if check.stepped else None)
        variance, tilts = (check.limit / 3.0) ** 2, self._euler
        for k, aiding in enumerate(self._down_aiding):
            off = check.newest[k]
            aiding.verdict = None if verdict is None else verdict.name
            aiding.compare(at_ns, tilts[k] + off, off, variance, check.ratio, rejected=doubted)

    @property
    def tilt_std(self) -> float:
        """[rad] of roll and pitch: as the filter knows, and what the accelerometer is off by; no
        less than `UNSURE` while the gyroscope is doubted."""
        std = hypot(self.tilt.std, self._settings.tilt_std)
        return max(UNSURE, std) if self.gyroscope.learning else std

    def rested(self, bias: Vec3) -> None:
        """The bias [rad/s] has been measured at rest."""
        self.gyro_bias = bias
        self.tilt.rest(CALIBRATED_BIAS)
        self._calibrated()

    def _calibrated(self) -> None:
        """The gyroscope measures turns about the vertical, too."""
        if self._rough:
            self._rough = self.gyroscope.patient = False
            self.control.calibrated()
            self._yaw_bias.forget()

    @property
    def imu_aiding(self) -> tuple[Aiding, ...]:
        """What was made of the IMU."""
        return self._force_aiding, *self._down_aiding

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self.control.blind(seconds)
        self.compass.blind(seconds)
        if self.compass.offset is not None:  # else nothing can tell
            self._unseen.blind(seconds)
        self.tilt.doubt(UNSURE_AFTER * seconds)
        if self.tilt.std > RESTART:
            self._started = False  # the accelerometer alone knows the tilt better

    def magnetometer(self, field: Vec3, stamp_ns: int) -> Event | None:
        """One validated sample [T], FRD. Returns an event to count."""
        if not self._started:
            return None
        before, self._field_ns = self._field_ns, stamp_ns
        dt = 0.0 if before is None else min(0.1, max(0.0, (stamp_ns - before) * 1e-9))
        compass, aiding = self.compass, self.compass_aiding
        if not self.gyroscope.trusted or self._unseen.matters:
            aiding.refuse(DOUBTED, stamp_ns)
            find = self._find if self.gyroscope.trusted else self._relearn
            return find(field, stamp_ns, dt)
        event = compass.step(self.filter.q, field, dt)
        if self._rough and compass.field.trusted:
            self._find_yaw_bias(compass.measured, compass.innovation, dt)
        if event is events.STEEP:
            aiding.refuse(STEEP, stamp_ns)
        else:
            seen = stamp_ns, compass.measured, compass.innovation, compass.std**2, compass.ratio
            aiding.compare(*seen, rejected=None if compass.field.trusted else DISTURBED)
        if event is not events.STEEP and self.compass.field.trusted:
            self._compass_ns = stamp_ns
        return None if event is None else event(topics.MAGNETOMETER.key)

    def _find_yaw_bias(self, measured: float, innovation: float, dt: float) -> None:
        """Without a rest, the magnetometer measures the bias about z: at once, and then slowly
        what is left of it. The offset [rad] to the magnetic heading that is `measured`, and its
        difference from the filter's."""
        x, y, z = self.gyro_bias
        if self._yaw_bias.learnt:
            self.control.calibrated()
            self.gyro_bias = x, y, z - SLOW_INTEGRAL * innovation * dt
        else:
            self.gyro_bias = x, y, z + self._yaw_bias.step(measured, dt)

    def _relearn(self, field: Vec3, stamp_ns: int, dt: float) -> Event | None:
        """While the gyroscope is not trusted, the magnetometer measures its bias about z."""
        measured = self.compass.measure(self.filter.q, field)
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

    def _find(self, field: Vec3, stamp_ns: int, dt: float) -> Event | None:
        """After a silence of the IMU, the magnetometer measures the heading."""
        offset = self._unseen.measure(self.compass.measure(self.filter.q, field), dt)
        if offset is None:
            return None
        self._compass_ns = stamp_ns
        self._correct(offset)
        return events.FOUND_HEADING()

    def _correct(self, offset: float) -> None:
        """The compass has measured this offset [rad]. What it differs by from the one before is a
        turn that the gyroscope did not measure."""
        std, before = self._settings.compass_std, self.compass.offset
        turned = 0.0 if before is None else wrapped(offset - before)
        self.filter.turn(turned)
        self._euler = to_euler(self.filter.q)
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

    def axes(self, specific_force: Vec3, noise: float = 0.0) -> AttitudeAxes:
        """How the accelerometer lies in the world, with its newest sample [m/s²], FRD, and the
        spectral density of its vibration [m²/s³]."""
        q = self.filter.q
        return AttitudeAxes(
            forward=to_world(q, FORWARD),
            starboard=to_world(q, STARBOARD),
            acceleration=down_along(q, specific_force) + GRAVITY,
            force=horizontal(q, specific_force),
            levelled=self.filter.levelled,
            tilt_std=self.tilt_std,
            noise=noise,
        )

    def estimates(self, valid: bool, now: int) -> AttitudeEstimates:
        """At `now` [ns]; `valid`: the IMU is heard."""
        (roll, pitch, _), control, compass = self._euler, self.control, self.compass
        upright, north = abs(pitch) < STEEPEST, None
        knows = self.knows_turns
        std = min(pi, HEADING_STD + control.std) if knows else pi
        if compass.offset is not None and self._compass_ns is not None:
            recent = now - self._compass_ns <= COMPASS_HOLD_NS and upright
            value = wrapped(control.heading + compass.offset)
            north = Estimate(value, compass.std, valid and knows and recent)
        turn_std = hypot(self._settings.yaw_rate_std, control.lag)
        return AttitudeEstimates(
            Estimate(roll, self.tilt_std, valid),
            Estimate(pitch, self.tilt_std, valid),
            Estimate(control.heading, std, valid and knows and upright),
            north,
            Estimate(control.yaw_rate, turn_std, valid and self.gyroscope.trusted),
        )

    @property
    def north_std(self) -> float:
        """[rad] 1σ of the heading from north; of the control heading without a compass."""
        if not self.knows_turns:
            return pi
        return self.control.std if self.compass.offset is None else self.compass.std
