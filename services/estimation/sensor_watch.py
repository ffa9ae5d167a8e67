"""Is a sensor alive, and can what it says be true? One `SensorWatch` for each sensor, judged by its
own samples alone: order, range, rate, repetition, noise, silence.

Ports have already refused malformed messages, NaN and infinities. Each change from good to bad is
told once, not every bad sample; why a sample is refused is returned for each of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, erf, hypot, inf, log, sqrt
from typing import Annotated, Any

import msgspec

from messages import events, topics
from messages.events import Event, Outbox
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from messages.units import WithinAnHour
from services.marine.rhythm import SampleRhythm
from services.marine.summation import plain_sum
from services.marine.vehicle import Thruster

SensorRate = Annotated[float, msgspec.Meta(ge=1.0, le=100.0)]
ImuRate = Annotated[float, msgspec.Meta(ge=10.0, le=400.0)]

# Range, against broken and saturated sensors.
# [m/s²] less is a dead sensor (a vehicle in water never falls freely); ±16 g parts end at 157.
LEAST_FORCE, MOST_FORCE = 0.5, 156.0
MOST_RATE = 34.8  # [rad/s] ±2000 deg/s parts end at 34.9
LEAST_PRESSURE, MOST_PRESSURE = 50e3, 12e6  # [Pa] from a mountain lake to 1100 m of sea
MOST_SPEED = 15.0  # [m/s] over the ground
MOST_DISTANCE = 20e3  # [m] range of acoustic positioning
LEAST_FIELD, MOST_FIELD = 15e-6, 100e-6  # [T] the Earth's is 22 to 67 µT

# Rate.
RATE_TOLERANCE = 0.2  # [-] of the sensor's rate
WINDOW = 2.0  # [s] over which a rate is judged
GAP = 5.0  # [periods] a longer break is a drop-out and does not count in the rate

# Silence, after the first sample. A silent IMU shows in the state, a silent pressure sensor in the
# age of its sample.
MAGNETOMETER_SILENT, DVL_SILENT, USBL_SILENT = 1.0, 5.0, 20.0  # [s]

# Repetition. A noisy sensor never repeats a value for so long.
MAGNETOMETER_FROZEN, PRESSURE_FROZEN, DVL_FROZEN, USBL_FROZEN = 1.0, 10.0, 10.0, 20.0  # [s]
# [-] of all thrust that there is: 1 % of a BlueROV2's is 2.4 N, eight steps of an accelerometer of
# 1 mg; for as long as it does not change the vehicle may be at rest.
NOTICEABLE = 0.01
IMPOSSIBLE = 1e-9  # [-] probability: frozen
UNLIKELY = 1e-3  # [-] probability: the samples say nothing new and are not used
LEAST = 0.5  # [s] a driver may repeat the newest value of a slower sensor for as long
CHANGES = 100  # changes and repeats together, from which σ is measured
ONE = 1.5  # [steps] a smaller change is one of a single step

# Noise, of second differences x₀ - 2 x₁ + x₂.
# 1σ of one sample that the pilot is told of; the filters weigh it long before.
GYRO_NOISE, FORCE_NOISE, PRESSURE_NOISE = 0.15, 2.0, 5000.0  # [rad/s], [m/s²], [Pa]
NOISE_SAMPLES = 40  # of the running mean
MOST = 3.0  # [-] times its limit: a larger one counts as that, so that one jump is no noise
GOOD = 0.5  # [-] of the limit, to be quiet again


class WatchSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How long identical values are allowed, and the rates.

    A sensor with coarse resolution repeats a value at rest: allow longer. Pressure is found frozen
    much sooner by its own noise and resolution (`FrozenWatch`), once these are measured.
    """

    imu_frozen: WithinAnHour = 0.2  # [s]
    # The same as long as the thrust does not change, for an IMU whose steps are coarser than its
    # noise; None: no longer than `imu_frozen`.
    imu_frozen_at_rest: WithinAnHour | None = None  # [s]
    imu_rate: ImuRate = topics.IMU.hz  # [1/s] another one is told, and its samples are used
    pressure_rate: SensorRate = topics.PRESSURE.hz  # [1/s] of this vehicle's sensor
    magnetometer_rate: SensorRate = topics.MAGNETOMETER.hz  # [1/s] the same


