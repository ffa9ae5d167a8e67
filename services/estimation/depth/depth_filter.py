"""Kalman filter of the vertical channel, driven by the accelerometer, corrected by pressure.

States, in a world whose yaw is the control heading:

    0, 1   depth [m], depth rate [m/s]
    2      bias along down [m/s²]: of the accelerometer, and of local gravity
    3, 4   bias of the forward and starboard accelerometer [m/s²]
    5, 6   tilt error [rad]: a turn about north and east that the attitude lacks
    7, 8   horizontal velocity [m/s], north and east

The thesis' filter (Andrén 2023, eq. 5.21 to 5.23) is the case without accelerometer: it estimates
the motion from pressure alone and so lags. The measured acceleration as an input removes the lag.

What is wrong with the acceleration along down of a vehicle under way is mostly tilt. The attitude
is level where the accelerometer's own bias says so, and gravity does not show that. A tilt error of
0.6°, which is a bias of 10 mg, makes a hundredth of any horizontal acceleration a vertical one:
12 mm/s of depth rate at a stop from 1.2 m/s. And a tilted vehicle has a share of the horizontal
biases along down. Both have one cause, so they begin correlated (`level`). Pressure tells them
apart from motion after some starts and stops. A turn shows them as well, because the biases turn
with the body, and the tilt error does not. For that the horizontal velocity is a state, of which
only what the thrust makes of it is known (thrust_speed.py) or, without reports of thrust, that an
underwater vehicle is not fast for long. Either is used as a measurement. The attitude's correction
towards the accelerometer is an input: it changes the tilt error by a known angle.

Written out in plain floats: NumPy costs as much at 9 × 9, and its matrix products do not give the
same bits on every computer.
"""

from math import sqrt
from typing import Annotated, NamedTuple

import msgspec

from messages.units import Positive, Vec3
from services.estimation.attitude_axes import LEVEL, MOVING_STD, AttitudeAxes
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY

Latency = Annotated[float, msgspec.Meta(ge=0.0, le=0.3)]
Row = list[float]
Pair = tuple[float, float]

SIZE = 9
GATE, CLIP = 6.0, 1.5  # [σ] innovations of the pressure: outliers beyond, and clipped beyond
TILT_WALK = 0.0003  # [rad/√s] random walk of the attitude: the gyroscope's noise
MOST = 1e12  # a larger variance counts as diverged
LEVELLED_STD = 1e-3  # [rad] of the tilt error besides that of the biases: it may bob by 1 cm/s²
AT_REST_STD = 0.05  # [m/s] of each horizontal velocity there
# [m²/s] spectral density of an error of the expected velocity of `MOVING_STD`, 4 s at a time.
SPEED_DENSITY = 4.0
SPEED_EVERY = 1.0  # [s] it is used as a measurement
FAR = 3.0  # [σ] from the expected velocity: that is not used
UNSURE = 0.04  # [rad] of the attitude's own spread: it was restarted, so the tilt is unknown


MOST_OF_NOISE = 9.0  # [-] times its density, that the accelerometer's own noise may have


class DepthSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise of the vertical channel's measurements."""

    pressure_std: Positive = 500.0  # [Pa] noise of one pressure sample; 5 mbar
    pressure_latency: Latency = 0.0  # [s] from a sample's time of validity to its stamp
    acceleration_noise: Positive = 0.0016  # [m/s²/√Hz] of the accelerometer
    bias_walk: Positive = 0.0001  # [m/s²/√s] random walk of the accelerometer's biases
    horizontal_bias_std: Positive = 0.1  # [m/s²] forward and starboard; 10 mg, unseen at rest
    motion_noise: Positive = 0.2  # [m/s²/√Hz] unknown motion without accelerometer


class SpeedInnovation(NamedTuple):
    """An expected horizontal velocity beside the filter's."""

    expected: Pair  # [m/s] north, east
    off: Pair  # [m/s] expected minus the filter's
    variance: Pair  # [m²/s²] of that
    refused: bool  # too far from it to be used


