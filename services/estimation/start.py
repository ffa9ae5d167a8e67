"""The wait before the dive: the vehicle floats at rest, and the pilot sees the time left.

It does not end while a sensor cannot be right: its unit or stamps, the specific force at rest
(first_samples.py), an IMU without usable samples. Each cause is counted, is one warning, and is in
the state as `blocked_by`. Once it is gone, the rest starts anew.
"""

from math import inf

from messages import events, topics
from messages.events import Event, Outbox, sentence
from messages.units import Vec3
from services.estimation.first_samples import (
    ArrivalCheck,
    of_imu,
    of_magnetometer,
    of_pressure,
    wrong_at_rest,
)
from services.estimation.pressure import LATEST_AGE
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD, Calibrated, Calibration
from services.estimation.sensor import LEAST_PRESSURE, MOST_PRESSURE
from services.estimation.settings import Settings

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


class Start:
    """Runs the calibration; `outbox` is told what it waits for, and its counts name why no sample
    is usable."""

    def __init__(self, settings: Settings, outbox: Outbox) -> None:
        self.calibration = Calibration(settings.calibration)
        self._settings, self._outbox = settings, outbox
        late = LATEST_AGE - settings.depth.pressure_latency
        limits = (
            of_imu(IMU_PATIENCE_NS * 1e-9),
            of_pressure(LEAST_PRESSURE, MOST_PRESSURE, late),
            of_magnetometer(LATEST_AGE),
        )
        self._arrivals = {allowed.key: ArrivalCheck(allowed) for allowed in limits}
        self._resting: Event | None = None  # what was wrong with the last rest
        self._finding: Event | None = None  # what blocks now
        self._unrest_ns: int | None = None  # [ns] since when it has not been at rest
        self._used_ns: int | None = None  # [ns] when the newest usable IMU sample was judged
        self._now: int | None = None  # [ns]
        self._first_ns: int | None = None  # [ns] first usable IMU sample
        self._felt_ns: int | None = None  # [ns] when the accelerometer felt a motion
        self._next_line = inf  # [s] left
        self.afloat = (
            False  # no thruster has run: the longer it floats, the better the air is known
        )

    @property
    def at_rest(self) -> bool:
        """Nothing has moved the vehicle lately."""
        return self.calibration.unrest is None

    @property
    def blocked_by(self) -> str | None:
        """Name of the count of what keeps the calibration from ending."""
        return None if self._finding is None else self._finding.name

    def gives_up(self) -> bool:
        """Whether there is no hope of a rest, and the sensors are as they should be: the dive has
        begun, or the boat rocks."""
        now, calibration = self._now, self.calibration
        if now is None or self._first_ns is None or self._wrong_sensor(now) or self._resting:
            return False
        if not self._arrivals[topics.IMU.key].judged:
            return False
        if calibration.shaken > FELT:
            self._felt_ns = now
        if self._felt_ns is None or now - self._felt_ns > RESTLESS_NS:
            return False  # only the gyroscope says that it moves: its unit may be wrong
        if self.afloat and now - self._first_ns < self._settings.calibration.still_time * 1e9:
            return False
        if self._unrest_ns is not None and now - self._unrest_ns > MOVING_NS:
            return True
        little = calibration.seconds_left > (1.0 - LITTLE) * self._settings.calibration.still_time
        return little and now - self._first_ns > RESTLESS_NS

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
            self._begin()
        self._block(sensor or self._resting or self._lack() or self._unrest(now))

    def imu(self, force: Vec3, rate: Vec3, dt: float) -> Calibrated | None:
        """One usable sample [m/s², rad/s], `dt` [s] after the one before. Returns the result once
        it is complete."""
        self._used_ns = self._now
        if self._first_ns is None:
            self._first_ns = self._now
        calibration, outbox = self.calibration, self._outbox
        if calibration.imu(force, rate, dt):
            outbox.tell(events.MOVED("calibration"))
            self._next_line, self._resting = inf, None
        result = self._sound(calibration.result())
        left = calibration.seconds_left
        if result is None and 0.0 < left <= self._next_line and self._finding is None:
            self._next_line = left - COUNTDOWN_STEP
            outbox.say("info", f"calibrating: {left:.0f} s at rest to go")
        return result

    def _begin(self) -> None:
        self.calibration = Calibration(self._settings.calibration)
        self._next_line = inf

    def _sound(self, result: Calibrated | None) -> Calibrated | None:
        """The result of a rest in which nothing was wrong."""
        if result is None or not all(self._arrivals[key].judged for key in NEEDED):
            return None
        tolerance = self._settings.attitude.gravity_tolerance
        self._resting = wrong_at_rest(result.specific_force, tolerance)
        if self._resting is not None:
            self._begin()
            return None
        return result

    def _wrong_sensor(self, now: int) -> Event | None:
        """Unit or stamps of a sensor, or an IMU that cannot be used."""
        found = (check.finding(now) for check in self._arrivals.values())
        wrong = next(filter(None, found), None)
        if wrong is not None or self._used_ns is None or now - self._used_ns <= PATIENCE_NS:
            return wrong
        why = self._why(topics.IMU.key) or f"nothing arrives on {topics.IMU.key}"
        return events.UNUSABLE_IMU(detail=why)

    def _unrest(self, now: int) -> Event | None:
        unrest = self.calibration.unrest
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

    def _lack(self) -> Event | None:
        if not self.calibration.lacks_pressure:
            return None
        return events.WAITING(topics.PRESSURE.key, detail=self._why(topics.PRESSURE.key))

    def _why(self, key: str) -> str:
        """The most frequent count of a sensor in words, or nothing."""
        counts = {name: n for name, n in self._outbox.counts.items() if name.endswith(f":{key}")}
        if not counts:
            return ""
        name = max(counts, key=lambda name: counts[name])
        return f"{sentence(name)}, {counts[name]} times"

    def _block(self, finding: Event | None) -> None:
        before, self._finding = self._finding, finding
        if finding is None:
            if before is not None:
                self._outbox.say("info", "calibration can finish now")
            return
        if before is None or before.name != finding.name:
            self._outbox.tell(finding)
