"""The depth observers without accelerometer: against batch least squares, and what the time of a
sample is worth to each."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lindy_research.bench.thesis_depth import RATE_STD, WAYS, ThesisObserver, Way

STEP_NS = 10_000_000
STD, NOISE = 0.05, 0.3  # [m], [m/s²/√Hz]

sample = st.tuples(
    st.floats(-2.0, 2.0),  # [m/s²]
    st.integers(1, 20),  # steps
    st.floats(-3.0, 3.0),  # [m] measured depth
    st.integers(0, 10),  # steps of its age
)
Steps = list[tuple[float, int, float, int]]


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
        q = NOISE**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
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
    way: Way, first: float, steps: Steps
) -> None:
    o, now = ThesisObserver(way, STD, NOISE), 0
    o.sample(first, now)
    for acceleration, count, depth, age in steps:
        now += count * STEP_NS
        o.predict(acceleration, now)
        o.sample(depth, now - age * STEP_NS)
    expected = batch(first, steps, way == "reference").tolist()
    assert [o.depth, o.rate] == pytest.approx(expected, abs=1e-6)


def sinking(way: Way, latency: float) -> float:
    """[m] Mean error while sinking at 0.5 m/s; samples of 50 Hz come 0.06 s late, stamped so, and
    the observer is told of `latency` [s]."""
    o, errors = ThesisObserver(way, STD, 0.2, latency), list[float]()
    for k in range(1, 1501):
        now = k * STEP_NS
        if k % 2 == 0:
            o.sample(1.0 + 0.5 * (now * 1e-9 - 0.06), now)
        o.predict(0.0, now)
        errors.append(o.depth - (1.0 + 0.5 * now * 1e-9))
    return float(np.mean(errors[500:]))


@pytest.mark.parametrize("way", WAYS)
def test_only_a_timed_observer_takes_the_error_of_a_known_latency_away(way: Way) -> None:
    assert sinking(way, 0.0) < -0.025
    if way == "hold":
        assert sinking(way, 0.06) < -0.025
    else:
        assert sinking(way, 0.06) == pytest.approx(0.0, abs=0.002)
