"""What rest says: the gyroscope reads its bias, in mid-dive (`Rest`) and before it (`Calibration`).

Uncalibrated, a small gyroscope drifts by tens of degrees of heading per minute; a few seconds of
averaging at rest bring that under one (Andrén 2023, §5.3.2). Motion by waves or handling must not
enter the average, so any motion restarts it.

Duration: white noise of density n leaves n / √T in a mean over T seconds, and no filter does
better. A typical 0.007 °/s/√Hz is 0.42 °/min after 1 s, 0.24 after 3 s, 0.13 after 10 s. Bias drift
during a dive of five minutes adds 0.10 °/min (10 °/h, τ 300 s), which no calibration removes:
longer than 10 s gains little, shorter than 8 s misses 0.2 °/min.
"""

from math import hypot, sqrt
from typing import NamedTuple

from messages import events
from messages.events import Event
from messages.units import Vec3
from services.estimation.filter import GYRO, ErrorStateFilter
from services.estimation.quantity import Fusion, Quantity
from services.estimation.settings import CalibrationSettings
from services.marine.summation import plain_sum

# Rest: blocks in which nothing moves. Six in a row, so that a wave's crest is none.
BLOCK_S, BLOCKS = 0.5, 6  # [s]
REST_RATE_STD, REST_FORCE_STD = 0.004, 0.06  # [rad/s], [m/s²] within a block, noise included
REST_CHANGE = 0.0017  # [rad/s] from the first block: what still fits a slow drift of temperature
# [rad/s] 1σ of a turn at rest, which cannot be told from a bias: afloat, or driven once.
AFLOAT_TURN, DRIVEN_TURN = 5e-5, 6e-4

# Before the dive a rest is longer and its limits are wider: it may bob. What the mean of half
# seconds scatters by is in its spread.
MOST_RATE_STD, MOST_FORCE_STD = 0.02, 0.2  # [rad/s], [m/s²] more within half a second is motion
SCATTERED = 0.3  # [-] of their spread: a swell of 8 s averages out by so much in 10 s
MOST_CHANGE = 1500.0  # [Pa] of pressure in the whole rest, and 3 σ: 15 cm; more is no bobbing
ENOUGH_PRESSURES = 20  # samples; fewer do not average 5 mbar away


