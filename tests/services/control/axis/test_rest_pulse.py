"""Short pulses at rest, on a vehicle whose thrusters give nothing below their dead-band's edge."""

from itertools import pairwise
from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.control.axis.plant import Plant
from services.control.axis.rest_pulse import LONGEST_WAIT, RestPulse

PERIOD = 0.01  # [s]
LAG = 0.08  # [s]
PUSHES = (0.0688, 0.0688)  # [N m] of each of two thrusters
ZONE = 0.003  # [rad]
FILE = Plant(inertia=0.375, linear=0.87)  # [kg m², N m s/rad]
ONE_STEP = PUSHES[0] * PERIOD / FILE.linear  # [rad]


class Hull:
    """A vehicle with a dead-band, whose law is without effect inside of it."""

    def __init__(self, off: float, plant: Plant = FILE, *, held: bool = False) -> None:
        self.plant, self.held = plant, held
        self.pulse = RestPulse(FILE, LAG, PERIOD, PUSHES, ZONE)
        self.error, self.rate, self.moment = off, 0.0, 0.0
        self.given: list[float] = []  # [N m] commands

    def rest(self, seconds: float, drift: float = 0.0) -> "Hull":
        """`drift` [rad/s]: of the estimate."""
        for _ in range(round(seconds / PERIOD)):
            share = self.pulse.step(self.error, self.rate, resting=True)
            command = PUSHES[self.pulse.turn] * (share or 0.0)
            self.pulse.effective = command != 0.0
            self.given.append(command)
            self.moment += (1.0 - exp(-PERIOD / LAG)) * (command - self.moment)
            push = (self.moment - self.plant.linear * self.rate) / self.plant.inertia
            self.rate += 0.0 if self.held else PERIOD * push
            self.error -= PERIOD * (self.rate + drift)
        return self

    @property
    def starts(self) -> int:
        return sum(
            now != 0.0 == before for before, now in zip(self.given, self.given[1:], strict=False)
        )


@settings(max_examples=30)
@given(st.floats(-0.01, 0.01))
def test_an_error_inside_the_dead_band_is_gone_after_five_seconds(off: float) -> None:
    hull = Hull(off).rest(5.0)
    assert abs(hull.error) <= ZONE
    if abs(off) > ZONE:
        assert abs(hull.error) <= ONE_STEP
        assert hull.starts == 1  # one pulse, of the right length


@settings(max_examples=15)
@given(st.floats(0.4, 2.5), st.floats(-0.007, 0.007))
def test_a_hull_with_another_drag_comes_to_rest_too(share: float, off: float) -> None:
    plant = FILE._replace(linear=share * FILE.linear)
    hull = Hull(off, plant).rest(15.0)
    assert abs(hull.error) <= ZONE + 1e-6
    begun = hull.starts
    assert begun <= 5
    assert hull.rest(30.0).starts == begun  # and stays there


def test_what_a_pulse_does_is_learnt() -> None:
    hull = Hull(0.007, FILE._replace(linear=0.5 * FILE.linear)).rest(120.0, drift=2e-4)
    assert hull.pulse.correction == pytest.approx(2.0, rel=0.3)


@pytest.mark.parametrize("drift", [2e-4, -2e-4])
def test_a_heading_that_drifts_is_kept_with_as_few_pulses_as_the_zone_allows(drift: float) -> None:
    hull = Hull(0.0).rest(30.0, drift)
    worst = 0.0
    begun, since = hull.starts, 300.0
    for _ in range(int(since)):
        hull.rest(1.0, drift)
        worst = max(worst, abs(hull.error))
    assert worst < 1.1 * ZONE
    every = 1.3 * ZONE / abs(drift)  # [s] from the edge of the zone to well beyond the reference
    assert hull.starts - begun <= since / every


def test_a_vehicle_that_lies_on_something_is_pushed_ever_more_seldom() -> None:
    hull = Hull(0.01, held=True).rest(600.0)
    assert hull.starts <= 20
    begun = hull.starts
    assert hull.rest(300.0).starts - begun <= 300.0 / (0.9 * LONGEST_WAIT * 0.86) + 1


def test_the_law_acts_while_it_has_effect_or_the_reference_moves() -> None:
    pulse = RestPulse(FILE, LAG, PERIOD, PUSHES, ZONE)
    for _ in range(500):
        assert pulse.step(0.02, 0.0, resting=True) is None  # effective
    pulse.effective = False
    for _ in range(500):
        assert pulse.step(0.02, 0.0, resting=False) is None
    assert pulse.step(0.02, 0.0, resting=True) is None  # the thrusters still run down


def test_a_pulse_ends_when_the_reference_moves() -> None:
    hull = Hull(0.01).rest(0.34)
    assert hull.given[-1] != 0.0
    assert hull.pulse.step(0.01, 0.0, resting=False) is None


def test_the_thrusters_take_turns() -> None:
    hull, turns = Hull(0.0), list[int]()
    for _ in range(200):
        before = hull.starts
        if hull.rest(1.0, drift=2e-4).starts > before:
            turns.append(hull.pulse.turn)
    assert len(turns) > 4
    assert all(now != before for before, now in pairwise(turns))
