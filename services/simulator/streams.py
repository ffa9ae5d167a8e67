"""Random numbers of the simulator: every one comes from the seed, each use has a stream of its own,
so that what is added to one changes no other."""

from collections.abc import Iterator, Sequence
from math import exp, sqrt

import numpy as np

BLOCK = 1024  # samples whose noise is drawn at once, because a single draw is slow
# Never numbered anew: the same seed goes on giving the same dive.
BIASES, IMU_NOISE, FIELD_NOISE, PRESSURE_NOISE, DVL_NOISE, USBL_NOISE, GYRO_DRIFT = range(7)
CURRENT, VIBRATION, WAVES = 7, 8, 9
SHAKING_WAYS = 14
WATER_TEMPERATURES, ALTITUDE_NOISE, DVL_SCALE, TERRAIN = range(18, 22)


def white_noise(seed: int, stream: int, std: Sequence[float]) -> Iterator[list[float]]:
    """Endless samples of independent Gaussian noise, one number per standard deviation."""
    rng = np.random.default_rng([seed, stream])
    while True:
        yield from (rng.standard_normal((BLOCK, len(std))) * np.array(std)).tolist()


def wandering(
    seed: int, stream: int, std: float, hz: float, time_constant: float
) -> Iterator[list[float]]:
    """Endless samples of three independent first-order Gauss-Markov processes at `hz` [1/s], zero
    at first, with the standard deviation `std` in the long run and this correlation time [s]."""
    keep = exp(-1.0 / (hz * time_constant))
    p = q = r = 0.0
    for a, b, c in white_noise(seed, stream, [std * sqrt(1.0 - keep * keep)] * 3):
        p, q, r = keep * p + a, keep * q + b, keep * r + c
        yield [p, q, r]
