"""A sensor that goes wrong in a dive: the depth does not run away, and the pilot is told."""

from collections import Counter
from typing import NamedTuple

import pytest

from messages.events import note
from messages.simulator import FaultKind
from tests.support.dive import DEEP, HANDS_OFF, Sortie

AT = 12.0  # [s] after arming, at rest at 2 m
DOWN = [(1.0, (0.0, 0.0, 1.0, 0.0)), (5.5, HANDS_OFF)]


class Flight(NamedTuple):
    away: float  # [m] furthest from where the depth was held
    speed: float  # [m/s] fastest, along down
    error: float  # [m] of the estimated depth, mean of the last two seconds
    apart: float  # [m] largest distance of the estimated depth from the true one
    counts: Counter[str]
    sortie: Sortie


def fly(part: str, fault: FaultKind, value: float | None, seconds: float) -> Flight:
    sortie = Sortie(DOWN, overrides=(DEEP,)).until(AT)
    before, held = len(sortie.truth), sortie.truth[-1].position[2]
    sortie.set_faults(part, fault, value)
    sortie.until(AT + seconds)
    truth = sortie.truth[before:]
    depths = zip(truth[-600:], sortie.states[-600:], strict=True)
    last = zip(truth[-200:], sortie.states[-200:], strict=True)
    return Flight(
        away=max(abs(m.position[2] - held) for m in truth),
        speed=max(abs(m.depth_rate) for m in truth),
        error=sum(s.depth.value - m.position[2] for m, s in last) / 200.0,
        apart=max(abs(s.depth.value - m.position[2]) for m, s in depths),
        counts=sortie.counts,
        sortie=sortie,
    )


@pytest.mark.slow
@pytest.mark.parametrize("bias", [0.02, -0.1])
def test_a_step_of_the_gyroscopes_bias_is_found_and_learnt(bias: float) -> None:
    flight = fly("sensor/imu", "biased", bias, 32.0)
    assert flight.away < 0.5
    assert flight.speed < 0.45
    assert abs(flight.error) < 0.1
    assert flight.counts["inconsistent:sensor/imu"] >= 1
    assert flight.counts["outlier:sensor/pressure"] < 20
    state, truth = flight.sortie.states[-1], flight.sortie.truth[-1]
    assert state.roll.value == pytest.approx(truth.roll, abs=0.05)
    assert state.pitch.value == pytest.approx(truth.pitch, abs=0.05)
    assert state.heading.valid  # gravity says nothing about it, the magnetometer does
    assert abs(truth.heading - flight.sortie.truth[-100].heading) < 0.05
    assert note(flight.sortie.status.notices) == ""


@pytest.mark.slow
def test_a_large_step_of_the_gyroscopes_bias_does_not_move_it_nor_its_end() -> None:
    flight = fly("sensor/imu", "biased", 0.5, 6.0)
    assert max(flight.away, flight.speed, flight.apart) < 0.3
    assert flight.counts["outlier:sensor/pressure"] == 0
    flight.sortie.set_faults("sensor/imu", "none")
    flight.sortie.until(AT + 26.0)
    truth = flight.sortie.truth
    assert abs(truth[-1].heading - truth[-500].heading) < 0.1
    assert max(abs(m.position[2] - truth[-2000].position[2]) for m in truth[-2000:]) < 0.5
    assert flight.sortie.wrenches[-1].heading_integral == pytest.approx(0.0, abs=0.3)


@pytest.mark.slow
def test_a_frozen_pressure_sensor_does_not_drive_it_up_or_down() -> None:
    moving = [(AT, (0.0, 0.0, 0.3, 0.0)), (AT + 4.0, HANDS_OFF)]
    sortie = Sortie([*DOWN, *moving], overrides=(DEEP,)).until(AT)
    sortie.set_faults("sensor/pressure", "frozen")
    sortie.until(AT + 1.0)
    assert sortie.counts["frozen:sensor/pressure"] == 1
    sortie.until(AT + 6.0)
    let_go = len(sortie.truth)
    sortie.until(AT + 20.0)
    after = sortie.truth[let_go:]
    assert max(abs(m.depth_rate) for m in after) < 0.1
    assert max(m.position[2] - after[0].position[2] for m in after) < 0.1  # not down
    assert max(after[0].position[2] - m.position[2] for m in after) < 0.8
    assert sortie.counts["unheld:depth"] == 1


