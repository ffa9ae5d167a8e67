"""What is known of the bottom, by which instrument."""

import pytest

from messages.message import Estimate
from messages.sensors import AltitudeSample, DvlSample
from messages.state import VehicleState
from services.reference.guidance.bottom import Bottom

S = 1_000_000_000  # [ns]


def state(now: int) -> VehicleState:
    known = Estimate(0.0, 0.01, valid=True)
    return VehicleState(
        stamp_ns=now,
        sensor_ns=now,
        phase="running",
        calibration_left=None,
        depth=Estimate(5.0, 0.01, valid=True),
        depth_rate=known,
        depth_acceleration=known,
        attitude=(1.0, 0.0, 0.0, 0.0),
        roll=known,
        pitch=known,
        heading=known,
        heading_navigation=known,
        yaw_rate=known,
    )


def test_an_altimeter_says_how_high_and_the_dvl_how_fast() -> None:
    bottom = Bottom()
    for k in range(1, 30):
        now = k * S // 10
        dvl = DvlSample(stamp_ns=now, velocity=(0.3, 0.4, 0.0), std=0.01, altitude=9.0)
        bottom.see(dvl, state(now), now / S, AltitudeSample(stamp_ns=now, altitude=3.0))
    assert bottom.depth(2.9) == pytest.approx(8.0)
    assert bottom.speed == pytest.approx(0.5)
    lost = DvlSample(stamp_ns=3 * S, velocity=None, std=0.01)
    bottom.see(lost, state(3 * S), 3.0, AltitudeSample(stamp_ns=3 * S, altitude=3.0))
    assert bottom.speed == pytest.approx(0.5)  # the newest that was measured


def test_without_an_altimeter_the_altitude_is_the_dvls() -> None:
    bottom = Bottom()
    for k in range(1, 30):
        now = k * S // 10
        dvl = DvlSample(stamp_ns=now, velocity=None, std=0.01, altitude=9.0)
        bottom.see(dvl, state(now), now / S)
    assert bottom.depth(2.9) == pytest.approx(14.0)
