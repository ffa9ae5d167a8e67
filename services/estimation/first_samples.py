"""Can a sensor be right, before the dive?

Does a driver speak the right unit, and does it stamp its samples with the right clock
(`ArrivalCheck`)? Judged on raw samples, before any is refused: a sensor in the wrong unit is often
out of range, and the pilot has to read what it said. Wide limits, so that no real motion or
disturbance is beyond them.

Is the mean specific force of a rest that of a vehicle at rest (`wrong_at_rest`)? It has the
magnitude of gravity and points up, which in FRD is -z. A turn of the IMU about the vertical does
not show here: neither a wrong sign of x and y together.
"""

from math import acos, degrees, hypot, inf
from typing import NamedTuple

from messages import events
from messages.events import Event
from messages.units import Vec3
from services.marine.vehicle import GRAVITY

SPAN_NS = 1_000_000_000  # [ns] judged together, by arrival; long enough for a backlog to pass
GONE_NS = 3_000_000_000  # [ns] without samples: the verdict is no longer of this sensor

# [m/s²] mean |f| over a second. The nearest wrong units are ft/s² (32.2) and g (1.0). Waves and
# hands stay inside; so does a fall into the water, which lasts less than a second.
LEAST_FORCE, MOST_FORCE = 3.0, 30.0
# [T] Magnetometers in use end between 0.8 and 4.9 mT, and a field of 2 mT is a magnet beside it;
# nothing shields the Earth's 22 to 67 µT down to 1 µT. µT, mG, gauss and nT are all beyond. What
# lies within and is not the Earth's is a disturbance: that costs the compass, not the dive.
LEAST_FIELD, MOST_FIELD = 1e-6, 2e-3


# [m/s²] the allowed deviation is the attitude filter's `gravity_tolerance`, beyond which it never
# corrects the tilt: 5 % by default, for ±50 mg of offset or 3 % of scale and 20 mg, as of a cheap
# MEMS accelerometer. However wide that is set, a fifth of gravity is not a sensor's error.
MOST_DEVIATION = 2.0
# [deg] A slipway is steep with 15, a vehicle that leans on its frame or hangs on a corner is below
# 45; one whose IMU is mounted at a right angle to what the vehicle file says reads 90.
MOST_TILT = 60.0
OVERTURNED = 120.0  # [deg] nearer to upside down than to lying on a side
MOUNTING = "check [vehicle.mounting.imu] in the vehicle file and the sign of the IMU's z axis"


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
        self._finding: Event | None = None
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

    def finding(self, now: int) -> Event | None:
        """What is wrong with this sensor, as far as it still speaks."""
        if self._seen_ns is None or now - self._seen_ns > GONE_NS:
            return None
        return self._finding

    def _begin(self, now: int | None) -> None:
        self._began_ns = now
        self._count, self._sum, self._youngest = 0, 0.0, inf

    def _verdict(self) -> Event | None:
        a, mean = self._allowed, self._sum / self._count
        if not a.least <= mean <= a.most:
            read = f"{a.quantity} {mean:.4g} {a.unit}".strip()
            return events.WRONG_UNIT(
                a.key,
                detail=f"the {a.sensor} reads {read}, allowed are {a.least:g} to {a.most:g}: "
                f"{a.hint}",
            )
        # The youngest: a computer that was busy has old samples and then young ones.
        if self._youngest > a.oldest:
            return events.OLD_STAMPS(
                a.key,
                detail=f"samples of the {a.sensor} are {self._youngest:.3g} s old when they "
                f"arrive, allowed are {a.oldest:g} s: its driver must stamp them with the time "
                f"that its handlers are given",
            )
        return None


def tilt(force: Vec3) -> float:
    """[deg] between the body's down axis and the vertical, at rest."""
    return degrees(acos(max(-1.0, min(1.0, -force[2] / hypot(*force)))))


def wrong_at_rest(force: Vec3, tolerance: float) -> Event | None:
    """What is wrong with this mean specific force [m/s²], FRD, if its magnitude may differ from
    gravity by `tolerance` [m/s²]."""
    read, band = hypot(*force), min(tolerance, MOST_DEVIATION)
    if abs(read - GRAVITY) > band:
        return events.WRONG_FORCE_IMU(
            detail=f"the IMU reads a specific force of {read:.2f} m/s² at rest, allowed are "
            f"{GRAVITY - band:.2f} to {GRAVITY + band:.2f}: check the unit and scale of its "
            f"accelerometer, and estimation.attitude.gravity_tolerance",
        )
    if (angle := tilt(force)) <= MOST_TILT:
        return None
    row = events.UPSIDE_DOWN_IMU if angle > OVERTURNED else events.ON_ITS_SIDE_IMU
    return row(
        detail=f"z is {force[2]:+.1f} m/s², tilted by {angle:.0f} deg, allowed are {MOST_TILT:g}: "
        f"put the vehicle upright, or {MOUNTING}",
    )
