"""The disturbance observer: what it learns, and when it must not."""

from math import exp

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.control.disturbance import DisturbanceObserver
from services.control.plant import Plant

DT = 0.01
many = settings(max_examples=100, deadline=None)
forces = st.lists(st.floats(-20, 20), min_size=5, max_size=60)


def observed(plant: Plant, bandwidth: float, w: float, pushes: list[float]) -> list[float]:
    """Estimates over the exact motion of a linear plant under held forces."""
    observer, v = DisturbanceObserver(plant, bandwidth, 1e3), 0.0
    left = exp(-plant.linear * DT / plant.inertia)
    estimates: list[float] = []
    observer.learn(v, 0.0, DT)
    for force in pushes:
        v = left * v + (1 - left) / plant.linear * (force + w)
        observer.learn(v, force, DT)
        estimates.append(observer.estimate)
    return estimates


@many
@given(st.floats(0.1, 40.0), st.floats(1.0, 50.0), st.floats(-10, 10), forces)
def test_a_constant_disturbance_is_learnt_exactly_whatever_the_thrusters_do(
    bandwidth: float, damping: float, w: float, pushes: list[float]
) -> None:
    estimates = observed(Plant(13.3, damping), bandwidth, w, pushes)
    expected = [w * (1 - exp(-bandwidth * DT * (k + 1))) for k in range(len(pushes))]
    assert estimates == pytest.approx(expected, abs=1e-7)


@many
@given(st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e6, 1e6)), min_size=1, max_size=50))
def test_it_never_believes_in_more_than_its_limit(steps: list[tuple[float, float]]) -> None:
    observer = DisturbanceObserver(Plant(20.0, 0.4, 25.0), 3.0, 15.0)
    for velocity, force in steps:
        observer.learn(velocity, force, DT)
        assert abs(observer.estimate) <= 15.0


def test_a_collision_teaches_little() -> None:
    """Half a metre per second lost at once is a hundred times the limit's force."""
    observer = DisturbanceObserver(Plant(20.0), 3.0, 15.0)
    observer.learn(0.5, 0.0, DT)
    observer.learn(0.0, 0.0, DT)
    assert 0.0 < abs(observer.estimate) < 0.5
    assert not observer.limited


@many
@given(st.floats(-5, 5), st.floats(-2, 2))
def test_a_pause_keeps_and_forgetting_forgets(velocity: float, later: float) -> None:
    observer = DisturbanceObserver(Plant(20.0, 0.4, 25.0), 3.0, 15.0)
    for k in range(50):
        observer.learn(0.01 * k, 0.0, DT)
    learnt = observer.estimate
    assert learnt != 0.0
    observer.pause()
    observer.learn(velocity, later, DT)  # nothing to compare this velocity with
    assert observer.estimate == learnt
    observer.forget()
    assert observer.estimate == 0.0
