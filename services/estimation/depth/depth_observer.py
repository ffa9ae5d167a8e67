"""From pressure samples to depth: the datum, the time of each sample, outliers and drop-outs."""

from dataclasses import dataclass
from math import exp, hypot, sqrt

from messages import events, topics
from messages.events import Event
from messages.message import Estimate
from services.estimation.aiding import MEMORY, Aiding
from services.estimation.attitude_axes import LEVEL, AttitudeAxes
from services.estimation.depth.depth_filter import CLIP, FAR, GATE, DepthFilter, DepthSettings
from services.estimation.depth.innovation_check import InnovationCheck
from services.estimation.depth.swell import Swell
from services.estimation.depth.trial import (
    MOST_MEAN,
    RATE_STD,
    AccelerometerTrial,
    RejectedSamples,
)
from services.marine.vehicle import GRAVITY

LOST_AFTER = 10.0  # [s] without pressure: prediction is useless, depth is held
LATEST_AGE = 0.5  # [s] an older sample is not used
AHEAD = 0.2  # [s] a sample may be this much newer than the newest IMU sample
VALID_FOR = 2.0  # [s] depth is valid this long after an accepted sample
LONGEST_STEP = 0.5  # [s] no prediction over a longer gap
MOVING_STD = 0.5  # [m/s] of the rate when the filter starts under way
RESTING_RATE_STD = 0.05  # [m/s] when it starts at rest; some swell
OUTLIER_RUN = 1.5  # [s] of outliers only, before they are believed
ALONE_RUN = 0.25  # [s] the same, without the accelerometer to tell a jump from a motion
GROWN = 0.6  # [σ] mean innovation before the first outlier: it has grown, and did not jump
DOUBTED_TILT = 0.1  # [rad] 1σ of an attitude that may be wrong
DOUBTED_STD, DOUBTED_RATE_STD = 0.3, 1.0  # [m], [m/s] errors after two seconds of wrong attitude
LEVEL_LINE = 0.05  # [m/s] slope of innovations that counts as none, and 3 σ
SCATTER = 0.05  # [m] about a line through samples that agree with each other, and 3 σ
KNOWN_RATE = 0.1  # [m/s] 1σ; without pressure the accelerometer keeps it below for half a minute
SHOCK = 1.0  # [m/s²] from sample to sample, as on the sea floor; thrusters change it by 0.1
RESTING_BIAS_STD = 0.01  # [m/s²] of the mean at rest: the vehicle may bob a little
NOISE_SAMPLES = 60  # of the running mean of the pressure's noise
MOST_NOISE = 9.0  # [-] times the mean: more counts as that, so that one jump is no noise
BY_CHANCE = 1.3  # [-] times the declared noise, or its inverse: what chance alone measures
QUIETER, NOISIER = 0.2, 10.0  # [-] times the declared noise, that is believed
SLOWER = 0.35  # [rad/s] cut-off of the depth filter in waves, which have 0.6 to 2
WHITE_SAMPLES = 60  # of the running means of innovations and of their products
ALIKE = 0.2  # [-] correlation of one innovation with the next that chance alone has
ADAPTING = 2.0  # [1/s] rate at which the acceleration is doubted, times the correlation
MOST_DOUBT = 100.0  # [-] times the density of the vibration
BANDWIDTH = 50.0  # [Hz] of the accelerometer at 100 Hz, to turn noise density into spread


@dataclass(frozen=True, slots=True)
class Atmosphere:
    """The air above the water, and how well it is known."""

    pressure: float  # [Pa]
    std: float  # [Pa]


