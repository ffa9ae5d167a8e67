"""A change of who decides about an axis, without a step in its force."""

from dataclasses import dataclass


@dataclass(slots=True)
class BumplessTransfer:
    """What the old way asked for fades into what the new way asks for."""

    seconds: float  # [s] until the old way is forgotten
    _way: str | None = None  # who decided at the last step; None: nobody yet
    _total: float = 0.0  # [N] or [N m] asked for at the last step
    _offset: float = 0.0  # [N] or [N m] old minus new at the change
    _left: float = 0.0  # [-] of the fading

    def step(self, way: str, wanted: float, dt: float) -> float:
        """The force [N] or [N m] to ask for, when `way` wants `wanted`.

        At a change it is what it was the step before; then the difference fades linearly.
        """
        if self._way not in (None, way):
            self._offset, self._left = self._total - wanted, 1.0
        else:
            self._left = max(0.0, self._left - dt / self.seconds)
        self._way = way
        self._total = wanted + self._left * self._offset
        return self._total

    def forget(self) -> None:
        self._way, self._left = None, 0.0