@pytest.mark.slow
def test_a_very_noisy_imu_has_less_weight_and_is_flown_with() -> None:
    """3 m/s² and 0.2 rad/s from sample to sample."""
    flight = fly("sensor/imu", "noisy", 200.0, 10.0)
    assert flight.away < 0.3
    assert flight.apart < 0.15
    assert flight.counts["noisy:sensor/imu"] == 1
    assert flight.counts["unusable:sensor/imu"] == 0
    state, truth = flight.sortie.states[-1], flight.sortie.truth[-1]
    assert state.roll.valid
    assert abs(state.roll.value - truth.roll) < 3.0 * state.roll.std
    assert flight.sortie.status.failsafe == "none"


@pytest.mark.slow
def test_an_imu_that_is_silent_is_said_for_as_long_as_it_lasts() -> None:
    flight = fly("sensor/imu", "silent", None, 6.0)
    assert flight.away < 0.3
    assert flight.speed < 0.35
    assert abs(flight.error) < 0.1
    assert flight.counts["unusable:sensor/imu"] == flight.counts["unheld:heading"] == 1
    for state in flight.sortie.states[-400:]:
        assert state.depth.valid
        assert not any(part.valid for part in (state.heading, state.roll, state.yaw_rate))
    assert note(flight.sortie.status.notices).startswith("the heading is not known and not held")
    assert flight.sortie.status.failsafe in ("imu_lost", "state_lost")
    assert "imu_lost" in flight.sortie.status.conditions
    flight.sortie.set_faults("sensor/imu", "none")
    flight.sortie.until(flight.sortie.t + 3.0)
    assert flight.sortie.counts["regained:sensor/imu"] == 1
    assert "not known" not in note(flight.sortie.status.notices)
    assert "imu_lost" not in flight.sortie.status.conditions


@pytest.mark.slow
def test_without_pressure_it_drifts_slowly_and_says_so() -> None:
    flight = fly("sensor/pressure", "silent", None, 15.0)
    assert flight.speed < 0.15
    assert flight.counts["unusable:sensor/pressure"] == flight.counts["unheld:depth"] == 1
    assert note(flight.sortie.status.notices) == "the depth is not known and not held"
    flight.sortie.set_faults("sensor/pressure", "none")
    there = flight.sortie.truth[-1].position[2]
    flight.sortie.until(flight.sortie.t + 4.0)
    assert flight.sortie.truth[-1].position[2] == pytest.approx(there, abs=0.15)
    assert note(flight.sortie.status.notices) == ""


@pytest.mark.slow
@pytest.mark.parametrize("step", [20e3, -20e3])
def test_a_jump_of_the_pressure_moves_the_held_depth_and_not_the_vehicle(step: float) -> None:
    flight = fly("sensor/pressure", "biased", step, 6.0)
    assert flight.away < 0.1
    assert flight.speed < 0.1
    assert flight.error == pytest.approx(step / (1025.0 * 9.81), abs=0.1)
    assert flight.counts["jumped:sensor/pressure"] == 1
    assert flight.sortie.states[-1].depth.std > 1.5  # which of the two is right is not known
    assert flight.counts["clamped:reference.depth"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("services", [["estimation"], ["estimation", "reference", "control"]])
def test_a_surface_that_is_only_assumed_has_an_honest_spread(services: list[str]) -> None:
    sticks = [(1.0, (0.0, 0.0, 0.5, 0.0)), (3.0, HANDS_OFF)]
    sortie = Sortie(sticks, overrides=(DEEP,)).until(8.0)
    for name in services:
        sortie.restart(name)
    sortie.until(26.0)
    state, truth = sortie.states[-1], sortie.truth[-1]
    assert state.phase == "running"
    assert abs(state.depth.value - truth.position[2]) < 2.0 * state.depth.std
    if services == ["estimation"]:  # the thrusters went on
        assert sortie.counts["assumed:atmosphere"] == 1
