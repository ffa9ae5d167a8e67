"""Is the gyroscope right, and what to do until it is: who contradicts whom, about attitude.

The bias has changed (`GyroCheck`). The accelerometer is right about down on average. If the
attitude has turned away from it by more than any motion explains, the gyroscope has: its bias has
changed by more than the attitude filter's small correction can hold. Then the bias is learnt anew
from the accelerometer, by a proportional and an integral correction (Mahony et al. 2008, eq. 48),
until they agree.

Gravity says nothing about a turn about the vertical. So after such a change the heading is unknown
until the magnetometer has measured it and the bias (`YawBias`). If the bias is what it was when the
gyroscope was last trusted, it was a long acceleration, or the gyroscope is mended.

There were no samples (`UnseenTurn`). The gyroscope measures turns, not the heading. After a silence
in which the vehicle may have turned far, the heading is unknown until the magnetometer has measured
the normal field for a while.

The vehicle is at rest (`RestingBias`): it measures its bias as well as at the calibration.
"""

from math import hypot, sqrt

from messages import events
from messages.events import Event
from messages.units import Quaternion, Vec3
from services.estimation.attitude.heading import UNKNOWN_TURN, wrapped
from services.marine.attitude import down_in_body
from services.marine.vehicle import GRAVITY

MEMORY = 2.0  # [s] of the mean deviation
# [rad] of the mean. Simulated dives reach 0.09, in tight circles under full thrust; a bias of
# 0.1 rad/s takes a second and a half.
MOST = 0.09
# [s] More of it for each rad/s of a lasting turn: the accelerometer is off by speed times yaw rate.
# A hull with less drag than in its file circles at 1.5 m/s and 1.05 rad/s, which is 0.16 rad.
TURNING, MOST_TURNING = 0.075, 0.1  # [rad]
AGREED, AGREED_FOR = 0.02, 6.0  # [rad], [s] of the mean: learnt
# As above, of a shorter mean: a bias of 0.5 rad/s takes half a second. Simulated dives with all
# sticks thrown over every 1.5 s reach 0.21. Much more would come too late: a vehicle that already
# follows the wrong depth accelerates too much to compare with gravity.
QUICK_MEMORY, QUICK_MOST = 0.1, 0.25  # [s], [rad]
MOST_SHARE = 0.2  # [-] of one sample in it: a mean is of several, at 20 a second too
# [-] times the acceleration that the thrust makes expect may explain a deviation: a hull with 30 %
# less mass, half of the drag and 20 % more thrust than in its file has 1.9 times as much.
EXPLAINED = 2.5
SPRING, INTEGRAL = 1.0, 0.25  # [1/s], [1/s²] critically damped
CHANGED = 0.004  # [rad/s] a change of the bias that the filter's correction would not have held

YAW_MEMORY, YAW_AGREED_FOR = 1.0, 4.0  # [s] as above, of the offset to the magnetic heading
MOST_UNSEEN = 0.2  # [rad] possible unseen turn that the heading's std alone may say
MEASURED_FOR = 1.0  # [s] of the mean

BLOCK = 50  # IMU samples judged together at rest; half a second
# While running, the bias is updated at rest; the limits of rest are tighter than at the start.
REST_TIME = 3.0  # [s] still without a break before it counts
REST_RATE_STD = 0.004  # [rad/s] within half a second, sensor noise included
REST_FORCE_STD = 0.06  # [m/s²] likewise
REST_CHANGE = 0.0017  # [rad/s] 0.1 deg/s; a bias does not change by more at once
REST_MEMORY = 60.0  # [s] longest averaging time of the running mean


