"""What rest says: at rest the gyroscope reads its bias.

Uncalibrated, a small gyroscope drifts by tens of degrees of heading per minute; a few seconds of
averaging at rest bring that under one (Andrén 2023, §5.3.2). Motion by waves or handling must not
enter the average, so any motion restarts it. In mid-dive a rest is three seconds in which nothing
moves. Before the dive the vehicle may bob, so that rest has wider limits and is longer; it shows
the air and the magnetic field as well.

Duration: white noise of density n leaves n / √T in a mean over T seconds, and no filter does
better. A typical 0.007 °/s/√Hz is 0.42 °/min after 1 s, 0.24 after 3 s, 0.13 after 10 s. Bias drift
during a dive of five minutes adds 0.10 °/min (10 °/h, τ 300 s), which no calibration removes:
longer than 10 s gains little, shorter than 8 s misses 0.2 °/min.
"""

from collections.abc import Sequence
from math import hypot, sqrt
from typing import NamedTuple

from messages import events
from messages.events import Event
from messages.units import Vec3
from services.estimation.filter import GYRO, ErrorStateFilter
from services.estimation.quantity import Fusion, Quantity
from services.estimation.settings import CalibrationSettings
from services.marine.summation import plain_sum

# A rest in mid-dive: blocks in which nothing moves. Six in a row, so that a wave's crest is none.
BLOCK_S, BLOCKS = 0.5, 6  # [s]
REST_RATE_STD, REST_FORCE_STD = 0.004, 0.06  # [rad/s], [m/s²] within a block, noise included
REST_CHANGE = 0.0017  # [rad/s] from the first block: what still fits a slow drift of temperature
# [rad/s] 1σ of a turn at rest, which cannot be told from a bias: afloat, or driven once.
AFLOAT_TURN, DRIVEN_TURN = 5e-5, 6e-4

# Before the dive.
MOST_RATE_STD, MOST_FORCE_STD = 0.02, 0.2  # [rad/s], [m/s²] more within a block is motion
LIMITS = (MOST_FORCE_STD,) * 3 + (MOST_RATE_STD,) * 3  # of a block's mean, from those before
SCATTERED = 0.3  # [-] of the blocks' spread: a swell of 8 s averages out by so much in 10 s
MOST_CHANGE = 1500.0  # [Pa] of a block's pressure, and 3 σ: 15 cm; more is no bobbing
ENOUGH_PRESSURES = 20  # samples; fewer do not average 5 mbar away


class Moments:
    """Mean and spread of several numbers, each relative to its first."""

    def __init__(self) -> None:
        self.count = 0
        self._first: Sequence[float] = ()
        self._sums = self._squares = list[float]()

    def add(self, numbers: Sequence[float]) -> None:
        if not self.count:
            self._first, n = numbers, len(numbers)
            self._sums, self._squares = [0.0] * n, [0.0] * n
        for k, (x, x0) in enumerate(zip(numbers, self._first, strict=True)):
            self._sums[k] += x - x0
            self._squares[k] += (x - x0) * (x - x0)
        self.count += 1

    @property
    def mean(self) -> list[float]:
        n = self.count
        return [x0 + x / n for x0, x in zip(self._first, self._sums, strict=True)]

    @property
    def std(self) -> list[float]:
        pairs, n = zip(self._squares, self._sums, strict=True), self.count
        return [sqrt(max(0.0, square / n - (x / n) ** 2)) for square, x in pairs]


class Calibrated(NamedTuple):
    """The result of a rest before the dive."""

    gyro_bias: Sequence[float]  # [rad/s] FRD
    gyro_std: Sequence[float]  # [rad/s]
    specific_force: Sequence[float]  # [m/s²] FRD, mean
    pressure: float  # [Pa] mean
    pressure_std: float  # [Pa] of that mean
    field: Sequence[float] | None  # [T] FRD, mean


class Unrest(NamedTuple):
    """The worst axis of a block that was no rest."""

    rate: float  # [rad/s] mean
    rate_std: float  # [rad/s]
    force_std: float  # [m/s²]
    pressure: float  # [Pa] change since the rest began


