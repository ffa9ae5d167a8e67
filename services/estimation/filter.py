"""One error-state Kalman filter of the whole vehicle (Solà 2017, *Quaternion kinematics for the
error-state Kalman filter*, arXiv:1711.02508, with the attitude's error in the world, §7).

The IMU drives the prediction; every other sensor corrects by scalar measurements, one after the
other (`fuse`). What each of them measures is in pressure.py, hull.py, compass.py and aids.py.

The world axes are NED turned by a fixed angle, so that the attitude's yaw is the control heading,
which no magnetometer moves; `north` is the angle from it to true north. Only the position north and
east is by true north: there the velocity is turned as it is added up. With the velocity in NED,
every velocity measured would be one of the heading as well, as wrong as the estimate it is
linearised at (Huang, Mourikis and Roumeliotis 2010).

Element-wise products and sums in a fixed order only: matrix products (BLAS) and `einsum` do not
give the same bits on every computer.
"""

from copy import copy
from math import atan2, cos, exp, isfinite, pi, remainder, sin, sqrt
from typing import Self

import numpy as np
from numpy.typing import NDArray

from messages.units import Quaternion, Vec3
from services.marine.attitude import from_euler, normalised
from services.marine.vehicle import GRAVITY

Floats = NDArray[np.float64]
Row = tuple[tuple[int, float], ...]  # a measurement: state and coefficient, the others are 0
Rotation = tuple[Vec3, Vec3, Vec3]  # rows

# The error states: where each begins, and how many they are.
POSITION = 0  # [m] 3: true north, true east, down
VELOCITY = 3  # [m/s] 3: world axes
TILT, YAW = 6, 8  # [rad] 3: turn about the world's axes that the attitude lacks
WAVE = 9  # [m s], [m] 2: of what a wave adds to the pressure, see `_wave`
GYRO = 11  # [rad/s] 3: bias, FRD
FORCE = 14  # [m/s²] 3: bias of the accelerometer, FRD
CURRENT = 17  # [m/s] 2: of the water over the ground, world axes
NORTH = 19  # [rad] from the control heading to true north's
DEVIATION = 20  # [rad] of the compass: what it reads more than the heading
REST = 21  # [m] the depth at which the vehicle came to rest last
SIZE = 22
DEPTH, DEPTH_RATE = POSITION + 2, VELOCITY + 2
ERRATIC = 11  # so many states are moved by others in the prediction

# Which state moves which: row by row of F - 1 (Solà eq. 269), at most five each; the coefficients
# are made in `_spread`.
MOVED_BY = np.array(
    (
        (3, 4, 19, 0, 0), (3, 4, 19, 0, 0), (5, 0, 0, 0, 0),  # position by velocity and north
        (7, 8, 14, 15, 16), (8, 6, 14, 15, 16), (6, 7, 14, 15, 16),  # velocity by attitude, bias
        (11, 12, 13, 0, 0), (11, 12, 13, 0, 0), (11, 12, 13, 0, 0),  # attitude by the gyroscope's
        (9, 10, 0, 0, 0), (9, 10, 0, 0, 0),  # the wave by itself
    )
)  # fmt: skip
SPREAD_EVERY = 0.015  # [s] the covariance is advanced: at 100 Hz every other sample
MOST = 1e8  # [unit²] a larger variance is not kept: the state is not known at all

# Random walks, 1σ over a second. The biases': 10 deg/h in five minutes of a small MEMS gyroscope
# (Andrén 2023, §5.3.2), and ten times an MPU-6000's accelerometer; both ten times wider made no
# difference on real dives.
GYRO_WALK, FORCE_WALK = 5e-6, 2e-4  # [rad/s/√s], [m/s²/√s]
WIDE_GYRO_WALK, WIDE_FORCE_WALK = 5e-3, 0.01  # the same while the IMU contradicts the others
CURRENT_WALK = 0.01  # [m/s/√s] tide, and change of place
NORTH_WALK = 1e-4  # [rad/√s]
BLIND_FORCE = 0.3  # [m/s²/√Hz] unknown motion without IMU: tuned on real dives, range 0.2 … 0.5
BLIND_TURN = (0.1, 0.1, 0.5)  # [rad/√s] the same of the attitude
SECOND_S = 0.5  # [s] that a tilt error lasts, where it is not small
# The wave in the pressure: λ and ω₀ of Fossen 2011, eq. 8.128: a wide spectrum about 6 s, whatever
# the sea; one that followed the sea's period made the stops half as large again. Tuned on simulated
# dives, range 0.2 … 0.6.
WAVE_DAMPING, WAVE_RATE = 0.4, 1.0  # [-], [rad/s]


