"""The table [simulator.vibration]: running thrusters shake the IMU.

Each thruster shakes at the rate of its shaft (a propeller out of balance), at that of its blades
(each passes arms and hull) and without any rate (the flow), a third of the power each, by a force
in proportion to its thrust, which goes with the square of its speed. A thruster's speed wanders,
so a tone has a width: it forgets its phase and strength within `MEMORY` periods. One whose thrust
changes knocks besides, in proportion to how fast, without any rate. Each tone reaches each axis by
a share of its own, drawn by the seed: hull and frame conduct as they like.

An IMU's samples fold a tone into the rates below half its own.

The defaults are those of a BlueROV of 2014 with six T200 in pool dives on record (Linköping, 2016),
thrusters reversing at 40 % of their limits: its accelerometer is shaken by 0.7 m/s² per axis while
they run and by 2.5 m/s² 30 to 60 ms after some were told to reverse. Over blocks of 0.42 s its
noisiest axis has a median of 1.3 to 1.6 m/s² and a 99th percentile of 2.2 to 3.8, the gyroscope's
0.05 to 0.06 and 0.08 to 0.1 rad/s.
"""

from collections.abc import Sequence
from math import cos, exp, hypot, pi, sin, sqrt
from typing import Annotated

import msgspec
import numpy as np

from messages.units import Vec3
from services.marine.summation import plain_sum
from services.marine.vehicle import Thruster
from services.simulator.streams import SHAKING_WAYS, VIBRATION, white_noise

MEMORY = 3.0  # [periods]
TONES = 3  # shaft, blades, flow
TONES_ROOT = sqrt(TONES)  # [-] the flow has a third of the power, a knock all of its own


class Vibration(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Strengths are those with every thruster at its limit, on average over the axes."""

    force: Annotated[float, msgspec.Meta(ge=0.0, le=50.0)] = 1.8  # [m/s²] 1σ per axis and sample
    rate: Annotated[float, msgspec.Meta(ge=0.0, le=5.0)] = 0.05  # [rad/s] 1σ per axis and sample
    # [s] One that changes by its whole limit within this time knocks as it shakes at its limit.
    knock: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 0.1
    speed: Annotated[float, msgspec.Meta(ge=1.0, le=500.0)] = 58.0  # [turns/s] at the limit
    blades: Annotated[int, msgspec.Meta(ge=1, le=12)] = 3


class Shaking:
    """What vibration adds to the samples of an IMU."""

    def __init__(
        self,
        settings: Vibration,
        thrusters: Sequence[Thruster],
        seed: int,
    ) -> None:
        """
        Args:
            seed: [-] 0 or more.
        """
        self._limits = [thruster.limits for thruster in thrusters]  # [N]
        self._speed, self._orders = settings.speed, (1.0, float(settings.blades))
        count = len(thrusters) * TONES
        ways = np.random.default_rng([seed, SHAKING_WAYS]).standard_normal((6, count)).tolist()
        strengths = [settings.force] * 3 + [settings.rate] * 3
        # Independent tones add up by their squares.
        sizes = [sqrt(plain_sum(x * x for x in axis)) for axis in ways]
        scales = [strength / size for strength, size in zip(strengths, sizes, strict=True)]
        self._ways = [
            [x * y for x, y in zip(way, scales, strict=True)] for way in zip(*ways, strict=True)
        ]
        self._noise = white_noise(seed, VIBRATION, [1.0] * (2 * count))
        self._knock = settings.knock
        self._shares = [0.0] * len(thrusters)  # [-] of the limits at the newest sample
        self._turned = [0.0] * len(thrusters)  # [turns]
        self._tones = [(0.0, 0.0)] * count  # in step and a quarter behind; 1σ 1

    def step(self, thrust: Sequence[float], dt: float) -> tuple[Vec3, Vec3]:
        """[m/s², rad/s] in the sensor's axes, at a sample `dt` [s] after the one before, with this
        thrust [N] of each thruster."""
        noise = iter(next(self._noise))
        a = b = c = p = q = r = 0.0
        for i, (newtons, (reverse, forward)) in enumerate(zip(thrust, self._limits, strict=True)):
            share = newtons / (forward if newtons >= 0.0 else -reverse)
            knock = self._knock * abs(share - self._shares[i]) / dt if dt > 0.0 else 0.0
            self._shares[i], share = share, abs(share)
            turns = self._speed * sqrt(share) * dt
            turned = self._turned[i] = (self._turned[i] + turns) % 1.0
            for tone in range(TONES):
                n, here, there = i * TONES + tone, next(noise), next(noise)
                if tone < len(self._orders):
                    size = share * self._tone(n, self._orders[tone], turns, turned, here, there)
                else:
                    size = hypot(share, TONES_ROOT * knock) * here
                u, v, w, k, m, o = self._ways[n]
                a, b, c = a + size * u, b + size * v, c + size * w
                p, q, r = p + size * k, q + size * m, r + size * o
        return (a, b, c), (p, q, r)

    def _tone(
        self, n: int, order: float, turns: float, turned: float, here: float, there: float
    ) -> float:
        """[-] 1σ 1: tone number `n` after this many further `turns` of its shaft, with fresh noise
        for what it forgets."""
        keep = exp(-turns * order / MEMORY)
        fresh = sqrt(1.0 - keep * keep)
        along, across = self._tones[n]
        along, across = keep * along + fresh * here, keep * across + fresh * there
        self._tones[n] = along, across
        angle = 2.0 * pi * order * turned
        return along * cos(angle) - across * sin(angle)
