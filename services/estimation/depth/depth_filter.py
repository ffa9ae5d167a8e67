"""Kalman filter of the vertical channel, driven by the accelerometer, corrected by pressure.

States: depth [m], depth rate [m/s], bias of the vertical accelerometer [m/s²], all along NED down;
and the bias of the forward accelerometer [m/s²], of which a pitched vehicle has a share along down.
With 10 mg and 10° that share is 0.017 m/s², far more than the sensor's noise.
The thesis' filter (Andrén 2023, eq. 5.21 to 5.23) is the case without accelerometer: it estimates
the motion from pressure alone and so lags. The measured acceleration as an input removes the lag;
its bias (sensor, local gravity, tilt) is one more state. A vehicle with little roll needs no state
for the starboard accelerometer: its share in roll counts as noise, as does the attitude error.

Written out in plain floats, because NumPy costs more than it saves on 4 × 4.
"""

from math import sqrt
from typing import Annotated

import msgspec

from messages.units import Positive
from services.estimation.depth.depth_variants import Observer

Latency = Annotated[float, msgspec.Meta(ge=0.0, le=0.3)]

Lean = tuple[float, float]  # [-] sines: how far the forward and starboard axes point down
LEVEL: Lean = (0.0, 0.0)
MOST = 1e12  # a larger variance counts as diverged
LEAST_MOTION_NOISE = 0.5  # [m/s²/√Hz] with 0.2 the simulated vehicle oscillates, 0.1 is unstable


class DepthSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Noise and limits of the vertical channel's measurements."""

    observer: Observer = (
        "accelerometer"  # see depth_variants.py; for "reference" reference_input.py
    )
    pressure_std: Positive = 500.0  # [Pa] noise of one pressure sample; 5 mbar
    pressure_latency: Latency = 0.0  # [s] from a sample's time of validity to its stamp
    acceleration_noise: Positive = 0.0025  # [m/s²/√Hz] of the accelerometer, while level
    pitch_noise: Positive = 0.02  # [m/s²/√Hz] added, times the sine of pitch: attitude errors
    roll_noise: Positive = 0.1  # [m/s²/√Hz] … of roll: and the starboard accelerometer's bias
    bias_walk: Positive = 0.0003  # [m/s²/√s] random walk of the accelerometer's bias
    forward_bias_std: Positive = 0.1  # [m/s²] forward accelerometer; 10 mg, unobservable at rest
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
    """Mean and covariance of (depth, rate, bias, forward bias). The caller keeps time."""

    depth: float  # [m]
    rate: float  # [m/s]
    bias: float  # [m/s²]
    forward_bias: float  # [m/s²] along the body's x
    p00: float  # covariance, upper triangle: [m²], [m²/s], [m²/s²], [m²/s²]
    p01: float
    p02: float
    p03: float
    p11: float  # [m²/s²], [m²/s³], [m²/s³]
    p12: float
    p13: float
    p22: float  # [m²/s⁴]
    p23: float
    p33: float

    def __init__(self, settings: DepthSettings) -> None:
        self._qa = settings.acceleration_noise**2
        self._q_pitch, self._q_roll = settings.pitch_noise**2, settings.roll_noise**2
        self._qb = settings.bias_walk**2
        self._qm = settings.motion_noise**2
        self.forward_bias, self.p33 = 0.0, settings.forward_bias_std**2
        self.start(0.0, 1.0)

    def start(
        self,
        depth: float,
        depth_std: float,
        rate_std: float = 0.5,
        bias: float = 0.0,
        bias_std: float = 0.1,
    ) -> None:
        """Restart at `depth` [m] with a rate of zero; standard deviations in m, m/s and m/s². The
        forward bias stays."""
        self.depth, self.rate, self.bias = depth, 0.0, bias
        self.p00, self.p11, self.p22 = depth_std**2, rate_std**2, bias_std**2
        self.p01 = self.p02 = self.p03 = self.p12 = self.p13 = self.p23 = 0.0

    def doubt(self, depth_std: float, rate_std: float) -> None:
        """Depth and rate may be wrong by this much more: [m], [m/s]."""
        self.p00 += depth_std**2
        self.p11 += rate_std**2

    def predict(
        self, acceleration: float | None, dt: float, measured: bool = True, lean: Lean = LEVEL
    ) -> None:
        """Advance the estimate by `dt` [s].

        Args:
            acceleration: [m/s²] along down, mean over the interval. None: unknown, so constant
                rate with `motion_noise`, as in the thesis.
            measured: by the accelerometer, bias included. False: the reference acceleration;
                `motion_noise` is then the deviation from it.
            lean: down components of the body's forward and starboard axes.
        """
        forward, _ = lean
        if acceleration is not None and measured:
            a = self.unbiased(acceleration, lean)
            db, hb, q = dt, 0.5 * dt * dt, self.noise(lean) * dt
        else:  # the bias has no effect
            a, db, hb, q = acceleration or 0.0, 0.0, 0.0, self._qm * dt
        self.depth += (self.rate + 0.5 * a * dt) * dt
        self.rate += a * dt
        # P = F P Fᵀ + Q with F = [[1, dt, -hb, -hf], [0, 1, -db, -df]] over the last two rows of
        # the identity; first A = F P.
        hf, df = forward * hb, forward * db
        a00 = self.p00 + dt * self.p01 - hb * self.p02 - hf * self.p03
        a01 = self.p01 + dt * self.p11 - hb * self.p12 - hf * self.p13
        a02 = self.p02 + dt * self.p12 - hb * self.p22 - hf * self.p23
        a03 = self.p03 + dt * self.p13 - hb * self.p23 - hf * self.p33
        a11 = self.p11 - db * self.p12 - df * self.p13
        a12 = self.p12 - db * self.p22 - df * self.p23
        a13 = self.p13 - db * self.p23 - df * self.p33
        self.p00 = a00 + dt * a01 - hb * a02 - hf * a03 + q * dt * dt / 3.0
        self.p01 = a01 - db * a02 - df * a03 + q * dt / 2.0
        self.p02, self.p03 = a02, a03
        self.p11 = a11 - db * a12 - df * a13 + q
        self.p12, self.p13 = a12, a13
        self.p22 += self._qb * dt
        self.p33 += self._qb * dt

    def unbiased(self, acceleration: float, lean: Lean) -> float:
        """[m/s²] A measured acceleration [m/s²] with the estimated biases removed."""
        forward, _ = lean
        return acceleration - self.bias - forward * self.forward_bias

    def noise(self, lean: Lean) -> float:
        """[m²/s³] Spectral density of the measured acceleration's noise."""
        forward, starboard = lean
        return self._qa + self._q_pitch * forward**2 + self._q_roll * starboard**2

    def innovation(self, depth: float, std: float, age: float) -> tuple[float, float]:
        """Innovation of a sample and its variance: [m], [m²].

        Args:
            depth: [m] measured `age` [s] before the filter's time; negative: after.
            std: [m] of the measurement.
        """
        innovation = depth - (self.depth - age * self.rate)
        return innovation, self.p00 - 2.0 * age * self.p01 + age * age * self.p11 + std * std

    def update(self, innovation: float, variance: float, age: float) -> None:
        """Correct by an `innovation` [m] and its variance [m²]: H = [1, -age, 0, 0], so that a late
        sample applies at its own time."""
        h0 = self.p00 - age * self.p01  # P Hᵀ
        h1 = self.p01 - age * self.p11
        h2 = self.p02 - age * self.p12
        h3 = self.p03 - age * self.p13
        k0, k1, k2, k3 = h0 / variance, h1 / variance, h2 / variance, h3 / variance
        self.depth += k0 * innovation
        self.rate += k1 * innovation
        self.bias += k2 * innovation
        self.forward_bias += k3 * innovation
        self.p00 -= k0 * h0
        self.p01 -= k0 * h1
        self.p02 -= k0 * h2
        self.p03 -= k0 * h3
        self.p11 -= k1 * h1
        self.p12 -= k1 * h2
        self.p13 -= k1 * h3
        self.p22 -= k2 * h2
        self.p23 -= k2 * h3
        self.p33 -= k3 * h3

    @property
    def depth_std(self) -> float:
        """[m]"""
        return sqrt(self.p00)

    @property
    def rate_std(self) -> float:
        """[m/s]"""
        return sqrt(self.p11)

    @property
    def bias_std(self) -> float:
        """[m/s²]"""
        return sqrt(self.p22)

    def is_sound(self) -> bool:
        """False if a number is not finite or a variance is not positive; then restart."""
        total = self.depth + self.rate + self.bias + self.forward_bias
        total += self.p01 + self.p02 + self.p03 + self.p12 + self.p13 + self.p23
        sound = total - total == 0.0  # NaN and infinities fail
        return (
            sound
            and 0.0 < self.p00 < MOST
            and 0.0 < self.p11 < MOST
            and 0.0 < self.p22 < MOST
            and 0.0 < self.p33 < MOST
        )
