"""Time as the sensors tell it, for a law that runs whenever a computer comes to it.

What a law compares is measured at the sensor's instants, and handled a random while later. So its
time goes on by the differences of the sensor stamps; by the clock only while no new ones come.
"""

from dataclasses import dataclass

from messages.units import Ns

PATIENCE_NS = 50_000_000  # [ns] five IMU periods; a stamp older than this is no longer waited for


@dataclass(slots=True)
class SensorTime:
    """`at` never runs backwards, and counts no interval twice: neither when it goes on by the
    clock and stamps return, nor when a sensor begins to count anew."""

    at: Ns = 0  # [ns] to which the law has come
    _stamp: Ns | None = None  # [ns] newest of the sensor
    _heard: Ns = 0  # [ns] by the clock, when it was new
    _stepped: Ns = 0  # [ns] by the clock, at the last step
    _shift: int = 0  # [ns] from stamps to `at`; other than 0 after the sensor began anew

    def step(self, stamp: Ns | None, now: Ns) -> Ns:
        """Where the law's time is now [ns].

        Args:
            stamp: [ns] of the newest sample known; None: there is none.
            now: [ns] by the clock.
        """
        self.at = max(self.at, self._sensed_or_clock(stamp, now))
        self._stepped = now
        return self.at

    def _sensed_or_clock(self, stamp: Ns | None, now: Ns) -> Ns:
        last = self._stamp
        if stamp is not None and stamp != last:
            if last is not None and stamp < last:
                self._shift = self.at + max(0, now - self._stepped) - stamp
            self._stamp, self._heard = stamp, now
            return stamp + self._shift
        if last is None:
            return now
        silence = now - self._heard
        return last + self._shift + silence if stamp is None or silence > PATIENCE_NS else self.at
