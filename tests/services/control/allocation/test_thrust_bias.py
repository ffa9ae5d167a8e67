"""Thrusters that turn against each other: no wrench of their own, and no dead-band left."""

from typing import cast

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.units import Vec6
from services.control.allocation.allocation import Allocation, AllocationSettings
from services.control.allocation.layout import Matrix, effect_matrix
from services.control.allocation.thrust_bias import biases
from services.marine.vehicle import Vehicle

BIASED = AllocationSettings(biased=("heave", "yaw"))
share = st.floats(-1.0, 1.0)
GENTLE = (0.4, 0.4, 0.6, 0.06, 0.05, 0.15)  # [N, N m] takes half a newton of a thruster at most
many = settings(max_examples=150, deadline=None)


def without_dead_band(vehicle: Vehicle) -> Vehicle:
    exact = [msgspec.structs.replace(t, dead_band=0.0) for t in vehicle.thruster]
    return msgspec.structs.replace(vehicle, thruster=exact)


def scaled(shares: Vec6, most: Vec6) -> Vec6:
    return cast(Vec6, tuple(s * m for s, m in zip(shares, most, strict=True)))


@many
@given(st.tuples(*[share] * 6))
def test_a_gentle_wrench_comes_exactly_and_no_thruster_stands(heavy: Vehicle, part: Vec6) -> None:
    wanted = scaled(part, GENTLE)
    done = Allocation(heavy, BIASED).allocate(wanted)
    if any(wanted):
        assert done.achieved == pytest.approx(wanted, abs=1e-9)
        assert min(map(abs, done.thrust)) >= 0.5 - 1e-9
    else:
        assert not any(done.thrust)  # nothing wanted is all thrusters stopped


@many
@given(st.lists(st.tuples(*[share] * 6), min_size=2, max_size=20), st.floats(0.0, 1.0))
def test_any_wrench_is_met_at_least_as_well_as_without_it(
    heavy: Vehicle, parts: list[Vec6], scale: float
) -> None:
    """Only the flat thrusters act on surge, sway and yaw, and only they are biased."""
    plain = Allocation(heavy, AllocationSettings(dead_band_compensation=False))
    biased = Allocation(heavy, AllocationSettings(dead_band_compensation=False, biased=("yaw",)))
    exact = Allocation(without_dead_band(heavy))
    for part in parts:
        wanted = scaled(part, cast(Vec6, tuple(scale * x for x in (90, 90, 90, 8, 8, 8))))
        truth, without, with_it = [
            np.array(allocation.allocate(wanted).achieved)[[0, 1, 5]]
            for allocation in (exact, plain, biased)
        ]
        assert np.linalg.norm(with_it - truth) <= np.linalg.norm(without - truth) + 1e-9


@many
@given(st.integers(0, 2**32 - 1), st.integers(4, 9))
def test_a_bias_makes_no_wrench_with_any_layout(seed: int, thrusters: int) -> None:
    rng = np.random.default_rng(seed)
    effect: Matrix = rng.normal(size=(6, thrusters))
    effect[:, -1] = 0.0  # one that has failed
    for bias in biases(effect):
        assert np.abs(effect @ bias).max() < 1e-9 * np.abs(bias).max() * thrusters
        assert np.abs(bias[bias != 0.0]).min() == pytest.approx(1.0)
        assert bias[-1] == 0.0


def test_the_heavy_has_two_sets_and_the_pioneer_none(heavy: Vehicle, pioneer: Vehicle) -> None:
    flat, vertical = biases(effect_matrix(heavy))
    assert (np.flatnonzero(flat).tolist(), np.flatnonzero(vertical).tolist()) == (
        [0, 1, 2, 3],
        [4, 5, 6, 7],
    )
    assert biases(effect_matrix(pioneer)) == []


def test_a_bias_that_the_layout_does_not_have_is_refused(pioneer: Vehicle) -> None:
    with pytest.raises(ValueError, match=r"biased: no thrusters that act on yaw can push against"):
        Allocation(pioneer, AllocationSettings(biased=("yaw",)))
