"""Depth observers without accelerometer: the thesis' and what follows from it, each with one
feature more than the one before. All are Kalman filters of depth and rate, with a constant rate
between samples or driven by the acceleration of the reference (Andrén 2023, eq. 5.21 to 5.23).
"""

from typing import Literal

# "hold": a sample is used again in every step until the next one (section 5.3.1: sampled and held
# at 100 Hz). "timed": once, at its own time. "reference": the same, and the acceleration of the
# reference is an input.
Way = Literal["hold", "timed", "reference"]
WAYS: tuple[Way, ...] = ("hold", "timed", "reference")
RATE_STD = 0.5  # [m/s] at the start
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap


class ThesisObserver:
    """One of `WAYS`. No gate, no clip, no drop-outs."""

    def __init__(self, way: Way, std: float, motion_noise: float, latency: float = 0.0) -> None:
        """
        Args:
            std: [m] 1σ of one sample.
            motion_noise: [m/s²/√Hz] of the unknown acceleration.
            latency: [s] from a sample's time of validity to its stamp.
        """
        self.depth = self.rate = 0.0  # [m], [m/s]
        self._way = way
        self._latency_ns = round(latency * 1e9)
        self._r, self._q = std**2, motion_noise**2  # [m²], [m²/s³]
        self._p = (self._r, 0.0, RATE_STD**2)  # covariance: depth, both, rate
        self._at_ns = 0
        self._input: float | None = None  # [m/s²] newest
        self._started = False
        self._held: float | None = None  # [m] newest sample

    def sample(self, depth: float, stamp_ns: int) -> None:
        """A measured depth [m]."""
        stamp_ns -= self._latency_ns
        if not self._started:
            self.depth, self._started = depth, True
            self._at_ns = max(self._at_ns, stamp_ns)
        elif self._way == "hold":
            self._held = depth
        else:
            self._correct(depth, (self._at_ns - stamp_ns) * 1e-9)

    def predict(self, acceleration: float, at_ns: int) -> None:
        """Advance to `at_ns`; `acceleration` [m/s²] of the reference, along down."""
        dt = (at_ns - self._at_ns) * 1e-9
        if dt <= 0.0:
            return
        newest = acceleration if self._way == "reference" else 0.0
        before = newest if self._input is None else self._input
        self._input, self._at_ns = newest, at_ns
        if not self._started or dt > LONGEST_STEP:
            return
        a = (before + newest) / 2.0
        self.depth += (self.rate + 0.5 * a * dt) * dt
        self.rate += a * dt
        (p, c, v), q = self._p, self._q
        p, c = p + 2.0 * dt * c + dt * dt * v, c + dt * v
        self._p = p + q * dt**3 / 3.0, c + q * dt**2 / 2.0, v + q * dt
        if self._held is not None:
            self._correct(self._held, 0.0)

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
