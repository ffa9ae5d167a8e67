"""Attitude, heading and gyroscope bias of many dives: `services/estimation/attitude/` in lanes, for
sensors that are as they should be. A lane whose gyroscope would be doubted is lost."""

from math import exp, pi
from typing import Any

import numpy as np

from services.estimation.attitude import attitude_observer as observer
from services.estimation.attitude import gyroscope
from services.estimation.attitude import tilt_spread as spreads
from services.estimation.attitude.attitude_filter import AttitudeSettings, turned_longer
from services.estimation.attitude.heading import YAW_RATE_CUTOFF, down_along, horizontal
from services.estimation.attitude_axes import AttitudeAxes
from services.marine.attitude import down_in_body, to_world
from services.marine.vehicle import GRAVITY
from tools.sweep.fast.lanes import Lanes, Lanes3, Mask, to_euler, unit, where, wrapped


class Attitudes:
    """Attitude, control heading and the spreads that weigh gyroscope and accelerometer."""

    def __init__(
        self, settings: AttitudeSettings, force: Lanes, rate: Lanes, field: Lanes | None, dt: float
    ) -> None:
        """
        Args:
            force, rate: (3, lanes) [m/s², rad/s] means of the calibration.
            field: (3, lanes) [T] likewise: the heading begins as its bearing; None: at zero.
            dt: [s] between two samples.
        """
        fx, fy, fz = force
        count = len(fx)
        self._settings, self._dt = settings, dt
        self.bias: Lanes3 = (rate[0], rate[1], rate[2])  # [rad/s]
        roll, pitch = np.arctan2(-fy, -fz), np.arctan2(fx, np.hypot(fy, fz))
        heading = np.zeros(count)
        if field is not None:
            north, east = horizontal(from_euler(roll, pitch, 0.0), field)
            heading = -np.arctan2(east, north)
        self.q = from_euler(roll, pitch, heading)
        self.roll, self.pitch, self._yaw = to_euler(self.q)
        self.heading: Lanes = heading
        self.yaw_rate = np.zeros(count)
        self.levelled: Any = (0.0, 0.0)
        self.lost = np.zeros(count, bool)
        self._rate: Lanes3 | None = None
        self._length = np.full(count, GRAVITY)
        # Covariance of tilt and bias (tilt_spread.py).
        self._tilt, self._both = np.full(count, observer.LEVELLED_STD**2), np.zeros(count)
        self._bias_variance = np.full(count, observer.CALIBRATED_BIAS**2)
        # Means of the gyroscope's check (gyroscope.py): over the longer and over the shorter time.
        self._slow, self._quick = np.zeros((4, count)), np.zeros((4, count))
        self._turn = np.zeros(count)

    def step(self, rate: Lanes3, force: Lanes3, noise: tuple[Lanes, Lanes], felt: Any) -> None:
        """One IMU sample [rad/s, m/s²], with the variances of its force and rate, and the
        acceleration that the thrust makes expect."""
        dt = self._dt
        (p, q, r), (bp, bq, br) = rate, self.bias
        turns = p - bp, q - bq, r - br
        before, self._rate = self._rate or turns, turns
        mean = tuple([0.5 * (a + b) for a, b in zip(before, turns, strict=True)])
        squared = p * p + q * q + r * r
        jump = sum((b - a) ** 2 for a, b in zip(before, turns, strict=True))
        self._predict(np.sqrt(squared), noise[1], (0.25 * dt) ** 2 * jump)
        # What the accelerometer is worth.
        fx, fy, fz = force
        expected = fx - felt[0], fy - felt[1], fz
        size = np.sqrt(fx * fx + fy * fy + fz * fz)
        self._length = self._length + min(1.0, dt / observer.LENGTH_MEMORY) * (size - self._length)
        expecting = observer.DOUBTFUL**2 * (felt[0] * felt[0] + felt[1] * felt[1])
        swing, off = observer.OFF_CENTRE * squared, self._length - GRAVITY
        spread = np.sqrt(observer.UNFELT**2 + expecting + off * off + swing * swing)
        variance = (2.0 * spreads.MEMORY * spread * spread / dt + noise[0]) / (GRAVITY * GRAVITY)
        most = observer.CLIP * np.sqrt((spread / GRAVITY) ** 2 + self._tilt)
        slack = observer.CLIP * (spread - observer.UNFELT + 0.3 * np.sqrt(noise[0])) / GRAVITY
        gain, bias_gain = self._correct(variance)
        (ex, ey, ez), (a, b, c) = self._level(mean, expected, gain, most), self.bias
        self.bias = a + bias_gain * ex, b + bias_gain * ey, c + bias_gain * ez
        self._check(force, size, turns[2], felt, slack)
        # Angles and control heading.
        self.roll, self.pitch, yaw = to_euler(self.q)
        self.heading = self.heading + wrapped(yaw - self._yaw)
        self._yaw = yaw
        share = 1.0 - exp(-2.0 * pi * YAW_RATE_CUTOFF * dt)
        self.yaw_rate = self.yaw_rate + share * (turns[2] - self.yaw_rate)

    def rested(self, bias: Lanes3, which: Mask) -> None:
        """The bias [rad/s] of these lanes has been measured at rest."""
        pairs = zip(bias, self.bias, strict=True)
        p, q, r = (where(which, new, old) for new, old in pairs)
        self.bias = p, q, r
        self._both = where(which, 0.0, self._both)
        self._bias_variance = where(which, observer.CALIBRATED_BIAS**2, self._bias_variance)

    def axes(self, force: Lanes3, noise: Lanes) -> AttitudeAxes:
        """As of the observer, with lanes in it."""
        q, f = self.q, force
        std: Any = np.sqrt(self._tilt + self._settings.tilt_std**2)
        return AttitudeAxes(
            forward=to_world(q, observer.FORWARD),
            starboard=to_world(q, observer.STARBOARD),
            acceleration=down_along(q, f) + GRAVITY,
            force=horizontal(q, f),
            levelled=self.levelled,
            tilt_std=std,
            noise=noise,
        )

    def _predict(self, turning: Lanes, noise: Lanes, unseen: Lanes) -> None:
        dt, missed = self._dt, spreads.MISSED * turning
        grown = self._tilt + dt * (dt * self._bias_variance - 2.0 * self._both)
        more = unseen + (spreads.TILT_NOISE + missed * missed + noise * dt) * dt
        self._tilt = np.minimum(spreads.MOST, grown + more)
        self._both = self._both - dt * self._bias_variance
        self._bias_variance = self._bias_variance + spreads.BIAS_WALK * dt

    def _correct(self, variance: Lanes) -> tuple[Lanes, Lanes]:
        total = self._tilt + variance
        share, of_bias = self._tilt / total, self._both / total
        self._bias_variance = self._bias_variance - of_bias * self._both
        self._both = self._both - share * self._both
        self._tilt = self._tilt - share * self._tilt
        return share, of_bias

    def _level(self, rate: Any, force: Lanes3, share: Lanes, most: Lanes) -> Lanes3:
        """Turn, and tilt towards the accelerometer (attitude_filter.py)."""
        self.q = unit(*turned_longer(self.q, rate, self._dt))
        fx, fy, fz = force
        size = np.sqrt(fx * fx + fy * fy + fz * fz)
        x, y, z = down_in_body(self.q)
        ex, ey, ez = (fz * y - fy * z) / size, (fx * z - fz * x) / size, (fy * x - fx * y) / size
        off = np.sqrt(ex * ex + ey * ey + ez * ez)
        angle = np.arctan2(off, -(fx * x + fy * y + fz * z) / size)
        scale = np.minimum(angle, most) / where(off > 0.0, off, 1.0)
        ex, ey, ez = scale * ex, scale * ey, scale * ez
        (a, b, c, d), self.q = self.q, unit(*turned_longer(self.q, (ex, ey, ez), share))
        w, x, y, z = self.q
        north, east = x * a - w * b + z * c - y * d, y * a - w * c + x * d - z * b
        self.levelled = 2.0 * north, 2.0 * east
        return ex, ey, ez

    def _check(self, force: Lanes3, size: Lanes, turn: Lanes, felt: Any, slack: Lanes) -> None:
        """A lane is lost where the gyroscope would be doubted (gyroscope.py)."""
        fx, fy, fz = force
        x, y, z = down_in_body(self.q)
        off = (fz * y - fy * z) / size, (fx * z - fz * x) / size
        seen = np.empty_like(self._slow)
        seen[0], seen[1], seen[2], seen[3] = *off, -felt[1] / GRAVITY, felt[0] / GRAVITY
        share = self._dt / gyroscope.MEMORY
        self._slow += share * (seen - self._slow)
        self._turn = self._turn + share * (turn - self._turn)
        self._quick += min(gyroscope.MOST_SHARE, self._dt / gyroscope.QUICK_MEMORY) * (
            seen - self._quick
        )
        allowed = slack + 2.0 * np.sqrt(self._tilt)
        most = (
            gyroscope.MOST
            + np.minimum(gyroscope.MOST_TURNING, gyroscope.TURNING * np.abs(self._turn))
            + allowed
        )
        self.lost |= ~(unexplained(*self._slow) <= most)
        self.lost |= ~(unexplained(*self._quick) <= gyroscope.QUICK_MOST + allowed)