class GyroCheck:
    """Compares the attitude's down with the accelerometer's, in the body's x and y."""

    __slots__ = (
        "_agreed_for",
        "_before",
        "_felt_x",
        "_felt_y",
        "_quick_felt_x",
        "_quick_felt_y",
        "_quick_x",
        "_quick_y",
        "_turn",
        "_x",
        "_y",
        "learning",
        "limit",
        "newest",
        "patient",
        "ratio",
        "stepped",
    )

    def __init__(self) -> None:
        self.learning = False  # the bias is being learnt anew
        self.stepped = False  # it has changed: the heading is unknown
        self.patient = False  # the longer mean alone doubts it
        self._x = self._y = 0.0  # [rad] mean deviation about x and y
        self._quick_x = self._quick_y = 0.0  # [rad] the same over a shorter time
        self._felt_x = self._felt_y = 0.0  # [rad] the same of what the thrust makes expect
        self._quick_felt_x = self._quick_felt_y = 0.0
        self._turn = 0.0  # [rad/s] mean yaw rate, over the longer time
        self.newest = 0.0, 0.0  # [rad] deviation about x and y
        self.limit = MOST  # [rad] of the mean deviation, now
        self.ratio = 0.0  # [-] of the mean deviation, squared, to its limit; beyond 1: doubted
        self._agreed_for = 0.0  # [s]
        self._before: Vec3 = (0.0, 0.0, 0.0)  # [rad/s] bias when last trusted

    @property
    def trusted(self) -> bool:
        """Whether the gyroscope measures turns about the vertical."""
        return not (self.learning or self.stepped)

    def trust(self) -> Event:
        """The magnetometer has measured the heading and the bias. Returns an event to count."""
        self.stepped = False
        return events.TRUSTED_GYROSCOPE()

    def rested(self, bias: Vec3) -> None:
        """A rest has measured the bias [rad/s], which so is the one to be trusted."""
        self._before = bias

    def step(
        self,
        q: Quaternion,
        force: Vec3,
        bias: Vec3,
        dt: float,
        turn: float = 0.0,
        felt: tuple[float, float] = (0.0, 0.0),
        slack: float = 0.0,
        tilt_std: float = 0.0,
    ) -> tuple[Vec3, Event | None]:
        """Take in a specific force [m/s²] `dt` [s] after the previous one, at a yaw rate `turn`
        [rad/s]. Returns the bias [rad/s], and an event to count.

        Args:
            felt: [m/s²] forward and starboard, what the thrust makes expect.
            slack: [rad] by which the accelerometer is known to be off more than usually.
            tilt_std: [rad] of the attitude.
        """
        fx, fy, fz = force
        x, y, z = down_in_body(q)
        size = sqrt(fx * fx + fy * fy + fz * fz)
        # Measured down, -f / |f|, crossed with the attitude's: the turn from this one to that one.
        ex, ey = (fz * y - fy * z) / size, (fx * z - fz * x) / size
        share = dt / MEMORY
        self._x += share * (ex - self._x)
        self._y += share * (ey - self._y)
        self._turn += share * (turn - self._turn)
        # An acceleration forward is taken for a turn about y, one to starboard for one about -x.
        mx, my = -felt[1] / GRAVITY, felt[0] / GRAVITY
        self._felt_x += share * (mx - self._felt_x)
        self._felt_y += share * (my - self._felt_y)
        deviation = unexplained(self._x, self._y, self._felt_x, self._felt_y)
        self.newest = ex, ey
        if self.learning:
            self.ratio = (deviation / self.limit) ** 2
            return self._learn(deviation - slack, bias, dt)
        share = min(MOST_SHARE, dt / QUICK_MEMORY)
        self._quick_x += share * (ex - self._quick_x)
        self._quick_y += share * (ey - self._quick_y)
        self._quick_felt_x += share * (mx - self._quick_felt_x)
        self._quick_felt_y += share * (my - self._quick_felt_y)
        quick = unexplained(self._quick_x, self._quick_y, self._quick_felt_x, self._quick_felt_y)
        most = MOST + min(MOST_TURNING, TURNING * abs(self._turn)) + slack
        most, quick_most = most + 2.0 * tilt_std, QUICK_MOST + slack + 2.0 * tilt_std
        self.limit, self.ratio = most, max((deviation / most) ** 2, (quick / quick_most) ** 2)
        if deviation <= most and (quick <= quick_most or self.patient):
            return bias, None
        self._quick_x = self._quick_y = 0.0
        if self.trusted:
            self._before = bias
        self.learning, self._agreed_for = True, 0.0
        return bias, events.DOUBTED_GYROSCOPE()

    def _learn(self, deviation: float, bias: Vec3, dt: float) -> tuple[Vec3, Event | None]:
        self._agreed_for = self._agreed_for + dt if deviation < AGREED else 0.0
        if self._agreed_for < AGREED_FOR:
            return bias, None
        self.learning = False
        if hypot(bias[0] - self._before[0], bias[1] - self._before[1]) <= CHANGED:
            self.stepped = False
            return self._before, events.TRUSTED_GYROSCOPE()
        self.stepped = True
        return bias, events.STEPPED_GYROSCOPE()


