"""Dives of hulls that are not the one of their file, flown at their worst moments."""

import numpy as np
import pytest

from lindy_research.bench.hull_runs import HullDifference, settings
from lindy_research.dives import DEEP, Dive, Row

SAGGING = settings("pioneer", HullDifference(thrust=0.6))
FULL_TURN = (0.98, 0.38, 0.3, -1.0)


def heading_error(rows: list[Row], until: float, seed: int) -> float:
    """[deg] Largest, of the reference less the truth."""
    dive = Dive(rows, seed=seed, overrides=(DEEP, *SAGGING)).until(until)
    error = dive.wanted_heading() - dive.heading()
    return float(np.degrees(np.abs(error - np.median(error[:90])).max()))


@pytest.mark.parametrize("yaw", [-1.0, 1.0])
def test_a_turn_with_surge_keeps_its_heading_at_sixty_percent_of_the_thrust(yaw: float) -> None:
    """All the thrust is needed for the turn, and surge gives way. Neither may what was learnt as
    it began stay as it was when it is not true any more, nor may the rounding of other thrusters
    be taken for a moment that is not to be had."""
    surge, sway, heave, _ = FULL_TURN
    rows: list[Row] = [
        (1.0, (surge, sway, heave, 0.0)),
        (5.0, (surge, sway, heave, yaw)),
        (8.0, (0.0, 0.0, 0.0, 0.0)),
    ]
    assert heading_error(rows, 11.0, seed=1) < 3.0
