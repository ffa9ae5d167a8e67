"""Where a stop ends: when the reference rests, what is held moves to where the vehicle then stands.

A stop ends where its plan says, and the vehicle runs past that point by some millimetres. Nobody
asked for that very point, only for a stop, so to be pulled back to it is a motion that the pilot
did not want.
"""

from dataclasses import dataclass

PATIENCE_S = 0.8  # [s] a vehicle that creeps on in one direction is held where it is after that
WORTH = 0.02  # [-] of the furthest; a smaller move is not made


@dataclass(slots=True)
class Standstill:
    """Of one axis. Time `t` in seconds, never decreasing."""

    most: float  # position units; furthest that what is held is moved
    moved: float = 0.0  # position units; by how much it was, at the newest stop
    _stops: bool = False  # the reference has moved, and no standstill has followed yet
    _rests: float | None = None  # [s] since when the reference rests after that
    _way: float = 0.0  # position units per second; newest velocity of the reference

    def cancel(self) -> None:
        """The end of this motion was asked for, or the vehicle is held back: leave it there."""
        self._stops, self._rests = False, None

    def step(
        self, error: float, rate: float, t: float, *, resting: bool, velocity: float = 0.0
    ) -> float:
        """By how much to move what is held, now. A vehicle that still runs on is waited for; one
        that has come to a standstill before, or comes back already, is held where it is.

        Args:
            error: position units; from what is held to the vehicle.
            rate: position units per second; of the vehicle.
            resting: the reference rests.
            velocity: position units per second; of the reference.
        """
        if not resting:
            self._stops, self._rests, self._way = True, None, velocity or self._way
            return 0.0
        if not self._stops:
            return 0.0
        if self._rests is None:
            self._rests = t
        if rate * self._way > 0.0 and t - self._rests < PATIENCE_S:
            return 0.0
        self.cancel()
        by = max(-self.most, min(self.most, error))
        self.moved = by if abs(by) >= WORTH * self.most else 0.0
        return self.moved
