"""A turn of a tilted vehicle about its own down axis."""

from math import cos, sin

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from messages.message import Estimate
from messages.reference import Motion
from services.control.laws import along_body, of_heading

TILTS = st.floats(-0.6, 0.6)
RATES = st.floats(-1.0, 1.0)


def known(value: float, *, valid: bool = True) -> Estimate:
    return Estimate(value, 0.01, valid)


@given(TILTS, TILTS, RATES, RATES)
def test_a_vehicle_on_its_reference_has_no_error_of_rate_at_any_tilt(
    roll: float, pitch: float, turning: float, pitching: float
) -> None:
    r = turning * cos(roll) * cos(pitch) - pitching * sin(roll)  # body, by the Euler rates
    wanted = along_body(Motion(1.0, turning, 0.0, 0.0), known(roll), known(pitch))
    measured = of_heading(known(r), known(roll), pitching)
    assert wanted.position == 1.0
    assert np.isclose(wanted.velocity, measured.value, atol=1e-12)


@given(TILTS, TILTS)
def test_what_rests_rests_exactly(roll: float, pitch: float) -> None:
    wanted = along_body(Motion(2.0, 0.0, 0.0, 0.0), known(roll), known(pitch))
    assert wanted == Motion(2.0, 0.0, 0.0, 0.0)


def test_level_and_unknown_tilt_change_nothing() -> None:
    motion, rate = Motion(1.0, 0.5, 0.2, 0.1), known(0.4)
    assert along_body(motion, known(0.0), known(0.0)) == motion
    assert along_body(motion, known(0.5), known(0.5, valid=False)) == motion
    assert of_heading(rate, known(0.0), 0.7) == rate
    assert of_heading(rate, known(0.5, valid=False), 0.7) == rate


def test_a_rate_that_is_not_known_stays_unknown() -> None:
    assert not of_heading(known(0.1, valid=False), known(0.2), 0.3).valid
