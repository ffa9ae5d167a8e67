"""Laws of the fit that cost a minute or more: `pytest tests/long/identify_fit.py`."""

import pytest

from tests.tools.identify.test_identify_fit import FILE, FITTED, coasting, made, truth
from tools.identify.fit import fit
from tools.identify.motion_model import AXES, start_of


def test_when_it_was_measured_changes_nothing() -> None:
    start = start_of(FILE)
    here = fit(made(seed=3), start, ("heave", "yaw"))
    later = fit(made(seed=3, shift=1234.0), start, ("heave", "yaw"))
    assert later.x == pytest.approx(here.x, abs=1e-6)


@pytest.mark.parametrize("excited", ["heave", "yaw"])
def test_an_axis_that_is_not_moved_keeps_its_numbers(excited: str) -> None:
    found = fit(made(excited), start_of(FILE), ("heave", "yaw"))
    assert found.axes == (excited,)
    assert set(found.refused) == {"heave", "yaw"} - {excited}


def test_drag_never_drives() -> None:
    start = start_of(FILE)
    found = fit(made(noise=10.0, windows=2), start, ("heave", "yaw"))
    assert found.axes
    for axis in map(AXES.index, found.axes):
        assert min(found.x[3 * axis + 1], found.x[3 * axis + 2]) >= 0.0


def test_a_drift_that_nothing_tells_beforehand_is_found() -> None:
    start = start_of(FILE)
    found = fit(coasting(seed=1, surge=-0.15), start, ("heave", "yaw"))
    assert found.x[9:12] == pytest.approx(truth(start)[9:12], abs=0.02)


def test_without_noise_the_numbers_come_back() -> None:
    start = start_of(FILE)
    found = fit(made(noise=0.0), start, ("heave", "yaw"))
    assert found.axes == ("heave", "yaw")
    assert found.x[FITTED] == pytest.approx(truth(start)[FITTED], abs=2e-6)
