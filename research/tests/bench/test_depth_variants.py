"""The depth observers that never fly: against batch least squares, and what the time of a sample is
worth to each."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy_research.bench.depth_variants import RATE_STD, VARIANTS, VariantObserver
from services.estimation.depth.depth_filter import DepthSettings
from services.marine.vehicle import GRAVITY, SEA_WATER

STEP_NS = 10_000_000
PER_METRE = SEA_WATER * GRAVITY  # [Pa/m]
STD = 0.05  # [m]
SET = DepthSettings(motion_noise=0.3, pressure_std=STD * PER_METRE)

sample = st.tuples(
    st.floats(-2.0, 2.0),  # [m/s²]
    st.integers(1, 20),  # steps
    st.floats(-3.0, 3.0),  # [m] measured depth
    st.integers(0, 10),  # steps of its age
)
Steps = list[tuple[float, int, float, int]]


def observer(way: str, told: DepthSettings = SET) -> VariantObserver:
    return VariantObserver(told, PER_METRE, way)


def batch(first: float, steps: Steps, driven: bool) -> np.ndarray:
    """The last state of the trajectory that fits start, motion and samples best, all at once."""
    n, before = len(steps), None
    rows: list[np.ndarray] = [np.diag([1 / STD, 1 / RATE_STD]) @ np.eye(2, 2 * n + 2)]
    right: list[np.ndarray] = [np.array([first / STD, 0.0])]
    for k, (acceleration, count, depth, age) in enumerate(steps):
        dt = 0.01 * count
        mean = acceleration if before is None else 0.5 * (before + acceleration)
        before = acceleration
        f, g = np.array([[1.0, dt], [0.0, 1.0]]), np.array([dt * dt / 2, dt]) * driven
        q = SET.motion_noise**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        whiten = np.linalg.inv(np.linalg.cholesky(q))
        motion = np.zeros((2, 2 * n + 2))
        motion[:, 2 * k : 2 * k + 2], motion[:, 2 * k + 2 : 2 * k + 4] = -f, np.eye(2)
        rows.append(whiten @ motion)
        right.append(whiten @ g * mean)
        seen = np.zeros((1, 2 * n + 2))
        seen[0, 2 * k + 2 : 2 * k + 4] = 1.0, -0.01 * age
        rows.append(seen / STD)
        right.append(np.array([depth / STD]))
    return np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0][-2:]


@pytest.mark.parametrize("way", ["timed", "reference"])
@settings(max_examples=40, deadline=None)
@given(first=st.floats(-3.0, 3.0), steps=st.lists(sample, min_size=1, max_size=6))
def test_sample_by_sample_is_what_all_samples_at_once_would_give(
    way: str, first: float, steps: Steps
) -> None:
    o, now = observer(way), 0
    o.sample(first, now)
    for acceleration, count, depth, age in steps:
        now += count * STEP_NS
        o.predict(acceleration, now)
        o.sample(depth, now - age * STEP_NS)
    expected = batch(first, steps, VARIANTS[way].driven).tolist()
    assert [o.depth, o.rate] == pytest.approx(expected, abs=1e-6)


def sinking(way: str, told: DepthSettings, late: float) -> float:
    """[m] Mean error while sinking at 0.5 m/s; samples of 50 Hz come `late` [s], stamped so."""
    o, errors = observer(way, told), list[float]()
    for k in range(1, 1501):
        now = k * STEP_NS
        if k % 2 == 0:
            o.sample(1.0 + 0.5 * (now * 1e-9 - late), now)
        o.predict(0.0, now)
        errors.append(o.depth - (1.0 + 0.5 * now * 1e-9))
    return float(np.mean(errors[500:]))


@pytest.mark.parametrize("way", list(VARIANTS))
def test_only_a_timed_observer_takes_the_error_of_a_known_latency_away(way: str) -> None:
    plain, told = DepthSettings(), DepthSettings(pressure_latency=0.06)
    assert sinking(way, plain, late=0.06) < -0.025
    if VARIANTS[way].timed:
        assert sinking(way, told, late=0.06) == pytest.approx(0.0, abs=0.002)
    else:
        assert sinking(way, told, late=0.06) < -0.025


def test_a_held_sample_counts_in_every_step_and_a_new_one_once() -> None:
    spreads: dict[str, float] = {}
    for way in ("hold", "new"):
        o = observer(way)
        o.sample(5.0, STEP_NS)
        o.sample(5.0, STEP_NS + 1)
        for k in range(2, 12):
            o.predict(None, k * STEP_NS)
        spreads[way] = o.depth_std
    assert spreads["hold"] < 0.7 * spreads["new"]


@pytest.mark.parametrize("way", list(VARIANTS))
def test_every_way_settles_on_a_depth(way: str) -> None:
    o = observer(way)
    for k in range(1, 1000):
        o.sample(5.0, k * STEP_NS)
        o.predict(0.0, k * STEP_NS)
    assert (o.depth, o.rate) == pytest.approx((5.0, 0.0), abs=0.01)
