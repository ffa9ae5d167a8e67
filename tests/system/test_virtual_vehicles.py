"""Every vehicle file in the whole chain on virtual time: it dives, stops, holds, is disturbed.
Depths and headings are the simulator's truth, so that errors of the sensors count."""

from math import inf, radians

import numpy as np
import pytest
from numpy.typing import NDArray

from messages.pilot import FlightMode
from messages.simulator import FaultKind
from tests.support.dive import DEEP, HANDS_OFF, Sortie, SortieRow

pytestmark = pytest.mark.slow

VEHICLES = ("pioneer", "bluerov2_heavy", "minerva")
FULL = {"pioneer": 0.5, "bluerov2_heavy": 0.4, "minerva": 0.2}  # [m/s] at full heave stick
NEAR_FLOOR = "simulator.floor_depth=25"  # [m] in reach of every DVL
DVL = ("simulator.dvl.rate=4.0", "simulator.dvl.std=0.01", "simulator.dvl.reach=100.0")
DOWN: SortieRow = (1.0, (0.0, 0.0, 1.0, 0.0))


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


def test_heave_and_yaw_stop_without_bounce_or_overshoot() -> None:
    """Moves of all sizes, both ways, with five quiet seconds after each."""
    moves = ((1.0, 0.5, 4.0), (-0.6, -1.0, 2.5), (0.3, 1.0, 3.0), (0.6, -0.5, 1.5), (-1.0, 1.0, 2))
    rows: list[SortieRow] = []
    ends: list[tuple[float, float, float]] = []
    t = 1.0
    for heave, yaw, seconds in moves:
        rows += [(t, (0.0, 0.0, heave, yaw)), (t + seconds, HANDS_OFF)]
        ends.append((t + seconds, heave, yaw))
        t += seconds + 5.0
    sortie = Sortie(rows).until(t)
    for end, heave, yaw in ends:
        quiet = sortie.columns(end, end + 5.0)
        assert past_rest(quiet.depth * np.sign(heave)) < 0.04  # [m]
        assert past_rest(quiet.heading * np.sign(yaw)) < radians(1.0)


def past_rest(way: NDArray[np.float64]) -> float:
    """From the furthest point to where it settles, the mean of the last second."""
    return float(way.max()) - float(way[-100:].mean())


@pytest.mark.parametrize("force", [-10.0, 10.0])
def test_a_weight_that_drops_moves_it_no_further_than_5_cm(force: float) -> None:
    """[N] of buoyancy."""
    sortie = Sortie([(1.0, (0.0, 0.0, 0.8, 0.0)), (6.0, HANDS_OFF)]).until(14.0)
    sortie.become(f"vehicle.net_buoyancy={1.0 + force}")
    sortie.until(22.0)
    before = sortie.columns(11.0, 14.0).depth.mean()
    assert np.abs(sortie.columns(14.0).depth - before).max() < 0.05


@pytest.mark.parametrize("vehicle", VEHICLES)
def test_from_the_sea_floor_it_does_not_jump(vehicle: str) -> None:
    """Ten seconds of full heave stick on it, then hands off."""
    floor = 2.0  # [m]
    let_go = 1.0 + floor / FULL[vehicle] + 2.0 + 10.0
    place = (f"simulator.floor_depth={floor}",)
    sortie = Sortie([DOWN, (let_go, HANDS_OFF)], vehicle=vehicle, overrides=place)
    sortie.until(let_go + 12.0)
    pushed, after = sortie.columns(let_go - 1.0, let_go), sortie.columns(let_go)
    assert pushed.depth.mean() - after.depth.min() < 0.05
    full = [m.saturated for m in sortie.wrenches[-len(after.depth) :]]
    assert not any(full[150:]), "off their limits within 1.5 s"