class SensorWatch:
    """Watches one sensor. `outbox` is told of what begins."""

    def __init__(
        self,
        key: str,
        frozen_after: float,
        outbox: Outbox,
        hz: float | None = None,
        silent_after: float = inf,
        noise: tuple[float, ...] = (),
        std: float | None = None,
        at_rest: "tuple[float, ThrustWatch] | None" = None,
        *,
        by_rhythm: bool = False,
    ) -> None:
        """
        Args:
            key: topic.
            frozen_after: [s] of identical samples.
            hz: [1/s] None: any rate.
            silent_after: [s] without samples.
            noise: largest 1σ of each number; empty: any.
            std: declared 1σ of the only number, to find out sooner that it is frozen.
            by_rhythm: silent sooner, where its samples come often enough.
            at_rest: [s] in place of `frozen_after` while nothing moves the vehicle, and who knows.
        """
        self._key, self._outbox = key, outbox
        self._content: tuple[float, ...] | None = None
        self._stamp_ns: int | None = None
        self._silent_after, self._silent = silent_after, False
        self._rhythm = SampleRhythm(silent_after) if by_rhythm else None
        self._excuse: Event | None = None  # what the sensor itself says it lacks
        # Rate: a whole window of periods, drop-outs left out, within these times.
        self._rate_wrong = False
        self._periods = self._span_ns = 0
        self._window = 0 if hz is None else max(5, round(WINDOW * hz))
        self._gap_ns = inf if hz is None else GAP * 1e9 / hz
        window_ns = 0.0 if hz is None else self._window * 1e9 / hz
        self._shortest_ns = window_ns / (1.0 + RATE_TOLERANCE)
        self._longest_ns = window_ns / (1.0 - RATE_TOLERANCE)
        # Repetition.
        self._frozen = False
        self._frozen_ns = round(frozen_after * 1e9)
        self._same_since_ns = 0
        self._moved_ns: int | None = None  # the vehicle, first since then
        self._repeats = None if std is None else FrozenWatch(std, frozen_after)
        self._rest_ns = None if at_rest is None else round(at_rest[0] * 1e9)
        self._thrust = None if at_rest is None else at_rest[1]
        self._noise = NoiseWatch(noise) if noise else None

    def trouble(self, now: int) -> Event | None:
        """What is wrong with the sensor now; None: nothing. Tells of a silence once; a sensor
        without any sample so far is absent, not silent. A noisy one is used."""
        last_ns = self._stamp_ns
        if last_ns is not None and not self._silent:
            rhythm = self._rhythm
            patience = self._silent_after if rhythm is None else rhythm.patience
            self._silent = (now - last_ns) * 1e-9 > patience
            if self._silent:
                self._outbox.tell(events.SILENT(self._key))
        if self._silent:
            return events.SILENT(self._key)
        if self._excuse is not None:
            return self._excuse
        if self._frozen:
            return events.FROZEN(self._key)
        if self._noise is not None and self._noise.noisy:
            return events.NOISY(self._key)
        return None

    def excused(self, why: Event, stamp_ns: int) -> None:
        """The sensor is alive and says itself why it measures nothing now."""
        self._excuse, self._stamp_ns, self._silent = why, max(stamp_ns, self._stamp_ns or 0), False
        if self._rhythm is not None:
            self._rhythm.see(stamp_ns)

    def judge(self, content: tuple[float, ...], stamp_ns: int) -> Event | None:  # noqa: C901
        """Why a sample cannot be used; None: it can. In one piece: these are all the questions.

        Args:
            content: the numbers it measures.
            stamp_ns: [ns] of its time of validity.
        """
        tell, key = self._outbox.tell, self._key
        before, last_ns = self._content, self._stamp_ns
        if last_ns is not None and stamp_ns <= last_ns:
            same = stamp_ns == last_ns and content == before
            refused = events.DUPLICATED(key) if same else events.NOT_NEWER(key)
            tell(refused)
            return refused
        self._content, self._stamp_ns = content, stamp_ns
        self._silent, self._excuse = False, None
        if self._rhythm is not None:
            self._rhythm.see(stamp_ns)

        if self._window and last_ns is not None:
            if stamp_ns - last_ns > self._gap_ns:
                self._periods = self._span_ns = 0
            else:
                self._periods += 1
                self._span_ns += stamp_ns - last_ns
            if self._periods >= self._window:
                wrong = not self._shortest_ns <= self._span_ns <= self._longest_ns
                if wrong and not self._rate_wrong:
                    tell(events.RATE(key))
                self._periods, self._span_ns, self._rate_wrong = 0, 0, wrong

        was, repeats = self._frozen, self._repeats
        if repeats is not None:
            repeats.step(content[0], stamp_ns)
            self._frozen = repeats.frozen
        elif content != before:
            self._same_since_ns, self._moved_ns, self._frozen = stamp_ns, None, False
        elif self._rest_ns is None:
            self._frozen = stamp_ns - self._same_since_ns >= self._frozen_ns
        else:
            # Has it said the same for too long, at rest or since the thrust began to change?
            changed_ns = None if self._thrust is None else self._thrust.changed_ns
            if self._moved_ns is None and changed_ns is not None:
                self._moved_ns = changed_ns if changed_ns > self._same_since_ns else None
            moved_ns = self._moved_ns
            self._frozen = stamp_ns - self._same_since_ns >= self._rest_ns or (
                moved_ns is not None and stamp_ns - moved_ns >= self._frozen_ns
            )
        if self._frozen and not was:
            tell(events.FROZEN(key))
        if repeats is not None and repeats.redundant:
            return events.FROZEN(key)

        noise = self._noise
        if noise is not None and noise.newly_noisy(content):
            tell(events.NOISY(key))
        return events.FROZEN(key) if self._frozen else None

    @property
    def noise(self) -> Sequence[float]:
        """Variance of each number of a sample now; empty: it is not measured."""
        return () if self._noise is None else self._noise.variances


