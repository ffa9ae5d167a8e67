"""Is a sensor alive, and can what it says be true? One `Sensor` for each, judged by its own samples
alone: order, range, rate, repetition, silence, noise. How well its samples fit the filter is
`Quantity`'s question (quantity.py).

Ports have already refused malformed messages, NaN and infinities. Each change from good to bad is
told once; why a sample is refused is returned for each of them.
"""

from collections.abc import Callable
from math import hypot, inf
from typing import Any

from messages import events, topics
from messages.events import Event, Outbox
from messages.sensors import (
    DvlSample,
    ImuSample,
    MagnetometerSample,
    PressureSample,
    UsblSample,
)
from services.estimation.settings import WatchSettings
from services.marine.rhythm import SampleRhythm

# Range, against broken and saturated sensors.
# [m/s²] less is a dead sensor (a vehicle in water never falls freely); ±16 g parts end at 157.
LEAST_FORCE, MOST_FORCE = 0.5, 156.0
MOST_RATE = 34.8  # [rad/s] ±2000 deg/s parts end at 34.9
LEAST_PRESSURE, MOST_PRESSURE = 50e3, 12e6  # [Pa] from a mountain lake to 1100 m of sea
MOST_SPEED = 15.0  # [m/s] over the ground
MOST_DISTANCE = 20e3  # [m] range of acoustic positioning
LEAST_FIELD, MOST_FIELD = 15e-6, 100e-6  # [T] the Earth's is 22 to 67 µT

RATE_TOLERANCE = 0.2  # [-] of the sensor's rate …
WINDOW = 2.0  # [s] … over which it is judged
GAP = 5.0  # [periods] a longer break is a drop-out and does not count in the rate
# Silence, after the first sample. A silent IMU shows in the state, a silent pressure sensor in the
# age of its sample.
MAGNETOMETER_SILENT, DVL_SILENT, USBL_SILENT = 1.0, 5.0, 20.0  # [s]
# A noisy sensor never repeats a value for so long.
PRESSURE_FROZEN, MAGNETOMETER_FROZEN, DVL_FROZEN, USBL_FROZEN = 0.8, 1.0, 10.0, 20.0  # [s]
# 1σ of one sample that the pilot is told of; the filter weighs it long before.
FORCE_NOISE, GYRO_NOISE, PRESSURE_NOISE = 2.0, 0.15, 5000.0  # [m/s²], [rad/s], [Pa]
NOISE_SAMPLES = 40  # of the running mean
GOOD = 0.5  # [-] of that limit, to be quiet again
REFUSED_NS = 500_000_000  # [ns] of samples that cannot be true, until the sensor is not used

Content = tuple[float, ...]


