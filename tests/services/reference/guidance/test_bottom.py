"""What is known of the bottom, by which instrument."""

import pytest

from messages.sensors import AltitudeSample, DvlSample
from services.reference.guidance.bottom import Bottom
from tests.support.said import state

S = 1_000_000_000  # [ns]


def test_an_altimeter_says_how_high_and_the_dvl_how_fast() -> None:
    bottom = Bottom()
    for k in range(1, 30):
        now = k * S // 10
        dvl = DvlSample(stamp_ns=now, velocity=(0.3, 0.4, 0.0), std=0.01, altitude=9.0)
        bottom.see(dvl, state(now, depth=5.0), now / S, AltitudeSample(stamp_ns=now, altitude=3.0))
    assert bottom.depth(2.9) == pytest.approx(8.0)
    assert bottom.speed == pytest.approx(0.5)
    lost = DvlSample(stamp_ns=3 * S, velocity=None, std=0.01)
    bottom.see(lost, state(3 * S, depth=5.0), 3.0, AltitudeSample(stamp_ns=3 * S, altitude=3.0))
    assert bottom.speed == pytest.approx(0.5)  # the newest that was measured


def test_without_an_altimeter_the_altitude_is_the_dvls() -> None:
    bottom = Bottom()
    for k in range(1, 30):
        now = k * S // 10
        dvl = DvlSample(stamp_ns=now, velocity=None, std=0.01, altitude=9.0)
        bottom.see(dvl, state(now, depth=5.0), now / S)
    assert bottom.depth(2.9) == pytest.approx(14.0)


@pytest.mark.parametrize(("hz", "lost_after"), [(10.0, 1.0), (4.0, 2.5), (1.0, 5.0)])
def test_it_is_lost_by_the_rate_at_which_altitudes_come(hz: float, lost_after: float) -> None:
    bottom, period = Bottom(), round(S / hz)
    for k in range(1, 60):
        now = k * period
        bottom.see(None, state(now, depth=5.0), now / S, AltitudeSample(stamp_ns=now, altitude=3.0))
    newest, last = AltitudeSample(stamp_ns=59 * period, altitude=3.0), 59 * period / S
    bottom.see(None, state(59 * period, depth=5.0), last + lost_after - 0.05, newest)
    assert bottom.known
    bottom.see(None, state(59 * period, depth=5.0), last + lost_after + 0.05, newest)
    assert not bottom.known
    assert bottom.lost


def test_a_step_of_the_floor_does_not_lose_it() -> None:
    """What is doubted is heard all the same, also of a sounder that is fast and answers late."""
    bottom = Bottom()
    for k in range(1, 80):
        now, altitude = k * S // 10, 3.0 if k < 40 else 6.0
        sample = AltitudeSample(stamp_ns=now - S // 5, altitude=altitude)
        bottom.see(None, state(now, depth=5.0), now / S, sample)
        assert bottom.known
    assert bottom.depth(7.9) == pytest.approx(11.0, abs=0.1)
