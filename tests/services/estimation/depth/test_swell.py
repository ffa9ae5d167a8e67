"""Waves are told from an accelerometer that is wrong, and the depth does not follow them."""

from math import pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.estimation.depth.depth_filter import DepthSettings
from services.estimation.depth.depth_observer import Atmosphere, DepthObserver
from services.estimation.depth.swell import LONGEST, Swell
from services.marine.vehicle import ATMOSPHERE, GRAVITY, SEA_WATER

STD = 0.02  # [m] of one sample
STEP_NS = 10_000_000  # [ns]
PER_METRE = SEA_WATER * GRAVITY  # [Pa/m]
periods = st.floats(3.0, 10.0)  # [s]


def swung(period: float, amplitude: float, seconds: float = 40.0) -> Swell:
    """Innovations that swing, with noise, fifty a second."""
    found, rng = Swell(), np.random.default_rng(1)
    for k in range(round(50 * seconds)):
        wave = amplitude * sin(2.0 * pi * 0.02 * k / period)
        found.add(wave + STD * float(rng.standard_normal()), STD, 0.02)
    return found


@settings(max_examples=30, deadline=None)
@given(periods, st.floats(0.08, 0.6))
def test_what_swings_about_the_depth_is_waves_and_does_not_leave(period: float, amplitude: float):
    found = swung(period, amplitude)
    assert found.rolls
    assert not found.leaves
    assert 0.5 * amplitude < found.amplitude < 1.1 * amplitude + 0.02


@settings(max_examples=30, deadline=None)
@given(st.floats(0.05, 2.0), st.sampled_from([-1.0, 1.0]))
def test_what_stays_on_one_side_leaves_and_is_no_wave(off: float, side: float):
    found = Swell()
    for _ in range(round(50 * (LONGEST + 1.0))):
        found.add(side * off, 0.01, 0.02)
    assert found.leaves
    assert not found.rolls


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000))
def test_noise_is_no_wave(seed: int):
    found, rng = Swell(), np.random.default_rng(seed)
    for _ in range(3000):
        found.add(STD * float(rng.standard_normal()), STD, 0.02)
    assert not found.rolls


def in_waves(height: float, period: float, seconds: float = 80.0) -> tuple[float, set[str]]:
    """[m] Largest error of the depth in the second half of a dive at rest whose pressure swings,
    and what was told; the accelerometer is right. They begin after ten seconds."""
    settings_ = DepthSettings(pressure_std=STD * PER_METRE)
    o = DepthObserver(settings_, Atmosphere(ATMOSPHERE, 0.0), SEA_WATER, 0.0)
    o.start(ATMOSPHERE + 3.0 * PER_METRE, 100, 0)
    rng, worst, told = np.random.default_rng(2), 0.0, set[str]()
    for k in range(1, round(100 * seconds)):
        noise = 0.016 * float(rng.standard_normal())
        events = [o.predict(noise, k * STEP_NS)]
        if k % 2 == 0:
            grown = min(1.0, max(0.0, 0.01 * k - 10.0) / (2.0 * period))
            wave = 0.5 * height * grown * sin(2.0 * pi * 0.01 * k / period)
            depth = 3.0 + wave + STD * float(rng.standard_normal())
            events.append(o.pressure(ATMOSPHERE + PER_METRE * depth, k * STEP_NS))
        told |= {event.name for event in events if event is not None}
        if k > 50 * seconds:
            worst = max(worst, abs(o.estimates(k * STEP_NS)[0].value - 3.0))
    return worst, told


@pytest.mark.parametrize("period", [4.0, 6.0, 8.0])
def test_a_vehicle_that_hangs_still_in_waves_keeps_its_imu_and_most_of_its_depth(period: float):
    worst, told = in_waves(0.4, period)
    assert "distrusted:sensor/imu" not in told
    assert "waves:sensor/pressure" in told
    assert worst < 0.15  # [m] where the pressure says 0.2
