"""From a wrench to thrusters: within limits, in order of importance, none of them standing
still."""

from collections.abc import Sequence
from itertools import pairwise
from math import hypot
from typing import cast

import msgspec
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from messages.units import Vec6
from services.control.allocation import (
    AXES,
    COMES_ON,
    GOES_OFF,
    PRIORITY,
    Allocation,
    AllocationSettings,
    Matrix,
    biases,
    effect_matrix,
)
from services.marine.vehicle import Vehicle, driven, total_wrench, wrench_per_newton

many = settings(max_examples=150, deadline=None)
force, moment = st.floats(-200.0, 200.0), st.floats(-40.0, 40.0)
wrench = st.tuples(force, force, force, moment, moment, moment)
share = st.floats(-1.0, 1.0)
# Losing the attitude, depth or heading disorients the pilot, losing speed does not.
ORDER = (("roll", "pitch"), ("heave",), ("yaw",), ("surge", "sway"))
EXACT = AllocationSettings(dead_band_compensation=False)
EDGE = 0.8  # [N] dead-band of the Pioneer's thrusters
NOISE = 0.49 * (COMES_ON - GOES_OFF) * EDGE  # [N] up and down, less than the hysteresis


@pytest.fixture(scope="module", params=["pioneer", "heavy"])
def vehicle(request: pytest.FixtureRequest) -> Vehicle:
    return cast(Vehicle, request.getfixturevalue(request.param))


@pytest.fixture(scope="module")
def slanted(heavy: Vehicle) -> Vehicle:
    """Four thrusters, each of which every axis needs: whoever gets more costs all the others."""
    down = [t.name.startswith("vertical") for t in heavy.thruster]
    tilted = [
        msgspec.structs.replace(t, direction=(*t.direction[:2], 0.7), dead_band=0.0)
        for t, vertical in zip(heavy.thruster, down, strict=True)
        if not vertical
    ]
    return msgspec.structs.replace(heavy, thruster=tilted)


def without_dead_band(vehicle: Vehicle) -> Vehicle:
    exact = [msgspec.structs.replace(t, dead_band=0.0) for t in vehicle.thruster]
    return msgspec.structs.replace(vehicle, thruster=exact)


def on_axes(wrench: Vec6, axes: frozenset[str] | tuple[str, ...]) -> list[float]:
    return [value for axis, value in zip(AXES, wrench, strict=True) if axis in axes]


@many
@given(st.tuples(*[share] * 6))
def test_inside_the_limits_allocation_then_mixing_is_identity(
    vehicle: Vehicle, shares: Vec6
) -> None:
    allocation = Allocation(without_dead_band(vehicle))
    wanted = cast(Vec6, tuple(s * m for s, m in zip(shares, (4, 3, 6, 0.3, 0.3, 0.2), strict=True)))
    done = allocation.allocate(wanted)
    assert on_axes(done.achieved, allocation.axes) == pytest.approx(
        on_axes(wanted, allocation.axes), abs=1e-9
    )
    assert done.saturated == ()


@many
@given(wrench)
def test_no_thruster_is_asked_for_more_than_it_has_and_achieved_is_what_they_will_really_do(
    vehicle: Vehicle, wanted: Vec6
) -> None:
    done = Allocation(vehicle).allocate(wanted)
    for thrust, thruster in zip(done.thrust, vehicle.thruster, strict=True):
        assert thruster.limits[0] <= thrust <= thruster.limits[1]
    yielded = [driven(t, f) for t, f in zip(vehicle.thruster, done.thrust, strict=True)]
    columns = [wrench_per_newton(t) for t in vehicle.thruster]
    assert done.achieved == pytest.approx(total_wrench(columns, yielded), abs=1e-9)
    exact = Allocation(without_dead_band(vehicle))
    done = exact.allocate(wanted)
    got, asked = on_axes(done.achieved, exact.axes), on_axes(wanted, exact.axes)
    assert (got != pytest.approx(asked, abs=1e-6)) == bool(done.saturated)
    assert set(done.saturated) <= {thruster.name for thruster in vehicle.thruster}


