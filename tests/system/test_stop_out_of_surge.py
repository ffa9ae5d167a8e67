"""A stop of a dive at high surge is a stop: with sensors almost without errors, only control is
left to be judged."""

import numpy as np
import pytest

from tests.support.sortie import DEEP, HANDS_OFF, Sortie, SortieRow

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
