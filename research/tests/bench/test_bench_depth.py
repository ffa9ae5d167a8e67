"""The world in which depth observers are compared: its truth is one, and the scores are right."""

import numpy as np
import pytest

from lindy.api.vehicle import GRAVITY, to_world
from lindy_research.bench.depth_runs import (
    TYPICAL,
    Estimates,
    Sensor,
    lindy,
    score,
    thesis,
    world,
)

pytestmark = pytest.mark.slow

COARSE, LATE = Sensor("coarse", 0.05), Sensor("late", 0.005, latency=0.03)


def test_rate_is_the_derivative_of_depth_and_the_accelerometer_that_of_rate():
    seen = world(Sensor("perfect", 0.0), 3)
    dt, first = seen.t[1] - seen.t[0], seen.flight.calibrated
    assert np.gradient(seen.depth, dt)[1:-1] == pytest.approx(seen.rate[1:-1], abs=1e-3)
    attitudes = seen.flight.attitude[first:].tolist()
    down = [
        to_world(q, sample.specific_force)[2] + GRAVITY
        for q, sample in zip(attitudes, seen.imu[first:], strict=True)
    ]
    off = (np.array(down) - np.gradient(seen.rate, dt))[1:-1]
    # A bias of 10 mg on each axis.
    assert abs(float(np.mean(off[:300]))) < 0.25
    assert float(np.std(off)) < 0.06
    noise = TYPICAL.accelerometer_noise * 10.0 * 2**0.5  # [m/s²] of one sample, of a difference
    assert float(np.std(np.diff(off))) == pytest.approx(noise, rel=0.05)


def test_a_late_sensor_says_the_depth_of_before():
    seen = world(Sensor("late", 0.0, latency=0.03), 3)
    late = seen.stamps > 0.1
    truth = np.interp(seen.stamps[late] - 0.03, seen.t, seen.depth)
    assert seen.said[late] == pytest.approx(truth, abs=2e-3)


def test_a_rate_that_comes_late_is_scored_so():
    seen = world(COARSE, 3)
    found = Estimates(seen.depth + 0.002, np.roll(seen.rate, 12), np.zeros(1))
    depth, _, lag = score(seen, found)
    assert depth == pytest.approx(2.0)
    assert lag == pytest.approx(120.0)


def test_each_step_away_from_the_thesis_is_worth_something():
    seen = world(LATE, 3)
    hold, timed, reference = (
        score(seen, thesis(seen, way, LATE, 0.05)) for way in ("hold", "timed", "reference")
    )
    shipped = score(seen, lindy(seen, LATE.settings()))
    assert hold.depth > 2.0 * timed.depth > reference.depth > shipped.depth
    assert timed.rate > 1.5 * reference.rate > 3.0 * shipped.rate
    assert shipped.depth <= 2.0
    assert shipped.rate <= 4.0
    assert shipped.lag <= 20.0
