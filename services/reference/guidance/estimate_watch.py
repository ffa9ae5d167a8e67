"""Are depth and heading measured? What is not measured is not held, and the pilot reads so for as
long as it lasts."""

from dataclasses import dataclass
from typing import Literal

PATIENCE_S = 0.5  # [s] control goes on without feedback for so long before anybody is told

Change = Literal["lost", "back"]


@dataclass(slots=True)
class EstimateWatch:
    """Of one axis."""

    lost: bool = False
    _valid: float | None = None  # [s] when the estimate was valid last

    def see(self, *, valid: bool, t: float) -> Change | None:
        """The estimate at `t` [s]. Returns what has just changed."""
        if valid or self._valid is None:
            self._valid = t
        if valid and self.lost:
            self.lost = False
            return "back"
        if not self.lost and t - self._valid > PATIENCE_S:
            self.lost = True
            return "lost"
        return None