class DepthFilter:
    """Mean and covariance of the states. The caller keeps time."""

    depth: float  # [m]
    rate: float  # [m/s]
    bias: float  # [m/s²] along the body's down axis
    horizontal_bias: Pair  # [m/s²] forward, starboard
    tilt: Pair  # [rad] about north and east, to be added to the attitude
    velocity: Pair  # [m/s] north, east
    covariance: list[Row]  # 9 × 9, symmetric
    compared: SpeedInnovation | None  # newest; the reader empties it

    def __init__(self, settings: DepthSettings) -> None:
        self._qa = settings.acceleration_noise**2
        self._walks = [settings.bias_walk**2] * 3 + [TILT_WALK**2] * 2
        self._qm = settings.motion_noise**2
        self._bias_std = settings.horizontal_bias_std
        self.covariance = [[0.0] * SIZE for _ in range(SIZE)]
        self.horizontal_bias = self.tilt = self.velocity = (0.0, 0.0)
        self.doubt_of_force = 1.0  # [-] by which the density of the acceleration's error is larger
        self._free = 0.0  # [s] since the velocity was last expected
        self.compared = None
        tilt_std = self._bias_std / GRAVITY
        stds = (self._bias_std, self._bias_std, tilt_std, tilt_std, MOVING_STD, MOVING_STD)
        for k, std in enumerate(stds, start=3):
            self._make_independent(k, std)
        self.start(0.0, 1.0)

    def start(
        self,
        depth: float,
        depth_std: float,
        rate_std: float = 0.5,
        bias: float = 0.0,
        bias_std: float = 0.1,
    ) -> None:
        """Restart at `depth` [m] with a rate of zero; standard deviations in m, m/s and m/s². What
        is known of tilt and horizontal biases stays."""
        self.depth, self.rate, self.bias = depth, 0.0, bias
        for k, std in enumerate((depth_std, rate_std, bias_std)):
            self._make_independent(k, std)

    def level(self, axes: AttitudeAxes, lack: float = 0.0, std: float = 0.01) -> None:
        """The attitude has just been taken from the accelerometer of a vehicle at rest: its tilt
        error is what the biases, of which little is known, make of gravity.

        Args:
            lack: [m/s²] of gravity that the specific force had. In a tilted vehicle it does not
                say which axis' bias it is.
            std: [m/s²] of that.
        """
        self.bias, self.horizontal_bias = 0.0, (0.0, 0.0)
        self.tilt = self.velocity = (0.0, 0.0)
        for k in range(2, SIZE):
            self._make_independent(k, AT_REST_STD)
        prior, lever, down = self._bias_std, self._bias_std / GRAVITY, axes.down
        (fn, fe, fd), (sn, se, sd), (dn, de, dd) = axes.forward, axes.starboard, down
        of_biases = (  # states 2 to 6 by the biases forward, starboard, down
            (0.0, 0.0, prior),
            (prior, 0.0, 0.0),
            (0.0, prior, 0.0),
            (lever * fe, lever * se, lever * de),
            (-lever * fn, -lever * sn, -lever * dn),
        )
        for k, (a, b, c) in enumerate(of_biases, start=2):
            for m, (d, e, f) in enumerate(of_biases, start=2):
                self.covariance[k][m] = a * d + b * e + c * f
        for k in (5, 6):
            self.covariance[k][k] += LEVELLED_STD**2
        seen = [dd * row[2] + fd * row[3] + sd * row[4] for row in self.covariance]
        self._correct(seen, lack, dd * seen[2] + fd * seen[3] + sd * seen[4] + std * std)

    def doubt(self, depth_std: float, rate_std: float) -> None:
        """Depth and rate may be wrong by this much more: [m], [m/s]."""
        self.covariance[0][0] += depth_std**2
        self.covariance[1][1] += rate_std**2

    def predict(  # noqa: C901 - in one piece, to be read like its equations
        self, acceleration: float | None, dt: float, axes: AttitudeAxes = LEVEL
    ) -> None:
        """Advance the estimate by `dt` [s]: mean, covariance, process noise, and once a second the
        velocity that is to be expected.

        Args:
            acceleration: [m/s²] along down, as the accelerometer measured it on average over the
                interval, bias included. None: unknown, so constant rate with `motion_noise`, as in
                the thesis.
            axes: of the vehicle, at the end of the interval.
        """
        # The attitude was turned towards the accelerometer by a known angle, or taken from it anew.
        self.tilt = self.tilt[0] - axes.levelled[0], self.tilt[1] - axes.levelled[1]
        if axes.tilt_std > UNSURE and self.covariance[5][5] < (0.5 * axes.tilt_std) ** 2:
            self.tilt = (0.0, 0.0)
            for k in (5, 6):
                self._make_independent(k, axes.tilt_std)

        P = self.covariance
        if acceleration is None:  # the rate moves the depth; the other states have no effect
            a, q, expected = 0.0, self._qm, LEVEL
            P[0] = depth = [z + dt * w for z, w in zip(P[0], P[1], strict=True)]
            depth[0] += dt * depth[1]
            for k in range(1, SIZE):
                P[k][0] = depth[k]
        else:
            a, force_north, force_east = self._in_world(acceleration, axes)
            q, expected = self.acceleration_density(axes), axes
            # The tilt error takes a share of gravity for an acceleration.
            self.velocity = (
                self.velocity[0] + (force_north - GRAVITY * self.tilt[1]) * dt,
                self.velocity[1] + (force_east + GRAVITY * self.tilt[0]) * dt,
            )
            # P = F P Fᵀ. F is the identity but for the rows of depth, rate and velocity, which the
            # accelerations move. First those rows of F P …
            half = 0.5 * dt * dt
            (fn, fe, fd), (sn, se, sd) = axes.forward, axes.starboard
            dn, de, dd = axes.down
            depth, rate, north, east = moved = Row(), Row(), Row(), Row()
            for z, w, p2, p3, p4, p5, p6, vn, ve in zip(*P, strict=True):
                down = -dd * p2 - fd * p3 - sd * p4 + force_east * p5 - force_north * p6
                depth.append(z + dt * w + half * down)
                rate.append(w + dt * down)
                north.append(vn + dt * (-dn * p2 - fn * p3 - sn * p4 - GRAVITY * p6))
                east.append(ve + dt * (-de * p2 - fe * p3 - se * p4 + GRAVITY * p5))
            for row in moved:  # … then of those times Fᵀ
                _, w, p2, p3, p4, p5, p6, _, _ = row
                down = -dd * p2 - fd * p3 - sd * p4 + force_east * p5 - force_north * p6
                row[0] += dt * w + half * down
                row[1] += dt * down
                row[7] += dt * (-dn * p2 - fn * p3 - sn * p4 - GRAVITY * p6)
                row[8] += dt * (-de * p2 - fe * p3 - se * p4 + GRAVITY * p5)
            for k, row in zip((0, 1, 7, 8), moved, strict=True):
                P[k] = row
                for m in range(SIZE):
                    P[m][k] = row[m]
        self.depth += (self.rate + 0.5 * a * dt) * dt
        self.rate += a * dt

        P[0][0] += q * dt**3 / 3.0
        P[1][0] = P[0][1] = P[0][1] + q * dt**2 / 2.0
        P[1][1] += q * dt
        for k, walk in enumerate((*self._walks, q, q), start=2):
            P[k][k] += walk * dt

        self._free += dt
        if self._free >= SPEED_EVERY:
            self._expect_speed(expected.velocity, expected.velocity_std)

    def acceleration_density(self, axes: AttitudeAxes) -> float:
        """[m²/s³] of the error of the measured acceleration: noise, and vibration now, each as much
        larger as the innovations say."""
        vibration = 2 * max(0.0, axes.noise - self._qa)
        return self._qa * min(self.doubt_of_force, MOST_OF_NOISE) + self.doubt_of_force * vibration

    def _in_world(self, acceleration: float, axes: AttitudeAxes) -> Vec3:
        """[m/s²] A measured acceleration [m/s²] along down without the estimated errors, and the
        specific force along north and east without the biases."""
        (forward, starboard), (about_north, about_east) = self.horizontal_bias, self.tilt
        (fn, fe, fd), (sn, se, sd), (north, east) = axes.forward, axes.starboard, axes.force
        (dn, de, dd), below = axes.down, self.bias
        north -= forward * fn + starboard * sn + below * dn
        east -= forward * fe + starboard * se + below * de
        down = acceleration - (forward * fd + starboard * sd + below * dd)
        down += about_north * east - about_east * north
        return down, north, east

    def acceleration(self, measured: float, axes: AttitudeAxes, bandwidth: float) -> Pair:
        """[m/s²] The acceleration along down by the `measured` one, bias included, and its standard
        deviation with the accelerometer's noise below `bandwidth` [Hz]."""
        down, north, east = self._in_world(measured, axes)
        # Derivatives of it with respect to the states 2 to 6.
        shares = b, f, s, n, e = -axes.down[2], -axes.forward[2], -axes.starboard[2], east, -north
        spread = 0.0
        for share, (_, _, p2, p3, p4, p5, p6, _, _) in zip(
            shares, self.covariance[2:7], strict=True
        ):
            spread += share * (b * p2 + f * p3 + s * p4 + n * p5 + e * p6)
        return down, sqrt(spread + self.acceleration_density(axes) * bandwidth)

    def innovation(self, depth: float, std: float, age: float) -> Pair:
        """Innovation of a sample and its variance: [m], [m²].

        Args:
            depth: [m] measured `age` [s] before the filter's time; negative: after.
            std: [m] of the measurement.
        """
        innovation, P = depth - (self.depth - age * self.rate), self.covariance
        return innovation, P[0][0] - 2.0 * age * P[0][1] + age * age * P[1][1] + std * std

    def update(self, innovation: float, variance: float, age: float) -> None:
        """Correct by an `innovation` [m] and its variance [m²]: H = [1, -age, 0, …], so that a late
        sample applies at its own time."""
        self._correct([row[0] - age * row[1] for row in self.covariance], innovation, variance)

    def _correct(self, seen: Row, innovation: float, variance: float) -> None:
        """`seen`: P Hᵀ."""
        k = [s / variance for s in seen]
        self.depth += k[0] * innovation
        self.rate += k[1] * innovation
        self.bias += k[2] * innovation
        (forward, starboard), (about_north, about_east) = self.horizontal_bias, self.tilt
        self.horizontal_bias = forward + k[3] * innovation, starboard + k[4] * innovation
        self.tilt = about_north + k[5] * innovation, about_east + k[6] * innovation
        north, east = self.velocity
        self.velocity = north + k[7] * innovation, east + k[8] * innovation
        self.covariance = [
            [p - a * b / variance for p, b in zip(row, seen, strict=True)]
            for row, a in zip(self.covariance, seen, strict=True)
        ]

    @property
    def depth_std(self) -> float:
        """[m]"""
        return sqrt(self.covariance[0][0])

    @property
    def rate_std(self) -> float:
        """[m/s]"""
        return sqrt(self.covariance[1][1])

    @property
    def bias_std(self) -> float:
        """[m/s²]"""
        return sqrt(self.covariance[2][2])

    def is_sound(self) -> bool:
        """False if a number is not finite or a variance is not positive; then restart."""
        total = self.depth + self.rate + self.bias
        total += plain_sum((*self.horizontal_bias, *self.tilt, *self.velocity))
        total += plain_sum(map(plain_sum, self.covariance))
        for k, row in enumerate(self.covariance):
            if not 0.0 < row[k] < MOST:
                return False
        return total - total == 0.0  # NaN and infinities fail

    def _expect_speed(self, expected: Pair, std: float) -> None:
        """The horizontal velocity, measured to be the expected one [m/s]. If it cannot be, as of a
        vehicle that pushes against a wall, it is measured to be zero, as without expectation."""
        self.compared = None
        if std < MOVING_STD:
            off = expected[0] - self.velocity[0], expected[1] - self.velocity[1]
            variances = tuple(self.covariance[k][k] + std * std for k in (7, 8))
            far = any(d * d > FAR * FAR * v for d, v in zip(off, variances, strict=True))
            self.compared = SpeedInnovation(expected, off, (variances[0], variances[1]), far)
            if far:
                expected, std = (0.0, 0.0), MOVING_STD
        variance = SPEED_DENSITY * (std / MOVING_STD) ** 2 / self._free
        self._free = 0.0
        for k in (7, 8):
            seen = [row[k] for row in self.covariance]
            self._correct(seen, expected[k - 7] - self.velocity[k - 7], seen[k] + variance)

    def _make_independent(self, k: int, std: float) -> None:
        """State `k` has this standard deviation, and no correlation with the others."""
        for m in range(SIZE):
            self.covariance[k][m] = self.covariance[m][k] = 0.0
        self.covariance[k][k] = std * std
