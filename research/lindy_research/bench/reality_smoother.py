"""Attitude and depth of a dive on record, from all of its samples, those to come as well.

This is no ground truth, which nobody has measured: it is a reference from the same sensors as the
estimator's, and shares their errors. A turn of the IMU in the hull, a wrong scale and a bias of the
accelerometer are in both. What it has besides is the future: an acceleration that lasts shorter
than the window of `TILT_S` averages out on both sides of a sample, where a filter can only guess
that it will. Two estimates that differ by less than what that leaves, some tenths of a degree and
millimetres of depth, cannot be told apart by it.

Tilt: the angular rate, integrated, turns each sample into one frame; there the mean of the specific
force over the window points up, and the frame is corrected by it; done `ROUNDS` times. Heading is
whatever comes of it. What these corrections add up to over the whole dive is the bias of the
gyroscope, which is taken out; done `BIAS_ROUNDS` times, each of which leaves 0.4 of it at worst.
(With the bias left in, a vehicle that turns about its vertical swings the reference: by 2 to 3 deg
where the bias was 0.06 rad/s.) Depth: a Kalman filter over depth, rate and the bias of the
acceleration along down, and back (Rauch, Tung and Striebel 1965).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lindy.api.messages import ImuSample, PressureSample, Vec3
from lindy.api.vehicle import ATMOSPHERE, GRAVITY

Floats = NDArray[np.float64]
FIRST_TILT_S, TILT_S = 2.0, 4.0  # [s] 1σ of the window, in the first round and in the others
ROUNDS, BIAS_ROUNDS = 4, 5
# [-] of the largest singular value: what the dive says less of is not taken for a bias, such as
# that about the vertical of a vehicle that stays level.
SEEN = 0.05
GRID_S = 0.02  # [s]
REST_SAMPLES = 20  # mean of the first ones: the attitude to begin with
LONGEST_STEP = 0.5  # [s] no integration over more of a gap
PRESSURE_STD = 0.006  # [m] of one sample
CLIPPED = 5.0  # [σ] of an innovation
ACCELERATION_NOISE = 0.08  # [m/s²/√Hz]
BIAS_WALK = 0.03  # [m/s²/√s]


class Smoothed(NamedTuple):
    """One entry for each IMU sample."""

    t: Floats  # [s] since the first
    first_ns: int  # [ns] of the first
    roll: Floats  # [rad]
    pitch: Floats  # [rad]
    depth: Floats  # [m] of the origin, less an unknown constant
    depth_rate: Floats  # [m/s]

    def at(self, name: str, stamps_ns: Sequence[int]) -> Floats:
        """One of them at these times [ns]; angles accumulate past ±π."""
        t = (np.array(stamps_ns) - self.first_ns) * 1e-9
        values: Floats = getattr(self, name)
        return np.interp(t, self.t, np.unwrap(values) if name == "roll" else values)


def rotations(vectors: Floats) -> Floats:
    """Rotation matrices [-] n × 3 × 3 of rotation vectors [rad] n × 3 (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=1)
    half = np.zeros((len(vectors), 3, 3))
    half[:, 2, 1], half[:, 0, 2], half[:, 1, 0] = vectors.T
    K = half - half.transpose(0, 2, 1)
    # sin(a) / a and (1 − cos(a)) / a², also at 0.
    once, twice = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.eye(3) + once[:, None, None] * K + twice[:, None, None] * (K @ K)


def smoothed(
    imu: Sequence[ImuSample],
    pressures: Sequence[PressureSample],
    arm: Vec3,
    latency: float,
    density: float,
) -> Smoothed:
    """
    Args:
        imu: at least REST_SAMPLES, with stamps that increase; at the origin, along the body's axes.
        pressures: at least one within their time.
        arm, latency: [m] FRD of the pressure sensor, [s] by which its stamps are late.
        density: [kg/m³]
    """
    stamps = np.array([m.stamp_ns for m in imu])
    t: Floats = (stamps - stamps[0]) * 1e-9
    force = np.array([m.specific_force for m in imu])
    R = _attitudes(t, force, np.array([m.angular_rate for m in imu]))
    down = np.einsum("nij,nj->ni", R, force)[:, 2] + GRAVITY
    at = np.array([m.stamp_ns - stamps[0] for m in pressures]) * 1e-9 - latency
    said = np.array([m.pressure - ATMOSPHERE for m in pressures]) / (density * GRAVITY)
    said -= np.interp(at, t, (R @ np.array(arm))[:, 2])
    within = (at >= 0.0) & (at <= t[-1])
    depth, rate = _depths(t, down, at[within], said[within])
    return Smoothed(
        t=t,
        first_ns=int(stamps[0]),
        roll=np.arctan2(R[:, 2, 1], R[:, 2, 2]),
        pitch=np.arcsin(np.clip(-R[:, 2, 0], -1.0, 1.0)),
        depth=depth,
        depth_rate=rate,
    )


def _attitudes(t: Floats, force: Floats, rate: Floats) -> Floats:
    """R_NB n × 3 × 3, of an unknown heading."""
    attitude, bias = _levelled(t, force, rate), np.zeros(3)
    for _ in range(BIAS_ROUNDS):
        bias += _bias(t, rate - bias, attitude)
        attitude = _levelled(t, force, rate - bias)
    return attitude


