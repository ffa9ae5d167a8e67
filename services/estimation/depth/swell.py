"""Waves, as a filter with an accelerometer sees them: the pressure swings about its depth.

In a wave the accelerometer is right and the pressure is not a depth: the water above the sensor
rises and falls, and a vehicle that goes along with it may read no change at all. A wrong
accelerometer leaves the pressure to one side, and for good.
"""

from math import exp

MEMORY = 0.5  # [s] of the mean innovation
LEAST = 0.015  # [m] of it, to count as a swing
SHORTEST, LONGEST = 1.2, 6.5  # [s] half a wave: from 2.4 to 13 s
FADES = 20.0  # [s] half a wave is remembered
ENOUGH = 1.2  # halves of waves, so: the second of two
MOST_SEEN = 4.0  # halves that count
# [m], [m], [-] times the swings: no wave goes so far to one side
FAR, FAR_ROLLING, FURTHER = 0.3, 0.5, 2.5


class Swell:
    """From the innovations [m] of one filter."""

    __slots__ = ("_peak", "_seen", "_side", "_since", "amplitude", "mean")

    def __init__(self) -> None:
        self.mean = 0.0  # [m] of the innovations, lately
        self.amplitude = 0.0  # [m] of the swings seen
        self._peak = 0.0  # [m] of this half
        self._side = 0  # of it
        self._since = 0.0  # [s] since it began
        self._seen = 0.0  # halves of waves one after the other, fading

    @property
    def rolls(self) -> bool:
        """There are waves."""
        return self._seen >= ENOUGH

    @property
    def leaves(self) -> bool:
        """The pressure has left the filter for too far or too long to be a wave."""
        far = max(FAR_ROLLING, FURTHER * self.amplitude) if self.rolls else FAR
        if abs(self.mean) > far:
            return True
        return self._since > LONGEST

    def add(self, innovation: float, std: float, dt: float) -> None:
        """One innovation, `dt` [s] after the one before, of a sensor with noise `std`: [m]."""
        share = dt / (MEMORY + dt)
        self.mean += share * (max(-1.0, min(1.0, innovation)) - self.mean)
        self._since += dt
        keep = exp(-dt / FADES)
        self._seen *= keep
        self.amplitude *= keep
        least = max(LEAST, 3.0 * std * share**0.5)
        side = (self.mean > least) - (self.mean < -least)
        if side == self._side or (side == 0 and self._since <= LONGEST):
            self._peak = max(self._peak, abs(self.mean))
            return
        if self._side and SHORTEST <= self._since <= LONGEST:
            self._seen = min(MOST_SEEN, self._seen + 1.0)
            self.amplitude = max(self.amplitude, self._peak)
        self._side, self._since, self._peak = side, 0.0, abs(self.mean)
