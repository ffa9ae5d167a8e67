"""The compass turned through all headings: hard iron and soft iron of the horizontal field.

The vehicle's own iron turns with it: it shifts the circle that the horizontal field draws (hard
iron) and makes it an ellipse (soft iron). Each sample is turned back by its tilt against the mean
tilt, which the accelerometer tells, because a tilt of 1° at a dip of 70° is 1 µT.

What turning about the vertical cannot tell: the vertical part of the iron, and a soft iron that
turns the whole field alike, which is a constant error of heading.

The ellipse is by least squares (Gauss-Newton) on the distance in units of the radius,
|A (p - c)| = 1 with a symmetric A (Gander, Golub and Strebel 1994, *Least-squares fitting of
circles and ellipses*, BIT 34(4), for the choice of a geometric distance).
"""

from math import degrees, hypot, pi
from typing import NamedTuple

import numpy as np

from messages.message import Message
from messages.sensors import ImuSample, MagnetometerSample
from messages.units import Vec3
from services.marine.mounting import ALONG, Mounting
from services.vehicle.mounting import MountedAxes
from tools.calibrate.guide import CalibrationError, SensorFound, Setting
from tools.calibrate.noise import Floats

BIN = 0.25  # [s] of samples averaged to one point
SECTORS = 24  # of 15° each; all are needed
TURN = 1.8 * pi  # [rad] by the gyroscope; a bias may hide the rest
FASTEST = 0.8  # [rad/s] faster turns smear a point over more than 11°
MOST_TILT = 0.35  # [rad] from the mean; the mean of the accelerometer is then no tilt
LEAST_FIELD = 3.0  # [µT] of horizontal field: at the magnetic poles there is no compass
ROUGH = 0.06  # [-] rms over the radius: the field changed meanwhile
OBLONG = 2.0  # [-] length over width of the ellipse


class Ellipse(NamedTuple):
    """Maps its points p to a circle: |shape (p - centre)| = radius."""

    centre: Floats  # shape (2,), unit of the points
    shape: Floats  # shape (2, 2), symmetric, determinant 1
    radius: float
    rms: float  # of the distance, in the unit of the points
    centre_covariance: Floats  # shape (2, 2)
    shape_std: float  # [-] largest of the entries'


def through(points: Floats) -> Ellipse:
    """
    Args:
        points: shape (n, 2), at least six.

    Raises:
        ValueError: no ellipse goes through them.
    """
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    size = float(np.ptp(points, axis=0).max()) / 2.0
    if size <= 0.0:
        raise ValueError("all points are one")
    p = (points - middle) / size  # of the order of one, so that a step is small or not
    x: Floats = np.array([0.0, 0.0, 1.0, 0.0, 1.0])  # centre, then A's 11, 12 and 22
    for _ in range(ROUNDS):
        residual, slope = _distance(p, x)
        if np.linalg.cond(slope) > 1e8:
            raise ValueError("they are on no ellipse")
        step: Floats = np.linalg.lstsq(slope, -residual, rcond=None)[0].astype(np.float64)
        x = x + step
        if max(np.abs(step)) < STEP:
            break
    residual, slope = _distance(p, x)
    a, b, c = x[2:].tolist()
    if not np.all(np.isfinite(x)) or a <= 0.0 or a * c - b * b <= 0.0:
        raise ValueError("they are on no ellipse")
    inverse: Floats = np.linalg.inv(slope.T @ slope).astype(np.float64)
    covariance = _variance(residual) * inverse
    round_ = (a * c - b * b) ** -0.5
    turn = np.array([_unit(x[2:] + 1e-6 * e) - _unit(x[2:] - 1e-6 * e) for e in np.eye(3)]) / 2e-6
    stds = np.sqrt(np.diag(turn.T @ covariance[2:, 2:] @ turn))
    return Ellipse(
        centre=middle + size * x[:2],
        shape=np.array([[a, b], [b, c]]) * round_,
        radius=size * round_,
        rms=size * round_ * float(np.sqrt(np.mean(residual**2))),
        centre_covariance=size * size * covariance[:2, :2],
        shape_std=float(max(stds)),
    )


