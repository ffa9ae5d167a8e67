"""The mean innovation: noise alone never condemns an accelerometer, a lasting difference does."""

import numpy as np
import pytest

from services.estimation.depth.accelerometer_trial import MOST_MEAN, SAMPLES, MeanInnovation
from services.estimation.depth.depth_filter import DepthSettings

CLIP = DepthSettings().clip  # [σ]
RATES = (5.0, 8.0, 20.0, 42.0, 100.0)  # [1/s]


def largest(innovations: np.ndarray, hz: float) -> float:
    """[σ] The largest magnitude of the running mean of these innovations [σ]."""
    mean = MeanInnovation()
    clipped = np.clip(innovations, -CLIP, CLIP)
    return max(mean.add(x, round(k * 1e9 / hz)) for k, x in enumerate(clipped.tolist()))


@pytest.mark.parametrize("hz", RATES)
def test_an_hour_of_noise_alone_is_no_doubt_at_any_sampling_rate(hz: float) -> None:
    noise = np.random.default_rng(1).standard_normal(round(3600.0 * hz))
    assert largest(noise, hz) < MOST_MEAN


@pytest.mark.parametrize("hz", RATES)
def test_a_lasting_difference_is_seen_within_a_second_or_one_memory_of_samples(hz: float) -> None:
    samples = round(max(hz, SAMPLES))
    assert largest(np.full(samples, 2.0), hz) > MOST_MEAN


def test_a_gap_between_samples_gives_the_next_one_no_more_weight() -> None:
    mean = MeanInnovation()
    mean.add(0.0, 0)
    assert mean.add(CLIP, 3_000_000_000) <= CLIP / SAMPLES * (1.0 + 1e-12)