def unexplained(x: float, y: float, felt_x: float, felt_y: float) -> float:
    """[rad] What is left of a deviation without the best share, from none to `EXPLAINED`, of what
    the thrust makes expect."""
    size = felt_x * felt_x + felt_y * felt_y
    if size == 0.0:
        return sqrt(x * x + y * y)
    share = max(0.0, min(EXPLAINED, (x * felt_x + y * felt_y) / size))
    return hypot(x - share * felt_x, y - share * felt_y)


class YawBias:
    """The bias about the vertical, learnt in motion: the offset from the gyroscope's heading to the
    magnetic one is constant if the bias is right. The same corrections follow the offset and move
    the bias until it is.

    From the moment the gyroscope is doubted until it is trusted again."""

    __slots__ = ("_agreed_for", "_mean", "offset")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self.offset: float | None = None  # [rad] magnetic minus control heading; None: not measured
        self._mean = 0.0  # [rad]
        self._agreed_for = 0.0  # [s]

    @property
    def learnt(self) -> bool:
        return self._agreed_for >= YAW_AGREED_FOR

    def miss(self) -> None:
        """A sample whose field is not the Earth's, as the attitude says: no agreement."""
        self._agreed_for = 0.0

    def step(self, measured: float, dt: float) -> float:
        """Take in an offset [rad] measured `dt` [s] after the last one. Returns the change of the
        bias [rad/s] about the body's z."""
        if self.offset is None:
            self.offset = wrapped(measured)
            return 0.0
        innovation = wrapped(measured - self.offset)
        self.offset = wrapped(self.offset + SPRING * innovation * dt)
        self._mean += min(1.0, dt / YAW_MEMORY) * (innovation - self._mean)
        self._agreed_for = self._agreed_for + dt if abs(self._mean) < AGREED else 0.0
        return -INTEGRAL * innovation * dt