class FrozenWatch:
    """Does a sensor of one number repeat a value more often than its noise allows?

    A value rounded to steps q, with normal noise σ, is the same value again with a probability of
    at most p = erf(q / (2 √2 σ)): that of a truth in the middle of a step. So n samples in a row
    are all the same with a probability of at most p^(n - 1). The rule follows from the sensor: one
    without rounding hardly ever repeats a value; one whose step is much coarser than its noise may
    repeat it for ever, and is not called frozen.

    q is the smallest change ever seen. σ is as declared, or the least ever measured if that is
    less, because a data sheet's "precision" is rarely the noise of one sample. It is measured by
    second differences, in which a steady climb has no share: a vehicle that moves is not noise.
    Before the first measurement of it, only a repetition for `longest` seconds counts. Frozen from
    the sample that makes the run impossible until the value changes.
    """

    __slots__ = (
        "_change", "_count", "_long", "_longest_ns", "_measured", "_newest", "_repeats", "_run",
        "_short", "_since_ns", "_std", "_step", "_sum", "frozen", "redundant",
    )  # fmt: skip

    def __init__(self, std: float, longest: float) -> None:
        """Declared noise `std` in the sensor's unit, `longest` in [s]."""
        self.frozen = False
        self.redundant = False  # the newest sample says nothing new
        self._std, self._step, self._measured = std, inf, inf
        self._longest_ns = round(longest * 1e9)
        self._short = self._long = inf  # samples in a row that are unlikely and impossible
        self._newest: float | None = None
        self._since_ns = self._repeats = self._count = 0
        self._change = 0.0  # from the sample before the newest to it
        self._run = self._sum = 0.0  # squared second differences in this run, and in this block

    def step(self, value: float, stamp_ns: int) -> None:
        before, self._newest = self._newest, value
        if before is not None:
            difference = value - before - self._change
            self._change = value - before
            self._run += difference * difference
        if before is None or value != before:
            if before is not None:
                self._learn(abs(value - before))
            self._since_ns, self._repeats, self._run = stamp_ns, 0, 0.0
            self.frozen = self.redundant = False
            return
        self._repeats += 1
        samples, lasted_ns = self._repeats + 1, stamp_ns - self._since_ns
        self.redundant = samples >= self._short
        if self._measured == inf:
            self.frozen = lasted_ns >= self._longest_ns
        else:
            self.frozen = samples >= self._long and lasted_ns >= LEAST * 1e9

    def _learn(self, change: float) -> None:
        """A run has ended with this change: a single step, or the run was not of a fault."""
        self._step = min(self._step, change)
        if not self.frozen or change < ONE * self._step:
            self._count += 1 + self._repeats
            self._sum += self._run
        else:
            self._change = 0.0
        if self._count >= CHANGES:  # a second difference has the variance 6 σ²
            self._measured = min(self._measured, sqrt(self._sum / (6 * self._count)))
            self._count, self._sum = 0, 0.0
            std = min(self._std, self._measured)
            self._short = in_a_row(self._step, std, UNLIKELY)
            self._long = in_a_row(self._step, std, IMPOSSIBLE)