@many
@example(wanted=(-1e-05, 0.0, 0.0, 5.0, 0.0, 30.0))
@given(wrench)
@example((0.0, 1.537e-5, 0.0, 0.0, 0.0, -7.0))  # all is given to the yaw, nothing to the sway
def test_within_a_group_the_wrench_keeps_its_direction(vehicle: Vehicle, wanted: Vec6) -> None:
    """What is got lies between nothing and what was asked, but for rounding. Rounding is a share of
    the whole wrench, however small the part of it is that one group asks for."""
    allocation = Allocation(without_dead_band(vehicle))
    done = allocation.allocate(wanted)
    rounding = 1e-9 + 1e-7 * hypot(*wanted)  # [N, N m]
    for group in PRIORITY:
        axes = allocation.axes.intersection(group)
        asked, got = on_axes(wanted, axes), on_axes(done.achieved, axes)
        size = sum(a * a for a in asked)
        along = sum(a * g for a, g in zip(asked, got, strict=True)) / size if size > 0.0 else 0.0
        share = min(max(along, 0.0), 1.0)
        assert got == pytest.approx([share * a for a in asked], abs=rounding, rel=0.0)


@many
@given(wrench, st.integers(1, 3))
def test_attitude_comes_before_depth_depth_before_heading_and_heading_before_speed(
    slanted: Vehicle, heavy: Vehicle, wanted: Vec6, served: int
) -> None:
    for vehicle in (slanted, without_dead_band(heavy)):
        before, both = shares(Allocation(vehicle), wanted, ORDER, served)
        assert all(b >= a - 1e-6 for a, b in zip(before, both, strict=True))


def shares(
    allocation: Allocation, wanted: Vec6, order: Sequence[Sequence[str]], served: int
) -> tuple[list[float], list[float]]:
    """[-] Got of what the first groups ask for, without the others' demands and with them."""
    first = {axis for group in order[:served] for axis in group}
    alone = [w if axis in first else 0.0 for axis, w in zip(AXES, wanted, strict=True)]
    found: list[list[float]] = []
    for demand in (cast(Vec6, tuple(alone)), wanted):
        got = allocation.allocate(demand).achieved
        axes = [axis for axis in AXES if axis in allocation.axes & first]
        pairs = [(wanted[AXES.index(axis)], got[AXES.index(axis)]) for axis in axes]
        found.append([have / want for want, have in pairs if abs(want) > 1e-3])
    return found[0], found[1]


def test_sway_that_turns_the_vehicle_the_wanted_way_helps_a_full_yaw(pioneer: Vehicle) -> None:
    """The lateral thruster is 48 mm ahead: 20 N of it are 0.96 N m."""
    alone = Allocation(pioneer, EXACT).allocate((0.0, 0.0, 0.0, 0.0, 0.0, 9.0))
    helped = Allocation(pioneer, EXACT).allocate((0.0, 20.0, 0.0, 0.0, 0.0, 9.0))
    assert alone.achieved[5] == pytest.approx(2 * 35.0 * 0.086)
    assert helped.achieved[5] == pytest.approx(2 * 35.0 * 0.086 + 20.0 * 0.048)
    assert helped.achieved[1] == pytest.approx(20.0)


@many
@given(st.floats(25.0, 200.0), share, share)
def test_the_others_take_over_what_a_full_thruster_cannot_give(
    heavy: Vehicle, forward: float, sway: float, yaw: float
) -> None:
    """Never less than by scaling the whole command, and no thruster is left idle needlessly."""
    exact = without_dead_band(heavy)
    allocation = Allocation(exact)
    wanted = (forward, forward * sway, 0.0, 0.0, 0.0, 4.0 * yaw)
    done = allocation.allocate(wanted)
    unlimited = msgspec.structs.replace(
        exact,
        thruster=[
            msgspec.structs.replace(t, max_thrust=1000.0, max_reverse=24.0 / 30.4 * 1000.0)
            for t in exact.thruster
        ],
    )
    plain = Allocation(unlimited).allocate((forward, forward * sway, 0.0, 0.0, 0.0, 0.0)).thrust
    held = Allocation(exact).allocate((0.0, 0.0, 0.0, 0.0, 0.0, 4.0 * yaw)).thrust
    fits = 1.0
    for base, more, thruster in zip(held, plain, exact.thruster, strict=True):
        low, high = thruster.limits
        if abs(more) > 1e-9:
            fits = min(fits, ((high if more > 0 else low) - base) / more)
    assert done.achieved[0] >= fits * forward - 1e-6


