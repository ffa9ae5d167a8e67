"""The wait before the dive: the vehicle floats at rest, and the pilot sees the time left.

It does not end while a sensor cannot be right. Does its driver speak the right unit, and does it
stamp its samples with the right clock (`ArrivalCheck`)? Is the mean specific force that of a
vehicle at rest (`wrong_at_rest`)? Are there usable samples of the IMU at all? Each cause is
counted, is one warning, and is in the state as `blocked_by`. Once it is gone, the rest starts anew.
"""

from collections.abc import Sequence
from math import acos, degrees, hypot, inf
from typing import NamedTuple

from messages import events, topics
from messages.events import Event, Outbox, sentence
from services.estimation.pressure import LATEST_AGE
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD, Calibrated, Rest
from services.estimation.sensor import LEAST_PRESSURE, MOST_PRESSURE
from services.estimation.settings import Settings
from services.marine.vehicle import GRAVITY

IMU_PATIENCE_NS = 200_000_000  # [ns] of a silent IMU, before a state is predicted without it
PATIENCE_NS = 5_000_000_000  # [ns] without a usable IMU sample; drivers may start a little later
UNREST_NS = 15_000_000_000  # [ns] longer than it takes to lay a vehicle down and let go of it
# [ns] without any rest, or with little: a log begins in mid-dive, or the boat rocks. The dive goes
# on with what is known then.
MOVING_NS, RESTLESS_NS = 2_000_000_000, 4_000_000_000
FELT = 0.06  # [m/s²] of the specific force within half a second: more than noise
LITTLE = 0.3  # [-] of the rest that is needed
COUNTDOWN_STEP = 2.0  # [s] of rest between two messages to the pilot
NEEDED = (topics.IMU.key, topics.PRESSURE.key)  # judged before it ends
SPAN_NS = 1_000_000_000  # [ns] judged together, by arrival; long enough for a backlog to pass
GONE_NS = 3_000_000_000  # [ns] without samples: the verdict is no longer of this sensor

# Wide limits, so that no real motion or disturbance is beyond them.
# [m/s²] mean |f| over a second. The nearest wrong units are ft/s² (32.2) and g (1.0). Waves and
# hands stay inside; so does a fall into the water, which lasts less than a second.
LEAST_FORCE, MOST_FORCE = 3.0, 30.0
# [T] Magnetometers in use end between 0.8 and 4.9 mT, and a field of 2 mT is a magnet beside it;
# nothing shields the Earth's 22 to 67 µT down to 1 µT. µT, mG, gauss and nT are all beyond. What
# lies within and is not the Earth's is a disturbance: that costs the compass, not the dive.
LEAST_FIELD, MOST_FIELD = 1e-6, 2e-3
# [m/s²] the allowed deviation is `gravity_tolerance`: 5 % by default, for ±50 mg of offset or 3 %
# of scale and 20 mg, as of a cheap MEMS accelerometer. However wide that is set, a fifth of gravity
# is not a sensor's error.
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


class ArrivalCheck:
    """Judges raw samples of one sensor, a second of arrivals at a time, before any is refused: a
    sensor in the wrong unit is often out of range, and the pilot has to read what it said."""

    def __init__(self, allowed: Allowed) -> None:
        self.judged = False  # at least once
        self._allowed = allowed
        self._finding: Event | None = None
        self._seen_ns = -GONE_NS  # [ns] newest arrival
        self._began_ns: int | None = None
        self._begin()

    def see(self, magnitude: float, stamp_ns: int, now: int) -> None:
        """One sample, arriving at `now` [ns]."""
        if self._began_ns is None:
            self._began_ns = now
        self._seen_ns = now
        self._count += 1
        self._sum += magnitude
        self._youngest = min(self._youngest, (now - stamp_ns) * 1e-9)
        if now - self._began_ns >= SPAN_NS:
            self._finding, self.judged = self._verdict(), True
            self._began_ns = now
            self._begin()

    def finding(self, now: int) -> Event | None:
        """What is wrong with this sensor, as far as it still speaks."""
        return self._finding if now - self._seen_ns <= GONE_NS else None

    def _begin(self) -> None:
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


