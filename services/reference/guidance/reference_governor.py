"""First anti-windup guard (Andrén 2023, 5.4.1): keeps the reference close to a vehicle that is
blocked, by the sea floor or by its tether."""

from dataclasses import dataclass

from services.marine.summation import plain_sum
from services.reference.trajectory.minimum_jerk import Sample

RETURN_S = 0.5  # [s] time constant of the reference's return to the vehicle


@dataclass(slots=True)
class ReferenceGovernor:
    """Keeps the reference within `most` of the vehicle. Once the stick is released the reference
    returns to the vehicle, so that the thrusters do not push against the obstacle for ever."""

    most: float  # position units
    blocked: bool = False

    def keep(self, size: float, dt: float, *, released: bool) -> float:
        """The share, 0 … 1, of an error of this size that may remain after `dt` [s].

        Args:
            released: the reference slows down or is at rest.
        """
        if size > self.most:
            self.blocked = True
            return self.most / size
        if self.blocked and released:
            self.blocked = size >= self.most / 10
            return 1.0 - min(1.0, dt / RETURN_S)
        self.blocked = self.blocked and size >= self.most / 2
        return 1.0


def is_released(*motions: Sample) -> bool:
    """Whether the reference slows down or is at rest; one motion per axis."""
    speeding_up = plain_sum(motion.velocity * motion.acceleration for motion in motions)
    at_rest = all(motion.velocity == 0.0 == motion.acceleration for motion in motions)
    return speeding_up < 0.0 or at_rest
