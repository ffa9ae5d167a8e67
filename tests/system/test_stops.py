"""Stops that once were none: out of high surge, and of a tilted vehicle; and the heading at
rest."""

from math import degrees

import numpy as np
import pytest

from tests.support.dive import DEEP
from tests.support.sortie import HANDS_OFF, Sortie, SortieRow

CLEAN = (  # not zero: a sensor without any noise counts as frozen
    "simulator.pressure_std=10",
    "estimation.depth.pressure_std=100",
    "simulator.gyro_bias=0",
    "simulator.gyro_drift=0",
    "simulator.gyro_noise=1e-5",
    "simulator.accelerometer_bias=0",
    "simulator.accelerometer_noise=1e-4",
)
STICKS: list[SortieRow] = [(1.0, (0.7, 0.0, 0.6, 0.0)), (5.0, HANDS_OFF)]
LET_GO, OVER = 5.0, 10.0  # [s]


def comes_back(*overrides: str) -> float:
    """[m] From the deepest point after the release to where the vehicle settles."""
    sortie = Sortie(STICKS, seed=20090, overrides=(DEEP, *CLEAN, *overrides)).until(OVER)
    depth = sortie.columns(LET_GO, OVER).depth
    assert np.abs(depth[-1] - depth[0]) > 0.1, "it was no dive"
    return float(depth.max() - depth[-100:].mean())


@pytest.mark.slow
def test_a_vehicle_that_dives_at_high_surge_does_not_come_back() -> None:
    assert comes_back() < 0.002
    assert comes_back("control.coupling.heave=false") > 0.004


@pytest.mark.slow
def test_the_heading_does_not_rest_off_and_swing_later() -> None:
    """With this seed the estimate drifts through the thrusters' dead-band, which is half a degree
    wide here. Nothing moves in it: pulses that held it within 0.2° swung it by a quarter."""
    sortie = Sortie([(1.0, (0.0, 0.0, 1.0, 0.5)), (8.0, HANDS_OFF)], seed=5007).until(48.0)
    seen = sortie.columns(13.0)
    _, off = sortie.estimate_errors(seen, 13.0)
    known = seen.heading + off
    assert degrees(np.abs(known - seen.wanted_heading).max()) <= 0.5
    assert degrees(np.abs(seen.heading[200:] - seen.heading[:-200]).max()) <= 0.1  # in 2 s


@pytest.mark.slow
def test_a_turn_that_stops_while_the_vehicle_is_tilted_does_not_run_on() -> None:
    """Surge, dive and turn at once pitch it by more than twenty degrees."""
    together = (0.75, 0.48, 1.0, 0.5)
    sortie = Sortie([(1.0, together), (5.0, HANDS_OFF)], seed=1, overrides=(DEEP,)).until(10.0)
    under_way, after = sortie.columns(4.0, 5.0), sortie.columns(5.0)
    _, off = sortie.estimate_errors(under_way, 4.0)
    error = under_way.heading + off - under_way.wanted_heading
    assert degrees(np.abs(error[50:]).max()) <= 0.3
    assert degrees(after.heading.max() - after.heading[-100:].mean()) <= 0.3