def _distance(p: Floats, x: Floats) -> tuple[Floats, Floats]:
    """|A (p - c)| - 1, shape (n,), and its slopes, shape (n, 5)."""
    a, b, c = x[2:].tolist()
    off, A = p - x[:2], np.array([[a, b], [b, c]])
    y = off @ A
    far = np.linalg.norm(y, axis=1)
    n = y / far[:, None]
    slope = np.column_stack(
        [
            -n @ A,
            n[:, 0] * off[:, 0],
            n[:, 0] * off[:, 1] + n[:, 1] * off[:, 0],
            n[:, 1] * off[:, 1],
        ]
    )
    return far - 1.0, slope


def _unit(entries: Floats) -> Floats:
    """The three entries with determinant 1."""
    a, b, c = entries.tolist()
    return entries / (a * c - b * b) ** 0.5


def _variance(residual: Floats) -> float:
    """Of one residual; more where neighbours are alike, because then there are fewer."""
    spare = len(residual) - 5
    variance = float(residual @ residual) / max(1, spare)
    alike = float(residual[1:] @ residual[:-1]) / float(residual @ residual)
    alike = min(MOST_ALIKE, max(0.0, alike))
    return variance * (1.0 + alike) / (1.0 - alike)


class CompassGuide:
    """Waits until the vehicle has been turned through all headings."""

    def __init__(self, mounting: Mounting) -> None:
        self._imu = MountedAxes(mounting.imu)
        self._field = MountedAxes(mounting.magnetometer)
        self._forces: list[Vec3] = []
        self._fields: list[Vec3] = []
        self._rates: list[Vec3] = []
        self._begin_ns: int | None = None
        self._points: list[tuple[Floats, Floats]] = []  # field [µT] and down, body axes
        self._turned = 0.0  # [rad]
        self._fast = False

    def see(self, sample: Message) -> None:
        if isinstance(sample, MagnetometerSample):
            x, y, z = self._field.to_body(sample.field)
            self._fields.append((1e6 * x, 1e6 * y, 1e6 * z))
        elif isinstance(sample, ImuSample):
            self._forces.append(self._imu.to_body(sample.specific_force))
            self._rates.append(self._imu.to_body(sample.angular_rate))
            if self._begin_ns is None:
                self._begin_ns = sample.stamp_ns
            elif (seconds := (sample.stamp_ns - self._begin_ns) * 1e-9) >= BIN:
                self._close(min(seconds, 2.0 * BIN))
                self._begin_ns = sample.stamp_ns

    def _close(self, seconds: float) -> None:
        """One point of the samples since the last."""
        force, rate = np.mean(self._forces, axis=0), np.mean(self._rates, axis=0)
        size = float(np.linalg.norm(force))
        self._fast = hypot(*rate) > FASTEST
        if self._fields and size > 0.0:
            down = -force / size
            self._turned += float(rate @ down) * seconds
            if not self._fast:
                self._points.append((np.mean(self._fields, axis=0), down))
        self._forces, self._rates, self._fields = [], [], []

    @property
    def done(self) -> bool:
        return abs(self._turned) >= TURN and self._covered() == SECTORS

    @property
    def prompt(self) -> str:
        pace = ", more slowly" if self._fast else ""
        return (
            f"turn the vehicle on the spot through all headings, level and away from iron{pace}: "
            f"{self._covered()} of {SECTORS} directions, {degrees(abs(self._turned)):.0f} deg"
        )

    def _level(self) -> tuple[Floats, Floats, Floats]:
        """The points in the level plane [µT], shape (n, 2), that plane's axes in the body, shape
        (2, 3), and down."""
        downs = np.array([down for _, down in self._points])
        down = downs.mean(axis=0)
        down /= np.linalg.norm(down)
        kept = np.flatnonzero(downs @ down > np.cos(MOST_TILT)).tolist()
        fields = [_turned_onto(downs[i], down) @ self._points[i][0] for i in kept]
        first = np.cross(down, np.eye(3)[int(np.argmin(np.abs(down)))])
        first /= np.linalg.norm(first)
        axes = np.array([first, np.cross(down, first)])
        return np.array(fields).reshape(-1, 3) @ axes.T, axes, down

    def _covered(self) -> int:
        """Sectors, seen from the middle of the points, in which there is one."""
        if len(self._points) < SECTORS:
            return 0
        points, _, _ = self._level()
        if len(points) < SECTORS or float(np.ptp(points, axis=0).min()) < LEAST_FIELD:
            return 0  # around the middle of a heap of noise, there are points everywhere
        off = points - (points.max(axis=0) + points.min(axis=0)) / 2.0
        angle = np.arctan2(off[:, 1], off[:, 0])
        return len(np.unique(np.floor((angle + pi) / (2.0 * pi) * SECTORS) % SECTORS))

    def result(self) -> SensorFound:
        """
        Raises:
            CalibrationError: not turned through all headings, or not round enough to be believed.
        """
        covered = self._covered()
        if covered < SECTORS or abs(self._turned) < TURN:
            raise CalibrationError(
                f"compass: {covered} of {SECTORS} directions and a turn of "
                f"{degrees(abs(self._turned)):.0f} deg in all, needed are all and "
                f"{degrees(TURN):.0f} deg; turn the vehicle on the spot, slowly, once or twice"
            )
        points, axes, down = self._level()
        try:
            found = through(points)
        except ValueError as error:
            raise CalibrationError(f"compass: the points cannot be used, {error}") from None
        _check(found)
        return self._settings(found, axes, down)

    def _settings(self, found: Ellipse, axes: Floats, down: Floats) -> SensorFound:
        """In the magnetometer's own axes."""
        columns = [self._field.to_sensor(unit) for unit in ALONG]
        R = np.array(columns).T  # R_SB
        plane = R @ axes.T  # shape (3, 2)
        upright = R @ down
        bias = 1e-6 * plane @ found.centre
        stds = 1e-6 * np.sqrt(np.diag(plane @ found.centre_covariance @ plane.T))
        matrix = plane @ found.shape @ plane.T + np.outer(upright, upright)
        rows = tuple(tuple(row) for row in matrix.tolist())
        worst, bias = found.shape_std, tuple(bias.tolist())
        return SensorFound(
            (
                Setting("magnetometer_bias", bias, tuple(stds.tolist()), "T", "horizontal"),
                Setting("magnetometer_matrix", rows, (), "-", f"± {worst:.2g} at most"),
            ),
            (
                f"compass: horizontal field {found.radius:.2f} µT, rest {found.rms:.2f} µT rms; "
                f"the vertical part of the iron and a constant error of heading are not seen",
            ),
        )


def _check(found: Ellipse) -> None:
    """
    Raises:
        CalibrationError: this is not the Earth's field and some iron.
    """
    short, long_ = np.linalg.eigvalsh(found.shape).tolist()
    if long_ / short > OBLONG:
        raise CalibrationError(
            f"compass: the field's ellipse is {long_ / short:.1f} times as long as wide, allowed "
            f"is {OBLONG:g}; move the magnetometer away from iron and from the thrusters"
        )
    if found.rms > ROUGH * found.radius:
        raise CalibrationError(
            f"compass: the field is off its ellipse by {found.rms:.1f} µT of {found.radius:.1f}; "
            f"iron or a current was near, or the vehicle did not stay level; turn it again"
        )


def _turned_onto(one: Floats, other: Floats) -> Floats:
    """The smallest rotation that takes the first unit vector to the second, less than 90° away."""
    v, c = np.cross(one, other), float(one @ other)
    x, y, z = v.tolist()
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + K + K @ K / (1.0 + c)


ROUNDS = 50
STEP = 1e-12  # [-] smaller steps, in units of the radius, end the iteration
MOST_ALIKE = 0.9  # [-] correlation from one residual to the next that is believed
