"""From a sensor's position and axes to the vehicle's origin and axes, and back.

A driver publishes raw samples, in the sensor's own axes and position. Estimation corrects them by
the calibration and transforms them on arrival (`AtOrigin`), `reference` their altitudes
(`AltitudeAtOrigin`); the simulator uses the inverse of the transformation. Samples of a sensor at
the origin along the body's axes are unchanged.

Rigid-body kinematics (Fossen 2011, §2.2 and eq. 7.8): a point at r has the velocity v + ω × r and
the specific force f + ω × (ω × r) + ω̇ × r.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable
from math import exp
from typing import Generic, NamedTuple, TypeVar

from msgspec.structs import replace

from messages.sensors import (
    AltitudeSample,
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.units import Vec3
from services.marine.attitude import (
    LEVEL,
    Quaternion,
    cross,
    minus,
    plus,
    to_body,
    to_world,
    turned,
)
from services.marine.mounting import (
    ALONG,
    NO_BIAS,
    NO_IRON,
    NO_SCALE,
    ORIGIN,
    Mount,
    Mounting,
    Rotation,
    SensorCalibration,
    Turned,
)
from services.marine.vehicle import GRAVITY

SMOOTHING = 0.02  # [s] of the gyroscope before it is differenced; typically two samples
LONGEST_STEP = 0.1  # [s] no differencing over a longer gap
REPEATED = 0.3  # [m] of the vehicle's depth through which no altitude repeats to the last digit
REMEMBERED_NS = 10_000_000_000  # [ns] no sample may be older: twice what estimation uses
AT_REST: Vec3 = (0.0, 0.0, 0.0)
UNCORRECTED = SensorCalibration()
S = TypeVar("S", DvlSample, AltitudeSample)


class MountedAxes:
    """R_BS of a sensor, made exactly orthonormal."""

    def __init__(self, turned: Turned) -> None:
        self.along = turned.rotation == ALONG
        self._R: Rotation = ALONG if self.along else _nearest_rotation(turned.rotation)

    def to_body(self, v_S: Vec3) -> Vec3:
        """v_B = R_BS v_S."""
        if self.along:
            return v_S
        (a, b, c), (d, e, f), (g, h, i) = self._R
        x, y, z = v_S
        return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z

    def to_sensor(self, v_B: Vec3) -> Vec3:
        """v_S = R_SB v_B."""
        if self.along:
            return v_B
        (a, b, c), (d, e, f), (g, h, i) = self._R
        x, y, z = v_B
        return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def force_at(r: Vec3, rate: Vec3, acceleration: Vec3) -> Vec3:
    """[m/s²] Specific force at r [m] minus that at the origin, for an angular rate [rad/s] and its
    derivative [rad/s²]; all in body axes."""
    return plus(cross(rate, cross(rate, r)), cross(acceleration, r))


class Moment(NamedTuple):
    """Attitude and angular rate at one instant."""

    stamp_ns: int
    rate: Vec3 = AT_REST  # [rad/s] body
    attitude: Quaternion = LEVEL  # q_NB


class AtOrigin:
    """Transforms samples of mounted sensors to the vehicle's origin and body axes.

    With a lever arm, pressure and fixes need the attitude at the time of the sample, and a DVL the
    angular rate too; with a declination, a compass needs the attitude: call `moved` after each IMU
    sample, if `needs_motion`.
    """

    def __init__(
        self, mounting: Mounting, density: float, calibration: SensorCalibration = UNCORRECTED
    ) -> None:
        """Water density [kg/m³]; the calibration corrects samples before they are turned."""
        self._calibration = c = calibration
        imu = c.accelerometer_bias, c.accelerometer_scale, c.gyro_bias
        self._corrects_imu = imu != (NO_BIAS, NO_SCALE, NO_BIAS)
        self._corrects_field = (c.magnetometer_bias, c.magnetometer_matrix) != (NO_BIAS, NO_IRON)
        self._imu, self._arm = MountedAxes(mounting.imu), mounting.imu.position
        self._field = MountedAxes(mounting.magnetometer)
        self._dvl, self._dvl_arm = MountedAxes(mounting.dvl), mounting.dvl.position
        self._pressure_arm, self._usbl_arm = mounting.pressure.position, mounting.usbl.position
        self._per_metre = density * GRAVITY  # [Pa/m]
        self._turning = Turning()
        self._moments = deque[Moment]()
        arms = self._dvl_arm, self._pressure_arm, self._usbl_arm
        self.needs_motion = any(arm != ORIGIN for arm in arms) or c.declination != 0.0

    def moved(self, moment: Moment) -> None:
        """Store the newest attitude and angular rate."""
        if self._moments and moment.stamp_ns <= self._moments[-1].stamp_ns:
            self._moments.clear()
        self._moments.append(moment)
        while moment.stamp_ns - self._moments[0].stamp_ns > REMEMBERED_NS:
            self._moments.popleft()

    def imu(self, sample: ImuSample) -> ImuSample:
        if not self._corrects_imu and self._imu.along and self._arm == ORIGIN:
            return sample
        rate, force = sample.angular_rate, sample.specific_force
        if self._corrects_imu:
            (fx, fy, fz), (bx, by, bz) = force, self._calibration.accelerometer_bias
            (p, q, r), (dp, dq, dr) = rate, self._calibration.gyro_bias
            sx, sy, sz = self._calibration.accelerometer_scale
            force = (sx * (fx - bx), sy * (fy - by), sz * (fz - bz))
            rate = (p - dp, q - dq, r - dr)
        rate, force = self._imu.to_body(rate), self._imu.to_body(force)
        if self._arm != ORIGIN:
            acceleration = self._turning.acceleration(rate, sample.stamp_ns)
            force = minus(force, force_at(self._arm, rate, acceleration))
        return replace(sample, angular_rate=rate, specific_force=force)

    def magnetometer(self, sample: MagnetometerSample) -> MagnetometerSample:
        declination = self._calibration.declination
        if not self._corrects_field and self._field.along and declination == 0.0:
            return sample
        field = self._calibration.field(sample.field) if self._corrects_field else sample.field
        field = self._field.to_body(field)
        if declination != 0.0:
            q_NB = self._at(sample.stamp_ns).attitude
            north, east, down = to_world(q_NB, field)
            north, east = turned((north, east), -declination)
            field = to_body(q_NB, (north, east, down))
        return replace(sample, field=field)

    def pressure(self, sample: PressureSample) -> PressureSample:
        offset = self._calibration.pressure_offset
        if offset == 0.0 and self._pressure_arm == ORIGIN:
            return sample
        pressure = sample.pressure - offset
        if self._pressure_arm != ORIGIN:
            deeper = to_world(self._at(sample.stamp_ns).attitude, self._pressure_arm)[2]  # [m]
            pressure -= self._per_metre * deeper
        return replace(sample, pressure=pressure)

    def dvl(self, sample: DvlSample) -> DvlSample:
        scale = self._calibration.dvl_scale
        if self._dvl.along and self._dvl_arm == ORIGIN and scale == 1.0:
            return sample
        moment, velocity = self._at(sample.stamp_ns), sample.velocity
        if velocity is not None:
            x, y, z = velocity
            velocity = self._dvl.to_body((scale * x, scale * y, scale * z))
            velocity = minus(velocity, cross(moment.rate, self._dvl_arm))
        return replace(sample, velocity=velocity)

    def usbl(self, sample: UsblSample) -> UsblSample:
        if self._usbl_arm == ORIGIN:
            return sample
        north, east, _ = to_world(self._at(sample.stamp_ns).attitude, self._usbl_arm)
        return replace(sample, north=sample.north - north, east=sample.east - east)

    def _at(self, stamp_ns: int) -> Moment:
        """The newest moment not after this time; else the oldest."""
        if not self._moments:
            return Moment(stamp_ns)
        after = bisect_right(self._moments, stamp_ns, key=lambda moment: moment.stamp_ns)
        return self._moments[max(0, after - 1)]


class AltitudeAtOrigin(Generic[S]):
    """Altitudes of one sensor as those of the vehicle's origin, by the attitude when a sample is
    first seen; none of a sensor that repeats one to the last digit while the depth changes."""

    def __init__(self, arm: Vec3, frozen: Callable[[], None] = lambda: None) -> None:
        """
        Args:
            arm: [m] of the sensor.
            frozen: called whenever it begins to repeat one.
        """
        self._arm, self._tell = arm, frozen
        self._raw: S | None = None  # newest
        self._there: S | None = None  # the same at the origin
        self._since: tuple[float, float] | None = None  # [m] its altitude, and the depth at first
        self._frozen = False

    def of(self, sample: S | None, attitude: Quaternion | None, depth: float | None) -> S | None:
        """
        Args:
            attitude: None: not known, taken as level.
            depth: [m] of the vehicle; None: not known.
        """
        if sample is None or sample.altitude is None:
            return sample
        if sample is not self._raw:
            self._raw, altitude = sample, None
            if not self._is_frozen(sample.altitude, depth):
                lower = self._arm[2] if attitude is None else to_world(attitude, self._arm)[2]
                altitude = max(0.0, sample.altitude + lower)
            self._there = replace(sample, altitude=altitude)
        return self._there

    def _is_frozen(self, altitude: float, depth: float | None) -> bool:
        if depth is None or self._since is None or altitude != self._since[0]:
            self._since, self._frozen = None if depth is None else (altitude, depth), False
            return False
        if not self._frozen and abs(depth - self._since[1]) > REPEATED:
            self._frozen = True  # until it says another one
            self._tell()
        return self._frozen


class Turning:
    """ω̇ by differencing a lightly smoothed angular rate."""

    def __init__(self) -> None:
        self._smooth: Vec3 | None = None  # [rad/s]
        self._stamp_ns = 0

    def acceleration(self, rate: Vec3, stamp_ns: int) -> Vec3:
        """[rad/s²] At the newest sample; zero for the first, and after a gap."""
        before, dt = self._smooth, (stamp_ns - self._stamp_ns) / 1e9
        self._stamp_ns = stamp_ns
        if before is None or not 0.0 < dt <= LONGEST_STEP:
            self._smooth = rate
            return AT_REST
        share = 1.0 - exp(-dt / SMOOTHING)
        step = minus(rate, before)
        step = (share * step[0], share * step[1], share * step[2])
        self._smooth = plus(before, step)
        return step[0] / dt, step[1] / dt, step[2] / dt


def place_of(arm: Vec3, position: Vec3, q_NB: Quaternion) -> Vec3:
    """[m] NED position of a sensor mounted at `arm` [m]."""
    return position if arm == ORIGIN else plus(position, to_world(q_NB, arm))


def measured_there(
    mount: Mount, axes: MountedAxes, force: Vec3, rate: Vec3, acceleration: Vec3
) -> tuple[Vec3, Vec3]:
    """Specific force [m/s²] and angular rate [rad/s] at the origin, as a mounted IMU measures them.

    Args:
        acceleration: [rad/s²] derivative of the angular rate, in body axes.
    """
    if mount.position != ORIGIN:
        force = plus(force, force_at(mount.position, rate, acceleration))
    return axes.to_sensor(force), axes.to_sensor(rate)


def seen_there(mount: Mount, axes: MountedAxes, velocity: Vec3, rate: Vec3) -> Vec3:
    """Velocity [m/s] of the origin, as a mounted DVL measures it."""
    if mount.position != ORIGIN:
        velocity = plus(velocity, cross(rate, mount.position))
    return axes.to_sensor(velocity)


def _nearest_rotation(R: Rotation) -> Rotation:
    """By the polar decomposition; what is written in a file has a few digits."""
    import numpy as np  # as much as the rest of a service's imports: few sensors are turned

    u, _, vt = np.linalg.svd(np.array(R))
    a, b, c = (u @ vt).tolist()
    return (a[0], a[1], a[2]), (b[0], b[1], b[2]), (c[0], c[1], c[2])