class RestingBiases:
    """The gyroscope's bias, measured at rest (gyroscope.py)."""

    def __init__(self, count: int, still_time: float, largest: float) -> None:
        self._largest = largest
        self._known_for = np.full(count, still_time)  # [s]
        self._still_for = np.full(count, gyroscope.REST_TIME)  # [s]
        self._waiting, self._waits = np.zeros((3, count)), np.zeros(count, bool)
        self._forget()

    def _forget(self) -> None:
        self._samples, self._seconds = list[Lanes](), 0.0

    def imu(
        self, rate: Lanes3, force: Lanes3, dt: float, bias: Lanes3
    ) -> tuple[Lanes, Mask] | None:
        """One sample, bias included. The new bias (3, lanes) [rad/s], and which lanes have it."""
        self._seconds += dt
        self._samples.append(np.array((*rate, *force)))
        if len(self._samples) < gyroscope.BLOCK:
            return None
        block, seconds = np.array(self._samples), self._seconds
        self._forget()
        mean = block.mean(axis=0)
        std = np.sqrt(np.maximum(0.0, (block * block).mean(axis=0) - mean * mean))
        rates, now = mean[:3], np.array(bias)
        still = np.max(std[:3], axis=0) <= gyroscope.REST_RATE_STD
        still &= np.max(std[3:], axis=0) <= gyroscope.REST_FORCE_STD
        still &= np.max(np.abs(rates - now), axis=0) <= gyroscope.REST_CHANGE
        still &= np.max(np.abs(rates), axis=0) <= self._largest
        self._still_for = where(still, self._still_for + seconds, 0.0)
        long = still & (self._still_for >= gyroscope.REST_TIME)
        learns = long & self._waits
        known = np.minimum(gyroscope.REST_MEMORY, self._known_for + seconds)
        self._known_for = where(learns, known, self._known_for)
        learnt = now + seconds / self._known_for * (self._waiting - now)
        self._waiting = where(long, rates, self._waiting)
        self._waits = (self._waits & still) | long
        return learnt, learns


def from_euler(roll: Lanes, pitch: Lanes, heading: Any) -> tuple[Lanes, Lanes, Lanes, Lanes]:
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    ch, sh = np.cos(heading / 2), np.sin(heading / 2)
    return (
        cr * cp * ch + sr * sp * sh,
        sr * cp * ch - cr * sp * sh,
        cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    )


def unexplained(x: Lanes, y: Lanes, felt_x: Lanes, felt_y: Lanes) -> Lanes:
    size = felt_x * felt_x + felt_y * felt_y
    share = (x * felt_x + y * felt_y) / where(size > 0.0, size, 1.0)
    share = np.clip(share, 0.0, gyroscope.EXPLAINED)
    return np.hypot(x - share * felt_x, y - share * felt_y)
