"""The model of the fit is the simulator's, and its thrust that of the simulated thrusters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.attitude import down_in_body, from_euler
from services.marine.vehicle import Lag, Vehicle, modes_of
from services.runtime.config.stack import Stack
from services.simulator.propulsion import SimulatedThrusters
from services.simulator.vessel import equations_of_motion
from tools.identify.motion_model import (
    CommandedThrust,
    Floats,
    Measured,
    coefficients,
    lagged,
    predict,
)

ROWS = [0, 1, 2, 5]
numbers = st.floats(-2.0, 2.0)


@pytest.mark.parametrize("name", ["pioneer", "bluerov2_heavy", "minerva"])
@settings(max_examples=20, deadline=None)
@given(nu=st.tuples(*[numbers] * 6), tilt=st.tuples(numbers, numbers), share=st.floats(0.0, 1.0))
def test_it_accelerates_as_the_simulated_vehicle(
    name: str, nu: tuple[float, ...], tilt: tuple[float, float], share: float
) -> None:
    vehicle = Stack(vehicle=name).section("vehicle", Vehicle)
    q_NB = from_euler(tilt[0] / 4, tilt[1] / 4, 1.0)
    u, v, w, p, q, r = nu
    expected = equations_of_motion(vehicle, share)(
        50.0, q_NB, (u, v, w, p, q, r), (5.0, -4.0, 3.0, 0.0, 0.0, 2.0)
    )
    wrench = np.tile([5.0, -4.0, 3.0, 2.0], (1, 1, 2, 1))
    down = np.tile(down_in_body(q_NB), (1, 1, 2, 1))
    rates = np.tile([p, q], (1, 2, 1))
    measured = Measured(0.01, wrench, wrench[:, :, :1], rates, down)
    begin = np.array(nu)[ROWS].reshape(1, 1, 4)
    found = predict(coefficients([vehicle], share), begin, measured).acceleration[0, 0, 0]
    assert found == pytest.approx(np.array(expected)[ROWS], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", ["pioneer", "bluerov2_heavy"])
def test_its_thrust_is_that_of_the_simulated_thrusters(name: str) -> None:
    vehicle = Stack(vehicle=name).section("vehicle", Vehicle)
    rng = np.random.default_rng(5)
    t = np.cumsum(rng.choice([0.01, 0.013, 3.0], 60))
    commands = rng.uniform(-20.0, 20.0, (60, len(vehicle.thruster)))
    simulated = SimulatedThrusters(vehicle, [0.0] * len(vehicle.thruster))
    expected = list[tuple[float, ...]]()
    for row, wait in zip(commands.tolist(), np.diff(t, append=t[-1] + 0.05).tolist(), strict=True):
        simulated.drive(row)
        expected.append(simulated.wrench(0.7 * wait))
        simulated.age += wait
    at = t + 0.7 * np.diff(t, append=t[-1] + 0.05)
    found = CommandedThrust(vehicle, t, commands).wrench(at).value
    assert found == pytest.approx(np.array(expected), abs=1e-9)


def test_the_integral_is_the_sum_of_many_short_means() -> None:
    rng = np.random.default_rng(6)
    t = np.cumsum(rng.uniform(0.005, 0.2, 50))
    settles = rng.normal(size=(50, 2))
    at: Floats = np.linspace(float(t[0]), float(t[-1]) + 1.0, 40_001)
    curved = Lag(numerator=[6136.0, 108700.0], denominator=[1.0, 89.0, 9258.0, 108700.0])
    found = lagged(t, settles, modes_of(curved), at)
    means: Floats = (found.value[1:] + found.value[:-1]) / 2 * np.diff(at)[:, None]
    assert found.integral[-1] == pytest.approx(means.sum(axis=0), abs=1e-5)
