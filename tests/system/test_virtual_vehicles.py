"""Every vehicle file in the whole chain on virtual time: it dives, stops, holds, is disturbed."""

from math import radians

import pytest

from messages.simulator import FaultKind
from tests.support.goal_runs import (
    DVL,
    NEAR_FLOOR,
    buoyancy_step,
    dead_thruster,
    floor_push,
    lost_sensor,
    mode_changes,
    place_held,
    releases,
)
from tests.support.sortie import HANDS_OFF, Sortie

VEHICLES = ("pioneer", "bluerov2_heavy", "minerva")


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_every_vehicle_dives_stops_and_holds(vehicle: str) -> None:
    rows = [(1.0, (0.0, 0.0, 1.0, 0.5)), (9.0, HANDS_OFF)]
    sortie = Sortie(rows, vehicle=vehicle, seed=1).until(24.0)
    moved, rest = sortie.columns(9.0), sortie.columns(19.0)
    assert moved.depth[0] > 0.8  # it went down and round
    assert moved.heading[0] - sortie.columns(0.0, 1.0).heading[0] > radians(60.0)
    assert moved.depth.max() - rest.depth.mean() < 0.05
    assert moved.heading.max() - rest.heading.mean() < radians(1.0)
    assert abs(rest.depth - rest.depth.mean()).max() < 0.05
    assert abs(rest.heading - rest.heading.mean()).max() < radians(1.0)
    assert not any("not_finite" in name for name in sortie.counts)


@pytest.mark.slow
def test_heave_and_yaw_stop_without_bounce_or_overshoot() -> None:
    alone = [r for r in releases(0, 40.0) if r.horizontal == "centred"]
    assert {r.axis for r in alone} == {"heave", "yaw"}
    assert max(r.overshoot for r in alone if r.axis == "heave") < 0.04
    assert max(r.overshoot for r in alone if r.axis == "yaw") < radians(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("force", [-10.0, 10.0])
def test_a_weight_that_drops_moves_it_no_further_than_5_cm(force: float) -> None:
    assert buoyancy_step(0, force) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", VEHICLES)
def test_from_the_sea_floor_it_does_not_jump(vehicle: str) -> None:
    push = floor_push(vehicle, 0)
    assert push.rebound < 0.05
    assert push.unsaturated < 1.5


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["pioneer", "minerva"])
def test_modes_change_without_a_bump(vehicle: str) -> None:
    bump = mode_changes(vehicle, seed=0, changes=3)
    assert bump.depth < 0.03  # with the noise of the depth sensor
    assert bump.heading < radians(0.5)


@pytest.mark.slow
def test_minerva_keeps_her_place_in_a_current_of_1_metre_per_second() -> None:
    held = place_held("minerva", north=-1.0, seed=0, after=45.0, seconds=15.0)
    assert held.place < 0.3


@pytest.mark.slow
def test_a_bluerov_with_a_dvl_keeps_its_place_as_long_as_it_has_the_thrust() -> None:
    current = (NEAR_FLOOR, *DVL)
    held = place_held(
        "bluerov2_heavy", north=-0.6, seed=0, after=40.0, seconds=15.0, overrides=current
    )
    assert held.place < 0.3


@pytest.mark.slow
def test_a_dead_thruster_costs_neither_depth_nor_heading() -> None:
    away = dead_thruster("vertical_aft_port", 0)
    assert away.depth < 0.05
    assert away.left < radians(2.0)


# [N] at most; without an IMU the depth rate comes from pressure alone, late and noisy.
LOST: list[tuple[str, FaultKind, float]] = [
    ("sensor/pressure", "silent", 3.5),
    ("sensor/magnetometer", "frozen", 3.5),
    ("sensor/imu", "frozen", 12.0),
    ("sensor/imu", "silent", 12.0),
]


@pytest.mark.slow
@pytest.mark.parametrize(("part", "fault", "most"), LOST)
def test_a_lost_sensor_makes_no_wild_thrust(part: str, fault: FaultKind, most: float) -> None:
    assert lost_sensor(part, fault, 0) < most
