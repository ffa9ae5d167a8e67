"""First windup guard (Andrén 2023, 5.4.1): the reference does not run away from a vehicle that is
held back, by the sea floor or by its tether."""

from dataclasses import dataclass

from services.reference.trajectory.minimum_jerk import Sample

GIVE_IN_S = 0.5  # [s] time constant with which a held-back reference comes to the vehicle


@dataclass(slots=True)
class ReferenceGovernor:
    """Keeps the reference within `most` of where the vehicle really is. Once the stick is let go
    the reference gives in and comes to the vehicle, so that nothing pushes on for ever."""

    most: float  # position units
    held_back: bool = False

    def keep(self, size: float, dt: float, *, let_go: bool) -> float:
        """The share, 0 … 1, of an error of this size that may remain after `dt` [s].

        Args:
            let_go: the reference slows down or stands still.
        """
        if size > self.most:
            self.held_back = True
            return self.most / size
        if self.held_back and let_go:
            self.held_back = size >= self.most / 10
            return 1.0 - min(1.0, dt / GIVE_IN_S)
        self.held_back = self.held_back and size >= self.most / 2
        return 1.0


def is_let_go(*motions: Sample) -> bool:
    """Whether the reference slows down or stands still; one motion per axis of a place."""
    speeding_up = sum(motion.velocity * motion.acceleration for motion in motions)
    at_rest = all(motion.velocity == 0.0 == motion.acceleration for motion in motions)
    return speeding_up < 0.0 or at_rest
