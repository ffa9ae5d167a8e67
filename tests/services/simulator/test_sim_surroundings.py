"""What is around the hull: current, tether, slope, and a floor with hills."""

from itertools import pairwise
from math import dist, exp, hypot, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.units import Quaternion, Vec3, Vec6
from services.marine.attitude import from_euler, to_body, to_world
from services.marine.hydrodynamics import system_inertia
from services.marine.vehicle import GRAVITY
from services.simulator.settings import CurrentSettings, Settings, TetherSettings
from services.simulator.surroundings import HELD, Current, Tether, sea_floor
from services.simulator.terrain import Terrain
from services.simulator.vessel import STEP, Vessel
from tests.services.simulator.hulls import NEUTRAL, PIONEER, deep, vessel
from tests.support.textbook_vessel import kinetic_energy

HEAVY = replace(PIONEER, net_buoyancy=-20.0)
motion = st.tuples(*[st.floats(-1.5, 1.5)] * 6)
attitude = st.builds(from_euler, st.floats(-3, 3), st.floats(-1.5, 1.5), st.floats(-3, 3))
flow = st.floats(-1, 1)
law = settings(max_examples=25, deadline=None)


def velocity_over_ground(ship: Vessel) -> Vec3:
    u, v, w, *_ = ship.velocity
    return to_world(ship.attitude, (u, v, w))


def energy(ship: Vessel) -> float:
    """[J] of motion and of tilt."""
    _, x, y, _ = ship.attitude
    righting = NEUTRAL.mass * GRAVITY * NEUTRAL.metacentric_height * 2 * (x * x + y * y)
    return kinetic_energy(system_inertia(NEUTRAL), ship.through_water) + righting


@settings(max_examples=8, deadline=None)
@given(flow, flow, attitude)
def test_a_free_hull_drifts_to_the_currents_velocity(
    north: float, east: float, q_NB: Quaternion
) -> None:
    ship = vessel(deep(current=CurrentSettings(north, east)), q_NB=q_NB)
    behind = [dist(velocity_over_ground(ship), (north, east, 0.0))]
    for _ in range(60):
        ship.advance(1.0)
        behind.append(dist(velocity_over_ground(ship), (north, east, 0.0)))
    assert behind[-1] < 0.05 * behind[0] + 0.02  # drag fades with speed: the last bit takes long
    assert ship.current == (north, east, 0.0)


@law
@given(flow, flow, attitude, motion, st.tuples(*[st.floats(-35, 35)] * 4))
def test_a_steady_current_carries_everything_along_and_changes_nothing_else(
    north: float, east: float, q_NB: Quaternion, nu: Vec6, thrust: tuple[float, ...]
) -> None:
    """Galilei: seen from the water, it moves as in water at rest."""
    u, v, w, p, q, r = nu
    a, b, c = to_body(q_NB, (north, east, 0.0))
    still = vessel(deep(), q_NB=q_NB, nu=nu)
    flowing = deep(current=CurrentSettings(north, east))
    carried = vessel(flowing, q_NB=q_NB, nu=(u + a, v + b, w + c, p, q, r))
    for ship in (still, carried):
        ship.propulsion.drive(thrust)
        ship.advance(2.0)
    x, y, z = still.position
    assert carried.position == pytest.approx((x + 2 * north, y + 2 * east, z), abs=1e-9)
    assert carried.attitude == pytest.approx(still.attitude, abs=1e-9)
    assert carried.acceleration == pytest.approx(still.acceleration, abs=1e-9)


def test_where_the_current_changes_the_hull_does_not_jump() -> None:
    ship = vessel(deep(current=CurrentSettings(0.2, 0.1, std=0.3, time_constant=5.0)))
    before, currents = velocity_over_ground(ship), {ship.current}
    for _ in range(400):
        ship.advance(STEP)
        after = velocity_over_ground(ship)
        assert dist(before, after) < 0.02  # at most some m/s² for one step
        before = after
        currents.add(ship.current)
    assert len(currents) == pytest.approx(400 * STEP / HELD, abs=1)


