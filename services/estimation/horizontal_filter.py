"""Kalman filter of the horizontal motion over the ground, driven by the accelerometer.

States of each axis, north and east: position [m], velocity [m/s], bias of the acceleration [m/s²]
(what a small error of tilt lets gravity add). A DVL's velocity is turned into NED before it comes
here, and all noise is taken as equal in every horizontal direction. Then both axes have the same
covariance and the same gains, and one 3 × 3 matrix serves both.

Written out in plain floats, because NumPy costs more than it saves on 3 × 3.
"""

from math import sqrt
from typing import Annotated

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1e6)]
Pair = tuple[float, float]  # north, east
Row3 = tuple[float, float, float]


class HorizontalSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far each measurement of the horizontal motion is trusted, and for how long."""

    acceleration_noise: Positive = 0.03  # [m/s²/√Hz] accelerometer noise, with what tilt adds
    # The attitude leans into an acceleration that lasts, and hides it: only changes are seen.
    bias_walk: Positive = 0.12  # [m/s²/√s] how fast the error of tilt wanders
    motion_noise: Positive = 0.3  # [m/s²/√Hz] unknown motion while the IMU is silent
    gate: Annotated[float, msgspec.Meta(ge=3.0, le=100.0)] = 6.0  # [σ] innovations beyond: outlier
    outliers: Annotated[int, msgspec.Meta(ge=2, le=100)] = 5  # in a row: the world has changed
    dvl_valid_for: Positive = 3.0  # [s] after the last accepted sample
    usbl_valid_for: Positive = 15.0  # [s]
    lost_after: Positive = 60.0  # [s] without either: prediction is worthless
    oldest: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 4.0  # [s] age of a usable sample


class HorizontalFilter:
    """Means of both axes and their common covariance. The caller keeps the time."""

    def __init__(self, settings: HorizontalSettings) -> None:
        self._qa = settings.acceleration_noise**2
        self._qb = settings.bias_walk**2
        self._qm = settings.motion_noise**2
        self.position: Pair = (0.0, 0.0)  # [m]
        self.velocity: Pair = (0.0, 0.0)  # [m/s]
        self.bias: Pair = (0.0, 0.0)  # [m/s²]
        self.p00 = self.p11 = self.p22 = 1.0
        self.p01 = self.p02 = self.p12 = 0.0

    def start(self, position_std: float, velocity_std: float) -> None:
        """Begin at zero with spreads in m and m/s."""
        self.position = self.velocity = self.bias = (0.0, 0.0)
        self.p00, self.p11, self.p22 = position_std**2, velocity_std**2, 0.1**2
        self.p01 = self.p02 = self.p12 = 0.0

    def move_to(self, position: Pair, std: float) -> None:
        """Forget the position [m], keep the velocity."""
        self.position, self.p00, self.p01, self.p02 = position, std * std, 0.0, 0.0

    def change_to(self, velocity: Pair, std: float) -> None:
        """Forget the velocity [m/s], keep the position."""
        self.velocity, self.p11, self.p01, self.p12 = velocity, std * std, 0.0, 0.0

    def predict(self, acceleration: Pair | None, dt: float) -> Pair:
        """Move on by `dt` [s] with a measured acceleration [m/s²], bias included; None: unknown.
        Returns the acceleration believed."""
        (x, y), (u, v), (b, c) = self.position, self.velocity, self.bias
        known = acceleration is not None
        a, d = (acceleration[0] - b, acceleration[1] - c) if known else (0.0, 0.0)
        h = 0.5 * dt * dt
        self.position = (x + u * dt + a * h, y + v * dt + d * h)
        self.velocity = (u + a * dt, v + d * dt)
        # F = [1 dt -h; 0 1 -dt; 0 0 1]; without the accelerometer its bias moves nothing.
        e, f = (-h, -dt) if known else (0.0, 0.0)
        p00, p01, p02, p11, p12, p22 = self.p00, self.p01, self.p02, self.p11, self.p12, self.p22
        r00, r01, r02 = p00 + dt * p01 + e * p02, p01 + dt * p11 + e * p12, p02 + dt * p12 + e * p22
        r11, r12 = p11 + f * p12, p12 + f * p22
        q = (self._qa if known else self._qm) * dt
        self.p00 = r00 + dt * r01 + e * r02 + q * dt * dt / 3.0
        self.p01 = r01 + f * r02 + q * dt / 2.0
        self.p02 = r02
        self.p11 = r11 + f * r12 + q
        self.p12 = r12
        self.p22 = p22 + self._qb * dt
        return a, d

    def variance(self, h: Row3) -> float:
        """Of the prediction of a measurement with this row of the measurement matrix."""
        g0, g1, g2 = self._times(h)
        return h[0] * g0 + h[1] * g1 + h[2] * g2

    def update(self, h: Row3, surprise: Pair, variance: float) -> None:
        """Use a measurement of both axes, `surprise` off the prediction, whose innovation has
        this variance."""
        g0, g1, g2 = self._times(h)
        k0, k1, k2 = g0 / variance, g1 / variance, g2 / variance
        n, e = surprise
        self.position = (self.position[0] + k0 * n, self.position[1] + k0 * e)
        self.velocity = (self.velocity[0] + k1 * n, self.velocity[1] + k1 * e)
        self.bias = (self.bias[0] + k2 * n, self.bias[1] + k2 * e)
        self.p00 -= k0 * g0
        self.p01 -= k0 * g1
        self.p02 -= k0 * g2
        self.p11 -= k1 * g1
        self.p12 -= k1 * g2
        self.p22 -= k2 * g2

    @property
    def position_std(self) -> float:
        """[m] of each axis."""
        return sqrt(self.p00)

    @property
    def velocity_std(self) -> float:
        """[m/s] of each axis."""
        return sqrt(self.p11)

    def is_sound(self) -> bool:
        """False when a number is not finite or a variance is not positive: start anew then."""
        total = sum((*self.position, *self.velocity, *self.bias, self.p01, self.p02, self.p12))
        positive = 0.0 < self.p00 < 1e12 and 0.0 < self.p11 < 1e12 and 0.0 < self.p22 < 1e12
        return total - total == 0.0 and positive  # NaN and infinities fail

    def _times(self, h: Row3) -> Row3:
        """P hᵀ."""
        a, b, c = h
        return (
            self.p00 * a + self.p01 * b + self.p02 * c,
            self.p01 * a + self.p11 * b + self.p12 * c,
            self.p02 * a + self.p12 * b + self.p22 * c,
        )
