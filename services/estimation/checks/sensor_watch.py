"""Is a sensor working? Checks that need only its own samples.

Port gates have already refused malformed and out-of-order samples. Each change from good to bad is
counted once, not every bad sample.
"""

from math import inf
from typing import Annotated

import msgspec

from messages import topics
from messages.units import OpenShare, Positive, WithinAnHour
from services.estimation.checks.frozen_watch import FrozenWatch
from services.estimation.checks.noise_watch import NoiseWatch
from services.estimation.checks.thrust_watch import ThrustWatch

SensorRate = Annotated[float, msgspec.Meta(ge=1.0, le=100.0)]
WINDOW = 2.0  # [s] over which a rate is judged
GAP = 5.0  # [periods] a longer break is a drop-out and does not count in the rate


class WatchSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How long identical values are allowed, and the tolerance of the rate.

    A noisy sensor never repeats a value. One with coarse resolution does, at rest: allow longer.
    Pressure is found frozen much sooner by its own noise and resolution (frozen_watch.py), once
    these are measured.
    """

    imu_frozen: WithinAnHour = 0.2  # [s]
    # The same as long as the thrust does not change, for an IMU whose steps are coarser than its
    # noise; None: no longer than `imu_frozen`.
    imu_frozen_at_rest: WithinAnHour | None = None  # [s]
    magnetometer_frozen: WithinAnHour = 1.0  # [s]
    pressure_frozen: WithinAnHour = 10.0  # [s]
    pressure_rate: SensorRate = topics.PRESSURE.hz  # [1/s] of this vehicle's sensor
    magnetometer_rate: SensorRate = topics.MAGNETOMETER.hz  # [1/s] the same
    dvl_frozen: WithinAnHour = 10.0  # [s]
    usbl_frozen: WithinAnHour = 20.0  # [s]
    rate_tolerance: OpenShare = 0.2  # [-] of the sensor's rate

    # More noise than any mounting has; below, the filters weigh and clip.
    gyro_noise: Positive = 0.15  # [rad/s] 1σ of one sample
    accelerometer_noise: Positive = 2.0  # [m/s²]
    pressure_noise: Positive = 5000.0  # [Pa]

    # A sensor without samples for this long, after its first, is silent.
    magnetometer_silent: WithinAnHour = 1.0  # [s]
    dvl_silent: WithinAnHour = 5.0  # [s]
    usbl_silent: WithinAnHour = 20.0  # [s]


class SensorWatch:
    """Watches one sensor. `usable` refuses frozen samples and stamps that do not increase; `events`
    collects names to count."""

    def __init__(
        self,
        key: str,
        frozen_after: float,
        events: list[str],
        hz: float | None = None,
        tolerance: float = 0.2,
        silent_after: float = inf,
        noise: tuple[float, ...] = (),
        std: float | None = None,
        at_rest: tuple[float, ThrustWatch] | None = None,
    ) -> None:
        """
        Args:
            key: topic.
            frozen_after: [s] of identical samples.
            hz, tolerance: [1/s], [-] of it; None: any rate.
            silent_after: [s] without samples.
            noise: largest 1σ of each number; empty: any.
            std: declared 1σ of the only number, to find out sooner that it is frozen.
            at_rest: [s] in place of `frozen_after` while nothing moves the vehicle, and who knows.
        """
        self._key = key
        self._frozen_ns = round(frozen_after * 1e9)
        self._events = events
        self._content: tuple[float, ...] | None = None
        self._stamp_ns: int | None = None
        self._same_since_ns = 0
        self._moved_ns: int | None = None  # the vehicle, first since then
        self._frozen = False
        self._silent_after = silent_after
        self._silent = False
        self._rate = None if hz is None else _Rate(hz, tolerance)
        self._noise = NoiseWatch(noise) if noise else None
        self._repeats = None if std is None else FrozenWatch(std, frozen_after)
        self._rest_ns = None if at_rest is None else round(at_rest[0] * 1e9)
        self._thrust = None if at_rest is None else at_rest[1]

    @property
    def frozen(self) -> str | None:
        """Name of the count while the sensor repeats a value; None: it does not."""
        return f"frozen:{self._key}" if self._frozen else None

    def listen(self, now: int) -> None:
        """Count a silence once; a sensor without any sample so far is absent, not silent."""
        if self._stamp_ns is None or self._silent:
            return
        if (now - self._stamp_ns) * 1e-9 > self._silent_after:
            self._silent = True
            self._events.append(f"silent:{self._key}")

    @property
    def trouble(self) -> str | None:
        """Name of the count that says why the sensor cannot be used now; None: it can."""
        if self._silent:
            return f"silent:{self._key}"
        if self._frozen:
            return f"frozen:{self._key}"
        if self._noise is not None and self._noise.noisy:
            return f"noisy:{self._key}"
        return None

    def usable(self, content: tuple[float, ...], stamp_ns: int) -> bool:
        before, last_ns = self._content, self._stamp_ns
        if last_ns is not None and stamp_ns <= last_ns:
            same = stamp_ns == last_ns and content == before
            self._events.append(f"{'duplicated' if same else 'not_newer'}:{self._key}")
            return False
        self._content, self._stamp_ns, self._silent = content, stamp_ns, False
        rate = self._rate
        if rate is not None and last_ns is not None and rate.newly_wrong(stamp_ns - last_ns):
            self._events.append(f"rate:{self._key}")
        was, self._frozen = self._frozen, self._is_frozen(content, before, stamp_ns)
        if self._frozen and not was:
            self._events.append(f"frozen:{self._key}")
        if self._repeats is not None and self._repeats.redundant:
            return False
        noise = self._noise
        if noise is None:
            return not self._frozen
        if noise.newly_noisy(content):
            self._events.append(f"noisy:{self._key}")
        return not (self._frozen or noise.noisy)

    def _is_frozen(
        self, content: tuple[float, ...], before: tuple[float, ...] | None, stamp_ns: int
    ) -> bool:
        if self._repeats is not None:
            self._repeats.step(content[0], stamp_ns)
            return self._repeats.frozen
        if content != before:
            self._same_since_ns, self._moved_ns = stamp_ns, None
            return False
        same_ns = stamp_ns - self._same_since_ns
        if self._rest_ns is None:
            return same_ns >= self._frozen_ns
        return same_ns >= self._rest_ns or self._repeats_in_motion(stamp_ns)

    def _repeats_in_motion(self, stamp_ns: int) -> bool:
        """Has it said the same for too long since the thrust began to change?"""
        if self._moved_ns is None and self._thrust is not None:
            changed_ns = self._thrust.changed_ns
            if changed_ns is not None and changed_ns > self._same_since_ns:
                self._moved_ns = changed_ns
        return self._moved_ns is not None and stamp_ns - self._moved_ns >= self._frozen_ns


class _Rate:
    """Samples per second of one sensor, drop-outs left out."""

    __slots__ = (
        "_count",
        "_gap_ns",
        "_longest_ns",
        "_periods",
        "_shortest_ns",
        "_span_ns",
        "_wrong",
    )

    def __init__(self, hz: float, tolerance: float) -> None:
        self._periods = max(5, round(WINDOW * hz))
        self._gap_ns = GAP * 1e9 / hz
        self._shortest_ns = self._periods * 1e9 / (hz * (1.0 + tolerance))
        self._longest_ns = self._periods * 1e9 / (hz * (1.0 - tolerance))
        self._count, self._span_ns, self._wrong = 0, 0, False

    def newly_wrong(self, period_ns: int) -> bool:
        """Take in a period. True when a whole window is wrong after a good one."""
        if period_ns > self._gap_ns:
            self._count = self._span_ns = 0
            return False
        self._count += 1
        self._span_ns += period_ns
        if self._count < self._periods:
            return False
        wrong = not self._shortest_ns <= self._span_ns <= self._longest_ns
        newly = wrong and not self._wrong
        self._count, self._span_ns, self._wrong = 0, 0, wrong
        return newly
