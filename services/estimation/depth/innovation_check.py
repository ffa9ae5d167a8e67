"""Does the pressure fit the filter, as far as the filter's spread says?

The innovations of a filter that knows its errors are white. Two ways in which they are not, after
Bar-Shalom, Li and Kirubarajan 2001, *Estimation with Applications to Tracking and Navigation*, §5.4
(test of whiteness):

- Their mean over a second is far more than that of noise: waves, a wrong accelerometer.
- They follow the vertical speed: a sample is older, or newer, than its stamp says.

The stated standard deviations then include what is seen. The estimate itself is not changed: which
of the two sensors is wrong is not known.
"""

from math import exp, hypot, sqrt

from services.estimation.depth.accelerometer_trial import MEMORY, SAMPLES
from services.estimation.depth.depth_filter import DepthFilter

USUAL, LARGE = 3.2, 5.5  # [σ] of the mean of white noise: counts in the spread, and is told
FORGET = 12.0  # [s] time constant of the excess once the mean is small again
TOLD_AFTER = 2.0  # [s] of a mean beyond `LARGE`, before it is told
CALM = 0.25  # [-] seconds beyond `LARGE` that a second within it makes up for
REMEMBERED = 300.0  # [s] of innovations, for the latency
LIKELY, SURE = 1.5, 6.0  # [σ] of the latency, before it counts in the spread and is told


class InnovationCheck:
    """From the innovations of one filter to what its spread lacks."""

    __slots__ = ("_latency", "_mean", "_share")

    def __init__(self) -> None:
        self._mean, self._latency = MeanCheck(), LatencyCheck()
        self._share = 0.0

    def add(
        self, innovation: float, variance: float, used: DepthFilter, dt: float, blind: bool
    ) -> bool:
        """One innovation [m] of this variance [m²], `dt` [s] after the one before, before the
        filter is corrected. `blind`: it works without the accelerometer, and so follows whatever
        the pressure does. True once, when it has to be told."""
        before = self.large
        self._share = used.p01 / used.p00
        self._mean.add(innovation, sqrt(variance), dt, blind)
        self._latency.add(used.rate, innovation, variance, used.p00, used.p01, dt)
        return self.large and not before

    @property
    def large(self) -> bool:
        """The spread lacks so much, or for so long, that the pilot has to know."""
        return self._mean.lasts or self._latency.is_sure

    @property
    def excess(self) -> tuple[float, float]:
        """[m], [m/s] to be added, in squares, to the standard deviations of depth and rate."""
        depth, (late_depth, late_rate) = self._mean.excess, self._latency.errors
        return hypot(depth, late_depth), hypot(depth * self._share, late_rate)


class MeanCheck:
    """The mean innovation beyond what noise does."""

    __slots__ = ("_large_for", "_mean", "_square", "lasts")

    def __init__(self) -> None:
        self.lasts = False  # it is large, and has been for a while
        self._mean = 0.0  # [m]
        self._square = 0.0  # [m²] excess, squared
        self._large_for = 0.0  # [s]

    @property
    def excess(self) -> float:
        """[m]"""
        return sqrt(self._square)

    def add(self, innovation: float, std: float, dt: float, blind: bool) -> None:
        """One innovation and its standard deviation [m]."""
        share = min(1.0 / SAMPLES, dt / MEMORY)
        self._mean += share * (innovation - self._mean)
        mean, noise = abs(self._mean), std * sqrt(share / (2.0 - share))  # of white noise, 1 σ
        usual, large = USUAL * noise, LARGE * noise
        keep = 1.0 if blind else exp(-2.0 * dt / FORGET)
        self._square = max(mean * mean - usual * usual, self._square * keep)
        self._large_for += dt if mean > large else -CALM * dt
        self._large_for = min(TOLD_AFTER, max(0.0, self._large_for))
        lasts = self.lasts and self._large_for > 0.0
        self.lasts = lasts or self._large_for >= TOLD_AFTER


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
    def latency(self) -> float:
        """[s]"""
        return self._xv / self._xx if self._xx > 0.0 else 0.0

    @property
    def errors(self) -> tuple[float, float]:
        """[m], [m/s] of the filter now, by as much of the latency as is not noise."""
        if self._xx == 0.0:
            return 0.0, 0.0
        late = sqrt(max(0.0, self.latency**2 - LIKELY * LIKELY / self._xx))  # [s]
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
