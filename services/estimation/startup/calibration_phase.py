"""Calibration before the dive: the vehicle floats at rest, and the pilot sees the time left.

It does not end while a sensor cannot be right: its unit or stamps (arrival_check.py), the specific
force at rest (resting_check.py), an IMU without usable samples. Each cause is counted, is one
warning, and is in the state as `blocked_by`. Once it is gone, the rest starts anew.
"""

from collections.abc import Mapping
from typing import NamedTuple

from messages import topics
from messages.counts import sentence
from messages.sensors import ImuSample
from messages.units import Vec3
from services.estimation.events import Events
from services.estimation.startup.arrival_check import Allowed, ArrivalCheck, Finding
from services.estimation.startup.calibration import (
    Calibrated,
    Calibration,
    CalibrationSettings,
    Countdown,
)
from services.estimation.startup.resting_check import wrong_at_rest

PATIENCE_NS = 5_000_000_000  # [ns] without a usable IMU sample; drivers may start a little later
UNREST_NS = 15_000_000_000  # [ns] longer than it takes to lay a vehicle down and let go of it


class StartLimits(NamedTuple):
    """What sensors may say before the dive."""

    force_tolerance: float  # [m/s²] of the specific force at rest
    sensors: tuple[Allowed, ...]
    needed: tuple[str, ...] = (topics.IMU.key, topics.PRESSURE.key)  # judged before it ends


class CalibrationPhase:
    """Runs the calibration; `events` gets what it waits for."""

    def __init__(
        self,
        settings: CalibrationSettings,
        limits: StartLimits,
        refused: Mapping[str, int],
        events: Events,
    ) -> None:
        """`refused`: the service's counts as they grow, to name why no sample is usable."""
        self._settings, self._limits = settings, limits
        self._refused, self._events = refused, events
        self._arrivals = {allowed.key: ArrivalCheck(allowed) for allowed in limits.sensors}
        self._resting: Finding | None = None  # what was wrong with the last rest
        self._finding: Finding | None = None  # what blocks now
        self._warned: set[str] = set()
        self._unrest_ns: int | None = None  # [ns] since when it has not been at rest
        self._used_ns: int | None = None  # [ns] when the newest usable IMU sample was judged
        self._now: int | None = None  # [ns]
        self._begin()

    @property
    def blocked_by(self) -> str | None:
        """Name of the count of what keeps the calibration from ending."""
        return None if self._finding is None else self._finding.name

    @property
    def seconds_left(self) -> float:
        """[s] of rest still needed."""
        return self._calibration.seconds_left

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

    def imu(self, sample: ImuSample, dt: float) -> Calibrated | None:
        """One usable sample, `dt` [s] after the previous one. Returns the result once it is
        complete."""
        self._used_ns = self._now
        calibration, events = self._calibration, self._events
        if calibration.imu(sample.angular_rate, sample.specific_force, dt):
            events.note("moved:calibration")
            events.warn("the vehicle moves: calibration waits until it is still")
            self._countdown, self._resting = Countdown(), None
        result = self._sound(calibration.result())
        line = self._countdown.line(calibration.seconds_left)
        if result is None and line is not None and self._finding is None:
            events.say(line)
        return result

    def pressure(self, pressure: float) -> None:
        """One validated sample [Pa]."""
        self._calibration.pressure(pressure)

    def drive(self) -> None:
        """The thrusters run: it does not float freely."""
        self._calibration.drive()

    def magnetometer(self, field: Vec3) -> None:
        """One validated sample [T], FRD."""
        self._calibration.magnetometer(field)

    def _begin(self) -> None:
        self._calibration, self._countdown = Calibration(self._settings), Countdown()

    def _sound(self, result: Calibrated | None) -> Calibrated | None:
        """The result of a rest in which nothing was wrong."""
        if result is None or not all(self._arrivals[key].judged for key in self._limits.needed):
            return None
        self._resting = wrong_at_rest(result.specific_force, self._limits.force_tolerance)
        if self._resting is not None:
            self._begin()
            return None
        return result

    def _wrong_sensor(self, now: int) -> Finding | None:
        """Unit or stamps of a sensor, or an IMU that cannot be used."""
        found = (check.finding(now) for check in self._arrivals.values())
        return next(filter(None, found), None) or self._unusable(now)

    def _unusable(self, now: int) -> Finding | None:
        if self._used_ns is None or now - self._used_ns <= PATIENCE_NS:
            return None
        why = self._why(topics.IMU.key) or f"nothing arrives on {topics.IMU.key}"
        return Finding("unusable:sensor/imu", f"no sample of the IMU can be used: {why}")

    def _unrest(self, now: int) -> Finding | None:
        unrest = self._calibration.unrest
        if unrest is None:
            self._unrest_ns = None
            return None
        if self._unrest_ns is None:
            self._unrest_ns = now
        if now - self._unrest_ns <= UNREST_NS:
            return None
        s = self._settings
        return Finding(
            "moving:calibration",
            f"the IMU has read no rest for {UNREST_NS / 1e9:.0f} s: rates of {unrest.rate:.2g} "
            f"rad/s that spread by {unrest.rate_std:.2g}, specific forces that spread by "
            f"{unrest.force_std:.2g} m/s², a pressure that changes by {unrest.pressure:.0f} Pa, "
            f"allowed are {s.largest_bias:g}, {s.rate_std:g} and "
            f"{s.force_std:g}: keep the vehicle still; if it is, its driver must say rad/s, not "
            f"deg/s",
        )

    def _lack(self) -> Finding | None:
        if not self._calibration.lacks_pressure:
            return None
        why = self._why(topics.PRESSURE.key)
        text = "calibration waits for the pressure sensor"
        return Finding("waiting:sensor/pressure", f"{text}: {why}" if why else text)

    def _why(self, key: str) -> str:
        """The most frequent count of a sensor in words, or nothing."""
        counts = {name: n for name, n in self._refused.items() if name.endswith(f":{key}")}
        if not counts:
            return ""
        name = max(counts, key=lambda name: counts[name])
        return f"{sentence(name)}, {counts[name]} times"

    def _block(self, finding: Finding | None) -> None:
        before, self._finding = self._finding, finding
        if finding is None:
            if before is not None:
                self._events.say("what kept the calibration from ending is gone")
            return
        if before is None or before.name != finding.name:
            self._events.note(finding.name)
        if finding.name not in self._warned:
            self._warned.add(finding.name)
            self._events.warn(finding.text)