def test_the_currents_wandering_has_its_strength_its_memory_and_its_seed() -> None:
    about = CurrentSettings(0.3, -0.2, std=0.1, time_constant=4.0)
    current, same, other = (Current(about, seed) for seed in (1, 1, 2))
    history = np.array([current.at(HELD * k) for k in range(40_000)])
    assert history.mean(axis=0) == pytest.approx((0.3, -0.2, 0.0), abs=0.02)
    assert history[:, :2].std(axis=0) == pytest.approx([0.1, 0.1], rel=0.1)
    lag = round(4.0 / HELD)
    kept = np.corrcoef(history[lag:, 0], history[:-lag, 0])[0, 1]
    assert kept == pytest.approx(exp(-1.0), abs=0.08)
    assert same.at(60.0) == tuple(history[round(60.0 / HELD)]) != other.at(60.0)


@law
@given(attitude, motion, st.floats(0, 100))
def test_with_a_tether_energy_is_only_lost_and_faster(
    q_NB: Quaternion, nu: Vec6, slack: float
) -> None:
    tethered = deep(tether=TetherSettings(slack=slack))
    ship, free = vessel(tethered, q_NB=q_NB, nu=nu), vessel(q_NB=q_NB, nu=nu)
    history = [energy(ship)]
    for _ in range(200):
        ship.advance(STEP)
        free.advance(STEP)
        history.append(energy(ship))
    assert all(b <= a + 1e-9 for a, b in pairwise(history))
    assert history[-1] <= energy(free) + 0.02 * history[0]


@law
@given(st.floats(0, 200), st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2))
def test_the_tether_pulls_against_the_motion_and_more_the_deeper(
    depth: float, north: float, east: float, down: float
) -> None:
    tether = Tether(TetherSettings(diameter=0.01, slack=10.0), 1025.0)
    shallow, deeper = (tether.pull(d, (north, east, down)) for d in (depth, 2 * depth + 1.0))
    pull_along = [pull * way for pull, way in zip(shallow, (north, east, down), strict=True)]
    assert max(pull_along) <= 0
    assert hypot(*deeper) >= hypot(*shallow)
    across = 0.25 * 1025.0 * 1.2 * 0.01 * (depth + 10.0) * (north**2 + east**2)
    assert hypot(*shallow[:2]) == pytest.approx(across)


@law
@given(attitude, motion)
def test_the_floor_creates_no_energy(q_NB: Quaternion, nu: Vec6) -> None:
    """It stores energy while it is pressed in, so compare what is left at the end."""
    ship = vessel(Settings(floor_depth=50.6), q_NB=q_NB, nu=nu)
    before = most = energy(ship)
    for _ in range(100):
        ship.advance(0.01)
        most = max(most, energy(ship))
    assert most <= before * 1.001 + 1e-6


slope = st.floats(-1.0, 1.0)


def test_a_hull_comes_to_rest_on_a_slope_that_it_does_not_slide_down() -> None:
    """Coulomb friction holds it at less than its own slope."""
    site = Settings(floor_depth=51.0, slope_north=0.2)
    ship = vessel(site, HEAVY, at=(40.0, 0.0, 58.0))
    assert not ship.around.floor_felt(ship.position, ship.attitude)
    ship.advance(20.0)
    north, east, down = ship.position
    assert abs(down - sea_floor(site).depth((north, east, 0.0))) < hypot(*NEUTRAL.size)
    assert ship.around.floor_felt(ship.position, ship.attitude)
    assert hypot(*velocity_over_ground(ship)) < 0.02


where = st.floats(-300.0, 300.0)
seeds = st.integers(0, 1000)
terrains = st.builds(Terrain, hills=st.floats(0.1, 5.0), length=st.floats(5.0, 100.0))


