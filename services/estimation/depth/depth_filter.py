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
from typing import Annotated

import msgspec

from messages.units import Positive
from services.estimation.depth.depth_variants import Observer
from services.estimation.lean import LEVEL, MOVING_STD, Lean
from services.marine.summation import plain_sum
from services.marine.vehicle import GRAVITY

Latency = Annotated[float, msgspec.Meta(ge=0.0, le=0.3)]
Row = list[float]
Shares = tuple[float, float, float, float, float]  # of the states 2 to 6 in an acceleration

SIZE = 9
MOST = 1e12  # a larger variance counts as diverged
LEAST_MOTION_NOISE = 0.5  # [m/s²/√Hz] with 0.2 the simulated vehicle oscillates, 0.1 is unstable
LEVELLED_STD = 1e-3  # [rad] of the tilt error besides that of the biases: it may bob by 1 cm/s²
AT_REST_STD = 0.05  # [m/s] of each horizontal velocity there
# [m²/s] spectral density of an error of the expected velocity of `MOVING_STD`, 4 s at a time.
SPEED_DENSITY = 4.0
SPEED_EVERY = 1.0  # [s] it is used as a measurement
FAR = 3.0  # [σ] from the expected velocity: that is not used
UNSURE = 0.04  # [rad] of the attitude's own spread: it was restarted, so the tilt is unknown


class DepthSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise and limits of the vertical channel's measurements."""

    observer: Observer = (
        "accelerometer"  # see depth_variants.py; for "reference" reference_input.py
    )
    pressure_std: Positive = 500.0  # [Pa] noise of one pressure sample; 5 mbar
    pressure_latency: Latency = 0.0  # [s] from a sample's time of validity to its stamp
    acceleration_noise: Positive = 0.0016  # [m/s²/√Hz] of the accelerometer
    bias_walk: Positive = 0.0001  # [m/s²/√s] random walk of the accelerometer's biases
    horizontal_bias_std: Positive = 0.1  # [m/s²] forward and starboard; 10 mg, unseen at rest
    tilt_walk: Positive = 0.0003  # [rad/√s] random walk of the attitude: the gyroscope's noise
    motion_noise: Positive = 0.2  # [m/s²/√Hz] unknown motion without accelerometer
    gate: Annotated[float, msgspec.Meta(ge=3.0, le=100.0)] = 6.0  # [σ] innovations beyond: outlier
    outlier_run: Positive = 1.5  # [s] of outliers only: the filter restarts at the newest sample
    valid_for: Positive = 2.0  # [s] depth is valid this long after an accepted pressure sample
    clip: Annotated[float, msgspec.Meta(ge=1.0, le=100.0)] = 1.5  # [σ] innovations are clipped here
    lost_after: Positive = 10.0  # [s] without pressure: prediction is useless, depth is held

    def __post_init__(self) -> None:
        # Below, control feeds back its own reference instead of the vehicle's rate: no damping.
        if self.observer == "reference" and self.motion_noise < LEAST_MOTION_NOISE:
            raise ValueError(
                f"estimation.depth.motion_noise: found {self.motion_noise}, but observer "
                f'"reference" needs at least {LEAST_MOTION_NOISE}'
            )