@given(st.floats(25.0, 200.0), share, share)
def test_where_a_board_mixes_axes_the_whole_group_is_scaled(
    heavy: Vehicle, size: float, ahead: float, aside: float
) -> None:
    """Every thruster keeps its share of the demand, as fixed axes would give it."""
    scaled = AllocationSettings(dead_band_compensation=False, redistribute=False)
    wanted: Vec6 = (size * ahead, size * aside, 0.0, 0.0, 0.0, 0.0)
    vehicle = without_dead_band(heavy)
    full = Allocation(vehicle, scaled).allocate(wanted)
    small = Allocation(vehicle, scaled).allocate((0.01 * wanted[0], 0.01 * wanted[1], 0, 0, 0, 0))
    factor = max(map(abs, full.thrust)) / max(1e-12, *map(abs, small.thrust))
    assert full.thrust == pytest.approx([factor * f for f in small.thrust], abs=1e-6)


@many
@given(wrench)
def test_what_cannot_be_driven_is_ignored_and_shows_in_achieved(
    pioneer: Vehicle, wanted: Vec6
) -> None:
    x, y, z, _, _, n = wanted
    allocation = Allocation(pioneer)
    asked = allocation.allocate(wanted)
    allocation.forget()
    assert asked == allocation.allocate((x, y, z, 0.0, 0.0, n))
    assert asked.achieved[4] == pytest.approx(0.032 * asked.thrust[3])


@many
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=50))
def test_a_force_inside_the_dead_band_is_never_off_by_all_of_it(
    pioneer: Vehicle, forces: list[float]
) -> None:
    allocation, plain = Allocation(pioneer), Allocation(pioneer, EXACT)
    for heave in forces:
        wanted = (0.0, 0.0, heave, 0.0, 0.0, 0.0)
        assert abs(allocation.allocate(wanted).achieved[2] - heave) <= COMES_ON * EDGE + 1e-9
        assert plain.allocate(wanted).achieved[2] in (0.0, pytest.approx(heave))


@many
@given(st.floats(-1.0, 1.0), st.lists(st.floats(-NOISE, NOISE), max_size=30))
def test_noise_does_not_make_a_thruster_chatter(
    pioneer: Vehicle, level: float, noise: list[float]
) -> None:
    """Noise of less than the hysteresis switches a thruster once at most."""
    allocation = Allocation(pioneer)
    on = [allocation.allocate((0.0, 0.0, level + n, 0.0, 0.0, 0.0)).thrust[3] != 0.0 for n in noise]
    assert sum(a != b for a, b in pairwise(on)) <= 1


def test_forgetting_is_a_fresh_start(pioneer: Vehicle) -> None:
    between = (0.0, 0.0, 0.4, 0.0, 0.0, 0.0)  # where only the hysteresis decides
    allocation = Allocation(pioneer)
    allocation.allocate((0.0, 0.0, 0.7, 0.0, 0.0, 0.0))
    assert allocation.allocate(between).thrust[3] == 0.8
    allocation.forget()
    assert allocation.allocate(between).thrust[3] == 0.0


BIASED = AllocationSettings(biased=("heave", "yaw"))
GENTLE = (0.4, 0.4, 0.6, 0.06, 0.05, 0.15)  # [N, N m] takes half a newton of a thruster at most


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


def test_the_heavy_drives_all_axes_and_has_two_sets_and_the_pioneer_four_and_none(
    heavy: Vehicle, pioneer: Vehicle
) -> None:
    assert Allocation(heavy).axes == set(AXES)
    flat, vertical = biases(effect_matrix(heavy))
    assert np.flatnonzero(flat).tolist() == [0, 1, 2, 3]
    assert np.flatnonzero(vertical).tolist() == [4, 5, 6, 7]
    assert Allocation(pioneer).axes == {"surge", "sway", "heave", "yaw"}
    assert biases(effect_matrix(pioneer)) == []
    with pytest.raises(ValueError, match=r"biased: no thrusters that act on yaw can push against"):
        Allocation(pioneer, AllocationSettings(biased=("yaw",)))