def in_a_row(step: float, std: float, probability: float) -> float:
    """[-] Identical samples in a row that are less likely than `probability`, for a value rounded
    to `step` with noise `std` in the same unit; infinity: they never are."""
    same = erf(step / (2.0 * sqrt(2.0) * std)) if std > 0.0 else 1.0
    if same >= 1.0:
        return inf
    if same <= 0.0:
        return 2
    return max(2, 1 + ceil(log(probability) / log(same)))


class NoiseWatch:
    """How noisy a sensor is now. More than its limit is told, once, until it is well within it
    again; the filters believe its samples less, and go on.

    Judged by second differences, in which steady motion and acceleration have no share. Those of
    white noise with the standard deviation σ have the variance 6 σ².
    """

    __slots__ = ("_after", "_before", "_largest", "_most", "noisy", "variances")

    def __init__(self, most: tuple[float, ...]) -> None:
        """`most`: 1σ of each number of a sample."""
        self.noisy = False
        self.variances = [0.0] * len(most)  # of each number now, over `NOISE_SAMPLES`
        self._most = [limit * limit for limit in most]
        self._largest = [6.0 * MOST * MOST * limit * limit for limit in most]
        self._before: tuple[float, ...] | None = None
        self._after: tuple[float, ...] | None = None

    def newly_noisy(self, content: tuple[float, ...]) -> bool:
        """Take in a sample. True when it becomes too noisy."""
        first, middle = self._before, self._after
        self._before, self._after = middle, content
        if first is None or middle is None:
            return False
        variances, largest, worst = self.variances, self._largest, 0.0
        for i, value in enumerate(content):
            difference = first[i] - 2.0 * middle[i] + value
            square = difference * difference
            if square > largest[i]:
                square = largest[i]
            variances[i] += (square / 6.0 - variances[i]) / NOISE_SAMPLES
            worst = max(worst, variances[i] / self._most[i])
        was, self.noisy = self.noisy, worst > (GOOD * GOOD if self.noisy else 1.0)
        return self.noisy and not was


@dataclass(slots=True)
class ThrustWatch:
    """When the thrust changed last by so much that the vehicle moves otherwise than before, so that
    an IMU must say something new."""

    _noticeable: float  # [N] sum over all thrusters
    _thrust: Sequence[float]  # [N] per thruster, when it changed last
    changed_ns: int | None = None

    @classmethod
    def of(cls, thrusters: Sequence[Thruster]) -> "ThrustWatch":
        most = plain_sum([thruster.max_thrust for thruster in thrusters])
        return cls(NOTICEABLE * most, [0.0] * len(thrusters))

    def see(self, thrust: Sequence[float], stamp_ns: int) -> None:
        """[N] Per thruster, as reported; a report of another length is left alone."""
        if len(thrust) != len(self._thrust):
            return
        change = 0.0
        for before, now in zip(self._thrust, thrust, strict=True):
            change += abs(now - before)
        if change > self._noticeable:
            self._thrust, self.changed_ns = thrust, stamp_ns


