"""Does the vertical acceleration fit the pressure?

The innovations of a sound filter have zero mean. An accelerometer that is wrong, or an attitude
that is, because it says which acceleration is vertical, pushes them all to one side. Depth then
comes from pressure alone, until a second filter with the accelerometer has agreed with the pressure
for some seconds.
"""

from services.estimation.depth.depth_filter import DepthFilter, DepthSettings
from services.estimation.lean import Lean

MEMORY = 1.0  # [s] of the running mean …
# … but at least so many samples: over one second of a sensor with 8 Hz, noise alone has a spread of
# 0.26 and reaches `MOST_MEAN` within minutes; over 20 samples it has 0.16.
SAMPLES = 20
# [σ] of the running mean, of innovations clipped at 1.5 σ. Sampled at 42 Hz, noise alone has a
# spread of 0.1; simulated dives in tight circles under full thrust reach 0.43.
MOST_MEAN = 0.8
AGREED = 5.0  # [s] within half of that, before the accelerometer is used again
# [m/s²] change of the accelerometer's bias that is believed: its own, and 10° of tilt.
MOST_BIAS = 0.3
RATE_STD = 0.1  # [m/s] error of a rate that a wrong acceleration was integrated into


class MeanInnovation:
    """Running mean of normalised innovations."""

    __slots__ = ("_stamp_ns", "mean")

    def __init__(self) -> None:
        self.mean = 0.0  # [σ]
        self._stamp_ns: int | None = None

    def add(self, normalised: float, stamp_ns: int) -> float:
        """One innovation [σ], clipped. Returns the magnitude of the mean [σ]."""
        before, self._stamp_ns = self._stamp_ns, stamp_ns
        if before is not None:
            share = min(1.0 / SAMPLES, max(0.0, (stamp_ns - before) * 1e-9 / MEMORY))
            self.mean += share * (normalised - self.mean)
        return abs(self.mean)


class AccelerometerTrial:
    """A filter with the accelerometer beside the one without."""

    def __init__(self, settings: DepthSettings, alone: DepthFilter) -> None:
        """`alone`: the filter in use, whose bias is from before the trial."""
        self.filter = DepthFilter(settings)
        self._settings = settings
        self._bias = alone.bias  # [m/s²]
        self._before: float | None = None  # [m/s²] newest acceleration
        self.begin(alone)

    def begin(self, alone: DepthFilter) -> None:
        """(Again) from the depth and rate of the filter in use."""
        f = self.filter
        f.start(alone.depth, alone.depth_std, max(RATE_STD, alone.rate_std), self._bias, MOST_BIAS)
        f.rate = alone.rate
        self._mean = MeanInnovation()
        self._since_ns: int | None = None  # [ns] of this attempt's first sample

    def predict(self, acceleration: float | None, dt: float, lean: Lean) -> None:
        """Advance by `dt` [s] with an acceleration [m/s²] along down; None: unknown."""
        before, self._before = self._before, acceleration
        if before is None or acceleration is None:
            self._since_ns = None
            self.filter.predict(None, dt)
        else:
            self.filter.predict((before + acceleration) / 2.0, dt, True, lean)

    def passed(
        self, depth: float, std: float, age: float, stamp_ns: int, alone: DepthFilter
    ) -> bool:
        """Take in a sample [m] with this std [m], `age` [s] old. True: the filter with the
        accelerometer is as good as it should be."""
        f, clip = self.filter, self._settings.clip
        if not f.is_sound():
            self.begin(alone)
            return False
        innovation, variance = f.innovation(depth, std, age)
        sigma = variance**0.5
        most = clip * sigma
        innovation = max(-most, min(most, innovation))
        f.update(innovation, variance, age)
        mean = self._mean.add(innovation / sigma, stamp_ns)
        if self._since_ns is None:
            self._since_ns = stamp_ns
        if mean > MOST_MEAN or abs(f.bias - self._bias) > MOST_BIAS:
            self.begin(alone)
            return False
        return mean < MOST_MEAN / 2.0 and (stamp_ns - self._since_ns) * 1e-9 > AGREED
