"""The stability check says what a simulation of the same loop shows."""

from dataclasses import dataclass
from math import exp

import msgspec
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.reference import Motion
from services.control.axis.axis import Axis, Gains
from services.control.axis.plant import Plant, lags_of, plant_of
from services.control.core import PERIOD_S, Controller
from services.control.laws import Settings
from services.control.stability import (
    YAW_RATE_CUTOFF,
    SampledLoop,
    exponential,
    held,
    require_stable,
)
from services.estimation import core
from services.marine.vehicle import Vehicle

LAG, DT = 0.08, 0.01
PLANT = Plant(20.0, 2.0)


def gains(kp: float, kd: float, ki: float = 0.0, observer: float = 0.0) -> Gains:
    return Gains(kp=kp, kd=kd, ki=ki, max_error=1e6, max_integral=1e6, observer=observer)


@dataclass
class Sea:
    """The law flown on the exact plant, with a step of delay and a low-pass of the rate."""

    law: Axis
    rate_lag: float = 0.0  # [s]

    def growth(self, seconds: float) -> float:
        """[-] Size at the end relative to the size half-way."""
        move, (x, v, f, coming, mean) = held(PLANT, LAG, DT), (1e-3, 0.0, 0.0, 0.0, 0.0)
        sizes, seen = list[float](), 0.0
        for k in range(round(seconds / DT)):
            seen += (1.0 - exp(-DT / self.rate_lag) if self.rate_lag else 1.0) * (v - seen)
            if k:
                self.law.learn(seen, mean, DT)
            command = self.law.step(Motion(0.0, 0.0, 0.0, 0.0), x, seen, DT)
            x, v, f, mean = (float(part) for part in move @ (x, v, f, coming))
            coming = command
            sizes.append(abs(x) + abs(v))
        half = len(sizes) // 2
        return max(sizes[half:]) / max(sizes[:half])


@settings(max_examples=20, deadline=None)
@given(
    st.floats(1.0, 2000.0),
    st.floats(1.0, 2000.0),
    st.floats(0.0, 100.0),
    st.booleans(),
    st.sampled_from((0.0, 0.02, 0.3)),
)
def test_the_eigenvalue_says_whether_the_flown_loop_grows(
    kp: float, kd: float, learns: float, observer: bool, rate_lag: float
) -> None:
    tried = gains(kp, kd, observer=learns / 10) if observer else gains(kp, kd, learns)
    radius = SampledLoop(PLANT, LAG, DT, rate_lag).radius(tried, tried)
    assume(abs(radius - 1) > 5e-3)
    growth = Sea(Axis(tried, PLANT, LAG, DT), rate_lag).growth(10.0)
    assert (growth > 1) == (radius > 1)


@given(st.floats(0.001, 5.0), st.floats(0.01, 50.0))
def test_the_exponential_of_a_matrix(lag: float, rate: float) -> None:
    matrix = np.array([[-1 / lag, 1.0], [0.0, -rate]])
    assume(abs(rate - 1 / lag) > 1e-3 * rate)
    off = (exp(-rate) - exp(-1 / lag)) / (1 / lag - rate)
    expected = [[exp(-1 / lag), off], [0.0, exp(-rate)]]
    assert exponential(matrix) == pytest.approx(np.array(expected), abs=1e-9, rel=1e-6)


@pytest.mark.parametrize("table", ["depth", "heading", "surge", "sway"])
def test_gains_that_shake_the_vehicle_are_refused_by_name(table: str, pioneer: Vehicle) -> None:
    ours = Settings()
    Controller(ours, pioneer, Outbox())
    wild = msgspec.structs.replace(getattr(ours, table), kd=5000.0)
    with pytest.raises(ValueError, match=rf"^control.{table}: .* kd = 5000 .* not stable"):
        Controller(msgspec.structs.replace(ours, **{table: wild}), pioneer, Outbox())


@pytest.mark.parametrize("kd", [12.0, 20.0])
def test_the_low_pass_of_the_yaw_rate_is_part_of_the_loop(kd: float, pioneer: Vehicle) -> None:
    """With these gains the heading of a Pioneer swings ever further."""
    wild = msgspec.structs.replace(Settings().heading, kp=3.0 * kd, kd=kd, observer=5.0)
    assert SampledLoop(plant_of(pioneer, 5), lags_of(pioneer)[5], PERIOD_S).radius(wild, wild) < 1
    with pytest.raises(ValueError, match=rf"^control.heading: .* kd = {kd:g} .* not stable"):
        require_stable(Settings(heading=wild), pioneer, PERIOD_S)
    assert YAW_RATE_CUTOFF == core.YAW_RATE_CUTOFF