class Block:
    """Mean and spread of six numbers over half a second: forces, then rates."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        self.seconds, self.count = 0.0, 0
        self._first: tuple[float, ...] = ()
        self._sums, self._squares = [0.0] * 6, [0.0] * 6

    def add(self, numbers: tuple[float, ...], dt: float) -> bool:
        """True: it is complete."""
        if not self.count:
            self._first = numbers
        for k, (x, x0) in enumerate(zip(numbers, self._first, strict=True)):
            self._sums[k] += x - x0
            self._squares[k] += (x - x0) * (x - x0)
        self.count += 1
        self.seconds += dt
        return self.seconds >= BLOCK_S - 1e-4 and self.count > 4

    @property
    def mean(self) -> list[float]:
        n = self.count
        return [x0 + x / n for x0, x in zip(self._first, self._sums, strict=True)]

    @property
    def std(self) -> list[float]:
        pairs, n = zip(self._squares, self._sums, strict=True), self.count
        return [sqrt(max(0.0, square / n - (x / n) ** 2)) for square, x in pairs]


class Rest:
    """At rest the gyroscope reads its bias. Who holds the heading by a wrong bias turns so that the
    gyroscope reads just that: no thruster may run."""

    def __init__(self, largest: float) -> None:
        """`largest` [rad/s]: a mean rate beyond it is a turn."""
        self.quantities = tuple(
            Quantity(f"rest_{axis}", "rad/s", AFLOAT_TURN, patience=10.0) for axis in "xyz"
        )
        self._largest = largest
        self._block, self._pushed = Block(), False
        self._rests = list[list[float]]()  # [rad/s] mean rates of blocks at rest, in a row

    def pushed(self) -> None:
        """A thruster runs."""
        self._pushed = True

    def moved(self) -> None:
        """A gap in the samples counts as motion."""
        self._block.begin()
        self._rests = []

    def fuse(
        self, f: ErrorStateFilter, force: Vec3, rate: Vec3, dt: float, at_ns: int, *, driven: bool
    ) -> Event | None:
        """One sample, biases included. Returns an event to tell."""
        block = self._block
        if not block.add((*force, *rate), dt):
            return None
        mean, std = block.mean[3:], block.std
        count = block.count
        block.begin()
        still = max(std[3:]) < REST_RATE_STD and max(std[:3]) < REST_FORCE_STD and not self._pushed
        still = still and max(map(abs, mean)) <= self._largest
        self._pushed, rests = False, self._rests
        if not still or (rests and _farthest(mean, rests[0]) > REST_CHANGE):
            self._rests = []
            return None
        rests.append(mean)
        if len(rests) < BLOCKS:
            return None
        # The first time with the whole run behind it, then block by block; the newest is left out,
        # because motion begins slowly.
        used = rests[:-1] if len(rests) == BLOCKS else rests[-2:-1]
        turn = DRIVEN_TURN if driven else AFLOAT_TURN
        for k, quantity in enumerate(self.quantities):
            measured = plain_sum(each[k] for each in used) / len(used)
            quantity.white = hypot(turn, std[3 + k] / sqrt(count * len(used)))
            quantity.white_variance = quantity.white**2
            off = measured - f.gyro_bias[k]
            h = ((GYRO + k, 1.0),)
            if quantity.fuse(f, h, measured, off, at_ns) is Fusion.PERSISTENT:
                f.widen(GYRO + k, abs(off))
                quantity.set_anew(f, h, off, at_ns)
        return events.RESTING("gyro_bias") if len(rests) == BLOCKS else None


def _farthest(a: list[float], b: list[float]) -> float:
    return max(abs(x - y) for x, y in zip(a, b, strict=True))


class Calibrated(NamedTuple):
    """The result of a rest before the dive."""

    gyro_bias: Vec3  # [rad/s] FRD
    gyro_std: Vec3  # [rad/s]
    specific_force: Vec3  # [m/s²] FRD, mean
    pressure: float  # [Pa] mean
    pressure_std: float  # [Pa] of that mean, and of how it changed
    driven: bool  # the thrusters ran: it may not have floated
    field: Vec3 | None  # [T] FRD, mean


class Unrest(NamedTuple):
    """The worst axis of half a second that was no rest."""

    rate: float  # [rad/s] mean
    rate_std: float  # [rad/s]
    force_std: float  # [m/s²]
    pressure: float  # [Pa] change since the rest began


class Calibration:
    """Averages over `still_time` of rest and at least `ENOUGH_PRESSURES` pressure samples."""

    def __init__(self, settings: CalibrationSettings) -> None:
        self._settings = settings
        self._block = Block()
        self._moving = False
        self.unrest: Unrest | None = None  # None: at rest
        self.shaken = 0.0  # [m/s²] largest spread of the specific force since the last rest
        self.begin()

    def begin(self) -> None:
        self._seconds = 0.0
        self._block.begin()
        self._means = list[list[float]]()  # of half seconds
        self.pressures = list[float]()  # [Pa]
        self._fields = list[Vec3]()  # [T]
        self.driven = False

    def imu(self, force: Vec3, rate: Vec3, dt: float) -> bool:
        """One sample [m/s², rad/s]. True: the vehicle has begun to move and the average restarts
        (once per disturbance)."""
        block = self._block
        if not block.add((*force, *rate), dt):
            return False
        mean, std, seconds, change = block.mean, block.std, block.seconds, self._pressure_change()
        block.begin()
        rates, spread, shaken = max(map(abs, mean[3:])), max(std[3:]), max(std[:3])
        if (
            spread <= MOST_RATE_STD and shaken <= MOST_FORCE_STD
            and rates <= self._settings.largest_bias
            and abs(change[0]) <= MOST_CHANGE + 3.0 * change[1] and self._agrees(mean)
        ):  # fmt: skip
            self._moving, self.unrest, self.shaken = False, None, 0.0
            self._seconds += seconds
            self._means.append(mean)
            return False
        disturbed, self._moving = not self._moving, True
        self.unrest = Unrest(rates, spread, shaken, change[0])
        self.shaken = max(self.shaken, shaken)
        self.begin()
        return disturbed

    def _agrees(self, mean: list[float]) -> bool:
        """With the rest so far."""
        if not self._means:
            return True
        limits = [MOST_FORCE_STD] * 3 + [MOST_RATE_STD] * 3
        before = (_mean(column) for column in zip(*self._means, strict=True))
        return all(abs(x - y) <= most for x, y, most in zip(mean, before, limits, strict=True))

    def magnetometer(self, field: Vec3) -> None:
        """One validated sample [T], FRD."""
        self._fields.append(field)

    @property
    def seconds_left(self) -> float:
        """[s] of rest still needed."""
        return max(0.0, self._settings.still_time - self._seconds)

    @property
    def _rested(self) -> bool:
        # The very first sample has none before it: n samples span n - 1 periods.
        return bool(self._means) and self._seconds >= self._settings.still_time - 0.015

    @property
    def lacks_pressure(self) -> bool:
        """Whether only pressure samples are missing."""
        return self._rested and len(self.pressures) < ENOUGH_PRESSURES

    def result(self) -> Calibrated | None:
        """None until there are enough samples."""
        if not self._rested or self.lacks_pressure:
            return None
        fx, fy, fz, p, q, r = (_mean(column) for column in zip(*self._means, strict=True))
        a, b, c = (
            hypot(AFLOAT_TURN, SCATTERED * _spread(column))
            for column in list(zip(*self._means, strict=True))[3:]
        )
        change, std = self._pressure_change()
        n, e, d = (
            (_mean(column) for column in zip(*self._fields, strict=True))
            if self._fields
            else (0.0,) * 3
        )
        lasting = change if abs(change) > 3.0 * std else 0.0
        return Calibrated(
            (p, q, r), (a, b, c), (fx, fy, fz), _mean(self.pressures),
            hypot(_spread(self.pressures) / sqrt(len(self.pressures)), lasting),
            self.driven, (n, e, d) if self._fields else None,
        )  # fmt: skip

    def _pressure_change(self) -> tuple[float, float]:
        """[Pa] From the first to the last quarter of this rest, and its 1σ."""
        quarter = len(self.pressures) // 4
        if 4 * quarter < ENOUGH_PRESSURES:
            return 0.0, 0.0
        first, last = self.pressures[:quarter], self.pressures[-quarter:]
        std = hypot(_spread(first), _spread(last)) / sqrt(quarter)
        return _mean(last) - _mean(first), std


def _mean(values: "list[float] | tuple[float, ...]") -> float:
    first = values[0]
    return first + plain_sum(value - first for value in values) / len(values)


def _spread(values: "list[float] | tuple[float, ...]") -> float:
    mean = _mean(values)
    return sqrt(plain_sum((value - mean) ** 2 for value in values) / len(values))
