"""A sensor is frozen when its noise makes the repetition all but impossible, and only then."""

from collections.abc import Iterator
from math import inf, isinf
from statistics import NormalDist

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.estimation.sensor_watch import IMPOSSIBLE, LEAST, FrozenWatch, in_a_row

HZ = 42.0  # [1/s]
LONGEST = 10.0  # [s]


def sensor(step: float, noise: float, seed: int, motion: float = 0.0) -> Iterator[float]:
    """[Pa] A vehicle that rests, or rises and sinks in turn by `motion` [Pa] per sample."""
    rng = np.random.default_rng(seed)
    truth = 1.2e5 + rng.uniform(0.0, step)
    for k in range(10**6):
        truth += motion * (k % 600 - 300 < 0) - motion * (k % 600 - 300 >= 0)
        value = truth + noise * rng.standard_normal()
        yield round(value / step) * step if step else value


def feed(watch: FrozenWatch, values: Iterator[float], seconds: float, begin: int = 0) -> int:
    """Returns how often it was called frozen."""
    found = 0
    for k in range(begin, begin + round(seconds * HZ)):
        before = watch.frozen
        watch.step(next(values), round(k * 1e9 / HZ))
        found += watch.frozen and not before
    return found


@pytest.mark.parametrize(
    ("step", "noise", "declared"),
    [
        (0.0, 500.0, 500.0),
        (100.0, 500.0, 500.0),  # 1 hPa
        (500.0, 500.0, 500.0),
        (500.0, 100.0, 100.0),  # coarser than its noise
        (500.0, 100.0, 500.0),  # … and the data sheet says too much
        (20.0, 10.0, 500.0),
    ],
)
@pytest.mark.parametrize("motion", [0.0, 60.0])
def test_a_sensor_that_works_is_never_called_frozen(
    step: float, noise: float, declared: float, motion: float
) -> None:
    for seed in range(4):
        values = sensor(step, noise, seed, motion)
        assert feed(FrozenWatch(declared, LONGEST), values, 90.0) == 0


@pytest.mark.parametrize(("step", "noise"), [(108.0, 20.0), (108.0, 40.0), (50.0, 15.0)])
@pytest.mark.parametrize("speed", [1.0, 4.0])
def test_a_coarse_one_may_rest_after_a_fast_dive(step: float, noise: float, speed: float) -> None:
    """Motion is not noise: measured by changes it made the rest that follows impossible."""
    rng = np.random.default_rng(1)
    watch, depth = FrozenWatch(200.0, LONGEST), 1.2e5

    def dives() -> Iterator[float]:
        nonlocal depth
        for k in range(10**6):
            depth += speed * step * (k % 1000 < 80) - speed * step * (500 <= k % 1000 < 580)
            yield round((depth + noise * rng.standard_normal()) / step) * step

    assert feed(watch, dives(), 200.0) == 0


@pytest.mark.parametrize(("step", "noise"), [(0.0, 500.0), (100.0, 500.0), (500.0, 500.0)])
@pytest.mark.parametrize("seed", range(3))
def test_one_finer_than_its_noise_is_found_within_a_second(
    step: float, noise: float, seed: int
) -> None:
    watch, values = FrozenWatch(noise, LONGEST), sensor(step, noise, seed)
    feed(watch, values, 20.0)
    stuck = iter([next(values)] * 42)
    assert feed(watch, stuck, 1.0, begin=840) == 1
    feed(watch, values, 0.1, begin=882)
    assert not watch.frozen


def test_a_driver_that_repeats_a_slower_sensor_is_not_a_frozen_one() -> None:
    watch, values = FrozenWatch(500.0, LONGEST), sensor(0.0, 500.0, 0)
    repeated = (value for value in values for _ in range(int(LEAST * HZ) - 1))
    assert feed(watch, repeated, 60.0) == 0


def test_one_that_never_changed_is_frozen_at_last() -> None:
    watch = FrozenWatch(500.0, LONGEST)
    assert feed(watch, iter([1e5] * 1000), LONGEST - 0.1) == 0
    assert feed(watch, iter([1e5] * 1000), 1.0, begin=round((LONGEST - 0.1) * HZ)) == 1


@settings(max_examples=100, deadline=None)
@given(st.floats(0.02, 3.0), st.floats(-0.5, 0.5))
def test_the_run_is_all_but_impossible_wherever_the_truth_lies_in_its_step(
    ratio: float, place: float
) -> None:
    """For a step of `ratio` times the noise: the sum over all values of their share to the n."""
    normal = NormalDist()
    most = round(8.0 / ratio) + 1
    shares = [
        normal.cdf((k + place + 0.5) * ratio) - normal.cdf((k + place - 0.5) * ratio)
        for k in range(-most, most + 1)
    ]
    count = in_a_row(ratio, 1.0, IMPOSSIBLE)
    assert sum(share**count for share in shares) <= IMPOSSIBLE
    assert count >= in_a_row(ratio / 2.0, 1.0, IMPOSSIBLE)


def test_a_step_far_beyond_the_noise_may_repeat_for_ever() -> None:
    assert isinf(in_a_row(500.0, 1.0, IMPOSSIBLE))
    assert in_a_row(500.0, 0.0, IMPOSSIBLE) == inf
