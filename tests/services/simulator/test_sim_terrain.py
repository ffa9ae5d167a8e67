"""A sea floor with hills and steps: laws of its shape, and a hull that lands on it."""

from math import hypot

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.settings import Settings
from services.simulator.surroundings import sea_floor
from services.simulator.terrain import SHARPNESS, Terrain, terraced
from services.simulator.vessel import Vessel

law = settings(max_examples=60, deadline=None)
where = st.floats(-300.0, 300.0)
seeds = st.integers(0, 1000)
steps = st.sampled_from([0.0, 0.4, 1.5])
terrains = st.builds(Terrain, hills=st.floats(0.1, 5.0), length=st.floats(5.0, 100.0), step=steps)
HEAVY = msgspec.structs.replace(Stack().section("vehicle", Vehicle), net_buoyancy=-20.0)


@law
@given(terrains, seeds, where, where)
def test_its_plane_touches_it(terrain: Terrain, seed: int, north: float, east: float) -> None:
    """At the place itself exactly; close by, better than linearly but on the edge of a step."""
    floor = sea_floor(Settings(terrain=terrain, slope_north=0.3), seed)
    (a, b, c), limit = floor.plane((north, east, 0.0))
    assert hypot(a, b, c) == pytest.approx(1.0)
    here = a * north + b * east + c * floor.depth((north, east, 0.0))
    assert here == pytest.approx(limit, abs=1e-9)
    if terrain.step > 0.0:
        return
    for off in (1e-3, -1e-3):
        there = a * (north + off) + b * (east - off) + c * floor.depth((north + off, east - off, 0))
        assert abs(there - limit) < 1e-3 * terrain.hills


@law
@given(terrains, seeds)
def test_the_dive_begins_over_the_depth_of_the_settings(terrain: Terrain, seed: int) -> None:
    assert sea_floor(Settings(terrain=terrain), seed).depth((0.0, 0.0, 0.0)) == 20.0


@law
@given(st.floats(-20.0, 20.0), st.floats(0.1, 5.0))
def test_terraces_are_flat_at_whole_steps_and_never_far_from_the_hill(
    height: float, step: float
) -> None:
    cut, steeper = terraced(height, step)
    assert abs(cut - height) <= step / 2 + 1e-9
    assert steeper in (0.0, SHARPNESS)
    if steeper == 0.0:
        assert cut / step == pytest.approx(round(cut / step))
    near, _ = terraced(height + 1e-6, step)
    assert -1e-12 <= near - cut <= SHARPNESS * 1e-6 + 1e-9


def test_hills_have_the_height_that_was_asked_for() -> None:
    """Over many seeds and a long way: the standard deviation of the settings, within 5 %."""
    spread = [
        sea_floor(Settings(terrain=Terrain(hills=2.0)), seed).depth((x, 0.6 * x, 0.0))
        - sea_floor(Settings(terrain=Terrain(hills=2.0)), seed).depth((x + 4000.0, 0.0, 0.0))
        for seed in range(300)
        for x in (1000.0, 2000.0)
    ]
    mean_square = sum(d * d for d in spread) / len(spread)
    assert (mean_square / 2) ** 0.5 == pytest.approx(2.0, rel=0.05)


def test_without_terrain_it_is_the_plane_to_the_bit() -> None:
    floor = sea_floor(Settings(slope_north=0.2), 5)
    assert not floor.rough
    assert floor.depth((3.0, 4.0, 0.0)) == 20.0 + 0.2 * 3.0


@pytest.mark.parametrize("step", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(4))
def test_a_heavy_hull_lands_on_a_hill_and_stays(seed: int, step: float) -> None:
    """It neither falls through nor is thrown up, wherever it comes down."""
    site = Settings(terrain=Terrain(hills=0.5, length=15.0, step=step))
    north, east = 7.0 * seed, -3.0 * seed
    floor = sea_floor(site, seed)
    top = floor.depth((north, east, 0.0))
    start = (north, east, top - 1.0, 1.0, 0.0, 0.0, 0.0, *(0.0,) * 6)
    ship = Vessel(HEAVY, site, start, [0.0] * len(HEAVY.thruster), seed)
    fastest = 0.0
    for _ in range(150):
        ship.advance(0.1)
        fastest = max(fastest, hypot(*ship.velocity[:3]))
    below = floor.depth(ship.position) - ship.position[2]
    assert 0.0 < below < hypot(*HEAVY.size)
    assert ship.around.floor_felt(ship.position, ship.attitude)
    assert fastest < 1.0


def test_far_above_a_steep_place_nothing_is_touched() -> None:
    site = Settings(terrain=Terrain(hills=5.0, length=5.0))
    floor = sea_floor(site, 1)
    for north in range(100):
        height = floor.depth((float(north), 0.0, 0.0)) - 2 * sum(HEAVY.size)
        start = (float(north), 0.0, height, 1.0, 0.0, 0.0, 0.0, *(0.0,) * 6)
        ship = Vessel(HEAVY, site, start, [0.0] * len(HEAVY.thruster), 1)
        assert not ship.around.near(ship.position)


def test_absurd_terrain_is_refused() -> None:
    for wrong in ({"hills": -1.0}, {"length": 0.0}, {"step": 100.0}, {"stones": 3}):
        with pytest.raises(msgspec.ValidationError):
            msgspec.convert(wrong, Terrain)