class ErrorStateFilter:
    """Nominal state, covariance of its error, and time."""

    def __init__(self) -> None:
        self.position: list[float] = [0.0, 0.0, 0.0]
        self.velocity: list[float] = [0.0, 0.0, 0.0]
        self.q: Quaternion = (1.0, 0.0, 0.0, 0.0)  # q_NB of the world axes
        self.rotation: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))  # the same
        self.wave = (0.0, 0.0)
        self.gyro_bias: Vec3 = (0.0, 0.0, 0.0)
        self.force_bias: Vec3 = (0.0, 0.0, 0.0)
        self.current = (0.0, 0.0)
        self.north = self.deviation = 0.0
        # [m], [m/s] by how much corrections have moved position and velocity so far.
        self.shift: tuple[float, ...] = (0.0,) * 6
        self.rest_shift = 0.0  # [m] the same of the depth at which the vehicle came to rest
        self.heading = 0.0  # [rad] control heading: yaw, accumulated past ±π
        self.acceleration = 0.0  # [m/s²] along down, newest
        self.wave_variance = 0.0  # [m²] of the model's rise
        self.wide_force = self.wide_gyro = False  # the biases may walk quickly
        self.P: Floats = np.zeros((SIZE, SIZE))
        self.variances = self.P.reshape(-1)[:: SIZE + 1]  # the diagonal, to be read and written
        self._yaw = 0.0
        self._begin_interval()

    def copy(self) -> Self:
        other = copy(self)
        other.position, other.velocity = self.position.copy(), self.velocity.copy()
        other.P, other._noise = self.P.copy(), self._noise.copy()  # pyright: ignore[reportConstantRedefinition]
        other.variances = other.P.reshape(-1)[:: SIZE + 1]
        return other

    def _begin_interval(self) -> None:
        """Since the covariance was advanced: time, impulse of the specific force, its directions,
        and the variance that noise has added to velocity and attitude."""
        self._seconds = self._felt = 0.0  # [s] in all, and with an IMU
        self._impulse = (0.0, 0.0, 0.0)  # [m/s] world
        self._turned = [0.0] * 9  # [s] R over time
        self._noise = [0.0] * 6

    # Prediction.

    def predict(self, force: Vec3, rate: Vec3, dt: float, noise: tuple[float, float]) -> None:
        """Advance by `dt` [s] with the mean specific force [m/s²] and rate [rad/s], FRD, of the
        interval (Solà eq. 260).

        Args:
            noise: spectral densities of force [m²/s³] and rate [rad²/s].
        """
        (p, q, r), (x, y, z), k = rate, self.gyro_bias, 0.25 * dt
        half = _exponential(k * (p - x), k * (q - y), k * (r - z))
        self._set_attitude(_multiplied(self.q, half), follow=False)
        (a, b, c), (d, e, f), (g, h, i) = self.rotation  # half-way through the interval
        (x, y, z), (bx, by, bz) = force, self.force_bias
        x, y, z = x - bx, y - by, z - bz
        fn, fe, fd = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z
        self.acceleration = fd + GRAVITY
        vn, ve, vd = self.velocity
        gained = fn * dt, fe * dt, self.acceleration * dt
        self._move(vn + 0.5 * gained[0], ve + 0.5 * gained[1], vd + 0.5 * gained[2], dt)
        self.velocity = [vn + gained[0], ve + gained[1], vd + gained[2]]
        self._set_attitude(_multiplied(self.q, half))

        impulse, turned, total = self._impulse, self._turned, self._noise
        self._impulse = impulse[0] + gained[0], impulse[1] + gained[1], impulse[2] + fd * dt
        for k, cell in enumerate((a, b, c, d, e, f, g, h, i)):
            turned[k] += cell * dt
        for k in range(3):
            total[k] += noise[0] * dt
            total[3 + k] += noise[1] * dt
        self._felt += dt
        self._advance(dt)

    def predict_blind(self, dt: float) -> None:
        """Advance by `dt` [s] without IMU: constant velocity, unknown turns."""
        vn, ve, vd = self.velocity
        self._move(vn, ve, vd, dt)
        self.widen_blind(dt)
        self._advance(dt)

    def widen_blind(self, dt: float) -> None:
        """What may have happened in `dt` [s] without IMU."""
        for k in range(3):
            self._noise[k] += BLIND_FORCE**2 * dt
            self._noise[3 + k] += BLIND_TURN[k] ** 2 * dt

    def _move(self, vn: float, ve: float, vd: float, dt: float) -> None:
        c, s = cos(self.north), sin(self.north)
        n, e, d = self.position
        self.position = [n + (c * vn - s * ve) * dt, e + (s * vn + c * ve) * dt, d + vd * dt]

    def _advance(self, dt: float) -> None:
        self._seconds += dt
        if self._seconds > SPREAD_EVERY:
            self.spread()

    def spread(self) -> None:
        """Advance the covariance by what has been predicted since: F P Fᵀ + Q."""
        dt = self._seconds
        if dt <= 0.0:
            return
        c, s = dt * cos(self.north), dt * sin(self.north)
        vn, ve, _ = self.velocity
        fn, fe, fd = self._impulse
        a, b, k, d, e, f, g, h, i = self._turned
        w00, w01, w10, w11 = self._wave(dt)
        G: Floats = np.array(
            (
                (c, -s, -s * vn - c * ve, 0.0, 0.0), (s, c, c * vn - s * ve, 0.0, 0.0),
                (dt, 0.0, 0.0, 0.0, 0.0),
                (fd, -fe, -a, -b, -k), (fn, -fd, -d, -e, -f), (fe, -fn, -g, -h, -i),
                (-a, -b, -k, 0.0, 0.0), (-d, -e, -f, 0.0, 0.0), (-g, -h, -i, 0.0, 0.0),
                (w00, w01, 0.0, 0.0, 0.0), (w10, w11, 0.0, 0.0, 0.0),
            )
        )[:, :, None]  # fmt: skip
        P, total = self.P, np.add.reduce
        moved = total(G * P.take(MOVED_BY, 0), 1)  # G P
        twice = total(G * moved.T.take(MOVED_BY, 0), 1)  # G P Gᵀ
        added = np.zeros((SIZE, SIZE))
        added[:ERRATIC] = moved
        added += added.T.copy()  # in this order it stays symmetric to the last bit
        added[:ERRATIC, :ERRATIC] += 0.5 * (twice + twice.T)
        P[:] += added
        gyro = (WIDE_GYRO_WALK if self.wide_gyro else GYRO_WALK) ** 2 * dt
        force = (WIDE_FORCE_WALK if self.wide_force else FORCE_WALK) ** 2 * dt
        current = CURRENT_WALK**2 * dt
        wave = 4.0 * WAVE_DAMPING * WAVE_RATE * self.wave_variance * dt
        # A tilt error θ makes g θ² / 2 of gravity vertical, which no first derivative has.
        second = 0.5 * GRAVITY * float(P[TILT, TILT] + P[TILT + 1, TILT + 1])
        self._noise[2] += 2.0 * SECOND_S * second * second * self._felt
        self.variances += (
            0.0, 0.0, 0.0, *self._noise, 0.0, wave, gyro, gyro, gyro, force, force, force,
            current, current, NORTH_WALK**2 * dt, 0.0, 0.0,
        )  # fmt: skip
        self._begin_interval()

    def _wave(self, dt: float) -> tuple[float, float, float, float]:
        """Second-order wave without a mean, whose rise is the second of ẋ₁ = x₂,
        ẋ₂ = −ω₀² x₁ − 2 λ ω₀ x₂ + n (Fossen 2011, eq. 8.128): advances it by `dt` [s] and returns
        its transition less the identity. The density of n that gives the rise its variance is
        4 λ ω₀ times that."""
        w0, k = WAVE_RATE, WAVE_DAMPING * WAVE_RATE
        wd, decay = w0 * sqrt(1.0 - WAVE_DAMPING * WAVE_DAMPING), exp(-k * dt)
        c, s = decay * cos(wd * dt), decay * sin(wd * dt) / wd
        a, b, d, e = c + k * s, s, -w0 * w0 * s, c - k * s
        x, y = self.wave
        self.wave = a * x + b * y, d * x + e * y
        return a - 1.0, b, d, e - 1.0

    # Correction.

    def explained(self, h: Row) -> tuple[Floats, float]:
        """P hᵀ, and the variance h P hᵀ that the filter expects of this measurement."""
        self.spread()
        (first, factor), *others = h
        Ph = factor * self.P[first]
        for state, factor in others:
            Ph += factor * self.P[state]
        variance = 0.0
        for state, factor in h:
            variance += factor * float(Ph[state])
        return Ph, max(0.0, variance)

    def correct(
        self, Ph: Floats, variance: float, innovation: float, mask: Floats | None = None
    ) -> None:
        """Use a measurement with this innovation and variance h P hᵀ + r (Solà §6.1). `mask`: 0
        where both states are considered and not corrected (Schmidt 1966), else 1; None:
        `KEEPS_PLACE`."""
        mask = KEEPS_PLACE if mask is None else mask
        root = Ph / sqrt(variance)
        self.P[:] -= root[:, None] * root * mask
        gain = (Ph * mask.diagonal() * (innovation / variance)).tolist()
        variances = self.variances
        if np.minimum.reduce(variances) < 0.0 or np.maximum.reduce(variances) > MOST:
            np.clip(variances, 0.0, MOST, out=variances)
        self._inject(gain)

    def _inject(self, d: list[float]) -> None:
        n, e, z, vn, ve, vz = self.shift
        self.shift = n + d[0], e + d[1], z + d[2], vn + d[3], ve + d[4], vz + d[5]
        n, e, z = self.position
        self.position = [n + d[0], e + d[1], z + d[2]]
        vn, ve, vz = self.velocity
        self.velocity = [vn + d[3], ve + d[4], vz + d[5]]
        self.wave = self.wave[0] + d[9], self.wave[1] + d[10]
        x, y, z = self.gyro_bias
        self.gyro_bias = x + d[11], y + d[12], z + d[13]
        x, y, z = self.force_bias
        self.force_bias = x + d[14], y + d[15], z + d[16]
        self.current = self.current[0] + d[17], self.current[1] + d[18]
        self.north = remainder(self.north + d[19], 2.0 * pi)
        self.deviation += d[20]
        self.rest_shift += d[21]
        if d[6] or d[7] or d[8]:
            turn = _exponential(0.5 * d[6], 0.5 * d[7], 0.5 * d[8])
            self._set_attitude(normalised(_multiplied(turn, self.q)))

    def rest(self) -> None:
        """The vehicle comes to rest here. What corrects the depth from now on corrects that place
        too, the less the longer ago that is (stochastic cloning, Roumeliotis and Burdick 2002)."""
        self.spread()
        P = self.P
        P[REST, :] = P[DEPTH, :]
        P[:, REST] = P[:, DEPTH]
        P[REST, REST] = P[DEPTH, DEPTH]

    def forget(self, state: int, std: float) -> None:
        """This state is known to `std` alone, independent of the others."""
        self.spread()
        self.P[state, :] = self.P[:, state] = 0.0
        self.P[state, state] = std * std

    def place(self, axis: int, value: float, std: float) -> None:
        """The position along this axis is `value` [m], known to `std`."""
        shift = list(self.shift)
        shift[axis] += value - self.position[axis]
        self.shift, self.position[axis] = tuple(shift), value
        self.forget(POSITION + axis, std)

    def widen(self, state: int, std: float) -> None:
        """This state may be wrong by `std` more."""
        self.P[state, state] += std * std

    def std(self, state: int) -> float:
        return sqrt(max(0.0, float(self.P[state, state])))

    # Attitude.

    def level(self, force: Vec3, std: float) -> None:
        """Take the tilt from a specific force [m/s²], FRD, known to `std` [rad]; the yaw stays."""
        x, y, z = force
        self._set_attitude(from_euler(atan2(-y, -z), atan2(x, sqrt(y * y + z * z)), self._yaw))
        for state in (TILT, TILT + 1):
            self.forget(state, std)

    def turn_to(self, heading: float, std: float) -> None:
        """The control heading is this [rad], known to `std`."""
        self.spread()
        by = heading - self._yaw
        c, s = cos(by), sin(by)
        self._set_attitude(_multiplied((cos(0.5 * by), 0.0, 0.0, sin(0.5 * by)), self.q))
        self.heading = heading
        for first in (VELOCITY, TILT, CURRENT):  # the level ones turn with the axes
            for M in (self.P, self.P.T):
                north, east = M[first].copy(), M[first + 1].copy()
                M[first], M[first + 1] = c * north - s * east, s * north + c * east
        (vn, ve, vd), (cn, ce) = self.velocity, self.current
        self.velocity = [c * vn - s * ve, s * vn + c * ve, vd]
        self.current = c * cn - s * ce, s * cn + c * ce
        self.forget(YAW, std)

    @property
    def tilt_stds(self) -> tuple[float, float]:
        """[rad] 1σ of roll and pitch."""
        P, c, s = self.P, cos(self._yaw), sin(self._yaw)
        nn, ne, ee = float(P[6, 6]), float(P[6, 7]), float(P[7, 7])
        along = c * c * nn + 2.0 * c * s * ne + s * s * ee
        across = s * s * nn - 2.0 * c * s * ne + c * c * ee
        return sqrt(max(0.0, along)), sqrt(max(0.0, across))

    @property
    def is_sound(self) -> bool:
        total = self.position[0] + self.position[1] + self.position[2] + self.heading + self.north
        total += self.velocity[0] + self.velocity[1] + self.velocity[2] + self.q[0]
        return isfinite(total + float(self.P[TILT, TILT] + self.P[DEPTH, DEPTH]))

    def _set_attitude(self, q: Quaternion, *, follow: bool = True) -> None:
        w, x, y, z = self.q = q
        self.rotation = (
            (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
            (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
            (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
        if follow:
            yaw = atan2(self.rotation[1][0], self.rotation[0][0])
            self.heading += remainder(yaw - self._yaw, 2.0 * pi)
            self._yaw = yaw


def considered(*states: int) -> Floats:
    """The mask of `ErrorStateFilter.correct` under which only these states are corrected."""
    corrected = np.zeros(SIZE)
    corrected[list(states)] = 1.0
    return np.maximum(corrected[:, None], corrected[None, :])


# Only what is measured over the ground corrects north and east: a better known north would move a
# vehicle that holds its place 40 m away by 0.7 m.
KEEPS_PLACE = considered(*(state for state in range(SIZE) if state not in (POSITION, POSITION + 1)))


def to_body(R: Rotation, v: tuple[float, float, float]) -> Vec3:
    """Rᵀ v."""
    (a, b, c), (d, e, f), (g, h, i) = R
    x, y, z = v
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def to_world(R: Rotation, v: Vec3) -> Vec3:
    """R v."""
    (a, b, c), (d, e, f), (g, h, i) = R
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def _exponential(x: float, y: float, z: float) -> Quaternion:
    """Of half a rotation vector [rad] (Solà eq. 101)."""
    angle = sqrt(x * x + y * y + z * z)
    k = 1.0 - angle * angle / 6.0 if angle < 1e-4 else sin(angle) / angle
    return cos(angle), k * x, k * y, k * z


def _multiplied(a: Quaternion, b: Quaternion) -> Quaternion:
    """a ⊗ b (Solà eq. 12)."""
    w, x, y, z = a
    i, j, k, m = b
    return (
        w * i - x * j - y * k - z * m,
        w * j + x * i + y * m - z * k,
        w * k - x * m + y * i + z * j,
        w * m + x * k - y * j + z * i,
    )
