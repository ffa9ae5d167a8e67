"""Waves as a depth filter sees them, in lanes: `services/estimation/depth/swell.py`."""

from math import exp

import numpy as np

from services.estimation.depth import swell
from tools.sweep.fast.lanes import Lanes, Mask, where


class Swells:
    def __init__(self, count: int) -> None:
        self.mean, self.amplitude = np.zeros(count), np.zeros(count)  # [m]
        self._peak, self._since, self._seen = np.zeros(count), np.zeros(count), np.zeros(count)
        self._side = np.zeros(count, int)

    @property
    def rolls(self) -> Mask:
        return self._seen >= swell.ENOUGH

    @property
    def leaves(self) -> Mask:
        far = where(
            self.rolls, np.maximum(swell.FAR_ROLLING, swell.FURTHER * self.amplitude), swell.FAR
        )
        return (np.abs(self.mean) > far) | (self._since > swell.LONGEST)

    def add(self, innovation: Lanes, std: Lanes, dt: float) -> None:
        share = dt / (swell.MEMORY + dt)
        self.mean = self.mean + share * (np.clip(innovation, -1.0, 1.0) - self.mean)
        self._since = self._since + dt
        keep = exp(-dt / swell.FADES)
        self._seen, self.amplitude = keep * self._seen, keep * self.amplitude
        least = np.maximum(swell.LEAST, 3.0 * std * share**0.5)
        side = (self.mean > least).astype(int) - (self.mean < -least)
        size = np.abs(self.mean)
        same = (side == self._side) | ((side == 0) & (self._since <= swell.LONGEST))
        half = (
            ~same
            & (self._side != 0)
            & (self._since >= swell.SHORTEST)
            & (self._since <= swell.LONGEST)
        )
        self._seen = where(half, np.minimum(swell.MOST_SEEN, self._seen + 1.0), self._seen)
        self.amplitude = where(half, np.maximum(self.amplitude, self._peak), self.amplitude)
        self._peak = where(same, np.maximum(self._peak, size), size)
        self._side = where(same, self._side, side)
        self._since = where(same, self._since, 0.0)
