"""Spreads are proposed only where they make the innovations whiter, and nothing else worse."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.estimation.settings import DepthSettings
from tools.report.columns import Array
from tools.review.estimated import Estimated, Innovations
from tools.review.spreads import STEPS, pressure_noise, proposal
from tools.review.track import Track

NOW = DepthSettings(pressure_std=200.0)


def estimated(correlation: float, rejected: float = 0.0, known_s: float = 60.0) -> Estimated:
    """An estimation whose innovations are an AR(1) process with this correlation."""
    n = 1000
    noise = np.random.default_rng(2).standard_normal(n)
    e: Array = np.zeros(n)
    for k in range(1, n):
        e[k] = correlation * e[k - 1] + np.sqrt(1.0 - correlation**2) * noise[k]
    t = np.asarray(np.arange(n) * 0.1, dtype=np.float64)
    one = np.ones(n)
    found = Innovations(t, one, e, e * e, one, rejected * one, Counter(), Counter(), "m")
    at = np.asarray(np.arange(0.0, known_s, 0.1), dtype=np.float64)
    track = Track(at, *(np.zeros_like(at) for _ in Track._fields[1:]))
    return Estimated(track, {"pressure": found}, 10.0, "", Counter())


class Dive:
    """An estimator that answers in turn."""

    def __init__(self, *answers: Estimated) -> None:
        self.answers = list(answers)
        self.asked: list[tuple[str, ...]] = []

    def __call__(self, overrides: Sequence[str]) -> Estimated:
        self.asked.append(tuple(overrides))
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


@given(
    st.floats(0.3, 0.95),
    st.lists(
        st.tuples(st.floats(-0.95, 0.95), st.floats(0.0, 0.3), st.floats(1.0, 60.0)),
        min_size=len(STEPS),
        max_size=len(STEPS),
    ),
)
def test_a_proposal_is_whiter_and_nothing_is_worse(
    before: float, answers: list[tuple[float, float, float]]
) -> None:
    dive = Dive(estimated(before), *(estimated(*answer) for answer in answers))
    found = proposal(NOW, 0.01, 30.0, 60.0, dive)
    assert found.before.lag_one is not None
    if found.chosen is None:
        assert found.toml == ""
        return
    chosen = found.trials[found.chosen]
    assert chosen.lag_one is not None
    assert abs(chosen.lag_one) <= abs(found.before.lag_one) / 2.0
    assert chosen.rejected <= found.before.rejected + 0.005
    assert chosen.known_s >= 0.99 * found.before.known_s
    assert chosen.acceleration_noise <= 5.0 * 0.01
    assert f"acceleration_noise = {chosen.acceleration_noise!r}" in found.toml


def test_white_innovations_need_nothing() -> None:
    dive = Dive(estimated(0.0))
    found = proposal(NOW, 0.01, 30.0, 60.0, dive)
    assert found.toml == ""
    assert "nothing to change" in found.words
    assert len(dive.asked) == 1


def test_the_smallest_that_is_white_is_proposed() -> None:
    dive = Dive(estimated(0.9), estimated(0.95, rejected=0.6), estimated(0.1), estimated(0.0))
    found = proposal(NOW, 0.01, 30.0, 60.0, dive)
    assert found.chosen == 1
    assert found.trials[1].lag_one == pytest.approx(0.1, abs=0.1)
    assert dive.asked[-1] == (
        "estimation.depth.pressure_std=30.0",
        "estimation.depth.acceleration_noise=0.02",
    )
    assert found.toml.startswith("[estimation.depth]\npressure_std = 30.0")


def test_what_makes_it_worse_is_said_and_not_proposed() -> None:
    found = proposal(NOW, 0.01, 30.0, 60.0, Dive(estimated(0.5), estimated(0.9)))
    assert found.chosen is None
    assert len(found.trials) == len(STEPS)
    assert "none is proposed" in found.words


def test_no_more_noise_is_tried_than_an_accelerometer_can_have() -> None:
    found = proposal(NOW, 0.4, 30.0, 60.0, Dive(estimated(0.9)))
    assert [trial.acceleration_noise for trial in found.trials] == [0.4, 0.8]


@given(std=st.floats(5.0, 500.0), amplitude=st.floats(0.0, 5000.0))
def test_the_pressure_of_a_moving_vehicle_tells_its_noise(std: float, amplitude: float) -> None:
    t = np.arange(600) / 10.0
    noise = std * np.random.default_rng(3).standard_normal(len(t))
    moving = 120_000.0 + amplitude * np.sin(2.0 * np.pi * 0.1 * t)
    # Half a metre up and down in ten seconds has a third difference of 1.2 Pa at 10 Hz.
    assert pressure_noise(moving + noise) == pytest.approx(std, rel=0.25, abs=1.0)


def test_noise_below_a_step_is_the_rounding() -> None:
    steps = 120_000.0 + 100.0 * np.repeat(np.arange(20.0), 20)
    assert pressure_noise(steps) == pytest.approx(100.0 / np.sqrt(12.0))
    assert pressure_noise(np.full(200, 1e5)) is None
    assert pressure_noise(np.zeros(10)) is None