class DepthFilter:
    """Mean and covariance of the states. The caller keeps time."""

    depth: float  # [m]
    rate: float  # [m/s]
    bias: float  # [m/s²] along down
    horizontal_bias: tuple[float, float]  # [m/s²] forward, starboard
    tilt: tuple[float, float]  # [rad] about north and east, to be added to the attitude
    velocity: tuple[float, float]  # [m/s] north, east
    covariance: list[Row]  # 9 × 9, symmetric
    unexpected: bool  # the newest expected velocity was too far from it to be used

    def __init__(self, settings: DepthSettings) -> None:
        self._qa = settings.acceleration_noise**2
        self._walks = [settings.bias_walk**2] * 3 + [settings.tilt_walk**2] * 2
        self._qm = settings.motion_noise**2
        self._bias_std = settings.horizontal_bias_std
        self.covariance = [[0.0] * SIZE for _ in range(SIZE)]
        self.horizontal_bias = self.tilt = self.velocity = (0.0, 0.0)
        self._free = 0.0  # [s] since the velocity was last expected
        self.unexpected = False
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

    def level(self, lean: Lean) -> None:
        """The attitude has just been taken from the accelerometer of a vehicle at rest: its tilt
        error is what the horizontal biases, of which nothing is known, make of gravity."""
        self.horizontal_bias = self.tilt = self.velocity = (0.0, 0.0)
        for k in range(3, SIZE):
            self._make_independent(k, AT_REST_STD)
        std, (fn, fe, _), (sn, se, _) = self._bias_std, lean.forward, lean.starboard
        lever = std / GRAVITY
        of_biases = ((std, 0.0), (0.0, std), (lever * fe, lever * se), (-lever * fn, -lever * sn))
        for k, (a, b) in enumerate(of_biases, start=3):
            for m, (c, d) in enumerate(of_biases, start=3):
                self.covariance[k][m] = a * c + b * d
        for k in (5, 6):
            self.covariance[k][k] += LEVELLED_STD**2

    def doubt(self, depth_std: float, rate_std: float) -> None:
        """Depth and rate may be wrong by this much more: [m], [m/s]."""
        self.covariance[0][0] += depth_std**2
        self.covariance[1][1] += rate_std**2

    def predict(
        self, acceleration: float | None, dt: float, measured: bool = True, lean: Lean = LEVEL
    ) -> None:
        """Advance the estimate by `dt` [s].

        Args:
            acceleration: [m/s²] along down, mean over the interval. None: unknown, so constant
                rate with `motion_noise`, as in the thesis.
            measured: by the accelerometer, bias included. False: the reference acceleration;
                `motion_noise` is then the deviation from it.
            lean: of the accelerometer, at the end of the interval.
        """
        self._see_tilt(lean)
        expected = LEVEL
        if acceleration is not None and measured:
            expected = lean
            a, q = self.unbiased(acceleration, lean), self._qa
            self._move_horizontally(lean, dt)
            _advance(self.covariance, _shares(lean, self._horizontal_force(lean)), dt)
        else:  # the other states have no effect
            a, q = acceleration or 0.0, self._qm
            _advance_blind(self.covariance, dt)
        self.depth += (self.rate + 0.5 * a * dt) * dt
        self.rate += a * dt
        self._add_noise(q, dt)
        self._free += dt
        if self._free >= SPEED_EVERY:
            self._expect_speed(expected.velocity, expected.velocity_std)

    def unbiased(self, acceleration: float, lean: Lean) -> float:
        """[m/s²] A measured acceleration [m/s²] along down without the estimated errors."""
        (forward, starboard), (about_north, about_east) = self.horizontal_bias, self.tilt
        north, east = self._horizontal_force(lean)
        share = forward * lean.forward[2] + starboard * lean.starboard[2]
        return acceleration - self.bias - share + about_north * east - about_east * north

    def innovation(self, depth: float, std: float, age: float) -> tuple[float, float]:
        """Innovation of a sample and its variance: [m], [m²].

        Args:
            depth: [m] measured `age` [s] before the filter's time; negative: after.
            std: [m] of the measurement.
        """
        innovation = depth - (self.depth - age * self.rate)
        return innovation, self.p00 - 2.0 * age * self.p01 + age * age * self.p11 + std * std

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
    def p00(self) -> float:
        """[m²]"""
        return self.covariance[0][0]

    @property
    def p01(self) -> float:
        """[m²/s]"""
        return self.covariance[0][1]

    @property
    def p11(self) -> float:
        """[m²/s²]"""
        return self.covariance[1][1]

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

    def acceleration_variance(self, lean: Lean, bandwidth: float) -> float:
        """[m²/s⁴] of `unbiased`, with the accelerometer's noise below `bandwidth` [Hz]."""
        shares, _, _ = _shares(lean, self._horizontal_force(lean))
        b, f, s, n, e = shares
        spread = 0.0
        for share, (_, _, p2, p3, p4, p5, p6, _, _) in zip(
            shares, self.covariance[2:7], strict=True
        ):
            spread += share * (b * p2 + f * p3 + s * p4 + n * p5 + e * p6)
        return spread + self._qa * bandwidth

    def is_sound(self) -> bool:
        """False if a number is not finite or a variance is not positive; then restart."""
        total = self.depth + self.rate + self.bias
        total += plain_sum((*self.horizontal_bias, *self.tilt, *self.velocity))
        total += plain_sum(map(plain_sum, self.covariance))
        sound = total - total == 0.0  # NaN and infinities fail
        return sound and all(0.0 < self.covariance[k][k] < MOST for k in range(SIZE))

    def _see_tilt(self, lean: Lean) -> None:
        """Take in by how much the attitude was corrected, or that it has been restarted."""
        (about_north, about_east), (north, east) = self.tilt, lean.levelled
        self.tilt = about_north - north, about_east - east
        if lean.tilt_std > UNSURE and self.covariance[5][5] < (0.5 * lean.tilt_std) ** 2:
            self.tilt = (0.0, 0.0)
            for k in (5, 6):
                self._make_independent(k, lean.tilt_std)

    def _horizontal_force(self, lean: Lean) -> tuple[float, float]:
        """[m/s²] Specific force along north and east, biases removed."""
        (forward, starboard), (north, east) = self.horizontal_bias, lean.force
        (fn, fe, _), (sn, se, _) = lean.forward, lean.starboard
        return north - forward * fn - starboard * sn, east - forward * fe - starboard * se

    def _move_horizontally(self, lean: Lean, dt: float) -> None:
        """The tilt error takes a share of gravity for an acceleration."""
        (north, east), (about_north, about_east) = self._horizontal_force(lean), self.tilt
        vn, ve = self.velocity
        self.velocity = (
            vn + (north - GRAVITY * about_east) * dt,
            ve + (east + GRAVITY * about_north) * dt,
        )

    def _expect_speed(self, expected: tuple[float, float], std: float) -> None:
        """The horizontal velocity, measured to be the expected one. If it cannot be, as of a
        vehicle that pushes against a wall, it is measured to be zero, as without expectation."""
        self.unexpected = std < MOVING_STD and self._is_far(expected, std)
        if self.unexpected:
            expected, std = (0.0, 0.0), MOVING_STD
        variance = SPEED_DENSITY * (std / MOVING_STD) ** 2 / self._free
        self._free = 0.0
        for k in (7, 8):
            seen = [row[k] for row in self.covariance]
            self._correct(seen, expected[k - 7] - self.velocity[k - 7], seen[k] + variance)

    def _is_far(self, velocity: tuple[float, float], std: float) -> bool:
        north, east = velocity[0] - self.velocity[0], velocity[1] - self.velocity[1]
        most = FAR * FAR
        return north * north > most * (self.covariance[7][7] + std * std) or east * east > most * (
            self.covariance[8][8] + std * std
        )

    def _add_noise(self, q: float, dt: float) -> None:
        """Of a vertical acceleration with the spectral density `q` [m²/s³], and of the rest."""
        P = self.covariance
        P[0][0] += q * dt**3 / 3.0
        P[1][0] = P[0][1] = P[0][1] + q * dt**2 / 2.0
        P[1][1] += q * dt
        for k, walk in enumerate((*self._walks, q, q), start=2):
            P[k][k] += walk * dt

    def _make_independent(self, k: int, std: float) -> None:
        """State `k` has this standard deviation, and no correlation with the others."""
        for m in range(SIZE):
            self.covariance[k][m] = self.covariance[m][k] = 0.0
        self.covariance[k][k] = std * std


