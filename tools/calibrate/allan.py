"""Allan deviation: separates white noise, bias instability and random walk of a sensor at rest.

Source: IEEE Std 952-1997, annex C: for white noise of density N, bias instability B and random walk
K the Allan variance over τ is N²/τ + (2 ln 2 / π) B² + K² τ / 3.
"""

from itertools import combinations
from math import log, log10, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FLAT = 2.0 * log(2.0) / pi  # [-] share of B² in the variance, where the curve is flat
LONGEST = 9.0  # parts: averages longer than a ninth of the recording are too uncertain
PER_DECADE = 10
SURE = 3.0  # [σ] of the white noise's scatter that slow drift must exceed


class AllanNoise(NamedTuple):
    """Noise of one axis, in the sensor's unit."""

    density: float  # [unit/√Hz] white noise
    instability: float | None  # [unit] None: not seen, the recording is too short for it
    walk: float | None  # [unit/√s] likewise
    drift_below: float  # [unit] slow drift is not larger than this over the longest average


def deviation(values: Floats, rate: float) -> tuple[Floats, Floats]:
    """Overlapping Allan deviation of evenly spaced samples.

    Args:
        values: shape (n,), n ≥ 20.
        rate: [1/s]

    Returns:
        Averaging times [s] and the deviation [unit] over each.
    """
    most = max(1, int(len(values) / LONGEST))
    steps = range(int(PER_DECADE * log10(most)) + 1)
    lengths = sorted({round(10.0 ** (k / PER_DECADE)) for k in steps})
    # Without the mean, so that the sum stays small and exact.
    total = np.concatenate(([0.0], np.cumsum(values - np.mean(values))))
    found = [_variance(total, length) for length in lengths]
    return np.array(lengths) / rate, np.sqrt(np.array(found))


def _variance(total: Floats, length: int) -> float:
    """Half the mean square difference of neighbouring means over `length` samples."""
    differences = total[2 * length :] - 2.0 * total[length:-length] + total[: -2 * length]
    return float(np.mean(differences**2)) / (2.0 * length**2)


def noise(values: Floats, rate: float) -> AllanNoise:
    """White noise, bias instability and random walk of a sensor at rest.

    Args:
        values: shape (n,), n ≥ 20, any unit.
        rate: [1/s]
    """
    tau, adev = deviation(values, rate)
    scatter = np.sqrt(2.0 * tau * rate / len(values))  # relative, of each variance
    drift_below = float(adev[-1]) / sqrt(FLAT)
    density = float(np.sqrt(np.average(adev**2 * tau, weights=scatter**-2 * (tau <= 1.0))))
    white = density**2 / tau[-1]
    if density == 0.0 or adev[-1] ** 2 <= white * (1.0 + SURE * scatter[-1]):
        return AllanNoise(density, None, None, drift_below)
    terms = np.column_stack([1.0 / tau, np.full_like(tau, FLAT), tau / 3.0])
    weights = 1.0 / (adev**2 * scatter)
    n2, b2, k2 = _not_negative(terms * weights[:, None], adev**2 * weights)
    return AllanNoise(sqrt(n2), sqrt(b2) or None, sqrt(k2) or None, drift_below)


def _not_negative(terms: Floats, right: Floats) -> list[float]:
    """Least squares with no negative coefficient, by trying every choice of terms."""
    best, least = [0.0] * terms.shape[1], float(right @ right)
    for size in range(1, terms.shape[1] + 1):
        for chosen in combinations(range(terms.shape[1]), size):
            found = np.linalg.lstsq(terms[:, chosen], right, rcond=None)[0]
            error = right - terms[:, chosen] @ found
            if np.all(found > 0.0) and float(error @ error) < least:
                least = float(error @ error)
                best = [0.0] * terms.shape[1]
                for place, value in zip(chosen, found.tolist(), strict=True):
                    best[place] = value
    return best