# What a sensor measures, and why it cannot be true; None: it can.


def imu_numbers(sample: ImuSample) -> tuple[tuple[float, ...], Event | None]:
    force, rate = sample.specific_force, sample.angular_rate
    content = (*force, *rate)
    # An axis at the end of its range: the true value is unknown.
    if max(map(abs, force)) >= MOST_FORCE or max(map(abs, rate)) >= MOST_RATE:
        return content, events.SATURATED_IMU()
    possible = hypot(*force) >= LEAST_FORCE
    return content, None if possible else events.IMPLAUSIBLE(topics.IMU.key)


def pressure_numbers(sample: PressureSample) -> tuple[tuple[float, ...], Event | None]:
    possible = LEAST_PRESSURE <= sample.pressure <= MOST_PRESSURE
    return (sample.pressure,), None if possible else events.IMPLAUSIBLE(topics.PRESSURE.key)


def magnetometer_numbers(sample: MagnetometerSample) -> tuple[tuple[float, ...], Event | None]:
    possible = LEAST_FIELD <= hypot(*sample.field) <= MOST_FIELD
    return sample.field, None if possible else events.IMPLAUSIBLE(topics.MAGNETOMETER.key)


def dvl_numbers(sample: DvlSample) -> tuple[tuple[float, ...], Event | None]:
    if sample.velocity is None:
        return (), events.NO_BOTTOM(topics.DVL.key)
    possible = hypot(*sample.velocity) <= MOST_SPEED and sample.std <= MOST_SPEED
    return sample.velocity, None if possible else events.IMPLAUSIBLE(topics.DVL.key)


def usbl_numbers(sample: UsblSample) -> tuple[tuple[float, ...], Event | None]:
    place = sample.north, sample.east
    possible = hypot(*place) <= MOST_DISTANCE and sample.std <= MOST_DISTANCE
    return place, None if possible else events.IMPLAUSIBLE(topics.USBL.key)


NUMBERS: dict[str, Callable[[Any], tuple[tuple[float, ...], Event | None]]] = {
    topics.IMU.key: imu_numbers,
    topics.PRESSURE.key: pressure_numbers,
    topics.MAGNETOMETER.key: magnetometer_numbers,
    topics.DVL.key: dvl_numbers,
    topics.USBL.key: usbl_numbers,
}


def watches_of(
    limits: WatchSettings, outbox: Outbox, pressure_std: float, thrust: ThrustWatch
) -> dict[str, SensorWatch]:
    """Of all sensors of a vehicle, by topic; `pressure_std` [Pa] is the declared noise of one
    sample."""
    imu, pressure, field, dvl, usbl = NUMBERS
    rest = limits.imu_frozen_at_rest
    return {
        imu: SensorWatch(
            imu, limits.imu_frozen, outbox, limits.imu_rate,
            noise=(FORCE_NOISE,) * 3 + (GYRO_NOISE,) * 3,
            at_rest=None if rest is None else (rest, thrust),
        ),
        pressure: SensorWatch(
            pressure, PRESSURE_FROZEN, outbox, limits.pressure_rate,
            noise=(PRESSURE_NOISE,), std=pressure_std,
        ),
        field: SensorWatch(
            field, MAGNETOMETER_FROZEN, outbox, limits.magnetometer_rate, MAGNETOMETER_SILENT
        ),
        dvl: SensorWatch(dvl, DVL_FROZEN, outbox, silent_after=DVL_SILENT, by_rhythm=True),
        usbl: SensorWatch(usbl, USBL_FROZEN, outbox, silent_after=USBL_SILENT),
    }  # fmt: skip
