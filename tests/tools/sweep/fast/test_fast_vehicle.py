"""Vehicles, thrusters and sensors in lanes beside the simulator's own, lane by lane."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.propulsion import Battery
from services.simulator.sensors import Sensors
from services.simulator.settings import Settings
from services.simulator.vessel import Vessel
from services.simulator.world import at_the_surface
from tools.sweep.fast.sensors import LaneSensors
from tools.sweep.fast.thrusters import LaneBattery
from tools.sweep.fast.vessel import Vessels

SEEDS = st.integers(0, 2**32 - 1)
GAP = 0.004  # [m] to floor and walls
PARTS = (0.0038, 0.0062, 0.01)  # [s] as a pressure sample divides an instant


def place_of(name: str, *overrides: str) -> tuple[Vehicle, Settings]:
    stack = Stack(pilot="script:first_dive", vehicle=name, overrides=list(overrides))
    return stack.section("vehicle", Vehicle), stack.section("simulator", Settings)


def narrow_place(name: str) -> tuple[Vehicle, Settings]:
    """Close above a sloping floor and beside each wall, on a tether."""
    vehicle, _ = place_of(name)
    length, width, height = vehicle.size
    floor = vehicle.floating_depth + height / 2 + GAP
    north, east = length / 2 + GAP, width / 2 + GAP
    return place_of(
        name,
        f"simulator.floor_depth={floor}",
        "simulator.slope_north=0.1",
        f"simulator.walls.north=[{-north}, {north}]",
        f"simulator.walls.east=[{-east}, {east}]",
        "simulator.tether.slack=3.0",
    )


def state_of(vessels: Vessels, lane: int) -> list[float]:
    numbers = *vessels.position, *vessels.attitude, *vessels.velocity
    return [float(np.broadcast_to(part, vessels.position[2].shape)[lane]) for part in numbers]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pioneer", "bluerov2_heavy", "minerva"])
@settings(max_examples=2)
@given(seed=SEEDS)
def test_a_lane_moves_as_its_vessel(name: str, seed: int):
    """From the surface to the floor and into the walls, with thrust that changes at random."""
    vehicle, site = narrow_place(name)
    world, rng = at_the_surface(vehicle, site), np.random.default_rng(seed)
    lanes = Vessels(vehicle, site, 3)
    battery = LaneBattery(vehicle, site, 3)
    alone = [Vessel(vehicle, site, world.state, world.thrust) for _ in range(3)]
    alone_batteries = [Battery(vehicle, site) for _ in range(3)]
    most = np.array([[thruster.max_thrust] for thruster in vehicle.thruster])
    down = np.array([[abs(thruster.direction[2])] for thruster in vehicle.thruster])
    for _ in range(3):
        thrust = most * np.clip(rng.normal(down, 0.4, (len(most), 3)), -1.3, 1.3)
        lanes.thrusters.drive(thrust)
        for lane, vessel in enumerate(alone):
            limited = np.clip(thrust[:, lane], -most[:, 0], most[:, 0])
            reverse = [t.limits[0] for t in vehicle.thruster]
            vessel.propulsion.drive(np.maximum(limited, reverse).tolist())
        for seconds in PARTS * 4:
            lanes.advance(seconds)
            battery.feed(lanes.thrusters.produced, seconds)
            for vessel, single in zip(alone, alone_batteries, strict=True):
                vessel.advance(seconds)
                single.feed(vessel.propulsion.produced, seconds)
        for lane, vessel in enumerate(alone):
            assert state_of(lanes, lane) == pytest.approx(vessel.state, abs=1e-9)
            felt = [float(part[lane]) for part in lanes.acceleration]
            assert felt == pytest.approx(vessel.acceleration, abs=1e-7)
            assert battery.used_wh[lane] == pytest.approx(alone_batteries[lane].used_wh, rel=1e-9)


def test_a_hull_meets_the_floor_in_that_test():
    """Else it would hold nothing against it."""
    found = list[float]()
    for vehicle, site in (narrow_place("pioneer"), place_of("pioneer")):
        vessels = Vessels(vehicle, site, 1)
        vessels.thrusters.drive(np.array([[0.0], [0.0], [0.0], [30.0]]))
        vessels.advance(0.24)
        found.append(float(vessels.position[2][0]))
    assert found[1] - found[0] > 0.01


EVERYTHING = (
    "simulator.accelerometer_drift=0.02", "simulator.accelerometer_walk=0.01",
    "simulator.gyro_walk=0.001", "simulator.warm_up=5.0", "simulator.gyro_temperature=0.001",
    "simulator.accelerometer_temperature=0.01", "simulator.gyro_step=1e-4",
    "simulator.accelerometer_step=0.01", "simulator.pressure_step=20.0",
)  # fmt: skip


@pytest.mark.parametrize("overrides", [(), EVERYTHING])
def test_a_lane_has_the_samples_of_its_seed(overrides: tuple[str, ...]):
    vehicle, site = place_of("pioneer", *overrides)
    seeds = [3, 1, 4]
    lanes, vessels = LaneSensors(site, seeds), Vessels(vehicle, site, 3)
    world = at_the_surface(vehicle, site)
    vessel = Vessel(vehicle, site, world.state, world.thrust)
    alone = [Sensors(site, seed) for seed in seeds]
    thrust = [5.0, 3.0, 2.0, 20.0]
    vessel.propulsion.drive(thrust)
    vessels.thrusters.drive(np.array([[newtons] * 3 for newtons in thrust]))
    for k in range(1, 1100):  # more than a block of noise
        if k % 10 == 0:
            vessel.advance(0.01)
            vessels.advance(0.01)
        at = k * 10_000_000
        force, rate = lanes.imu((at - 10_000_000) * 1e-9, vessels)
        pressure = lanes.pressure(vessels.position[2])
        for lane, sensors in enumerate(alone):
            sample: Any = sensors.imu(
                at, vessel.attitude, vessel.through_water, vessel.acceleration
            )
            assert [x[lane] for x in force] == pytest.approx(sample.specific_force, abs=1e-9)
            assert [x[lane] for x in rate] == pytest.approx(sample.angular_rate, abs=1e-12)
            exact = sensors.pressure(at, vessel.position[2]).pressure
            assert pressure[lane] == pytest.approx(exact, abs=1e-6)
