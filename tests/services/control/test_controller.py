"""The vehicle's controller: what it does when its inputs are missing."""

import math

from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from services.control.core import Controller, Settings
from services.marine.vehicle import Vehicle
from services.runtime.stack import Stack

PIONEER = Stack().section("vehicle", Vehicle)


def controller() -> Controller:
    return Controller(Settings(), PIONEER)


def state(depth: float = 1.0, *, valid: bool = True) -> VehicleState:
    return VehicleState(
        stamp_ns=0,
        sensor_ns=7,
        phase="running",
        depth=Estimate(depth, 0.01, valid),
        depth_rate=Estimate(0.0, 0.01, valid),
        depth_acceleration=Estimate(0.0, 0.01),
        attitude=(1.0, 0.0, 0.0, 0.0),
        roll=Estimate(0.0, 0.01),
        pitch=Estimate(0.0, 0.01),
        heading=Estimate(0.0, 0.01),
        heading_navigation=None,
        yaw_rate=Estimate(0.0, 0.01),
    )


def reference(depth: float = 1.0, surge: float = 0.0, *, armed: bool = True) -> Reference:
    return Reference(
        stamp_ns=0,
        sensor_ns=7,
        pilot_ns=5,
        armed=armed,
        depth=Motion(depth, 0.0, 0.0, 0.0),
        heading=Motion(0.0, 0.0, 0.0, 0.0),
        surge_force=surge,
        sway_force=0.0,
    )


def test_too_shallow_means_thrust_downwards() -> None:
    wrench, command = controller().step(reference(depth=1.1), state(depth=1.0), 0)
    assert wrench.wanted[2] > 0
    assert command.thrust[3] > 0
    assert (command.sensor_ns, command.pilot_ns) == (7, 5)


def test_disarmed_means_no_thrust_whatever_else_is_said() -> None:
    _, command = controller().step(reference(depth=5.0, surge=30.0, armed=False), state(), 0)
    assert set(command.thrust) == {0.0}


def test_without_a_state_the_thrusters_stop_and_it_is_counted() -> None:
    law = controller()
    _, command = law.step(reference(surge=30.0), None, 0)
    assert set(command.thrust) == {0.0}
    assert law.happened == ["stale:state"]


def test_when_the_reference_dies_the_last_position_is_held_without_surge() -> None:
    law = controller()
    law.step(reference(depth=1.2, surge=30.0), state(), 0)
    wrench, _ = law.step(None, state(depth=1.2), 10_000_000)
    assert wrench.wanted[0] == 0.0
    assert abs(wrench.wanted[2]) < 1.0
    assert law.step(None, state(depth=1.0), 20_000_000)[0].wanted[2] > 5.0


def test_before_any_reference_there_is_no_thrust() -> None:
    _, command = controller().step(None, state(), 0)
    assert set(command.thrust) == {0.0}


def test_an_invalid_depth_is_not_fed_back() -> None:
    law = controller()
    wrench, _ = law.step(reference(depth=9.0), state(valid=False), 0)
    assert wrench.wanted[2] == 0.0
    assert "invalid:state.depth" in law.happened


def test_a_result_that_is_not_finite_never_reaches_a_thruster() -> None:
    law = controller()
    _, command = law.step(reference(surge=math.inf), state(), 0)
    assert set(command.thrust) == {0.0}
    assert "not_finite:wrench" in law.happened


def test_disarming_forgets_what_the_integrators_learnt() -> None:
    law = controller()
    for k in range(100):
        law.step(reference(depth=1.05), state(), k * 10_000_000)
    learnt, _ = law.step(reference(depth=1.05), state(), 10**9)
    assert learnt.depth_integral > 0
    law.step(reference(armed=False), state(), 10**9)
    assert law.step(reference(), state(), 10**9)[0].depth_integral == 0.0


def test_a_saturation_is_counted_once_per_passage() -> None:
    law = controller()
    for k in range(10):
        law.step(reference(surge=100.0), state(), k * 10_000_000)
    assert len(law.happened) == 1
    assert law.happened[0].startswith("saturated:")
    law.step(reference(surge=1.0), state(), 10**9)
    law.step(reference(surge=100.0), state(), 10**9)
    assert len(law.happened) == 2
