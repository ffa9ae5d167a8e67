"""A short soak on virtual time."""

import pytest

from tests.long.soak import fly


@pytest.mark.slow
def test_minutes_of_random_faults_leave_the_pilot_in_control_after_each() -> None:
    flown = fly(hours=0.1, number=12, seed=11)
    assert [one.misses for one in flown.judged] == [()] * 12
    assert any(one.said for one in flown.judged)
    assert flown.restarts > 0
    assert flown.hours >= 0.09