class DepthObserver:
    """Depth of the vehicle's origin below the surface.

    A sample is used on arrival and applies at its own time, with H = [1, -age, 0, …]. Its
    innovation is clipped at `CLIP` σ (Huber 1964). This costs nothing with Gaussian noise and keeps
    a disturbance just inside the gate from changing the rate so much that the good samples after it
    look like outliers.

    What are pressure and acceleration worth now? The noise of the samples is measured
    (`_hear_noise`), the acceleration is believed as much as makes the innovations white (`_weigh`),
    and in waves (`swell.py`) the pressure is believed less.

    Does the innovation fit the stated spread? Its running mean and variance are in `aiding`; what
    is no noise (`innovation_check.py`: waves, latency, clipping that lasts) is in the standard
    deviations of depth and rate, and counted once (`inconsistent:`, `clipped:`).

    Who contradicts whom? (`trial.py`) Innovations of one sign on average, for longer or further
    than in a wave, mean that the accelerometer does not fit the pressure: depth comes from pressure
    alone until it does. An innovation beyond `GATE` σ is an outlier and is not used, unless the
    ones before had grown towards it. After `OUTLIER_RUN` seconds of outliers only that agree with
    each other, pressure is believed: either the depth is moved by the jump, which the reference
    follows, or the accelerometer was wrong. The latter needs only a quarter of a second where the
    filter leaves the samples fast.

    After `LOST_AFTER` seconds without an accepted sample the depth is lost, and the next valid
    sample restarts the filter. The rate is known for as long as the accelerometer keeps its
    standard deviation below `KNOWN_RATE`.
    """

    def __init__(
        self, settings: DepthSettings, atmosphere: Atmosphere, density: float, bias: float
    ) -> None:
        """Water density [kg/m³], accelerometer bias [m/s²]."""
        self.atmosphere = atmosphere
        self.moved = 0.0  # [m] sum of the jumps of the pressure that were believed
        self.aiding = Aiding("pressure", "m", (CLIP / GATE) ** 2)
        # Horizontal velocity, in a world whose yaw is the control heading.
        self.thrust_aiding = Aiding("thrust_north", "m/s"), Aiding("thrust_east", "m/s")
        self._settings = settings
        self._latency_ns = round(settings.pressure_latency * 1e9)
        self._per_metre = density * GRAVITY  # [Pa/m]
        self._datum_std = atmosphere.std / self._per_metre  # [m]
        self._sample_std = settings.pressure_std / self._per_metre  # [m]
        self._declared = self._calm_std = self._sample_std  # … as stated, and without waves
        self._noise = self._sample_std**2  # [m²] of one sample, as measured
        self._judged_ns = 0  # [ns] of the newest sample
        self._product, self._square, self._last = 0.0, 1.0, 0.0
        self._two = 0.0, 0.0  # [m] newest samples
        self._filter = DepthFilter(settings)
        self._filter.bias = bias
        self._at_ns = 0  # [ns] time of the filter
        self._input: float | None = None  # [m/s²] newest acceleration, bias included
        self._axes = LEVEL
        self._started = False
        self._lost = False  # the next sample gives the depth; the rate may still be known
        self._accepted_ns: int | None = None  # [ns] time of validity of the last accepted sample
        self._rejected: RejectedSamples | None = None  # since the last accepted sample
        self._newest = 0.0  # [m] newest sample judged
        self._check = InnovationCheck()
        self._swell = Swell()
        self._waves = False  # they are told
        self._outlier_ns: int | None = None  # [ns] newest that was the first in a row
        # Not None: the acceleration does not fit the pressure, and depth is from pressure alone.
        self.trial: AccelerometerTrial | None = None
        self._refuses = False  # the velocity that is expected by the thrust

    @property
    def pressure_aiding(self) -> tuple[Aiding, ...]:
        """What was made of the pressure: by the filter in use, and by the one on trial."""
        return (self.aiding,) if self.trial is None else (self.aiding, self.trial.aiding)

    def start(self, pressure: float, samples: int, at_ns: int, axes: AttitudeAxes = LEVEL) -> None:
        """Begin with the mean [Pa] of several samples taken at rest, and the attitude that the
        accelerometer measured there."""
        depth_std, bias_std = self._sample_std / sqrt(samples), RESTING_BIAS_STD
        lack = self._filter.bias
        self._begin(self.depth_of(pressure), depth_std, RESTING_RATE_STD, bias_std, at_ns)
        self._filter.level(axes, lack, bias_std)
        self._at_ns = at_ns

    def depth_of(self, pressure: float) -> float:
        """[m]"""
        return (pressure - self.atmosphere.pressure) / self._per_metre

    def correct_atmosphere(self, atmosphere: Atmosphere) -> None:
        """The air has been measured: the depth is moved, and the vehicle has not."""
        by = (self.atmosphere.pressure - atmosphere.pressure) / self._per_metre
        self._filter.depth += by
        self.moved += by
        self.atmosphere = atmosphere
        self._datum_std = atmosphere.std / self._per_metre
        self._two = self._two[0] + by, self._two[1] + by
        self._rejected = None

    def predict(  # noqa: C901 - one step, top down
        self, acceleration: float | None, at_ns: int, axes: AttitudeAxes = LEVEL
    ) -> Event | None:
        """Advance to `at_ns` with the measured acceleration [m/s²] along down, bias included; None:
        unknown. `axes`: of the vehicle, now. Returns an event to tell."""
        dt = (at_ns - self._at_ns) * 1e-9
        if dt <= 0.0:
            return None
        trial, measured = self.trial, acceleration
        if trial is not None:
            acceleration = None
        before, self._input, self._axes, self._at_ns = self._input, acceleration, axes, at_ns
        if before is None and acceleration is not None:  # those of a blind filter were not its
            self.aiding.forget()
        if not self._started:
            return None
        heard = self._heard_within(LOST_AFTER, at_ns)
        if dt > LONGEST_STEP or not (heard or self._knows_rate):
            return self._stop(None if self._lost else events.LOST_DEPTH())

        mean = acceleration
        if before is not None and acceleration is not None:
            # The newest alone would lead by half a step. After a shock, what was between the two
            # ends is not known.
            change = abs(acceleration - before)
            if change > SHOCK:
                self._filter.doubt(0.0, 0.5 * change * dt)
            mean = (before + acceleration) / 2.0
        self._filter.predict(mean, dt, axes)
        if trial is not None:
            trial.predict(measured, dt, axes)
        if not self._filter.is_sound():
            return self._reset()

        # What was made of the velocity that the thrust makes expect, told once when it begins to be
        # refused.
        event: Event | None = None
        seen, self._filter.compared = self._filter.compared, None
        if seen is not None:
            why = events.OUTLIER_ACTUATION() if seen.refused else None
            event, self._refuses = None if self._refuses else why, seen.refused
            for k, aiding in enumerate(self.thrust_aiding):
                value, off, variance = seen.expected[k], seen.off[k], seen.variance[k]
                ratio = off * off / (FAR * FAR * variance)
                aiding.compare(at_ns, value, off, variance, ratio, rejected=why)
        if not heard and not self._lost:
            self._lost = True
            return events.LOST_DEPTH()
        return event

    def pressure(self, pressure: float, stamp_ns: int) -> Event | None:
        """Use a validated sample [Pa]. Returns an event to tell."""
        depth = self.depth_of(pressure)
        stamp_ns -= self._latency_ns
        if not self._started or self._lost:
            self._at_ns, rate = max(self._at_ns, stamp_ns), self._filter.rate
            self._begin(depth, self._sample_std, MOVING_STD, 0.1, stamp_ns)
            self._filter.rate = rate
            return None
        age = (self._at_ns - stamp_ns) * 1e-9
        if not -AHEAD <= age <= LATEST_AGE:
            late = events.LATE_PRESSURE()
            self.aiding.refuse(late, stamp_ns)
            return late

        since = 0.0 if self._accepted_ns is None else (stamp_ns - self._accepted_ns) * 1e-9
        before, self._judged_ns = self._judged_ns, stamp_ns
        dt = min(max(0.0, (stamp_ns - before) * 1e-9), 0.5)
        self._hear_noise(depth, dt)
        innovation, variance = self._filter.innovation(depth, self._sample_std, age)
        std, ratio = sqrt(variance), innovation * innovation / (GATE * GATE * variance)
        if self._uses_accelerometer:
            self._swell.add(innovation, self._calm_std, dt)
        # A wave may leave the gate, but it does not jump there.
        near = self._uses_accelerometer and not self._swell.leaves and self._grown(innovation)
        if abs(innovation / std) > GATE and not near:
            why = self._outlier(innovation, depth, stamp_ns)
            self.aiding.compare(stamp_ns, depth, innovation, variance, ratio, rejected=why)
            return why
        most = CLIP * std
        used = max(-most, min(most, innovation))
        # A value that repeats may be of a frozen sensor, which says nothing of the accelerometer.
        fresh, self._newest = depth != self._newest, depth
        self.aiding.compare(stamp_ns, depth, innovation, variance, ratio, used, fresh=fresh)
        blind = not self._uses_accelerometer
        unlike = self._check.add(
            innovation, variance, most, self._filter, max(0.0, since), blind, self.aiding
        )
        told, self._waves = self._waves, self._swell.rolls
        if self._waves:  # which is why it does not fit
            unlike = None if told else events.WAVES_PRESSURE()
            self.aiding.verdict = events.WAVES_PRESSURE.name
        else:
            large = events.INCONSISTENT_PRESSURE.name if self._check.large else None
            self.aiding.verdict = large
        self._weigh(used, variance, dt)
        self._filter.update(used, variance, age)
        self._accepted_ns, self._rejected = stamp_ns, None
        if not self._filter.is_sound():
            return self._reset()

        if self.trial is not None:
            agrees = self.trial.passed(depth, self._sample_std, age, stamp_ns, self._filter)
            if not agrees or self._axes.tilt_std >= DOUBTED_TILT:
                return unlike
            self._filter, self.trial = self.trial.filter, None
            self._forget()
            return events.TRUSTED_IMU()
        # It takes time to tell a wave from a wrong accelerometer; a doubted attitude gives none.
        leaves = self._swell.leaves or self._axes.tilt_std >= DOUBTED_TILT
        against = leaves and abs(self.aiding.mean) > MOST_MEAN
        if fresh and self._uses_accelerometer and against:
            self._filter.doubt(0.0, RATE_STD)
            return self._distrust()
        return unlike

    def _hear_noise(self, depth: float, dt: float) -> None:
        """The noise of the samples by their second differences, in which motion has no share."""
        first, middle = self._two
        self._two = middle, depth
        off = first - 2.0 * middle + depth
        seen = min(off * off / 6.0, MOST_NOISE * self._noise)
        self._noise += (seen - self._noise) / NOISE_SAMPLES
        ratio = sqrt(self._noise) / self._declared
        if ratio > BY_CHANCE:
            ratio = min(NOISIER, ratio / BY_CHANCE)
        else:
            ratio = min(1.0, max(QUIETER, ratio * BY_CHANCE))
        self._sample_std = self._calm_std = ratio * self._declared
        if self._swell.rolls and self._uses_accelerometer:
            # So much that the filter does not follow the waves, and no more than they swing.
            density = sqrt(self._filter.acceleration_density(self._axes)) / SLOWER**2
            slow, swing = density / sqrt(max(dt, 0.005)), self._swell.amplitude
            waves = min(max(slow, 0.8 * swing), 2.0 * swing)
            self._sample_std = max(self._sample_std, waves)

    def _weigh(self, innovation: float, variance: float, dt: float) -> None:
        """Believe the accelerometer as much as makes the innovations white: of one sign from sample
        to sample they say that the filter follows too slowly (Mehra 1970)."""
        normalised = innovation / sqrt(variance)
        self._product += (normalised * self._last - self._product) / WHITE_SAMPLES
        self._square += (normalised * normalised - self._square) / WHITE_SAMPLES
        self._last = normalised
        likeness = self._product / self._square if self._square > 0.0 else 0.0
        beyond = max(0.0, abs(likeness) - ALIKE)
        step = exp(ADAPTING * dt * (beyond if likeness > 0.0 else -beyond))
        f = self._filter
        if self._swell.rolls:
            step = exp(-ADAPTING * dt)  # waves are alike from sample to sample as well
        f.doubt_of_force = max(1.0, min(MOST_DOUBT, f.doubt_of_force * step))

    def estimates(self, now: int) -> tuple[Estimate, Estimate, Estimate]:
        """Depth [m], rate [m/s], acceleration [m/s²]; positive down. Valid for `VALID_FOR` after
        an accepted sample; the rate also for as long as the accelerometer alone keeps it known; the
        acceleration only with accelerometer samples. The depth's standard deviation includes the
        atmosphere's, which is constant during a dive."""
        f, valid = self._filter, self._heard_within(VALID_FOR, now)
        if (measured := self._input) is not None:
            acceleration, acceleration_std = f.acceleration(measured, self._axes, BANDWIDTH)
        else:
            acceleration = 0.0
            acceleration_std = hypot(f.bias_std, self._settings.motion_noise * sqrt(BANDWIDTH))
        off, rate_off = self._check.excess
        return (
            Estimate(f.depth, hypot(f.depth_std, self._datum_std, off), valid),
            Estimate(f.rate, hypot(f.rate_std, rate_off), valid or self._knows_rate),
            Estimate(acceleration, acceleration_std, valid and measured is not None),
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

    def _forget(self) -> None:
        """The innovations before say nothing about those to come."""
        self.aiding.forget()
        self._check = InnovationCheck()
        self._swell = Swell()

    @property
    def _uses_accelerometer(self) -> bool:
        return self.trial is None and self._input is not None

    def doubt_accelerometer(self) -> Event | None:
        """The attitude has been wrong for a while. Returns an event to tell."""
        if not self._uses_accelerometer:
            return None
        self._filter.doubt(DOUBTED_STD, DOUBTED_RATE_STD)
        return self._distrust()

    @property
    def _knows_rate(self) -> bool:
        return self._started and self._uses_accelerometer and self._filter.rate_std <= KNOWN_RATE

    def _distrust(self) -> Event:
        """Go on with pressure alone."""
        self.trial, self._input = AccelerometerTrial(self._settings, self._filter), None
        return events.DISTRUSTED_IMU()

    def _outlier(self, innovation: float, depth: float, stamp_ns: int) -> Event:
        if self._rejected is None:
            grown = self._grown(innovation)
            before, self._outlier_ns = self._outlier_ns, stamp_ns
            lone = before is None or (stamp_ns - before) * 1e-9 > MEMORY
            if grown and lone and self._uses_accelerometer:
                self._filter.doubt(0.0, RATE_STD)
                return self._distrust()
            patience = OUTLIER_RUN if self.trial is None else ALONE_RUN
            self._rejected = RejectedSamples(depth, stamp_ns, patience)
        over = self._rejected.add(innovation, depth, stamp_ns)
        if not over and not self._rejected.diverges(self._most_spread):
            return events.OUTLIER(topics.PRESSURE.key)
        rejected, self._rejected = self._rejected, None
        return self._believe(rejected, stamp_ns)

    def _grown(self, innovation: float) -> bool:
        """Those before it were of its side: it has not jumped there."""
        return self.aiding.mean * innovation > GROWN * abs(innovation)

    def _believe(self, rejected: RejectedSamples, stamp_ns: int) -> Event:
        """Believe the pressure if its samples, rejected for long, agree with each other."""
        most = self._most_spread
        jump, line, f = rejected.innovations, rejected.depths, self._filter
        if jump.spread <= most and abs(jump.slope) <= LEVEL_LINE + 3.0 * jump.slope_std:
            f.depth += jump.level
            f.doubt(self._sample_std, 0.0)
            self._jumped(jump.level)
            event = events.JUMPED_PRESSURE()
        elif line.spread <= most:
            f.start(line.level, self._sample_std, RATE_STD + line.slope_std, f.bias, f.bias_std)
            f.rate = line.slope
            if self._uses_accelerometer:
                self._distrust()
            event = events.RESTARTED_DEPTH()
        else:
            return events.OUTLIER(topics.PRESSURE.key)
        self._forget()
        self._accepted_ns, self._rejected = stamp_ns, None
        if self.trial is not None:
            self.trial.begin(f)
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
        self._forget()
        if self.trial is not None:
            self.trial.begin(self._filter)
        self._accepted_ns, self._rejected = stamp_ns, None

    def _heard_within(self, seconds: float, now: int) -> bool:
        heard = self._accepted_ns
        return self._started and heard is not None and (now - heard) * 1e-9 <= seconds

    def _stop(self, why: Event | None) -> Event | None:
        """Hold the depth, claim no rate, wait for the next sample."""
        self._filter.rate = 0.0
        self._started = self._lost = False
        self._check = InnovationCheck()
        return why

    def _reset(self) -> Event | None:
        """Last line of defence against numbers that are not finite."""
        self._filter = DepthFilter(self._settings)
        return self._stop(events.NOT_FINITE("depth"))
