"""The bounded law for many axes is the bounded law for each."""

from math import inf

import numpy as np
import pytest
from numpy.typing import NDArray

from lindy.api.references import Limits, Ramp, solve
from lindy_research.laws import batch
from lindy_research.laws.stepping import step

N = 400
CLOSE = 1e-12  # relative to the size of the motion


def axes() -> tuple[NDArray[np.float64], ...]:
    """Random states with every corner: at rest, no change, no limit, exactly at the limit."""
    rng = np.random.default_rng(5)
    v, a, target = rng.uniform(-3, 3, N), rng.uniform(-4, 4, N), rng.uniform(-3, 3, N)
    jerk, a_max = 10 ** rng.uniform(-1, 1.3, N), 10 ** rng.uniform(-1, 0.7, N)
    a[:40] = 0.0
    target[20:60] = v[20:60]
    a_max[100:250] = inf
    a[60:80] = a_max[60:80]
    return v, a, target, jerk, a_max


def ramps() -> list[Ramp]:
    found: list[Ramp] = []
    for v, a, target, jerk, a_max in zip(*(z.tolist() for z in axes()), strict=True):
        lim = Limits(jerk, a_max)
        found.append(Ramp(lim, target=target, segments=tuple(solve(v, a, target, lim))))
    return found


@pytest.mark.parametrize("share", [0.0, 0.1, 0.37, 0.8, 1.0, 1.4])
def test_every_axis_agrees_with_the_scalar_law(share: float) -> None:
    plans = batch.solve(*axes())
    t = share * plans.duration
    found = np.stack(plans.at(t)[:3])
    expected = np.array([ramp.at(time) for ramp, time in zip(ramps(), t.tolist(), strict=True)])
    assert np.max(np.abs(found - expected.T[:3]) / (1 + np.abs(expected.T[:3]))) < CLOSE


def test_durations_agree_with_the_scalar_law() -> None:
    expected = [sum(part.duration for part in ramp.segments) for ramp in ramps()]
    np.testing.assert_allclose(batch.solve(*axes()).duration, expected, rtol=CLOSE, atol=1e-15)


@pytest.mark.parametrize("dt", [1e-3, 0.03, 0.4, 3.0])
def test_a_step_is_the_scalar_step_on_every_axis(dt: float) -> None:
    v, a, target, jerk, a_max = axes()
    found = np.stack(batch.step(np.ones(N), v, a, target, jerk, a_max, dt)[:3])
    columns = np.stack((v, a, target, jerk, a_max)).T.tolist()
    expected = np.array([step(1.0, v1, a1, to, J, top, dt)[:3] for v1, a1, to, J, top in columns]).T
    assert np.max(np.abs(found - expected) / (1 + np.abs(expected))) < CLOSE


def test_steps_with_new_targets_keep_the_limits_and_the_same_limits_serve_all_axes() -> None:
    rng = np.random.default_rng(6)
    x = v = a = np.zeros(N)
    for _ in range(200):
        x_before, v_before, a_before = x, v, a
        x, v, a, j = batch.step(x, v, a, rng.uniform(-1, 1, N), 2.0, 0.5, 0.05)
        assert np.max(np.abs(a)) <= 0.5 * (1 + 1e-12)
        assert np.max(np.abs(j)) <= 2.0 * (1 + 1e-9)
        assert np.max(np.abs(a - a_before)) <= 2.0 * 0.05 * (1 + 1e-9)
        assert np.max(np.abs(v - v_before)) <= 0.5 * 0.05 * (1 + 1e-9)
        assert np.max(np.abs(x - x_before)) <= np.max(np.abs([v, v_before])) * 0.05 + 1e-3