class Sensor:
    """Watches one sensor; `outbox` is told of what begins."""

    def __init__(
        self,
        key: str,
        outbox: Outbox,
        frozen_after: float,
        silent_after: float = inf,
        hz: float | None = None,
        noise: Content = (),
        *,
        by_rhythm: bool = False,
    ) -> None:
        """
        Args:
            key: topic.
            frozen_after: [s] of identical samples.
            silent_after: [s] without samples.
            hz: [1/s] None: any rate.
            noise: largest 1σ of each number; empty: any.
            by_rhythm: silent sooner, where its samples come often enough.
        """
        self.key, self._outbox = key, outbox
        self.frozen_ns = round(frozen_after * 1e9)
        self.rest_ns: int | None = None  # [ns] the same while nothing moves the vehicle
        self.moved_ns = 0  # [ns] when something moved it last
        self.repeats = False  # a repeated value is used until it is frozen; else it says nothing
        self.variances = [0.0] * len(noise)  # of each number of one sample, now
        self._content: Content | None = None
        self._stamp_ns: int | None = None
        self._silent_after, self._silent = silent_after, False
        self._rhythm = SampleRhythm(silent_after) if by_rhythm else None
        self._refused: Event | None = None  # why its newest sample cannot be true …
        self._refused_ns = 0  # [ns] … and since when that is so
        self._hz, self._periods, self._span_ns, self._rate_wrong = hz, 0, 0, False
        self._since_ns, self._since_moved_ns = 0, 0  # [ns] it says the same, and was moved first
        self._frozen = self._noisy = False
        self._limits = [limit * limit for limit in noise]
        self._before: Content | None = None
        self._after: Content | None = None

    def trouble(self, now: int) -> Event | None:
        """What is wrong with the sensor now; None: nothing. A sensor without any sample so far is
        absent, not silent. A noisy one is used."""
        if self._stamp_ns is not None and not self._silent:
            patience = self._silent_after if self._rhythm is None else self._rhythm.patience
            self._silent = (now - self._stamp_ns) * 1e-9 > patience
            if self._silent:
                self._outbox.tell(events.SILENT(self.key))
        if self._silent:
            return events.SILENT(self.key)
        if self._refused is not None and now - self._refused_ns > REFUSED_NS:
            return self._refused
        if self._frozen:
            return events.FROZEN(self.key)
        return events.NOISY(self.key) if self._noisy else None

    def refused(self, why: Event, stamp_ns: int) -> None:
        """The sensor is alive, but this sample measures nothing, or cannot be true."""
        self._outbox.tell(why)
        if self._refused is None:
            self._refused_ns = stamp_ns
        self._refused = why
        self._stamp_ns, self._silent = max(stamp_ns, self._stamp_ns or 0), False
        if self._rhythm is not None:
            self._rhythm.see(stamp_ns)

    def judge(self, content: Content, stamp_ns: int) -> Event | None:
        """Why a sample with these numbers at this time [ns] cannot be used; None: it can."""
        tell, key, last_ns = self._outbox.tell, self.key, self._stamp_ns
        same = content == self._content
        if last_ns is not None and stamp_ns <= last_ns:
            row = events.DUPLICATED if same and stamp_ns == last_ns else events.NOT_NEWER
            tell(row(key))
            return row(key)
        self._content, self._stamp_ns = content, stamp_ns
        self._silent, self._refused = False, None
        if self._rhythm is not None:
            self._rhythm.see(stamp_ns)
        if self._hz is not None and last_ns is not None:
            self._judge_rate(self._hz, stamp_ns - last_ns)
        if not same:
            self._since_ns, self._since_moved_ns, self._frozen = stamp_ns, 0, False
            self._hear_noise(content)
            return None
        if not self._since_moved_ns and self.moved_ns > self._since_ns:
            self._since_moved_ns = self.moved_ns
        limit_ns = self.frozen_ns if self.rest_ns is None else self.rest_ns
        frozen = stamp_ns - self._since_ns >= limit_ns or (
            self._since_moved_ns > 0 and stamp_ns - self._since_moved_ns >= self.frozen_ns
        )
        if frozen and not self._frozen:
            tell(events.FROZEN(key))
        self._frozen = frozen
        if self.repeats and not frozen:
            self._hear_noise(content)
            return None
        return events.FROZEN(key) if frozen or not self.repeats else None

    def _judge_rate(self, hz: float, period_ns: int) -> None:
        """By a whole window of periods, drop-outs left out."""
        if period_ns > GAP * 1e9 / hz:
            self._periods = self._span_ns = 0
            return
        self._periods += 1
        self._span_ns += period_ns
        window = max(5, round(WINDOW * hz))
        if self._periods < window:
            return
        ratio = self._span_ns * 1e-9 * hz / window
        wrong = not 1.0 / (1.0 + RATE_TOLERANCE) <= ratio <= 1.0 / (1.0 - RATE_TOLERANCE)
        if wrong and not self._rate_wrong:
            self._outbox.tell(events.RATE(self.key))
        self._periods, self._span_ns, self._rate_wrong = 0, 0, wrong

    def _hear_noise(self, content: Content) -> None:
        """By second differences, in which steady motion and acceleration have no share; those of
        white noise with the standard deviation σ have the variance 6 σ². A jump is no noise."""
        first, middle = self._before, self._after
        self._before, self._after = middle, content
        if not self._limits or first is None or middle is None:
            return
        worst = 0.0
        for i, limit in enumerate(self._limits):
            off = first[i] - 2.0 * middle[i] + content[i]
            seen = min(off * off / 6.0, 9.0 * limit)
            self.variances[i] += (seen - self.variances[i]) / NOISE_SAMPLES
            worst = max(worst, self.variances[i] / limit)
        was, self._noisy = self._noisy, worst > (GOOD * GOOD if self._noisy else 1.0)
        if self._noisy and not was:
            self._outbox.tell(events.NOISY(self.key))


