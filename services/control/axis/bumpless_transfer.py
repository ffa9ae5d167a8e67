"""Bumpless transfer: a change of an axis' mode without a step in its force."""

from dataclasses import dataclass


@dataclass(slots=True)
class BumplessTransfer:
    """The force of the old mode fades into that of the new one."""

    seconds: float  # [s] of the fade
    _mode: str | None = None  # at the last step; None: not yet stepped
    _total: float = 0.0  # [N] or [N m] output of the last step
    _offset: float = 0.0  # [N] or [N m] old minus new at the change
    _left: float = 0.0  # [-] of the offset

    def step(self, mode: str, force: float, dt: float) -> float:
        """The output [N] or [N m], for the `force` that `mode` requires.

        At a mode change the output is that of the previous step; then the difference fades
        linearly.
        """
        if self._mode not in (None, mode):
            self._offset, self._left = self._total - force, 1.0
        else:
            self._left = max(0.0, self._left - dt / self.seconds)
        self._mode = mode
        self._total = force + self._left * self._offset
        return self._total

    def forget(self) -> None:
        """End the fade; the next step has no transfer."""
        self._mode, self._left = None, 0.0
