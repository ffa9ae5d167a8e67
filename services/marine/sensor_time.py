"""Time by sensor stamps, for laws that are handled with a random delay.

A law's inputs are measured at the sensor's instants and handled later. So its time advances by the
differences of sensor stamps, and by the clock only while there are no new samples.
"""

from dataclasses import dataclass

from messages.units import Ns

PATIENCE_NS = 50_000_000  # [ns] five IMU periods without a new stamp, then the clock counts


@dataclass(slots=True)
class SensorTime:
    """`at` never decreases and counts no interval twice: neither when stamps return after a time by
    the clock, nor when a sensor restarts its stamps."""

    at: Ns = 0  # [ns] time of the law
    _stamp: Ns | None = None  # [ns] newest of the sensor
    _heard: Ns = 0  # [ns] by the clock, when it was new
    _stepped: Ns = 0  # [ns] by the clock, at the last step
    _shift: int = 0  # [ns] from stamps to `at`; not 0 after the sensor restarted

    def step(self, stamp: Ns | None, now: Ns) -> Ns:
        """The law's time now [ns].

        Args:
            stamp: [ns] of the newest sample; None: none in time, so the clock counts at once.
            now: [ns] by the clock.
        """
        last, at = self._stamp, self.at
        if stamp is not None and stamp != last:  # a new sample
            if last is not None and stamp < last:
                self._shift = self.at + max(0, now - self._stepped) - stamp
            self._stamp, self._heard = stamp, now
            at = stamp + self._shift
        elif last is None:  # no sample ever
            at = now
        elif stamp is None or now - self._heard > PATIENCE_NS:  # the clock goes on from the last
            at = last + self._shift + now - self._heard
        self.at, self._stepped = max(self.at, at), now
        return self.at
