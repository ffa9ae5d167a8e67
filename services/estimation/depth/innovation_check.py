"""Does the pressure fit the filter, as far as the filter's spread says?

The innovations of a filter that knows its errors are white (`aiding.py`). Three ways in which they
are not:

- Their mean over a second is far more than that of noise: waves, a wrong accelerometer.
- They are clipped on one side for more than a second. One clipped sample in eight is normal; sound
  sensors never are on one side for more than 0.6 s. The depth is then known no better than the
  distance between filter and sensor.
- They follow the vertical speed: a sample is older, or newer, than its stamp says.

The stated standard deviations then include what is seen. The estimate itself is not changed: which
of the two sensors is wrong is not known.
"""

from math import exp, hypot, sqrt

from messages import events, topics
from messages.events import Event
from services.estimation.aiding import Aiding
from services.estimation.depth.depth_filter import DepthFilter

CLIPPED = events.CLIPPED(topics.PRESSURE.key)
USUAL, LARGE = 3.2, 5.5  # [σ] of the mean of white noise: counts in the spread, and is told
FORGET = 12.0  # [s] time constant of the excess once the mean is small again
TOLD_AFTER = 2.0  # [s] of a mean beyond `LARGE`, before it is told
CALM = 0.25  # [-] seconds beyond `LARGE` that a second within it makes up for
LASTING = 1.0  # [s] clipped on one side
REMEMBERED = 300.0  # [s] of innovations, for the latency
LIKELY, SURE = 1.5, 6.0  # [σ] of the latency, before it counts in the spread and is told


class InnovationCheck:
    """From the innovations of one filter to what its spread lacks."""

    __slots__ = (
        "_clipped_for", "_distance", "_excess", "_large_for", "_lasts", "_latency", "_side",
        "excess", "large",
    )  # fmt: skip

    def __init__(self) -> None:
        self._latency = LatencyCheck()
        self._excess = 0.0  # [m²] mean innovation beyond what noise does, squared
        self._large_for = 0.0  # [s]
        self._lasts = False  # the mean is large, and has been for a while
        self._side = 0  # on which the newest innovation was clipped; 0: it was not
        self._clipped_for = 0.0  # [s] there without a break
        self._distance = 0.0  # [m] between filter and sensor, while that lasts
        # The spread lacks so much, or for so long, that the pilot has to know.
        self.large = False
        # [m], [m/s] to be added, in squares, to the standard deviations of depth and rate.
        self.excess = (0.0, 0.0)

    def add(
        self, innovation: float, variance: float, most: float, used: DepthFilter, dt: float,
        blind: bool, seen: Aiding,
    ) -> Event | None:  # fmt: skip
        """One innovation [m] of this variance [m²], clipped at `most` [m], `dt` [s] after the one
        before; the filter is not yet corrected. Returns an event to tell, once when it begins.

        Args:
            blind: the filter works without the accelerometer, and so follows whatever the pressure
                does.
            seen: the running mean.
        """
        before = self.large
        p00, p01 = used.covariance[0][:2]
        mean, usual = abs(seen.mean), USUAL * seen.mean_std  # [σ]
        keep = 1.0 if blind else exp(-2.0 * dt / FORGET)
        self._excess = max((mean * mean - usual * usual) * variance, self._excess * keep)
        self._large_for += dt if mean > LARGE * seen.mean_std else -CALM * dt
        self._large_for = min(TOLD_AFTER, max(0.0, self._large_for))
        self._lasts = self._large_for >= TOLD_AFTER or (self._lasts and self._large_for > 0.0)

        side = (innovation > most) - (innovation < -most)
        self._clipped_for = self._clipped_for + dt if side and side == self._side else 0.0
        apart, self._side = self._distance > 0.0, side
        self._distance = abs(innovation) if self._clipped_for >= LASTING else 0.0

        self._latency.add(used.rate, innovation, variance, p00, p01, dt)
        self.large = self._lasts or self._latency.is_sure
        depth, (late_depth, late_rate) = sqrt(self._excess), self._latency.errors
        # An error of the depth is one of the rate too, as the two are correlated.
        self.excess = (
            max(hypot(depth, late_depth), self._distance),
            hypot(depth * (p01 / p00), late_rate),
        )
        if self.large and not before:
            return events.INCONSISTENT_PRESSURE()
        return CLIPPED if self._distance > 0.0 and not apart else None


class LatencyCheck:
    """Estimates by how much the samples are older than their stamps say.

    Such a sample is off by -rate × latency, and so is, once it has followed, the filter. How depth
    and rate of the filter change with the latency is a recursion beside the filter, with its gains;
    the innovations' slope over it, by least squares, is the latency.
    """

    __slots__ = ("_depth", "_rate", "_xv", "_xx", "is_sure")

    def __init__(self) -> None:
        # [m/s], [m/s²] of the filter per second of latency.
        self._depth: float = 0.0
        self._rate: float = 0.0
        self._xx: float = 0.0  # [1/s²] sums of the least squares
        self._xv: float = 0.0  # [1/s]
        self.is_sure = False

    @property
    def errors(self) -> tuple[float, float]:
        """[m], [m/s] of the filter now, by as much of the latency as is not noise."""
        if self._xx == 0.0:
            return 0.0, 0.0
        latency = self._xv / self._xx  # [s]
        late = sqrt(max(0.0, latency**2 - LIKELY * LIKELY / self._xx))  # [s]
        return abs(late * self._depth), abs(late * self._rate)

    def add(
        self, rate: float, innovation: float, variance: float, p00: float, p01: float, dt: float
    ) -> None:
        """One innovation [m] of this variance [m²] with the filter's covariances [m², m²/s]."""
        self._depth += self._rate * dt
        slope = -rate - self._depth  # [m/s] of the innovation per second of latency
        self._depth += p00 / variance * slope
        self._rate += p01 / variance * slope
        keep = exp(-dt / REMEMBERED)
        self._xx = keep * self._xx + slope * slope / variance
        self._xv = keep * self._xv + slope * innovation / variance
        sigma = LIKELY if self.is_sure else SURE
        self.is_sure = self._xv * self._xv > sigma * sigma * self._xx