class UnseenTurn:
    """`matters` from a long silence on, until the heading has been measured."""

    __slots__ = ("_first", "_rest", "_samples", "_seconds", "_turn")

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The heading is known."""
        self._turn = 0.0  # [rad] possible
        self._begin()

    def _begin(self) -> None:
        self._first: float | None = None  # [rad] first offset measured
        self._rest, self._samples = 0.0, 0  # [rad] sum of the differences from it
        self._seconds = 0.0  # [s] since then

    @property
    def matters(self) -> bool:
        return self._turn > MOST_UNSEEN

    def blind(self, seconds: float) -> None:
        """No IMU samples for this long [s]."""
        self._turn += UNKNOWN_TURN * seconds
        self._begin()

    def measure(self, offset: float | None, dt: float) -> float | None:
        """Take in the offset [rad] from control to magnetic heading, `dt` [s] after the last one;
        None: the field is not the normal one. Returns their mean [rad] once it is known."""
        if offset is None:
            self._begin()
            return None
        if self._first is None:
            self._first = offset
        else:
            self._seconds += dt
        self._rest += wrapped(offset - self._first)
        self._samples += 1
        if self._seconds < MEASURED_FOR:
            return None
        return wrapped(self._first + self._rest / self._samples)


class Mean:
    """Mean and standard deviation of vectors of one length."""

    def __init__(self, length: int) -> None:
        self.count = 0
        self._sums = [0.0] * length
        self._squares = [0.0] * length

    def add(self, values: tuple[float, ...]) -> None:
        self.count += 1
        for i, value in enumerate(values):
            self._sums[i] += value
            self._squares[i] += value * value

    def add_all(self, other: "Mean") -> None:
        self.count += other.count
        self._sums = [a + b for a, b in zip(self._sums, other._sums, strict=True)]
        self._squares = [a + b for a, b in zip(self._squares, other._squares, strict=True)]

    def mean(self) -> list[float]:
        return [total / self.count for total in self._sums]

    def std(self) -> list[float]:
        means = zip(self._squares, self.mean(), strict=True)
        return [max(0.0, square / self.count - mean * mean) ** 0.5 for square, mean in means]


class RestingBias:
    """Updates of the gyroscope bias while the vehicle is at rest: a running mean of the rate, in
    blocks of half a second.

    Start-up averaging leaves an error of noise / √seconds, and the bias drifts. A vehicle that
    still floats, or lies on the sea floor, measures its bias as well as at start-up. Thrusters and
    moving water exceed the sensor's own noise, so only true rest is averaged. A steady turn slower
    than `REST_CHANGE` cannot be told from a bias; so the average is slow.

    A block counts only if the next one is at rest too, because motion begins slowly.
    """

    def __init__(self, bias: Vec3, still_time: float, largest: float) -> None:
        """Start with this bias [rad/s], with the weight of a calibration of `still_time` [s];
        `largest` [rad/s]: a mean rate beyond it is a turn."""
        self.bias = bias
        self._still_time, self._largest = still_time, largest
        self._known_for = still_time  # [s] of rest in the mean
        self._still_for = REST_TIME  # [s] calibration has just seen rest
        self._block, self._seconds = Mean(6), 0.0
        self._waiting: Vec3 | None = None  # mean of the block before

    def imu(self, rate: Vec3, specific_force: Vec3, dt: float) -> Event | None:
        """One sample, bias included [rad/s, m/s²]. Returns an event to tell."""
        self._seconds += dt
        self._block.add((*rate, *specific_force))
        if self._block.count < BLOCK:
            return None
        block, seconds = self._block, self._seconds
        self._block, self._seconds = Mean(6), 0.0
        p, q, r, *_ = block.mean()
        if not self._is_still(block, (p, q, r)):
            self._still_for, self._waiting = 0.0, None
            return None
        began = self._still_for < REST_TIME
        self._still_for += seconds
        if self._still_for < REST_TIME:
            return None
        if self._waiting is not None:
            self._learn(self._waiting, seconds)
        self._waiting = (p, q, r)
        return events.RESTING("gyro_bias") if began else None

    def relearn(self, bias: Vec3) -> None:
        """Go on with another bias [rad/s], with the weight of the calibration."""
        self.bias, self._known_for = bias, self._still_time
        self.moved()

    def moved(self) -> None:
        """A gap in the samples counts as motion."""
        self._block, self._seconds = Mean(6), 0.0
        self._still_for, self._waiting = 0.0, None

    def _learn(self, mean: Vec3, seconds: float) -> None:
        self._known_for = min(REST_MEMORY, self._known_for + seconds)
        share, (a, b, c), (p, q, r) = seconds / self._known_for, self.bias, mean
        self.bias = (a + share * (p - a), b + share * (q - b), c + share * (r - c))

    def _is_still(self, block: Mean, mean: Vec3) -> bool:
        spread = block.std()
        if max(spread[:3]) > REST_RATE_STD or max(spread[3:]) > REST_FORCE_STD:
            return False
        change = max(abs(new - old) for new, old in zip(mean, self.bias, strict=True))
        return change <= REST_CHANGE and max(map(abs, mean)) <= self._largest
