"""Truth beside estimate in whole dives on virtual time: the errors are as small as they should be,
and no larger than the state itself says."""

from functools import cache
from math import cos, degrees, hypot, pi, radians, remainder, sin
from typing import NamedTuple

import numpy as np
import pytest

from messages import events, topics
from messages.message import Estimate
from messages.state import VehicleState
from messages.vehicle import Truth
from tests.support.dive import Dive

S = 1_000_000_000  # [ns]
CALIBRATED, FLOWN = 10.1, 34.0  # [s]
# Down, turn, ahead in a curve, up, turn back, down again: no axis is spared.
SCRIPT = """t,surge,sway,heave,yaw
1,0,0,0.8,0
8,0,0,0,0.5
12,0.4,0,0,0.2
18,0,0,-0.6,0
22,0,0,0,-0.8
26,0,0,1,0
32,0,0,0,0
40,0,0,0,0
"""


class Errors(NamedTuple):
    """Of one part of the state, with the standard deviation stated for each."""

    error: np.ndarray
    std: np.ndarray

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def within_four(self) -> float:
        """[-] share of the samples."""
        return float(np.mean(np.abs(self.error) <= 4.0 * self.std))


@cache
def flown(seed: int, *settings: str) -> dict[str, Errors]:
    """A dive from power-on with the default calibration; what the estimates were worth."""
    return compared(*sailed(seed, *settings))


def sailed(
    seed: int, *settings: str, vehicle: str = "pioneer"
) -> tuple[list[VehicleState], dict[int, Truth]]:
    """The states of such a dive from the end of calibration on, and the truth by its stamp."""
    dive = Dive(
        SCRIPT, still_s=10.0, vehicle=vehicle, link="perfect", seed=seed,
        overrides=["simulator.floor_depth=20", *settings],
    )  # fmt: skip
    truth: dict[int, Truth] = {}
    dive.ears().each(topics.TRUTH, lambda m, _: truth.update({m.stamp_ns: m}))
    states = dive.heard(topics.STATE)
    dive.run(CALIBRATED + FLOWN)
    assert events.INCONSISTENT_IMU.name not in dive.counts
    running = [state for state in states if state.phase == "running" and state.sensor_ns in truth]
    assert len(running) > 0.99 * FLOWN * topics.IMU.hz
    return running, truth


def compared(states: list[VehicleState], truth: dict[int, Truth]) -> dict[str, Errors]:
    # The control heading counts from where it was at the end of calibration.
    first = states[0]
    began = first.heading.value - truth[first.sensor_ns].heading
    rows: dict[str, list[tuple[float, float]]] = {}
    for state in states:
        true, north = truth[state.sensor_ns], state.heading_navigation
        assert north is not None
        parts: dict[str, tuple[Estimate, float]] = {
            "depth": (state.depth, true.position[2]),
            "rate": (state.depth_rate, true.depth_rate),
            "control": (state.heading, true.heading + began),
            "navigation": (north, true.heading),
            "roll": (state.roll, true.roll),
            "pitch": (state.pitch, true.pitch),
        }
        for name, (part, value) in parts.items():
            assert part.valid
            error = part.value - value
            wrapped = error if name in ("depth", "rate") else remainder(error, 2.0 * pi)
            rows.setdefault(name, []).append((wrapped, part.std))
    return {name: Errors(*np.array(pairs).T) for name, pairs in rows.items()}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_errors_are_small_and_no_larger_than_the_state_says(seed: int) -> None:
    found = flown(seed)
    for name, errors in found.items():
        assert errors.within_four >= 0.99, name
    # Pressure of σ 5 cm, a typical MEMS unit: 10 mg, 0.6 °/s, 0.2 µT of iron.
    assert found["depth"].rms <= 0.012
    assert found["rate"].rms <= 0.010
    assert degrees(found["control"].rms) <= 0.3
    assert degrees(found["navigation"].rms) <= 3.0
    # A spread that is far too large would also never be left.
    assert found["depth"].rms > 0.4 * float(np.mean(found["depth"].std))
    assert found["rate"].rms > 0.3 * float(np.mean(found["rate"].std))


def rolled_and_pitched(roll: float, pitch: float) -> list[list[float]]:
    """R_BS of a sensor turned by pitch, then by roll [rad], as a person writes it: three digits."""
    cr, sr, cp, sp = cos(roll), sin(roll), cos(pitch), sin(pitch)
    matrix = [[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]]
    return [[round(part, 4) for part in row] for row in matrix]


@pytest.mark.slow
def test_a_mounted_imu_is_as_good_as_one_at_the_origin() -> None:
    at_origin = flown(0)
    mounted = flown(
        0,
        f"vehicle.mounting.imu.rotation={rolled_and_pitched(radians(5.0), radians(3.0))}",
        "vehicle.mounting.imu.position=[0.2, 0.05, 0.1]",
    )
    for name, errors in mounted.items():
        assert errors.within_four >= 0.99, name
        assert errors.rms <= 1.2 * at_origin[name].rms + radians(0.06), name


ARMS = (
    "vehicle.mounting.dvl.position=[1.0, 0.3, 0.5]",
    "vehicle.mounting.dvl.rotation=[[0.7071,-0.7071,0.0],[0.7071,0.7071,0.0],[0.0,0.0,1.0]]",
    "vehicle.mounting.usbl.position=[-0.8, 0.2, -0.6]",
    "vehicle.mounting.pressure.position=[0.5, 0.2, 0.3]",
    "vehicle.mounting.magnetometer.rotation=[[0.0,1.0,0.0],[-1.0,0.0,0.0],[0.0,0.0,1.0]]",
)


@pytest.mark.slow
def test_the_other_sensors_may_be_mounted_as_well() -> None:
    """Unsaid, these mountings put the position 1.5 m and the velocity 0.2 m/s off."""
    states, truth = sailed(
        1, "vehicle.mounting.imu.position=[0.2, 0.05, 0.1]", *ARMS, vehicle="minerva"
    )
    errors: list[tuple[float, float, float]] = []
    for state in states:
        true = truth[state.sensor_ns]
        if state.north is None or state.east is None or state.stamp_ns < 20 * S:
            continue
        assert state.surge_velocity is not None
        assert state.sway_velocity is not None
        assert state.heading_navigation is not None
        place = hypot(state.north.value - true.position[0], state.east.value - true.position[1])
        surge, sway, _ = true.velocity
        speed = hypot(state.surge_velocity.value - surge, state.sway_velocity.value - sway)
        errors.append((place, speed, state.depth.value - true.position[2]))
    assert len(errors) > 2000
    place, speed, depth = np.sqrt(np.mean(np.array(errors) ** 2, axis=0)).tolist()
    assert place < 0.2  # [m]
    assert speed < 0.04  # [m/s]
    assert depth < 0.02  # [m]
