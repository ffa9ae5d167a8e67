"""Whether a DVL still sees the bottom that it saw before.

Fish below the vehicle make its altitude jump, as a step of the bottom does. Over a step the
velocity goes on as before; fish swim.
"""

from dataclasses import dataclass

JUMP = 0.3  # [m] a change of altitude that neither the vehicle's own depth …
STEEPEST = 1.0  # [-] … nor the way over a slope such as this one explains
LONGEST_S = 2.0  # [s] between two altitudes, so that they can be compared
GATE = 3.0  # [σ] a velocity within goes on as before
NS = 1_000_000_000


@dataclass(slots=True)
class BottomLock:
    """Call `sink` as the vehicle moves, then for each sample `see`, `swims` and, if its velocity is
    used, `believe`."""

    _expected: float | None = None  # [m] altitude over the bottom that is believed
    _newest: float | None = None  # [m] altitude
    _newest_ns: int = 0
    _jumped: bool = False  # the newest altitude is not of that bottom …
    _swims: bool = False  # … nor is the velocity since

    def sink(self, by: float) -> None:
        """The vehicle went `by` [m] down."""
        if self._expected is not None:
            self._expected -= by

    def see(self, altitude: float | None, stamp_ns: int, speed: float) -> None:
        """An altitude [m] at its time [ns], None: not measured, and the speed [m/s] beside it."""
        since = max(0.0, (stamp_ns - self._newest_ns) / NS)
        most = max(JUMP, STEEPEST * speed * since)
        self._newest, self._newest_ns = altitude, stamp_ns
        expected = self._expected if since <= LONGEST_S else None
        if altitude is None or expected is None or abs(altitude - expected) <= most:
            self.believe()
        else:
            self._jumped = True

    def swims(self, surprise: float) -> bool:
        """Is what is seen no bottom? `surprise`: normalised innovation squared of the velocity."""
        self._swims = self._jumped and (self._swims or surprise > GATE**2)
        return self._swims

    def believe(self) -> None:
        """What is seen is the bottom from now on."""
        self._expected, self._jumped, self._swims = self._newest, False, False