class Rest:
    """The rest that lasts now. Who holds the heading by a wrong bias turns so that the gyroscope
    reads just that: in mid-dive, no thruster may run."""

    def __init__(self, settings: CalibrationSettings) -> None:
        self.quantities = tuple(
            Quantity(f"rest_{axis}", "rad/s", AFLOAT_TURN, patience=10.0) for axis in "xyz"
        )
        self.calibrates = True  # looks for the rest of a vehicle that bobs, and did not begin yet
        self.shaken = 0.0  # [m/s²] largest spread of the specific force since the last rest
        self._settings = settings
        self._block, self._seconds = Moments(), 0.0
        self._block_pressure = Moments()
        self._pushed = False
        self._quiet = list[tuple[list[float], list[float], int]]()  # rates, their std, samples
        self.begin()

    def begin(self) -> None:
        """The rest before the dive begins anew."""
        self.unrest: Unrest | None = None  # of the newest block, which was motion
        self._rested = 0.0  # [s]
        self._means, self._pressures, self._fields = Moments(), Moments(), Moments()

    def pushed(self) -> None:
        """A thruster runs."""
        self._pushed = True

    def moved(self) -> None:
        """A gap in the samples counts as motion."""
        self._block, self._seconds, self._quiet = Moments(), 0.0, []

    def pressure(self, pressure: float) -> None:
        """One sample [Pa]."""
        if self.calibrates:
            self._block_pressure.add((pressure,))
            self._pressures.add((pressure,))

    def magnetometer(self, field: Vec3) -> None:
        """One sample [T], FRD."""
        if self.calibrates:
            self._fields.add(field)

    def imu(self, force: Vec3, rate: Vec3, dt: float) -> bool:
        """One sample [m/s², rad/s], biases included. True: a block is complete."""
        block = self._block
        block.add((*force, *rate))
        self._seconds += dt
        if self._seconds < BLOCK_S - 1e-4 or block.count < 5:
            return False
        mean, std, seconds = block.mean, block.std, self._seconds
        self._block, self._seconds = Moments(), 0.0
        turn = max(map(abs, mean[3:]))
        first = self._quiet[0][0] if self._quiet else mean[3:]
        if self._pushed or max(std[3:]) >= REST_RATE_STD or max(std[:3]) >= REST_FORCE_STD or (
            turn > self._settings.largest_bias or _farthest(mean[3:], first) > REST_CHANGE
        ):  # fmt: skip
            self._quiet = []
        else:
            self._quiet.append((mean[3:], std[3:], block.count))
        self._pushed = False
        if self.calibrates:
            self._calibrate(mean, std, seconds, turn)
        return True

    # In mid-dive.

    def fuse(self, f: ErrorStateFilter, at_ns: int, *, driven: bool) -> Event | None:
        """After a complete block. Returns an event to tell."""
        quiet = self._quiet
        if len(quiet) < BLOCKS:
            return None
        # The first time with the whole run behind it, then block by block; the newest is left out,
        # because motion begins slowly.
        begins = len(quiet) == BLOCKS
        used = quiet[:-1] if begins else quiet[-2:-1]
        if not begins:
            del quiet[1]  # the first, and as many as are needed, stay
        turn, (_, std, count) = DRIVEN_TURN if driven else AFLOAT_TURN, quiet[-1]
        for k, quantity in enumerate(self.quantities):
            measured = plain_sum(each[0][k] for each in used) / len(used)
            quantity.white = hypot(turn, std[k] / sqrt(count * len(used)))
            quantity.white_variance = quantity.white**2
            off = measured - f.gyro_bias[k]
            h = ((GYRO + k, 1.0),)
            if quantity.fuse(f, h, measured, off, at_ns) is Fusion.PERSISTENT:
                f.widen(GYRO + k, abs(off))
                quantity.set_anew(f, h, off, at_ns)
        return events.RESTING("gyro_bias") if begins else None

    # Before the dive, and after one that began without a rest.

    def _calibrate(self, mean: list[float], std: list[float], seconds: float, turn: float) -> None:
        change, allowed = self._pressure_change()
        before = self._means.mean if self._means.count else mean
        spread, shaken = max(std[3:]), max(std[:3])
        if (
            spread <= MOST_RATE_STD and shaken <= MOST_FORCE_STD
            and turn <= self._settings.largest_bias and abs(change) <= allowed
            and all(abs(x - y) <= z for x, y, z in zip(mean, before, LIMITS, strict=True))
        ):  # fmt: skip
            self.unrest, self.shaken = None, 0.0
            self._rested += seconds
            self._means.add(mean)
            return
        self.begin()
        self.unrest = Unrest(turn, spread, shaken, change)
        self.shaken = max(self.shaken, shaken)

    def _pressure_change(self) -> tuple[float, float]:
        """[Pa] Of the newest block from the whole rest, and what is allowed."""
        block, self._block_pressure = self._block_pressure, Moments()
        if not block.count or self._pressures.count < ENOUGH_PRESSURES:
            return 0.0, MOST_CHANGE
        spread = self._pressures.std[0] / sqrt(block.count)
        return block.mean[0] - self._pressures.mean[0], MOST_CHANGE + 3.0 * spread

    @property
    def seconds_left(self) -> float:
        """[s] of rest still needed."""
        return max(0.0, self._settings.still_time - self._rested)

    @property
    def lacks_pressure(self) -> bool:
        """Whether only pressure samples are missing."""
        return self._is_long and self._pressures.count < ENOUGH_PRESSURES

    @property
    def _is_long(self) -> bool:
        # The very first sample has none before it: n samples span n - 1 periods.
        return self._means.count > 0 and self._rested >= self._settings.still_time - 0.015

    def result(self) -> Calibrated | None:
        """None until there are enough samples."""
        if not self._is_long or self.lacks_pressure:
            return None
        mean, std = self._means.mean, self._means.std[3:]
        pressures, fields = self._pressures, self._fields
        return Calibrated(
            mean[3:], [hypot(AFLOAT_TURN, SCATTERED * spread) for spread in std], mean[:3],
            pressures.mean[0], pressures.std[0] / sqrt(pressures.count),
            fields.mean if fields.count else None,
        )  # fmt: skip


def _farthest(a: list[float], b: list[float]) -> float:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))
