"""Lindy on ArduSub's own firmware in its simulator, in real time, where LINDY_ARDUSUB names one."""

import os
from pathlib import Path

import pytest

from lindy_research.ardusub_comparison.flights import fly_lindy
from lindy_research.ardusub_comparison.station_keeping import keep_with_lindy
from lindy_research.ardusub_comparison.sticks import drawn

FIRMWARE = os.environ.get("LINDY_ARDUSUB", "").partition(":")[0]
pytestmark = [
    pytest.mark.slow,
    pytest.mark.system,
    pytest.mark.skipif(not FIRMWARE, reason="LINDY_ARDUSUB names no firmware"),
]


def test_what_is_let_go_comes_to_rest_where_it_should(tmp_path: Path) -> None:
    """Heave, surge, both, heave alone of both, a turn, and surge in a turn."""
    flight = fly_lindy(FIRMWARE, drawn(7, 1), tmp_path / "flight")
    assert max(release.bounce for release in flight.releases) < 0.03
    assert max(flight.swayed) < 0.03
    assert max(turn.bounce for turn in flight.turns) < 0.04


def test_a_place_is_held_against_a_current(tmp_path: Path) -> None:
    flight = keep_with_lindy(FIRMWARE, tmp_path / "flight")
    assert max(stage.settled for stage in flight.stages) < 0.1
    assert flight.stop.bounce < 0.02
