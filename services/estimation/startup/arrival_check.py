"""Does a driver speak the right unit, and does it stamp its samples with the right clock?

Judged on raw samples, before any is refused: a sensor in the wrong unit is often out of range, and
the pilot has to read what it said. Wide limits, so that no real motion or disturbance is beyond
them; `resting_check.py` has the narrow ones of a vehicle at rest.
"""

from math import inf
from typing import NamedTuple

SPAN_NS = 1_000_000_000  # [ns] judged together, by arrival; long enough for a backlog to pass
GONE_NS = 3_000_000_000  # [ns] without samples: the verdict is no longer of this sensor

# [m/s²] mean |f| over a second. The nearest wrong units are ft/s² (32.2) and g (1.0). Waves and
# hands stay inside; so does a fall into the water, which lasts less than a second.
LEAST_FORCE, MOST_FORCE = 3.0, 30.0
# [T] Magnetometers in use end between 0.8 and 4.9 mT, and a field of 2 mT is a magnet beside it;
# nothing shields the Earth's 22 to 67 µT down to 1 µT. µT, mG, gauss and nT are all beyond. What
# lies within and is not the Earth's is a disturbance: that costs the compass, not the dive.
LEAST_FIELD, MOST_FIELD = 1e-6, 2e-3


class Finding(NamedTuple):
    """What is wrong: a name to count, and a sentence for the pilot."""

    name: str
    text: str


class Allowed(NamedTuple):
    """What samples of one sensor may be."""

    key: str  # topic
    sensor: str  # in words
    quantity: str  # "a field of"
    unit: str
    least: float  # [unit] of the magnitude, mean over a second
    most: float
    oldest: float  # [s] when it arrives
    hint: str  # what to look at if it is not


def of_imu(oldest: float) -> Allowed:
    """Samples older than `oldest` [s] count as silence in the estimator."""
    return Allowed(
        "sensor/imu", "IMU", "a specific force of", "m/s²", LEAST_FORCE, MOST_FORCE, oldest,
        "its driver must say m/s², not g",
    )  # fmt: skip


def of_magnetometer(oldest: float) -> Allowed:
    return Allowed(
        "sensor/magnetometer", "magnetometer", "a field of", "T", LEAST_FIELD, MOST_FIELD, oldest,
        "its driver must say T, not µT or gauss; or a magnet lies beside it",
    )  # fmt: skip


def of_pressure(least: float, most: float, oldest: float) -> Allowed:
    """[Pa] what the estimator accepts."""
    return Allowed(
        "sensor/pressure", "pressure sensor", "", "Pa", least, most, oldest,
        "its driver must say absolute pressure in Pa, not mbar or bar",
    )  # fmt: skip


class ArrivalCheck:
    """Judges one sensor, a second of arrivals at a time."""

    def __init__(self, allowed: Allowed) -> None:
        self.judged = False  # at least once
        self._allowed = allowed
        self._finding: Finding | None = None
        self._seen_ns: int | None = None  # [ns] newest arrival
        self._begin(None)

    def see(self, magnitude: float, stamp_ns: int, now: int) -> None:
        """One sample, arriving at `now` [ns]."""
        if self._began_ns is None:
            self._begin(now)
        self._seen_ns = now
        self._count += 1
        self._sum += magnitude
        self._youngest = min(self._youngest, (now - stamp_ns) * 1e-9)
        assert self._began_ns is not None
        if now - self._began_ns >= SPAN_NS:
            self._finding, self.judged = self._verdict(), True
            self._begin(now)

    def finding(self, now: int) -> Finding | None:
        """What is wrong with this sensor, as far as it still speaks."""
        if self._seen_ns is None or now - self._seen_ns > GONE_NS:
            return None
        return self._finding

    def _begin(self, now: int | None) -> None:
        self._began_ns = now
        self._count, self._sum, self._youngest = 0, 0.0, inf

    def _verdict(self) -> Finding | None:
        a, mean = self._allowed, self._sum / self._count
        if not a.least <= mean <= a.most:
            read = f"{a.quantity} {mean:.4g} {a.unit}".strip()
            return Finding(
                f"wrong_unit:{a.key}",
                f"the {a.sensor} reads {read}, allowed are {a.least:g} to {a.most:g}: {a.hint}",
            )
        # The youngest: a computer that was busy has old samples and then young ones.
        if self._youngest > a.oldest:
            return Finding(
                f"old_stamps:{a.key}",
                f"samples of the {a.sensor} are {self._youngest:.3g} s old when they arrive, "
                f"allowed are {a.oldest:g} s: its driver must stamp them with the time that its "
                f"handlers are given",
            )
        return None
