"""Who contradicts whom: pressure and accelerometer, when they do not agree.

Pressure rejected. Samples in a row, all beyond the gate, may agree with each other though not with
the filter. If their innovations are all the same, the pressure has jumped and the filter's motion
is right. If not, but the depths themselves lie on a line, the filter is wrong. If neither, the
pressure is noise (`RejectedSamples`).

Pressure pushes to one side. The innovations of a sound filter have zero mean. An accelerometer that
is wrong, or an attitude that is, because it says which acceleration is vertical, pushes them all to
one side. Depth then comes from pressure alone, until a second filter with the accelerometer has
agreed with the pressure for some seconds (`AccelerometerTrial`).
"""

from math import sqrt

from services.estimation.aiding import Aiding
from services.estimation.attitude_axes import AttitudeAxes
from services.estimation.depth.depth_filter import CLIP, GATE, DepthFilter, DepthSettings
from services.estimation.line_fit import Line, LineFit

# [σ] of the running mean of innovations clipped at 1.5 σ. Sampled at 42 Hz, noise alone has a
# spread of 0.1; simulated dives in tight circles under full thrust reach 0.43.
MOST_MEAN = 0.8
AGREED = 5.0  # [s] within half of that, before the accelerometer is used again
# [m/s²] change of the accelerometer's bias that is believed: its own, and 10° of tilt.
MOST_BIAS = 0.3
RATE_STD = 0.1  # [m/s] error of a rate that a wrong acceleration was integrated into
# A filter that leaves the samples as fast is wrong. A jump of the pressure keeps its size.
DIVERGES_IN, DIVERGES_BY = 0.25, 0.5  # [s], [m/s]


class RejectedSamples:
    """Those in a row since `since_ns` [ns]."""

    __slots__ = ("_depths", "_first", "_innovations", "_seconds", "_since_ns", "patience")

    def __init__(self, depth: float, stamp_ns: int, patience: float) -> None:
        """`patience`: [s] of rejected samples before they are judged."""
        self.patience = patience
        self._since_ns, self._seconds = stamp_ns, 0.0
        self._first = depth  # sums of squares of small numbers are accurate
        self._innovations, self._depths = LineFit(), LineFit()

    def add(self, innovation: float, depth: float, stamp_ns: int) -> bool:
        """One sample and its innovation [m]. True: it is time to judge."""
        self._seconds = (stamp_ns - self._since_ns) * 1e-9
        self._innovations.add(self._seconds, innovation)
        self._depths.add(self._seconds, depth - self._first)
        return self._seconds > self.patience

    def diverges(self, most: float) -> bool:
        """Do samples within `most` [m] of a line leave the filter ever further behind?"""
        if self._seconds <= DIVERGES_IN:
            return False
        away = self.innovations
        fast = abs(away.slope) > DIVERGES_BY + 3.0 * away.slope_std
        return fast and away.slope * away.level > 0.0 and self.depths.spread <= most

    @property
    def innovations(self) -> Line:
        return self._innovations.line(self._seconds)

    @property
    def depths(self) -> Line:
        line = self._depths.line(self._seconds)
        return line._replace(level=line.level + self._first)


class AccelerometerTrial:
    """A filter with the accelerometer beside the one without."""

    def __init__(self, settings: DepthSettings, alone: DepthFilter) -> None:
        """`alone`: the filter in use, whose bias is from before the trial."""
        self.filter = DepthFilter(settings)
        self._bias = alone.bias  # [m/s²]
        self._before: float | None = None  # [m/s²] newest acceleration
        self.aiding = Aiding("trial", "m")
        self.begin(alone)

    def begin(self, alone: DepthFilter) -> None:
        """(Again) from the depth and rate of the filter in use."""
        f = self.filter
        f.start(alone.depth, alone.depth_std, max(RATE_STD, alone.rate_std), self._bias, MOST_BIAS)
        f.rate = alone.rate
        self.aiding.forget()
        self._since_ns: int | None = None  # [ns] of this attempt's first sample

    def predict(self, acceleration: float | None, dt: float, axes: AttitudeAxes) -> None:
        """Advance by `dt` [s] with an acceleration [m/s²] along down; None: unknown."""
        before, self._before = self._before, acceleration
        if before is None or acceleration is None:
            self._since_ns = None
            self.filter.predict(None, dt)
        else:
            self.filter.predict((before + acceleration) / 2.0, dt, axes)

    def passed(
        self, depth: float, std: float, age: float, stamp_ns: int, alone: DepthFilter
    ) -> bool:
        """Take in a sample [m] with this std [m], `age` [s] old. True: the filter with the
        accelerometer is as good as it should be."""
        f = self.filter
        if not f.is_sound():
            self.begin(alone)
            return False
        innovation, variance = f.innovation(depth, std, age)
        most = CLIP * sqrt(variance)
        used = max(-most, min(most, innovation))
        ratio = innovation * innovation / (GATE * GATE * variance)
        self.aiding.compare(stamp_ns, depth, innovation, variance, ratio, used)
        f.update(used, variance, age)
        mean = abs(self.aiding.mean)
        if self._since_ns is None:
            self._since_ns = stamp_ns
        if mean > MOST_MEAN or abs(f.bias - self._bias) > MOST_BIAS:
            self.begin(alone)
            return False
        return mean < MOST_MEAN / 2.0 and (stamp_ns - self._since_ns) * 1e-9 > AGREED
