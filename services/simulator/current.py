"""The ocean current: horizontal, uniform, a mean plus a random part."""

from math import exp, sqrt

from messages.units import Vec3
from services.simulator.settings import CurrentSettings
from services.simulator.streams import CURRENT, white_noise

HELD = 0.1  # [s] step of the random part; short compared with its time constant


class Current:
    """First-order Gauss-Markov process about the mean (Fossen 2011, §8.4), solved exactly."""

    def __init__(self, settings: CurrentSettings, seed: int) -> None:
        """Starts at the mean.

        Args:
            seed: [-] 0 or more.
        """
        self._mean = (settings.north, settings.east)
        self._keep = exp(-HELD / settings.time_constant)
        push = settings.std * sqrt(1.0 - self._keep**2)
        self._noise = white_noise(seed, CURRENT, [push, push])
        self._steady = settings.std == 0.0
        self._off = (0.0, 0.0)  # [m/s] from the mean
        self._until = HELD  # [s]

    def at(self, seconds: float) -> Vec3:
        """[m/s] NED, `seconds` after the start; must not decrease between calls."""
        while seconds >= self._until and not self._steady:
            (a, b), (x, y) = next(self._noise), self._off
            self._off = self._keep * x + a, self._keep * y + b
            self._until += HELD
        return self._mean[0] + self._off[0], self._mean[1] + self._off[1], 0.0
