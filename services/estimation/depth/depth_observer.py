"""From pressure samples to depth: the datum, the time of each sample, outliers and drop-outs."""

from dataclasses import dataclass
from math import hypot, sqrt

from messages.message import Estimate
from services.estimation.depth.accelerometer_trial import (
    MEMORY,
    MOST_MEAN,
    RATE_STD,
    AccelerometerTrial,
    MeanInnovation,
)
from services.estimation.depth.depth_filter import DepthFilter, DepthSettings
from services.estimation.depth.depth_variants import VARIANTS, DepthVariant
from services.estimation.depth.innovation_check import InnovationCheck
from services.estimation.depth.rejected_samples import RejectedSamples
from services.estimation.lean import LEVEL, Lean
from services.marine.vehicle import GRAVITY

LATEST_AGE = 0.5  # [s] an older sample is not used
AHEAD = 0.2  # [s] a sample may be this much newer than the newest IMU sample
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap
MOVING_STD = 0.5  # [m/s] of the rate when the filter starts under way
RESTING_RATE_STD = 0.05  # [m/s] when it starts at rest; some swell
LASTING = 1.0  # [s] clipped on one side; sound sensors never are for more than 0.6 s
ALONE_RUN = 0.25  # [s] as `outlier_run`, without the accelerometer to tell a jump from a motion
GROWN = 0.6  # [σ] mean innovation before the first outlier: it has grown, and did not jump
GROWN_RATE_STD = 0.3  # [m/s] error of the rate then
DOUBTED_STD, DOUBTED_RATE_STD = 0.3, 1.0  # [m], [m/s] errors after two seconds of wrong attitude
LEVEL_LINE = 0.05  # [m/s] slope of innovations that counts as none, and 3 σ
SCATTER = 0.05  # [m] about a line through samples that agree with each other, and 3 σ
KNOWN_RATE = 0.1  # [m/s] 1σ; without pressure the accelerometer keeps it below for half a minute
SHOCK = 1.0  # [m/s²] from sample to sample, as on the sea floor; thrusters change it by 0.1
RESTING_BIAS_STD = 0.01  # [m/s²] of the mean at rest: the vehicle may bob a little
BANDWIDTH = 50.0  # [Hz] of the accelerometer at 100 Hz, to turn noise density into spread


@dataclass(frozen=True, slots=True)
class Atmosphere:
    """The air above the water, and how well it is known."""

    pressure: float  # [Pa]
    std: float  # [Pa]


