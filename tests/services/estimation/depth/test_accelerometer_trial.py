"""The mean innovation: noise alone never condemns an accelerometer, a lasting difference does."""

import numpy as np
import pytest

from services.estimation.aiding import SAMPLES, Aiding
from services.estimation.depth.depth_filter import CLIP
from services.estimation.depth.trial import MOST_MEAN

RATES = (5.0, 8.0, 20.0, 42.0, 100.0)  # [1/s]


def largest(innovations: np.ndarray, hz: float) -> float:
    """[σ] The largest magnitude of the running mean of these innovations [σ]."""
    aiding, found = Aiding("pressure", "m"), 0.0
    clipped = np.clip(innovations, -CLIP, CLIP)
    for k, (x, used) in enumerate(zip(innovations.tolist(), clipped.tolist(), strict=True)):
        aiding.compare(round(k * 1e9 / hz), 0.0, x, 1.0, 0.0, used)
        found = max(found, abs(aiding.mean))
    return found


@pytest.mark.parametrize("hz", RATES)
def test_an_hour_of_noise_alone_is_no_doubt_at_any_sampling_rate(hz: float) -> None:
    noise = np.random.default_rng(1).standard_normal(round(3600.0 * hz))
    assert largest(noise, hz) < MOST_MEAN


@pytest.mark.parametrize("hz", RATES)
def test_a_lasting_difference_is_seen_within_a_second_or_one_memory_of_samples(hz: float) -> None:
    samples = round(max(hz, SAMPLES))
    assert largest(np.full(samples, 2.0), hz) > MOST_MEAN


def test_a_gap_between_samples_gives_the_next_one_no_more_weight() -> None:
    aiding = Aiding("pressure", "m")
    aiding.compare(0, 0.0, 0.0, 1.0, 0.0)
    aiding.compare(3_000_000_000, 0.0, CLIP, 1.0, 0.0)
    assert aiding.mean <= CLIP / SAMPLES * (1.0 + 1e-12)