def sensors_of(limits: WatchSettings, outbox: Outbox) -> dict[str, Sensor]:
    """Of a vehicle, by topic."""
    imu, pressure, field, dvl, usbl = OF
    found = (
        Sensor(imu, outbox, limits.imu_frozen, hz=limits.imu_rate,
               noise=(FORCE_NOISE,) * 3 + (GYRO_NOISE,) * 3),
        Sensor(pressure, outbox, PRESSURE_FROZEN, hz=limits.pressure_rate, noise=(PRESSURE_NOISE,)),
        Sensor(field, outbox, MAGNETOMETER_FROZEN, MAGNETOMETER_SILENT, limits.magnetometer_rate),
        Sensor(dvl, outbox, DVL_FROZEN, DVL_SILENT, by_rhythm=True),
        Sensor(usbl, outbox, USBL_FROZEN, USBL_SILENT),
    )  # fmt: skip
    found[0].repeats = found[2].repeats = found[3].repeats = found[4].repeats = True
    if limits.imu_frozen_at_rest is not None:
        found[0].rest_ns = round(limits.imu_frozen_at_rest * 1e9)
    return {sensor.key: sensor for sensor in found}


# What a sensor measures, and why it cannot be true; None: it can.


def _imu(sample: ImuSample) -> tuple[Content, Event | None]:
    force, rate = sample.specific_force, sample.angular_rate
    content = (*force, *rate)
    # An axis at the end of its range: the true value is unknown.
    if max(map(abs, force)) >= MOST_FORCE or max(map(abs, rate)) >= MOST_RATE:
        return content, events.SATURATED_IMU()
    return content, None if hypot(*force) >= LEAST_FORCE else events.IMPLAUSIBLE(topics.IMU.key)


def _pressure(sample: PressureSample) -> tuple[Content, Event | None]:
    possible = LEAST_PRESSURE <= sample.pressure <= MOST_PRESSURE
    return (sample.pressure,), _unless(possible, topics.PRESSURE.key)


def _magnetometer(sample: MagnetometerSample) -> tuple[Content, Event | None]:
    possible = LEAST_FIELD <= hypot(*sample.field) <= MOST_FIELD
    return sample.field, _unless(possible, topics.MAGNETOMETER.key)


def _dvl(sample: DvlSample) -> tuple[Content, Event | None]:
    if sample.velocity is None:
        return (), events.NO_BOTTOM(topics.DVL.key)
    possible = hypot(*sample.velocity) <= MOST_SPEED and sample.std <= MOST_SPEED
    return sample.velocity, _unless(possible, topics.DVL.key)


def _usbl(sample: UsblSample) -> tuple[Content, Event | None]:
    possible = max(hypot(sample.north, sample.east), sample.std) <= MOST_DISTANCE
    return (sample.north, sample.east), _unless(possible, topics.USBL.key)


def _unless(possible: bool, key: str) -> Event | None:
    return None if possible else events.IMPLAUSIBLE(key)


# By the topic's key.
OF: dict[str, Callable[[Any], tuple[Content, Event | None]]] = {
    topics.IMU.key: _imu,
    topics.PRESSURE.key: _pressure,
    topics.MAGNETOMETER.key: _magnetometer,
    topics.DVL.key: _dvl,
    topics.USBL.key: _usbl,
}
