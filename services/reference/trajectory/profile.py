"""The common result of all generators: a motion along one coordinate, known in advance."""

from typing import Protocol

from services.reference.trajectory.minimum_jerk import Sample


class MotionProfile(Protocol):
    """A motion over `duration` seconds. Before 0 and after the end, velocity is constant."""

    @property
    def duration(self) -> float:
        """[s] From start to arrival."""
        ...

    def at(self, t: float) -> Sample:
        """Position (from 0), velocity, acceleration and jerk at `t` [s]."""
        ...
