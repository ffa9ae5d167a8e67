"""How often a sensor speaks and when it is silent by that; and time by sensor stamps.

A sensor that comes ten times a second is silent after a second; one that comes once a second is not
late after two. A change of rate, as of a DVL between the modes of its range, is no silence.

A law's inputs are measured at the sensor's instants and handled later, with a random delay. So its
time advances by the differences of sensor stamps, and by the clock only while there are no new
samples.
"""

from dataclasses import dataclass

from messages.units import Ns

PERIODS = 10.0  # [-] without a sample, and it is silent …
LEAST_S = 1.0  # [s] … but not sooner: a hiccup of a computer or a link is none
SHARE = 0.2  # [-] of the newest period in the running mean


@dataclass(slots=True)
class SampleRhythm:
    """The running mean of the periods between a sensor's samples."""

    longest: float  # [s] after which any is silent, also one of which nothing is known yet
    _period: float | None = None  # [s]
    _stamp_ns: Ns | None = None  # of the newest

    def see(self, stamp_ns: Ns) -> None:
        """A sample arrived; one that is not newer than the last says nothing."""
        last_ns = self._stamp_ns
        if last_ns is not None and stamp_ns <= last_ns:
            return
        self._stamp_ns = stamp_ns
        if last_ns is None:
            return
        # An outage counts as the longest period that makes a difference.
        period = min((stamp_ns - last_ns) * 1e-9, self.longest / PERIODS)
        before = self._period
        self._period = period if before is None else before + SHARE * (period - before)

    @property
    def patience(self) -> float:
        """[s] Without a sample, after which it is silent."""
        if self._period is None:
            return self.longest
        return min(self.longest, max(LEAST_S, PERIODS * self._period))


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