@law
@given(terrains, seeds, where, where)
def test_its_plane_touches_it(terrain: Terrain, seed: int, north: float, east: float) -> None:
    """At the place itself exactly; close by, better than linearly."""
    floor = sea_floor(Settings(terrain=terrain, slope_north=0.3, slope_east=-0.2), seed)
    (a, b, c), limit = floor.plane((north, east, 0.0))
    assert hypot(a, b, c) == pytest.approx(1.0)
    here = a * north + b * east + c * floor.depth((north, east, 0.0))
    assert here == pytest.approx(limit, abs=1e-9)
    for off in (1e-3, -1e-3):
        there = a * (north + off) + b * (east - off) + c * floor.depth((north + off, east - off, 0))
        assert abs(there - limit) < 1e-3 * terrain.hills


@law
@given(terrains, seeds)
def test_the_dive_begins_over_the_depth_of_the_settings(terrain: Terrain, seed: int) -> None:
    assert sea_floor(Settings(terrain=terrain), seed).depth((0.0, 0.0, 0.0)) == 20.0
    plane = sea_floor(Settings(slope_north=0.2, slope_east=-0.1), seed)
    assert not plane.rough
    assert plane.depth((3.0, 4.0, 0.0)) == pytest.approx(20.0 + 0.2 * 3.0 - 0.1 * 4.0)


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


@pytest.mark.parametrize("seed", [0, 1])
def test_a_heavy_hull_lands_on_a_hill_and_stays(seed: int) -> None:
    """It neither falls through nor is thrown up, wherever it comes down."""
    site = Settings(terrain=Terrain(hills=0.5, length=15.0))
    north, east = 7.0 * seed, -3.0 * seed
    floor = sea_floor(site, seed)
    top = floor.depth((north, east, 0.0))
    ship, fastest = vessel(site, HEAVY, at=(north, east, top - 1.0), seed=seed), 0.0
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
        ship = vessel(site, HEAVY, at=(float(north), 0.0, height), seed=1)
        assert not ship.around.near(ship.position)


def test_surge_with_a_tether_ends_where_both_drags_balance_thrust() -> None:
    ship = vessel(deep(tether=TetherSettings(diameter=0.01, slack=0.0)))
    ship.propulsion.drive([35.0, 35.0, 0.0, 0.0])
    ship.advance(15.0)
    linear = NEUTRAL.linear_damping[0]
    quadratic = NEUTRAL.quadratic_damping[0] + 0.25 * 1025.0 * 1.2 * 0.01 * ship.position[2]
    expected = (sqrt(linear**2 + 4 * quadratic * 70.0) - linear) / (2 * quadratic)
    assert ship.through_water[0] == pytest.approx(expected, rel=0.01)
    pull = ship.around.tether_pull(ship.position[2], ship.attitude, ship.through_water)
    assert pull[0] == pytest.approx(-quadratic * expected**2 + 25.0 * expected**2, rel=0.02)


@law
@given(slope, slope, st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_the_floor_slopes_as_its_settings_say(
    falls_north: float, falls_east: float, north: float, east: float
) -> None:
    """The direction into it is at a right angle to it, and leads to the depth below a place."""
    site = Settings(floor_depth=30.0, slope_north=falls_north, slope_east=falls_east)
    place = (north, east, 0.0)
    way, limit = sea_floor(site).plane(place)
    below = sea_floor(site).depth(place)
    assert below == pytest.approx(30.0 + falls_north * north + falls_east * east)
    assert sum(a * b for a, b in zip(way, (north, east, below), strict=True)) == pytest.approx(
        limit
    )
    assert hypot(*way) == pytest.approx(1.0)
    for along in ((1.0, 0.0, falls_north), (0.0, 1.0, falls_east)):
        assert sum(a * b for a, b in zip(way, along, strict=True)) == pytest.approx(0.0, abs=1e-12)
