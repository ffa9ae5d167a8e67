"""Is the gyroscope's bias still what it was?

The accelerometer is right about down on average. If the attitude has turned away from it by more
than any motion explains, the gyroscope has: its bias has changed by more than the attitude filter's
small correction can hold. Then the bias is learnt anew from the accelerometer, by a proportional
and an integral correction (Mahony et al. 2008, eq. 48), until they agree.

Gravity says nothing about a turn about the vertical. So after such a change the heading is unknown
until the magnetometer has measured it and the bias (yaw_bias.py). If the bias is what it was when
the gyroscope was last trusted, it was a long acceleration, or the gyroscope is mended.
"""

from math import hypot, sqrt

from messages.units import Quaternion, Vec3
from services.marine.attitude import down_in_body

MEMORY = 2.0  # [s] of the mean deviation
# [rad] of the mean. Simulated dives reach 0.09, in tight circles under full thrust; a bias of
# 0.1 rad/s takes a second and a half.
MOST = 0.13
# [s] More of it for each rad/s of a lasting turn: the accelerometer is off by speed times yaw rate.
# A hull with less drag than in its file circles at 1.5 m/s and 1.05 rad/s, which is 0.16 rad.
TURNING, MOST_TURNING = 0.06, 0.1  # [rad]
AGREED, AGREED_FOR = 0.02, 6.0  # [rad], [s] of the mean: learnt
# As above, of a shorter mean: a bias of 0.5 rad/s takes half a second. Simulated dives with all
# sticks thrown over every 1.5 s reach 0.21. Much more would come too late: a vehicle that already
# follows the wrong depth accelerates too much to compare with gravity.
QUICK_MEMORY, QUICK_MOST = 0.1, 0.25  # [s], [rad]
SPRING, INTEGRAL = 1.0, 0.25  # [1/s], [1/s²] critically damped
CHANGED = 0.004  # [rad/s] a change of the bias that the filter's correction would not have held


class GyroCheck:
    """Compares the attitude's down with the accelerometer's, in the body's x and y."""

    __slots__ = (
        "_agreed_for",
        "_before",
        "_now",
        "_quick_x",
        "_quick_y",
        "_turn",
        "_x",
        "_y",
        "learning",
        "stepped",
    )

    def __init__(self) -> None:
        self.learning = False  # the bias is being learnt anew
        self.stepped = False  # it has changed: the heading is unknown
        self._x = self._y = 0.0  # [rad] mean deviation about x and y
        self._quick_x = self._quick_y = 0.0  # [rad] the same over a shorter time
        self._turn = 0.0  # [rad/s] mean yaw rate, over the longer time
        self._now = 0.0, 0.0  # [rad] newest deviation
        self._agreed_for = 0.0  # [s]
        self._before: Vec3 = (0.0, 0.0, 0.0)  # [rad/s] bias when last trusted

    @property
    def trusted(self) -> bool:
        """Whether the gyroscope measures turns about the vertical."""
        return not (self.learning or self.stepped)

    def trust(self) -> str:
        """The magnetometer has measured the heading and the bias. Returns an event to count."""
        self.stepped = False
        return "trusted:gyroscope"

    def corrected(self, rate: Vec3) -> Vec3:
        """[rad/s] A rate with the proportional correction."""
        (x, y), (p, q, r) = self._now, rate
        return p + SPRING * x, q + SPRING * y, r

    def step(
        self, q: Quaternion, force: Vec3, bias: Vec3, dt: float, turn: float = 0.0
    ) -> tuple[Vec3, str | None]:
        """Take in a specific force [m/s²] whose magnitude is about gravity, `dt` [s] after the
        previous one, at a yaw rate `turn` [rad/s]. Returns the bias [rad/s], and an event to
        count."""
        fx, fy, fz = force
        x, y, z = down_in_body(q)
        size = sqrt(fx * fx + fy * fy + fz * fz)
        # Measured down, -f / |f|, crossed with the attitude's: the turn from this one to that one.
        ex, ey = (fz * y - fy * z) / size, (fx * z - fz * x) / size
        share = dt / MEMORY
        self._x += share * (ex - self._x)
        self._y += share * (ey - self._y)
        self._turn += share * (turn - self._turn)
        deviation = sqrt(self._x * self._x + self._y * self._y)
        if self.learning:
            self._now = ex, ey
            return self._learn(deviation, bias, dt)
        share = dt / QUICK_MEMORY
        self._quick_x += share * (ex - self._quick_x)
        self._quick_y += share * (ey - self._quick_y)
        most = MOST + min(MOST_TURNING, TURNING * abs(self._turn))
        if deviation <= most and hypot(self._quick_x, self._quick_y) <= QUICK_MOST:
            return bias, None
        self._quick_x = self._quick_y = 0.0
        if self.trusted:
            self._before = bias
        self.learning, self._agreed_for = True, 0.0
        self._now = ex, ey
        return bias, "doubted:gyroscope"

    def _learn(self, deviation: float, bias: Vec3, dt: float) -> tuple[Vec3, str | None]:
        (x, y), (a, b, c) = self._now, bias
        bias = a - INTEGRAL * x * dt, b - INTEGRAL * y * dt, c
        self._agreed_for = self._agreed_for + dt if deviation < AGREED else 0.0
        if self._agreed_for < AGREED_FOR:
            return bias, None
        self.learning = False
        if hypot(bias[0] - self._before[0], bias[1] - self._before[1]) <= CHANGED:
            self.stepped = False
            return self._before, "trusted:gyroscope"
        self.stepped = True
        return bias, "stepped:gyroscope"