def _levelled(t: Floats, force: Floats, rate: Floats) -> Floats:
    """R_NB n × 3 × 3 by an angular rate without bias."""
    attitude = np.empty((len(t), 3, 3))
    attitude[0] = _level(-force[:REST_SAMPLES].mean(axis=0))
    for k, turn in enumerate(_turns(t, rate)):
        attitude[k + 1] = attitude[k] @ turn
    for n in range(ROUNDS):
        up = _windowed(t, np.einsum("nij,nj->ni", attitude, force), TILT_S if n else FIRST_TILT_S)
        down = -up / np.linalg.norm(up, axis=1, keepdims=True)
        # The turn from what is taken for down to down.
        axis = np.cross(down, (0.0, 0.0, 1.0))
        size = np.linalg.norm(axis, axis=1)
        angle = np.arctan2(size, down[:, 2]) / np.maximum(size, 1e-12)
        attitude = rotations(axis * angle[:, None]) @ attitude
    return attitude


def _turns(t: Floats, rate: Floats) -> Floats:
    """From each sample to the next, (n - 1) × 3 × 3."""
    dt = np.minimum(LONGEST_STEP, np.diff(t))
    return rotations(0.5 * (rate[1:] + rate[:-1]) * dt[:, None])


def _bias(t: Floats, rate: Floats, attitude: Floats) -> Floats:
    """[rad/s] Of the rate, by least squares: a bias tilts the frame by −∫ R b dt, and `attitude`
    differs by that from the rate's integral."""
    kept = attitude[:-1]
    missed = _turns(t, rate).transpose(0, 2, 1) @ kept.transpose(0, 2, 1) @ attitude[1:]
    half = 0.5 * (missed - missed.transpose(0, 2, 1))
    turned = np.stack([half[:, 2, 1], half[:, 0, 2], half[:, 1, 0]], axis=1)
    tilts: Floats = np.cumsum(np.einsum("nij,nj->ni", kept, turned)[:, :2], axis=0)
    by_bias: Floats = -np.cumsum(kept[:, :2] * np.diff(t)[:, None, None], axis=0)
    tilts -= tilts.mean(axis=0)  # where it began
    by_bias -= by_bias.mean(axis=0)
    found = np.linalg.lstsq(by_bias.reshape(-1, 3), tilts.reshape(-1), rcond=SEEN)[0]
    return np.asarray(found, dtype=np.float64)


def _level(down: Floats) -> Floats:
    """R_NB whose down in body axes is this, and whose forward is as far ahead as it can be."""
    z = down / np.linalg.norm(down)
    ahead = (1.0, 0.0, 0.0) if abs(z[0]) < 0.9 else (0.0, 0.0, -1.0)
    y = np.cross(z, ahead)
    y /= np.linalg.norm(y)
    return np.array([np.cross(y, z), y, z])


def _windowed(t: Floats, values: Floats, std: float) -> Floats:
    """Mean of values n × 3 in a Gaussian window of 1σ `std` [s] about each time."""
    grid = np.arange(t[0], t[-1] + GRID_S, GRID_S)
    reach = int(4.0 * std / GRID_S)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) * GRID_S / std) ** 2)

    def summed(row: Floats) -> Floats:
        return np.convolve(row, window)[reach : reach + len(grid)]

    weight = summed(np.ones(len(grid)))
    columns = [summed(np.interp(grid, t, values[:, k])) / weight for k in range(values.shape[1])]
    return np.stack([np.interp(t, grid, column) for column in columns], axis=1)


def _depths(t: Floats, down: Floats, at: Floats, said: Floats) -> tuple[Floats, Floats]:
    """Depth [m] and its rate [m/s] from acceleration `down` [m/s²] and depths `said` [m] `at`
    [s]."""
    measured: dict[int, list[float]] = {}
    for index, value in zip(np.searchsorted(t, at).tolist(), said.tolist(), strict=True):
        measured.setdefault(index, []).append(value)
    n = len(t)
    x, p = np.array([said[0], 0.0, 0.0]), np.diag([0.01, 0.1, 0.1])
    X, after, before, p_before, F = (
        np.empty((n, *s)) for s in ((3,), (3, 3), (3,), (3, 3), (3, 3))
    )
    variance = PRESSURE_STD**2
    for k in range(n):
        dt = min(LONGEST_STEP, t[k] - t[k - 1]) if k else 0.0
        mean = 0.5 * (down[k] + down[k - 1]) if k else down[0]
        F[k] = [[1.0, dt, -dt * dt / 2.0], [0.0, 1.0, -dt], [0.0, 0.0, 1.0]]
        x = F[k] @ x + np.array([0.5 * dt * dt * mean, dt * mean, 0.0])
        noise = np.diag([0.0, ACCELERATION_NOISE**2 * dt, BIAS_WALK**2 * dt])
        p = F[k] @ p @ F[k].T + noise
        before[k], p_before[k] = x, p
        for value in measured.get(k, ()):
            S = p[0, 0] + variance
            most = CLIPPED * np.sqrt(S)
            gain = p[:, 0] / S
            x = x + gain * np.clip(value - x[0], -most, most)
            p = p - np.outer(gain, p[0])
        X[k], after[k] = x, p
    back = after[:-1] @ F[1:].transpose(0, 2, 1) @ np.linalg.inv(p_before[1:])
    for k in range(n - 2, -1, -1):
        X[k] += back[k] @ (X[k + 1] - before[k + 1])
    return X[:, 0], X[:, 1]