class Start:
    """Waits for the rest; `outbox` is told what it waits for, and its counts name why no sample is
    usable."""

    def __init__(self, settings: Settings, rest: Rest, outbox: Outbox) -> None:
        self._settings, self._rest, self._outbox = settings, rest, outbox
        limits = (
            Allowed(topics.IMU.key, "IMU", "a specific force of", "m/s²", LEAST_FORCE, MOST_FORCE,
                    IMU_PATIENCE_NS * 1e-9, "its driver must say m/s², not g"),
            Allowed(topics.PRESSURE.key, "pressure sensor", "", "Pa", LEAST_PRESSURE, MOST_PRESSURE,
                    LATEST_AGE - settings.depth.pressure_latency,
                    "its driver must say absolute pressure in Pa, not mbar or bar"),
            Allowed(topics.MAGNETOMETER.key, "magnetometer", "a field of", "T", LEAST_FIELD,
                    MOST_FIELD, LATEST_AGE,
                    "its driver must say T, not µT or gauss; or a magnet lies beside it"),
        )  # fmt: skip
        self._arrivals = {allowed.key: ArrivalCheck(allowed) for allowed in limits}
        self._resting: Event | None = None  # what was wrong with the last rest
        self._finding: Event | None = None  # what blocks now
        self._unrest_ns: int | None = None  # [ns] since when it has not been at rest
        self._used_ns: int | None = None  # [ns] when the newest usable IMU sample was judged
        self._now = 0  # [ns]
        self._first_ns: int | None = None  # [ns] first usable IMU sample
        self._felt_ns: int | None = None  # [ns] when the accelerometer felt a motion
        self._next_line = inf  # [s] left

    @property
    def blocked_by(self) -> str | None:
        """Name of the count of what keeps the calibration from ending."""
        return None if self._finding is None else self._finding.name

    @property
    def seconds_left(self) -> float | None:
        """[s] of rest; None: blocked."""
        return self._rest.seconds_left if self._finding is None else None

    def arrived(self, key: str, magnitude: float, stamp_ns: int, now: int) -> None:
        """A sample of a sensor, usable or not, with the magnitude of what it measures."""
        self._arrivals[key].see(magnitude, stamp_ns, now)
        self.judge(now)

    def judge(self, now: int) -> None:
        """Look for what is wrong at `now` [ns]; count and say it once."""
        self._now = now
        if self._used_ns is None:
            self._used_ns = now
        sensor = self._wrong_sensor(now)
        if sensor is not None:
            self._begin_rest()
        lack = None
        if self._rest.lacks_pressure:
            lack = events.WAITING(topics.PRESSURE.key, detail=self._why(topics.PRESSURE.key))
        before, self._finding = self._finding, sensor or self._resting or lack or self._unrest(now)
        if self._finding is None:
            if before is not None:
                self._outbox.say("info", "calibration can finish now")
        elif before is None or before.name != self._finding.name:
            self._outbox.tell(self._finding)

    def imu(self, *, rested: bool) -> Calibrated | None:
        """After a usable sample, at rest or not before it. Returns the result once it is
        complete."""
        self._used_ns = self._now
        if self._first_ns is None:
            self._first_ns = self._now
        rest = self._rest
        if rest.unrest is not None and rested:
            self._outbox.tell(events.MOVED("calibration"))
            self._next_line, self._resting = inf, None
        result, left = rest.result(), rest.seconds_left
        if result is None or not all(self._arrivals[key].judged for key in NEEDED):
            if 0.0 < left <= self._next_line and self._finding is None:
                self._next_line = left - COUNTDOWN_STEP
                self._outbox.say("info", f"calibrating: {left:.0f} s at rest to go")
            return None
        tolerance = self._settings.attitude.gravity_tolerance
        self._resting = wrong_at_rest(result.specific_force, tolerance)
        if self._resting is None:
            return result
        self._begin_rest()
        return None

    def gives_up(self, *, afloat: bool) -> bool:
        """Whether there is no hope of a rest, and the sensors are as they should be: the dive has
        begun, or the boat rocks. `afloat`: no thruster has run, so the longer it floats, the better
        the air is known."""
        now, rest, needed = self._now, self._rest, self._settings.calibration.still_time
        wrong = self._wrong_sensor(now) or self._resting
        if self._first_ns is None or wrong or not self._arrivals[topics.IMU.key].judged:
            return False
        if rest.shaken > FELT:
            self._felt_ns = now
        if self._felt_ns is None or now - self._felt_ns > RESTLESS_NS:
            return False  # only the gyroscope says that it moves: its unit may be wrong
        since = now - self._first_ns
        if afloat and since < needed * 1e9:
            return False
        if self._unrest_ns is not None and now - self._unrest_ns > MOVING_NS:
            return True
        return rest.seconds_left > (1.0 - LITTLE) * needed and since > RESTLESS_NS

    def _begin_rest(self) -> None:
        self._rest.moved()
        self._rest.begin()
        self._next_line = inf

    def _wrong_sensor(self, now: int) -> Event | None:
        """Unit or stamps of a sensor, or an IMU that cannot be used."""
        found = (check.finding(now) for check in self._arrivals.values())
        wrong = next(filter(None, found), None)
        if wrong is not None or self._used_ns is None or now - self._used_ns <= PATIENCE_NS:
            return wrong
        why = self._why(topics.IMU.key) or f"nothing arrives on {topics.IMU.key}"
        return events.UNUSABLE_IMU(detail=why)

    def _unrest(self, now: int) -> Event | None:
        unrest = self._rest.unrest
        if unrest is None:
            self._unrest_ns = None
            return None
        if self._unrest_ns is None:
            self._unrest_ns = now
        if now - self._unrest_ns <= UNREST_NS:
            return None
        return events.MOVING_CALIBRATION(
            detail=f"the IMU has read no rest for {UNREST_NS / 1e9:.0f} s: rates of "
            f"{unrest.rate:.2g} rad/s that spread by {unrest.rate_std:.2g}, specific forces that "
            f"spread by {unrest.force_std:.2g} m/s², a pressure that changes by "
            f"{unrest.pressure:.0f} Pa, allowed are {self._settings.calibration.largest_bias:g}, "
            f"{MOST_RATE_STD:g} and {MOST_FORCE_STD:g}: keep the vehicle still; if it is, its "
            f"driver must say rad/s, not deg/s",
        )

    def _why(self, key: str) -> str:
        """The most frequent count of a sensor in words, or nothing."""
        counts = {name: n for name, n in self._outbox.counts.items() if name.endswith(f":{key}")}
        if not counts:
            return ""
        name = max(counts, key=lambda name: counts[name])
        return f"{sentence(name)}, {counts[name]} times"


def tilt(force: Sequence[float]) -> float:
    """[deg] between the body's down axis and the vertical, at rest."""
    return degrees(acos(max(-1.0, min(1.0, -force[2] / hypot(*force)))))


def wrong_at_rest(force: Sequence[float], tolerance: float) -> Event | None:
    """What is wrong with this mean specific force [m/s²], FRD, if its magnitude may differ from
    gravity by `tolerance` [m/s²]. It points up, which is -z. A turn of the IMU about the vertical
    does not show here: neither a wrong sign of x and y together."""
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
