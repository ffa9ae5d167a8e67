"""Depth observers that never fly: the thesis' and what follows from it, each with one feature more
than the one before. The last in the row is the product's own, driven by the accelerometer
(services/estimation/depth/).

All are Kalman filters of depth and rate with a constant rate between samples, or driven by the
acceleration of the reference (Andrén 2023, eq. 5.21 to 5.23).
"""

from dataclasses import dataclass
from math import sqrt

from services.estimation.depth.depth_filter import DepthSettings

RATE_STD = 0.5  # [m/s] at the start
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap


@dataclass(frozen=True, slots=True)
class DepthVariant:
    """Properties of an observer."""

    driven: bool = False  # the acceleration of the reference is an input; False: constant rate
    timed: bool = True  # a sample applies at its own time; False: at the step it is read in
    held: bool = False  # the newest sample is used again in every step until the next one


VARIANTS: dict[str, DepthVariant] = {
    "hold": DepthVariant(timed=False, held=True),  # section 5.3.1: sampled and held at 100 Hz
    "new": DepthVariant(timed=False),  # each sample counts once
    "timed": DepthVariant(),
    "reference": DepthVariant(driven=True),
}
ACCELEROMETER = "accelerometer"  # the product's
WAYS = (*VARIANTS, ACCELEROMETER)


class VariantObserver:
    """One of `VARIANTS`. No gate, no clip, no drop-outs."""

    def __init__(self, settings: DepthSettings, per_metre: float, way: str) -> None:
        """`per_metre`: [Pa/m] of the water."""
        self.depth = self.rate = 0.0  # [m], [m/s]
        self._variant = VARIANTS[way]
        self._latency_ns = round(settings.pressure_latency * 1e9)
        self._r = (settings.pressure_std / per_metre) ** 2  # [m²]
        self._q = settings.motion_noise**2  # [m²/s³]
        self._p = (self._r, 0.0, RATE_STD**2)  # covariance: depth, both, rate
        self._at_ns = 0
        self._input: float | None = None  # [m/s²] newest
        self._started = False
        self._unread: tuple[float, int] | None = None  # [m], [ns] newest sample, if not timed

    @property
    def depth_std(self) -> float:
        """[m]"""
        return sqrt(self._p[0])

    def sample(self, depth: float, stamp_ns: int) -> None:
        """A measured depth [m]."""
        stamp_ns -= self._latency_ns
        if not self._started:
            self.depth, self._started = depth, True
            self._at_ns = max(self._at_ns, stamp_ns)
        elif self._variant.timed:
            self._correct(depth, (self._at_ns - stamp_ns) * 1e-9)
        else:
            self._unread = depth, stamp_ns

    def predict(self, acceleration: float | None, at_ns: int) -> None:
        """Advance to `at_ns`; `acceleration` [m/s²] of the reference, along down."""
        dt = (at_ns - self._at_ns) * 1e-9
        if dt <= 0.0:
            return
        before, newest = self._input, acceleration if self._variant.driven else None
        self._input, self._at_ns = newest, at_ns
        if not self._started or dt > LONGEST_STEP:
            return
        a = 0.0 if newest is None else newest if before is None else (before + newest) / 2.0
        self.depth += (self.rate + 0.5 * a * dt) * dt
        self.rate += a * dt
        (p, c, v), q = self._p, self._q
        p, c = p + 2.0 * dt * c + dt * dt * v, c + dt * v
        self._p = p + q * dt**3 / 3.0, c + q * dt**2 / 2.0, v + q * dt
        if self._unread is not None:
            self._correct(self._unread[0], 0.0)
            if not self._variant.held:
                self._unread = None

    def _correct(self, depth: float, age: float) -> None:
        p, c, v = self._p
        along, across = p - age * c, c - age * v  # P Hᵀ with H = [1, -age]
        variance = along - age * across + self._r
        innovation = depth - (self.depth - age * self.rate)
        self.depth += along / variance * innovation
        self.rate += across / variance * innovation
        self._p = (
            p - along * along / variance,
            c - along * across / variance,
            v - across * across / variance,
        )
