"""How often a sensor speaks, and when it is silent by that.

One that comes ten times a second is silent after a second; one that comes once a second is not late
after two. A change of rate, as of a DVL between the modes of its range, is no silence.
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