def _shares(lean: Lean, force: tuple[float, float]) -> tuple[Shares, Shares, Shares]:
    """Derivatives of the acceleration along down, north and east with respect to the states 2 to 6.
    `force` [m/s²]: horizontal specific force."""
    (fn, fe, fd), (sn, se, sd), (north, east) = lean.forward, lean.starboard, force
    return (
        (-1.0, -fd, -sd, east, -north),
        (0.0, -fn, -sn, 0.0, -GRAVITY),
        (0.0, -fe, -se, GRAVITY, 0.0),
    )


def _advance(P: list[Row], shares: tuple[Shares, Shares, Shares], dt: float) -> None:
    """P = F P Fᵀ. F is the identity but for the rows of depth, rate and velocity, which the
    accelerations move."""
    half = 0.5 * dt * dt
    (b, f, s, n, e), (_, fn, sn, _, en), (_, fe, se, ne, _) = shares
    depth, rate, north, east = [], [], [], []
    moved: list[Row] = [depth, rate, north, east]
    for z, w, p2, p3, p4, p5, p6, vn, ve in zip(*P, strict=True):  # those rows of F P
        a = b * p2 + f * p3 + s * p4 + n * p5 + e * p6
        depth.append(z + dt * w + half * a)
        rate.append(w + dt * a)
        north.append(vn + dt * (fn * p3 + sn * p4 + en * p6))
        east.append(ve + dt * (fe * p3 + se * p4 + ne * p5))
    for row in moved:  # and of those times Fᵀ
        _, w, p2, p3, p4, p5, p6, _, _ = row
        a = b * p2 + f * p3 + s * p4 + n * p5 + e * p6
        row[0] += dt * w + half * a
        row[1] += dt * a
        row[7] += dt * (fn * p3 + sn * p4 + en * p6)
        row[8] += dt * (fe * p3 + se * p4 + ne * p5)
    for k, row in zip((0, 1, 7, 8), moved, strict=True):
        P[k] = row
        for m in range(SIZE):
            P[m][k] = row[m]


def _advance_blind(P: list[Row], dt: float) -> None:
    """The same where no acceleration is measured: only the rate moves the depth."""
    P[0] = depth = [z + dt * w for z, w in zip(P[0], P[1], strict=True)]
    depth[0] += dt * depth[1]
    for k in range(1, SIZE):
        P[k][0] = depth[k]
