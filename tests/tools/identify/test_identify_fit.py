"""The fit finds the vehicle that made the data, by the model and the thrust of the simulator."""

from collections import Counter
from math import nan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.marine.attitude import down_in_body, from_euler
from services.marine.vehicle import Lag, Vehicle, modes_of
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.simulator.hull import Hull, in_the_water
from services.simulator.propulsion import SimulatedThrusters
from services.simulator.vessel import equations_of_motion
from tools.identify.dive_data import FitInput, Windows
from tools.identify.fit import fit
from tools.identify.motion_model import (
    AXES,
    BUOYANCY,
    LAG,
    Beginning,
    CommandedThrust,
    Floats,
    Measured,
    coefficients,
    lagged,
    predict,
    start_of,
)
from tools.identify.search import descended

FILE = Stack().section("vehicle", Vehicle)
TRUTH = in_the_water(
    FILE,
    Hull(
        net_buoyancy=2.0,
        added_mass=(5.22, 19.87, 15.0, 0.097, 0.182, 0.11),
        linear_damping=(1.84, 3.18, 0.9, 0.87, 0.87, 0.6),
        quadratic_damping=(25.0, 45.7, 20.0, 1.53, 1.53, 2.0),
        time_constant=0.12,
    ),
)
PERIOD, COUNT, SHIFT = 0.01, 800, 4
FORCE, RATE, DEPTH = 0.015, 0.0012, 0.05  # std of a sample
TURNS = {"heave": (12.0, 0.0), "yaw": (0.0, 2.5), "both": (12.0, 2.5), "none": (0.0, 0.0)}


def steps(excited: str, shift: float, seed: int) -> tuple[Floats, Floats]:
    """Times [s] and commands [N]: steps of random length and size."""
    rng = np.random.default_rng(seed)
    t: Floats = np.arange(-100.0, 4000 + COUNT) * PERIOD + shift
    heave, turn = TURNS[excited]
    levels = rng.uniform(-1.0, 1.0, (len(t) // 90 + 1, 2)).repeat(90, axis=0)[: len(t)]
    side = turn * levels[:, 1] / 0.172
    zero = np.zeros(len(t))
    return t, np.stack([side, -side, zero, heave * levels[:, 0]], axis=-1)


def made(
    excited: str = "both", noise: float = 1.0, seed: int = 0, shift: float = 0.0, windows: int = 4,
    gap: float = 10.0,
) -> FitInput:  # fmt: skip
    """What a level vehicle would measure that moves as the model says."""
    rng = np.random.default_rng([seed, 1])
    commands = CommandedThrust(TRUTH, *steps(excited, shift, seed))
    begins = shift + gap * np.arange(windows)
    t = begins[:, None] + PERIOD * np.arange(COUNT)
    ends = np.column_stack([t[:, ::2], t[:, -1] + PERIOD])
    rows = [0, 1, 2, 5]
    lag = TRUTH.thruster[0].time_constant
    wrench = commands.wrench(t.ravel(), lag).value.reshape(windows, COUNT, 6)[..., rows]
    whole = commands.wrench(ends.ravel(), lag).integral.reshape(windows, -1, 6)[..., rows]
    mean = np.diff(whole, axis=1) / (2 * PERIOD)
    down = np.zeros((windows, COUNT, 3))
    down[..., 2] = 1.0
    measured = Measured(PERIOD, wrench[None], mean[None], np.zeros((windows, COUNT, 2)), down[None])
    begin = np.zeros((1, windows, 4))
    begin[..., 2] = 0.05
    motion = predict(coefficients([TRUTH], 1.0), begin, measured)
    rates = np.zeros((windows, COUNT, 3))
    rates[..., 2] = motion.velocity[0, ..., 3] + noise * RATE * rng.normal(size=(windows, COUNT))
    force = motion.force[0] + 0.05 + noise * FORCE * rng.normal(size=(windows, COUNT, 3))
    tilted = np.zeros((windows, COUNT, 3, 2))
    tilted[..., 0, 0] = tilted[..., 1, 1] = 1.0
    depth = [7.0 + d[::2] + noise * DEPTH * rng.normal(size=COUNT // 2) for d in motion.depth[0]]
    every: Floats = PERIOD * np.arange(0.0, COUNT, 2.0)
    times = [every] * windows
    found = Windows(PERIOD, t, rates, force, down, tilted, begin[0], times, depth, Counter[str]())
    return FitInput(found, commands, wrench, mean, 1e-6, 1.0, fits_lag=True)


def coasting(seed: int, surge: float) -> FitInput:
    """Three windows, one after the other, of a drone that coasts along while it heaves and turns;
    nothing but its motion tells how fast.

    Args:
        surge: [m/s] at the begin.
    """
    rng = np.random.default_rng([seed, 2])
    taken = made("both", 0.0, seed, windows=3, gap=COUNT * PERIOD)
    w = taken.windows
    begin: Floats = np.array([[[surge, 0.0, 0.05, 0.0]]])
    rates, force, depth = w.rates.copy(), w.force.copy(), list[Floats]()
    begins = w.begin.copy()
    for k in range(len(w.t)):
        now = slice(k, k + 1)
        measured = Measured(
            PERIOD, taken.wrench[None, now], taken.mean[None, now], w.rates[now, :, :2],
            w.down[None, now],
        )  # fmt: skip
        motion = predict(coefficients([TRUTH], 1.0), begin, measured)
        rates[k, :, 2] = motion.velocity[0, 0, :, 3] + RATE * rng.normal(size=COUNT)
        force[k] = motion.force[0, 0] + 0.05 + FORCE * rng.normal(size=(COUNT, 3))
        depth.append(7.0 + motion.depth[0, 0, ::2] + DEPTH * rng.normal(size=COUNT // 2))
        begins[k, 2:] = begin[0, 0, 2:]
        begin = 2 * motion.velocity[:, :, -1] - motion.velocity[:, :, -2]
    return taken._replace(windows=w._replace(rates=rates, force=force, depth=depth, begin=begins))


def truth(start: Beginning) -> Floats:
    found = start_of(TRUTH).vector
    for axis in range(4):
        found[3 * axis + 1] = TRUTH.linear_damping[ROW[axis]] / start.linear[axis]
        found[3 * axis + 2] = TRUTH.quadratic_damping[ROW[axis]] / start.quadratic[axis]
    return found


ROW = (0, 1, 2, 5)
FITTED = [6, 7, 8, 9, 10, 11, BUOYANCY, LAG]


def test_without_any_excitation_nothing_is_fitted() -> None:
    found = fit(made("none"), start_of(FILE))
    assert found.axes == ()
    assert set(found.refused) >= set(AXES)


@pytest.mark.slow
def test_surge_that_only_the_window_before_tells_has_the_right_sign() -> None:
    """Else the yaw's drag, of which the wake makes some, is wrong by many deviations."""
    start = start_of(FILE)
    found = fit(coasting(seed=2, surge=0.2), start, ("heave", "yaw"))
    off = (found.x - truth(start)) / np.sqrt(np.diag(found.covariance))
    assert np.abs(off[9:12]).max() < 3.0


def test_a_dive_that_no_model_explains_is_one_sentence() -> None:
    """A descent that begins at no finite sum of squares had ended a review with a traceback."""
    here: Any = SimpleNamespace(at=SimpleNamespace(normal=SimpleNamespace(cost=nan)))
    with pytest.raises(LindyError, match="no inertia and drag explain how it moved"):
        descended(here, 1e-3)


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