@pytest.mark.parametrize("vehicle", ["pioneer", "minerva"])
def test_modes_change_without_a_bump(vehicle: str) -> None:
    """How far an axis that is held afterwards is from what it was at the change, two seconds
    long."""
    modes: list[FlightMode] = ["manual", "depth_hold", "heading_hold", "stabilised"]
    if vehicle == "minerva":
        modes.append("station_keeping")
    down = 5.0 / FULL[vehicle]  # [s]
    rows = [DOWN, (1.0 + down, HANDS_OFF)]
    sortie = Sortie(rows, vehicle=vehicle, overrides=(NEAR_FLOOR,)).until(9.0 + down)
    for mode in modes:
        begin = len(sortie.references)
        sortie.hold(mode)
        sortie.until(sortie.t + 2.5)
        assert sortie.flight_mode == mode
        true = {m.stamp_ns: m for m in sortie.truth}
        pairs = [(r, true[r.sensor_ns]) for r in sortie.references[begin:] if r.sensor_ns in true]
        depth = [r.depth.position - t.position[2] for r, t in pairs[:200] if r.heave_force is None]
        heading = [r.heading.position - t.heading for r, t in pairs[:200] if r.yaw_moment is None]
        assert spread(depth) < 0.03  # [m] with the noise of the depth sensor
        assert spread(heading) < radians(0.5)


def spread(error: list[float]) -> float:
    """Furthest from the first."""
    return max((abs(e - error[0]) for e in error), default=0.0)


@pytest.mark.parametrize(
    ("vehicle", "north", "after", "more"),
    [("minerva", -1.0, 45.0, ()), ("bluerov2_heavy", -0.6, 40.0, DVL)],
)
def test_a_place_is_kept_in_a_current_as_long_as_there_is_the_thrust(
    vehicle: str, north: float, after: float, more: tuple[str, ...]
) -> None:
    """[m/s], from so many seconds on."""
    overrides = (f"simulator.current.north={north}", NEAR_FLOOR, *more)
    rows = [(1.0, (0.0, 0.0, 0.8, 0.0)), (6.0, HANDS_OFF)]
    sortie = Sortie(rows, vehicle=vehicle, overrides=overrides).until(15.0)
    sortie.hold("station_keeping")
    sortie.until(15.0 + after + 15.0)
    seen = sortie.columns(15.0 + after)
    away = np.hypot(seen.north - seen.north.mean(), seen.east - seen.east.mean())
    assert (away.max() if sortie.references[-1].north is not None else inf) < 0.3


def test_a_dead_thruster_costs_neither_depth_nor_heading() -> None:
    """Of a BlueROV2 that loses it while it runs ahead."""
    rows = [DOWN, (8.0, HANDS_OFF), (16.0, (0.6, 0.0, 0.0, 0.0)), (26.0, HANDS_OFF)]
    sortie = Sortie(rows, vehicle="bluerov2_heavy").until(20.0)
    sortie.set_faults("vertical_aft_port", "dead")
    sortie.until(32.0)
    before, after = sortie.columns(18.0, 20.0), sortie.columns(20.0)
    assert np.abs(after.depth - before.depth.mean()).max() < 0.05
    assert np.abs(after.heading - before.heading.mean())[-100:].mean() < radians(2.0)


# [N] at most; without an IMU the depth rate comes from pressure alone, late and noisy.
LOST: list[tuple[str, FaultKind, float]] = [
    ("sensor/pressure", "silent", 3.5),
    ("sensor/magnetometer", "frozen", 3.5),
    ("sensor/imu", "frozen", 12.0),
    ("sensor/imu", "silent", 12.0),
]


@pytest.mark.parametrize(("part", "fault", "most"), LOST)
def test_a_lost_sensor_makes_no_wild_thrust(part: str, fault: FaultKind, most: float) -> None:
    """In the 15 s after it is lost, hands off."""
    sortie = Sortie([DOWN, (6.0, HANDS_OFF)], overrides=(DEEP,)).until(16.0)
    sortie.set_faults(part, fault)
    sortie.until(31.0)
    before, after = sortie.columns(12.0, 16.0).thrust, sortie.columns(16.0).thrust
    assert np.abs(after - before.mean(axis=0)).max() < most
