"""The accelerometer in six positions: bias and scale of each axis.

At rest the specific force has the magnitude of gravity, whatever the position (Frosio, Pedersini
and Borghese 2009, *Autocalibration of MEMS accelerometers*, IEEE Trans. Instrum. Meas. 58(6)): so
no position has to be exact. With each axis once up and once down, bias b and scale s of

    |s (f' - b)| = g

follow by least squares (Gauss-Newton) over the means of the rests.
"""

from math import hypot

import numpy as np

from messages.message import Message
from messages.sensors import ImuSample
from services.marine.vehicle import GRAVITY
from tools.calibrate.rests import RestMean, RestWatch
from tools.calibrate.results import CalibrationError, SensorFound, Setting
from tools.recordings.allan import Floats

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
        side = side_of(rest.force)
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
        return SensorFound(
            (
                Setting("accelerometer_bias", _three(bias), _three(std[:3]), "m/s²"),
                Setting("accelerometer_scale", _three(scale), _three(std[3:]), "-"),
            ),
            (
                "accelerometer: bias and scale only; axes that are not square to each other, or "
                "turned in the housing, are for [vehicle.mounting.imu]",
            ),
        )


def side_of(force: tuple[float, float, float]) -> Side | None:
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


def _three(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def _text(values: Floats) -> str:
    return ", ".join(f"{value:.3g}" for value in values)
