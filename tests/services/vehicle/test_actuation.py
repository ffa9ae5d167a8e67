"""What an ESC is asked for, and what an open-loop thruster is believed to do."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from services.marine.vehicle import CURVES, Lag, Thruster, Vehicle, driven
from services.runtime.config.stack import Stack
from services.simulator.propulsion import SimulatedThrusters
from services.vehicle.actuation import OpenLoopThrust, share_of_voltage

S = 1_000_000_000  # [ns]
T200 = Thruster(
    "t200", (0, 0, 0), (1, 0, 0), max_thrust=30.0, max_reverse=25.0, dead_band=1.0, curve="t200"
)
LINEAR = Thruster("linear", (0, 0, 0), (1, 0, 0), max_thrust=40.0, max_reverse=20.0, dead_band=1.0)
SLOW = Thruster(
    "slow", (0, 0, 0), (1, 0, 0), max_thrust=40.0, lag=Lag([1.0, 25.0], [1.0, 6.0, 25.0])
)
COMMANDS = st.lists(st.tuples(st.floats(0.0, 0.5), st.floats(-60, 60)), min_size=1, max_size=12)


@given(st.floats(-60, 60))
def test_the_share_gives_the_thrust_back_through_the_curve(newtons: float) -> None:
    share = share_of_voltage(T200, newtons)
    assert -1.0 <= share <= 1.0
    assert CURVES["t200"].thrust(share) == pytest.approx(driven(T200, newtons), abs=1e-9)


@pytest.mark.parametrize(
    ("newtons", "share"),
    [(40.0, 1.0), (90.0, 1.0), (20.0, 0.5), (-20.0, -1.0), (-5.0, -0.25), (0.9, 0.0), (0.0, 0.0)],
)
def test_without_a_curve_it_is_a_share_of_the_limit(newtons: float, share: float) -> None:
    assert share_of_voltage(LINEAR, newtons) == pytest.approx(share)


@given(COMMANDS)
def test_it_is_what_the_simulated_thrusters_do(commands: list[tuple[float, float]]) -> None:
    pioneer = Stack().section("vehicle", Vehicle)
    lags = [SLOW, *pioneer.thruster[1:]]
    believed, now = OpenLoopThrust(lags), 0
    simulated = SimulatedThrusters(replace(pioneer, thruster=lags), [0.0] * len(lags))
    for later, newtons in commands:
        now += round(later * S)
        simulated.age += round(later * S) / S
        assert believed.believed(now) == pytest.approx(simulated.thrust, abs=1e-6)
        believed.drive([newtons] * len(lags), now)
        simulated.drive([newtons] * len(lags))