class DepthObserver:
    """Depth of the vehicle's origin below the surface.

    Innovations are clipped at `clip` σ (Huber 1964). This costs nothing with Gaussian noise and
    keeps a disturbance just inside the gate from changing the rate so much that the good samples
    after it look like outliers.

    Clipping one sample in eight is normal. Clipping on one side for more than a second is not:
    filter and sensor disagree, and the depth is known no better than their distance. It is counted
    once (`clipped:`), and the standard deviation includes that distance while it lasts.

    An innovation beyond `gate` σ is an outlier and is not used. After `outlier_run` seconds of
    outliers only that agree with each other, pressure is believed (`rejected_samples.py`): either
    the depth is moved by the jump, which the reference follows, or the accelerometer was wrong.
    The latter needs only a quarter of a second where the filter leaves the samples fast.
    After `lost_after` seconds without an accepted sample the depth is lost, and the next valid
    sample restarts the filter. The rate is known for as long as the accelerometer keeps its
    standard deviation below `KNOWN_RATE`.

    Innovations that are no noise (`innovation_check.py`: waves, latency) are in the standard
    deviations of depth and rate. They are counted once (`inconsistent:`) where they are large.

    Innovations of one sign on average mean that the accelerometer does not fit the pressure: depth
    comes from pressure alone until it does (`accelerometer_trial.py`).

    A timed observer uses a sample on arrival, with H = [1, -age, 0]. The others read the sensor at
    each step, as if the newest sample were of that moment.
    """

    def __init__(
        self,
        settings: DepthSettings,
        atmosphere: Atmosphere,
        density: float,
        bias: float,
        variant: DepthVariant | None = None,
    ) -> None:
        """Water density [kg/m³], accelerometer bias [m/s²]; `variant` replaces the settings'."""
        self.surprise = 0.0  # [σ] newest innovation, normalised by its standard deviation
        self.atmosphere = atmosphere
        self.moved = 0.0  # [m] sum of the jumps of the pressure that were believed
        self._settings = settings
        self._variant = VARIANTS[settings.observer] if variant is None else variant
        self._latency_ns = round(settings.pressure_latency * 1e9)
        self._per_metre = density * GRAVITY  # [Pa/m]
        self._datum_std = atmosphere.std / self._per_metre  # [m]
        self._sample_std = settings.pressure_std / self._per_metre  # [m]
        self._filter = DepthFilter(settings)
        self._filter.bias = bias
        self._at_ns = 0  # [ns] time of the filter
        self._input: float | None = None  # [m/s²] newest acceleration, bias included
        self._lean = LEVEL
        self._started = False
        self._lost = False  # the next sample gives the depth; the rate may still be known
        self._accepted_ns: int | None = None  # [ns] time of validity of the last accepted sample
        self._rejected: RejectedSamples | None = None  # since the last accepted sample
        self._newest = 0.0  # [m] newest sample judged
        self._mean = MeanInnovation()
        self._check = InnovationCheck()
        self._outlier_ns: int | None = None  # [ns] newest that was the first in a row
        self._trial: AccelerometerTrial | None = None  # None: the accelerometer is used
        self._clipped = _Clipped()
        self._refuses = False  # the velocity that is expected by the thrust
        self._unread: tuple[float, int] | None = None  # [m], [ns] newest sample, if not timed

    def start(self, pressure: float, samples: int, at_ns: int, lean: Lean = LEVEL) -> None:
        """Begin with the mean [Pa] of several samples taken at rest, and the attitude that the
        accelerometer measured there."""
        depth_std, bias_std = self._sample_std / sqrt(samples), RESTING_BIAS_STD
        self._filter.level(lean)
        self._begin(self.depth_of(pressure), depth_std, RESTING_RATE_STD, bias_std, at_ns)
        self._at_ns = at_ns

    def depth_of(self, pressure: float) -> float:
        """[m]"""
        return (pressure - self.atmosphere.pressure) / self._per_metre

    def predict(self, acceleration: float | None, at_ns: int, lean: Lean = LEVEL) -> str | None:
        """Advance to `at_ns`. `acceleration` [m/s²] along down is measured or, for the observer
        "reference", of the reference; None: unknown. `lean`: of the accelerometer. Returns an event
        to count."""
        dt = (at_ns - self._at_ns) * 1e-9
        if dt <= 0.0:
            return None
        if not self._variant.driven:
            acceleration = None
        trial, measured = self._trial, acceleration
        if trial is not None:
            acceleration = None
        before, self._input, self._lean, self._at_ns = self._input, acceleration, lean, at_ns
        if not self._started:
            return None
        heard = self._heard_within(self._settings.lost_after, at_ns)
        if dt > LONGEST_STEP or not (heard or self._knows_rate):
            return self._stop(None if self._lost else "lost:depth")
        acceleration = self._mean_of(before, acceleration, dt)
        self._filter.predict(acceleration, dt, self._variant.measured, lean)
        if trial is not None:
            trial.predict(measured, dt, lean)
        if not self._filter.is_sound():
            return self._reset()
        if not heard and not self._lost:
            self._lost = True
            return "lost:depth"
        if self._unread is not None:
            return self._read(self._unread)
        return self._speed_refused()

    def _speed_refused(self) -> str | None:
        """An event to count, once when the expected velocity begins to be refused."""
        before, self._refuses = self._refuses, self._filter.unexpected
        return "outlier:vehicle/actuation" if self._refuses and not before else None

    def _mean_of(self, before: float | None, newest: float | None, dt: float) -> float | None:
        """[m/s²] Mean of both ends of a step [s]: the newest alone would lead by half of it. After
        a shock, what was between them is not known."""
        if before is None or newest is None:
            return newest
        change = abs(newest - before)
        if change > SHOCK and self._variant.measured:
            self._filter.doubt(0.0, 0.5 * change * dt)
        return (before + newest) / 2.0

    def pressure(self, pressure: float, stamp_ns: int) -> str | None:
        """Use a validated sample [Pa]. Returns an event to count."""
        depth = self.depth_of(pressure)
        stamp_ns -= self._latency_ns
        if not self._started or self._lost:
            self._at_ns, rate = max(self._at_ns, stamp_ns), self._filter.rate
            self._begin(depth, self._sample_std, MOVING_STD, 0.1, stamp_ns)
            self._filter.rate = rate
            return None
        age = (self._at_ns - stamp_ns) * 1e-9
        if not -AHEAD <= age <= LATEST_AGE:
            return "late:sensor/pressure"
        if self._variant.timed:
            return self._correct(depth, stamp_ns, age)
        self._unread = depth, stamp_ns
        return None

    def estimates(self, now: int) -> tuple[Estimate, Estimate, Estimate]:
        """Depth [m], rate [m/s], acceleration [m/s²]; positive down. Valid for `valid_for` after
        an accepted sample; the rate also for as long as the accelerometer alone keeps it known; the
        acceleration only with accelerometer samples. The depth's standard deviation includes the
        atmosphere's, which is constant during a dive."""
        f, valid = self._filter, self._heard_within(self._settings.valid_for, now)
        measured = self._input is not None and self._variant.measured
        if measured:
            acceleration = f.unbiased(self._input or 0.0, self._lean)
            acceleration_std = sqrt(f.acceleration_variance(self._lean, BANDWIDTH))
        else:
            acceleration = self._input or 0.0
            acceleration_std = hypot(f.bias_std, self._settings.motion_noise * sqrt(BANDWIDTH))
        off, rate_off = self._check.excess
        off = max(off, self._clipped.distance)
        return (
            Estimate(f.depth, hypot(f.depth_std, self._datum_std, off), valid),
            Estimate(f.rate, hypot(f.rate_std, rate_off), valid or self._knows_rate),
            Estimate(acceleration, acceleration_std, valid and measured),
        )

    def pressure_age_ms(self, now: int) -> float | None:
        """[ms] Since the last accepted sample; None before the first."""
        return None if self._accepted_ns is None else max(0, now - self._accepted_ns) * 1e-6

    @property
    def rate(self) -> tuple[float, float]:
        """[m/s] Depth rate, positive down, and its standard deviation."""
        return self._filter.rate, self._filter.rate_std

    @property
    def bias(self) -> float:
        """[m/s²] of the vertical accelerometer."""
        return self._filter.bias

    def _read(self, sample: tuple[float, int]) -> str | None:
        """Use the newest sample as if it were of this moment."""
        if not self._variant.held:
            self._unread = None
        return self._correct(*sample, age=0.0)

    def _correct(self, depth: float, stamp_ns: int, age: float) -> str | None:
        innovation, variance = self._filter.innovation(depth, self._sample_std, age)
        std = sqrt(variance)
        self.surprise = innovation / std
        if abs(self.surprise) > self._settings.gate:
            return self._outlier(innovation, depth, stamp_ns)
        most = self._settings.clip * std
        used = max(-most, min(most, innovation))
        since = 0.0 if self._accepted_ns is None else (stamp_ns - self._accepted_ns) * 1e-9
        unlike = self._check.add(
            innovation, variance, self._filter, max(0.0, since), not self._uses_accelerometer
        )
        self._filter.update(used, variance, age)
        self._accept(stamp_ns)
        if not self._filter.is_sound():
            return self._reset()
        lasts = self._clipped.lasts(innovation, most, stamp_ns)
        event = self._judge_accelerometer(used / std, depth, age, stamp_ns)
        if event is None and unlike:
            event = "inconsistent:sensor/pressure"
        return event or ("clipped:sensor/pressure" if lasts else None)

    def _judge_accelerometer(
        self, normalised: float, depth: float, age: float, stamp_ns: int
    ) -> str | None:
        """After a sample [m] with this clipped innovation [σ]."""
        if self._trial is not None:
            if not self._trial.passed(depth, self._sample_std, age, stamp_ns, self._filter):
                return None
            self._filter, self._trial = self._trial.filter, None
            self._mean, self._check = MeanInnovation(), InnovationCheck()
            return "trusted:sensor/imu"
        repeated, self._newest = depth == self._newest, depth
        if repeated or not self._uses_accelerometer:
            return None  # a value that repeats may be of a frozen sensor
        if self._mean.add(normalised, stamp_ns) <= MOST_MEAN:
            return None
        self._filter.doubt(0.0, RATE_STD)
        return self._distrust()

    @property
    def distrusts_accelerometer(self) -> bool:
        """Its acceleration does not fit the pressure: depth from pressure alone."""
        return self._trial is not None

    @property
    def _uses_accelerometer(self) -> bool:
        return self._variant.measured and self._trial is None and self._input is not None

    def doubt_accelerometer(self) -> str | None:
        """The attitude has been wrong for a while. Returns an event to count."""
        if not self._uses_accelerometer:
            return None
        self._filter.doubt(DOUBTED_STD, DOUBTED_RATE_STD)
        return self._distrust()

    @property
    def _knows_rate(self) -> bool:
        return self._started and self._uses_accelerometer and self._filter.rate_std <= KNOWN_RATE

    def _distrust(self) -> str:
        """Go on with pressure alone."""
        self._trial, self._input = AccelerometerTrial(self._settings, self._filter), None
        return "distrusted:sensor/imu"

    def _outlier(self, innovation: float, depth: float, stamp_ns: int) -> str:
        self._unread = None
        if self._rejected is None:
            grown = self._mean.mean * innovation > GROWN * abs(innovation)
            before, self._outlier_ns = self._outlier_ns, stamp_ns
            lone = before is None or (stamp_ns - before) * 1e-9 > MEMORY
            if grown and lone and self._uses_accelerometer:
                self._filter.doubt(0.0, RATE_STD)
                return self._distrust()
            patience = self._settings.outlier_run if self._trial is None else ALONE_RUN
            self._rejected = RejectedSamples(depth, stamp_ns, patience)
        over = self._rejected.add(innovation, depth, stamp_ns)
        if not over and not self._rejected.diverges(self._most_spread):
            return "outlier:sensor/pressure"
        rejected, self._rejected = self._rejected, None
        return self._believe(rejected, stamp_ns)

    def _believe(self, rejected: RejectedSamples, stamp_ns: int) -> str:
        """Believe the pressure if its samples, rejected for long, agree with each other."""
        most = self._most_spread
        jump, line, f = rejected.innovations, rejected.depths, self._filter
        if jump.spread <= most and abs(jump.slope) <= LEVEL_LINE + 3.0 * jump.slope_std:
            f.depth += jump.level
            f.doubt(self._sample_std, 0.0)
            self._jumped(jump.level)
            event = "jumped:sensor/pressure"
        elif line.spread <= most:
            f.start(line.level, self._sample_std, RATE_STD + line.slope_std, f.bias, f.bias_std)
            f.rate = line.slope
            if self._uses_accelerometer:
                self._distrust()
            event = "restarted:depth"
        else:
            return "outlier:sensor/pressure"
        self._clipped, self._mean, self._check = _Clipped(), MeanInnovation(), InnovationCheck()
        self._accept(stamp_ns)
        if self._trial is not None:
            self._trial.begin(f)
        return event

    @property
    def _most_spread(self) -> float:
        """[m] of samples that agree with each other."""
        return SCATTER + 3.0 * self._sample_std

    def _jumped(self, by: float) -> None:
        """The depth has moved by this [m], and the vehicle has not: either may be right."""
        self.moved += by
        self.atmosphere = Atmosphere(
            self.atmosphere.pressure, hypot(self.atmosphere.std, by * self._per_metre)
        )
        self._datum_std = self.atmosphere.std / self._per_metre

    def _begin(
        self, depth: float, depth_std: float, rate_std: float, bias_std: float, stamp_ns: int
    ) -> None:
        self._filter.start(depth, depth_std, rate_std, self._filter.bias, bias_std)
        self._started, self._lost = True, False
        self._unread = None
        self._clipped, self._mean, self._check = _Clipped(), MeanInnovation(), InnovationCheck()
        if self._trial is not None:
            self._trial.begin(self._filter)
        self._accept(stamp_ns)

    def _accept(self, stamp_ns: int) -> None:
        self._accepted_ns = stamp_ns
        self._rejected = None

    def _heard_within(self, seconds: float, now: int) -> bool:
        heard = self._accepted_ns
        return self._started and heard is not None and (now - heard) * 1e-9 <= seconds

    def _stop(self, why: str | None) -> str | None:
        """Hold the depth, claim no rate, wait for the next sample."""
        self._filter.rate = 0.0
        self._started = self._lost = False
        self._unread = None
        self._clipped, self._check = _Clipped(), InnovationCheck()
        return why

    def _reset(self) -> str | None:
        """Last line of defence against numbers that are not finite."""
        self._filter = DepthFilter(self._settings)
        return self._stop("not_finite:depth")


class _Clipped:
    """How long innovations have been clipped on one side."""

    __slots__ = ("_above", "_counted", "_since_ns", "distance")

    def __init__(self) -> None:
        self.distance = 0.0  # [m] between filter and sensor, while it lasts
        self._above = False
        self._since_ns: int | None = None
        self._counted = False

    def lasts(self, innovation: float, most: float, stamp_ns: int) -> bool:
        """Take in an innovation [m] clipped at `most` [m]. True once, when clipping has lasted."""
        above = innovation > 0.0
        if abs(innovation) <= most or above != self._above or self._since_ns is None:
            self.distance, self._counted = 0.0, False
            self._above, self._since_ns = above, stamp_ns if abs(innovation) > most else None
            return False
        if (stamp_ns - self._since_ns) * 1e-9 < LASTING:
            return False
        self.distance = abs(innovation)
        newly, self._counted = not self._counted, True
        return newly
