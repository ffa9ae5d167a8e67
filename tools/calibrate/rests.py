"""Rests: spans in which the IMU neither turned nor was pushed, and its means in them."""

from collections.abc import Sequence
from math import hypot
from typing import NamedTuple

import numpy as np

from messages.units import Vec3
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD
from services.estimation.settings import CalibrationSettings
from tools.recordings.allan import Floats

BLOCK = 0.5  # [s] judged together
STILL = CalibrationSettings()
MOST_CHANGE_RATE, MOST_CHANGE_FORCE = 0.01, 0.1  # [rad/s], [m/s²] of a block's mean within a rest


class RestMean(NamedTuple):
    """Mean of a rest, and how well it is known."""

    seconds: float
    samples: int
    mean: Floats  # shape (6,): angular rate [rad/s], specific force [m/s²]; the sensor's axes
    std: Floats  # shape (6,) of one sample
    mean_std: Floats  # shape (6,) of the mean, from the spread of the blocks' means

    @property
    def force(self) -> Vec3:
        x, y, z = self.mean[3:].tolist()
        return x, y, z


class RestWatch:
    """Collects the rest that lasts now."""

    def __init__(self) -> None:
        self.moved = ""  # why the last block was no rest; empty: it was
        self._block: list[tuple[float, ...]] = []
        self._begin_ns: int | None = None  # [ns] of the block
        self._last_ns = 0
        self._blocks: list[Floats] = []  # of this rest, shape (n, 6) each
        self._seconds = 0.0

    @property
    def seconds(self) -> float:
        """[s] at rest so far."""
        return self._seconds

    def imu(self, rate: Sequence[float], force: Sequence[float], stamp_ns: int) -> bool:
        """One sample [rad/s, m/s²]; one that is not newer than the last is left out. True: the rest
        has become longer."""
        if self._begin_ns is None:
            self._begin_ns = stamp_ns
        elif stamp_ns <= self._last_ns:
            return False
        gap = (stamp_ns - self._last_ns) * 1e-9 if self._block else 0.0
        self._last_ns = stamp_ns
        if gap > BLOCK:
            self.forget("its samples had a gap")
            self._begin_ns = stamp_ns
        self._block.append((*rate, *force))
        seconds = (stamp_ns - self._begin_ns) * 1e-9
        if seconds < BLOCK:
            return False
        block = np.array(self._block)
        self._block, self._begin_ns = [], stamp_ns
        self.moved = self._motion(block)
        if self.moved:
            self._blocks, self._seconds = [], 0.0
            return False
        self._blocks.append(block)
        self._seconds += seconds
        return True

    def forget(self, why: str = "") -> None:
        """Begin a new rest."""
        self.moved = why
        self._block, self._blocks, self._seconds, self._begin_ns = [], [], 0.0, None

    def result(self) -> RestMean | None:
        """The mean of this rest; None for less than two blocks."""
        if len(self._blocks) < 2:
            return None
        every = np.concatenate(self._blocks)
        means = np.array([block.mean(axis=0) for block in self._blocks])
        std, spread = every.std(axis=0, ddof=1), means.std(axis=0, ddof=1)
        # Few blocks may agree by chance; white noise is the least there is.
        known = np.maximum(spread / len(means) ** 0.5, std / len(every) ** 0.5)
        return RestMean(self._seconds, len(every), every.mean(axis=0), std, known)

    def _motion(self, block: Floats) -> str:
        spread, mean = block.std(axis=0), block.mean(axis=0)
        if max(spread[:3]) > MOST_RATE_STD or hypot(*mean[:3]) > STILL.largest_bias:
            return "it turns"
        if max(spread[3:]) > MOST_FORCE_STD:
            return "it is pushed"
        if self._blocks:
            change = np.abs(mean - self._blocks[0].mean(axis=0))
            if max(change[:3]) > MOST_CHANGE_RATE:
                return "it turns"
            if max(change[3:]) > MOST_CHANGE_FORCE:
                return "it tilts"
        return ""
