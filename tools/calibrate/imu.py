"""The IMU at rest: bias and noise of the gyroscope, bias and scale of the accelerometer.

The accelerometer lies in six positions. At rest the specific force has the magnitude of gravity,
whatever the position (Frosio, Pedersini and Borghese 2009, *Autocalibration of MEMS
accelerometers*, IEEE Trans. Instrum. Meas. 58(6)): so no position has to be exact. With each axis
once up and once down, bias b and scale s of

    |s (f' - b)| = g

follow by least squares (Gauss-Newton) over the means of the rests.
"""

from collections.abc import Sequence
from math import hypot, sqrt
from typing import NamedTuple

import numpy as np

from messages.message import Message
from messages.sensors import ImuSample
from services.estimation.rest import MOST_FORCE_STD, MOST_RATE_STD
from services.estimation.settings import CalibrationSettings
from services.marine.vehicle import GRAVITY
from tools.calibrate.guide import CalibrationError, SensorFound, Setting
from tools.calibrate.noise import Floats

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


ENOUGH = 30.0  # [s]
LEAST = 10.0  # [s] of a recording


class GyroscopeGuide:
    """Waits for a rest. The longest one counts."""

    def __init__(self) -> None:
        self._watch = RestWatch()
        self._best: RestMean | None = None

    def see(self, sample: Message) -> None:
        if isinstance(sample, ImuSample):
            longer = self._watch.imu(sample.angular_rate, sample.specific_force, sample.stamp_ns)
            if longer and (self._best is None or self._watch.seconds > self._best.seconds):
                self._best = self._watch.result() or self._best

    @property
    def done(self) -> bool:
        return self._best is not None and self._best.seconds >= ENOUGH

    @property
    def prompt(self) -> str:
        moved = f" ({self._watch.moved})" if self._watch.moved else ""
        so_far = f"{self._watch.seconds:.0f} of {ENOUGH:.0f} s"
        return f"lay the vehicle down and leave it alone{moved}: {so_far}"

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: it was never at rest for long enough.
        """
        best = self._best
        if best is None or best.seconds < LEAST:
            seconds = 0.0 if best is None else best.seconds
            why = f", because {self._watch.moved}" if self._watch.moved else ""
            raise CalibrationError(
                f"gyroscope: the longest rest is {seconds:.1f} s, needed are {LEAST:.0f} s{why}; "
                f"lay the vehicle on something firm"
            )
        bias, known = tuple(best.mean[:3].tolist()), tuple(best.mean_std[:3].tolist())
        density = max(best.std[:3].tolist()) * sqrt(best.seconds / best.samples)
        about = f"rest of {best.seconds:.0f} s"
        return SensorFound(
            (Setting("gyro_bias", bias, known, "rad/s", about),),
            (
                f"gyroscope: noise {density:.2g} rad/s/√Hz on the worst axis; its bias is learnt "
                f"anew before each dive, so this matters only where it exceeds "
                f"estimation.calibration.largest_bias",
            ),
        )


REST = 5.0  # [s] in each position
STEEP = 0.85  # [-] share of gravity along an axis that counts as along it: 32° off
SIDES = {
    (0, -1): "on its tail, nose up",
    (0, 1): "on its nose",
    (1, -1): "on its port side, starboard up",
    (1, 1): "on its starboard side",
    (2, -1): "upright",
    (2, 1): "upside down",
}  # axis and sign of the specific force: at rest it points up, and down is +
MOST_BIAS, MOST_SCALE = 2.0, 0.2  # [m/s²], [-] more is a broken sensor or a wrong unit
ROUNDS = 20
STEP = 1e-10  # [m/s², -] smaller steps end the iteration
Side = tuple[int, int]


class AccelerometerGuide:
    """Waits for a rest on each side; the longest of each counts."""

    def __init__(self) -> None:
        self._watch = RestWatch()
        self._rests: dict[Side, RestMean] = {}
        self._odd = False  # it lies still, but on no side

    def see(self, sample: Message) -> None:
        if not isinstance(sample, ImuSample):
            return
        watch = self._watch
        longer = watch.imu(sample.angular_rate, sample.specific_force, sample.stamp_ns)
        rest = watch.result() if longer and watch.seconds >= REST else None
        if rest is None:
            return
        side = side_of(rest.mean[3:].tolist())
        self._odd = side is None
        if side is not None:
            before = self._rests.get(side)
            if before is None or rest.seconds > before.seconds:
                self._rests[side] = rest

    @property
    def missing(self) -> list[str]:
        return [words for side, words in SIDES.items() if side not in self._rests]

    @property
    def done(self) -> bool:
        return not self.missing

    @property
    def prompt(self) -> str:
        why = f" ({self._watch.moved})" if self._watch.moved else ""
        why = " (lay it along an axis)" if self._odd and not why else why
        return (
            f"{6 - len(self.missing)} of 6 sides; still {min(self._watch.seconds, REST):.0f} of "
            f"{REST:.0f} s{why}; to come: {', '.join(self.missing)}"
        )

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: a side is missing, or the numbers are no sensor's.
        """
        if self.missing:
            raise CalibrationError(
                f"accelerometer: no rest of {REST:.0f} s {' and none '.join(self.missing)}; all "
                f"six sides are needed"
            )
        rests = list(self._rests.values())
        forces = np.array([rest.mean[3:] for rest in rests])
        noise = np.array([rest.mean_std[3:] for rest in rests])
        bias, scale, std = fitted(forces, noise)
        if max(np.abs(bias)) > MOST_BIAS or max(np.abs(scale - 1.0)) > MOST_SCALE:
            raise CalibrationError(
                f"accelerometer: bias {_text(bias)} m/s² and scale {_text(scale)} are not those of "
                f"a working sensor, allowed are ±{MOST_BIAS:g} and 1 ± {MOST_SCALE:g}; check its "
                f"unit, and that it was at rest on each side"
            )
        b, s, known = (tuple(found.tolist()) for found in (bias, scale, std))
        return SensorFound(
            (
                Setting("accelerometer_bias", b, known[:3], "m/s²"),
                Setting("accelerometer_scale", s, known[3:], "-"),
            ),
            (
                "accelerometer: bias and scale only; axes that are not square to each other, or "
                "turned in the housing, are for [vehicle.mounting.imu]",
            ),
        )


def side_of(force: Sequence[float]) -> Side | None:
    """The axis along which this specific force [m/s²] points, and its sign."""
    size = hypot(*force)
    axis = max(range(3), key=lambda i: abs(force[i]))
    if size == 0.0 or abs(force[axis]) < STEEP * size:
        return None
    return axis, 1 if force[axis] > 0.0 else -1


def fitted(forces: Floats, noise: Floats) -> tuple[Floats, Floats, Floats]:
    """Bias [m/s²], scale [-] and the deviations of the six.

    Args:
        forces: [m/s²] shape (n, 3), means of n rests on all sides.
        noise: [m/s²] shape (n, 3), 1σ of each.

    Raises:
        CalibrationError: the positions do not tell all six.
    """
    high, low = forces.max(axis=0), forces.min(axis=0)
    x: Floats = np.concatenate([(high + low) / 2.0, 2.0 * GRAVITY / (high - low)])
    for _ in range(ROUNDS):
        lacking, slope = _equations(x, forces, noise)
        if np.linalg.cond(slope) > 1e6:
            raise CalibrationError("accelerometer: its positions are too alike")
        step: Floats = np.linalg.lstsq(slope, lacking, rcond=None)[0].astype(np.float64)
        x = x + step
        if max(np.abs(step)) < STEP:
            break
    _, slope = _equations(x, forces, noise)
    return x[:3], x[3:], np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))


def _equations(x: Floats, forces: Floats, noise: Floats) -> tuple[Floats, Floats]:
    """What |s (f' - b)| lacks to g, in units of its deviation, shape (n,), and its slopes over bias
    and scale, shape (n, 6)."""
    bias, scale = x[:3], x[3:]
    true: Floats = scale * (forces - bias)
    size: Floats = np.sqrt(np.sum(true**2, axis=1))
    along: Floats = true / size[:, None]
    spread: Floats = np.sqrt(np.sum((along * scale * noise) ** 2, axis=1))
    weight: Floats = 1.0 / np.maximum(spread, 1e-9)
    slope: Floats = np.hstack([-along * scale, along * (forces - bias)])
    return (GRAVITY - size) * weight, slope * weight[:, None]


def _text(values: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
