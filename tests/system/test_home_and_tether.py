"""Back to where it was armed, and the tether's turns undone, by a BlueROV2 with a DVL."""

from math import dist, pi, tau

import pytest

from messages.pilot import RequestKind
from services.estimation.aids import LOST_AFTER
from tests.support.sortie import HANDS_OFF, Sortie

REARMED: tuple[RequestKind, ...] = ("disarm", "arm", "home")
A50 = ("sensors.dvl=a50", "simulator.floor_depth=20")


@pytest.mark.slow
@pytest.mark.system
def test_it_goes_home_by_request_against_a_current() -> None:
    current = ("simulator.current.north=0.1", "simulator.current.east=-0.15")
    hands = [(0.5, (0.0, 0.0, 0.6, 0.0)), (6.0, (0.8, 0.3, 0.0, 0.1)), (26.0, HANDS_OFF)]
    sortie = Sortie(hands, vehicle="bluerov2_heavy", overrides=(*A50, *current))
    armed_at = sortie.truth[-1].position[:2]
    sortie.until(30.0)
    away = dist(sortie.truth[-1].position[:2], armed_at)
    assert away > 5.0
    depth = sortie.truth[-1].position[2]
    sortie.ask("home")
    sortie.until(100.0)
    assert not sortie.refused()
    assert dist(sortie.truth[-1].position[:2], armed_at) < 0.3 + 0.03 * away
    assert sortie.truth[-1].position[2] == pytest.approx(depth, abs=0.15)


@pytest.mark.slow
@pytest.mark.system
def test_it_turns_the_tethers_turns_back_and_looks_where_it_looked() -> None:
    hands = [(0.5, (0.0, 0.0, 0.6, 0.0)), (5.0, (0.0, 0.0, 0.0, 0.8)), (30.0, HANDS_OFF)]
    sortie = Sortie(hands, vehicle="bluerov2_heavy", overrides=A50).until(33.0)
    before = sortie.truth[-1].heading
    turns = round(before / tau)
    assert turns >= 2
    sortie.ask("unwind")
    sortie.until(70.0)
    assert not sortie.refused()
    assert sortie.truth[-1].heading == pytest.approx(before - turns * tau, abs=0.1)
    assert abs(sortie.truth[-1].heading) < pi + 0.1
    sortie.ask("unwind")
    sortie.until(71.0)
    assert sortie.refused() == ["the tether has no whole turn in it"]


@pytest.mark.slow
@pytest.mark.system
def test_home_is_lost_with_the_position_and_that_is_said_at_once() -> None:
    """After so long without a DVL the position begins anew, and nobody knows where."""
    sortie = Sortie([(0.5, HANDS_OFF)], vehicle="bluerov2_heavy", overrides=A50).until(5.0)
    sortie.set_faults("sensor/dvl", "silent")
    sortie.until(10.0 + LOST_AFTER)
    sortie.set_faults("sensor/dvl", "none")
    sortie.until(15.0 + LOST_AFTER)
    assert any("home is not known any more" in line.text for line in sortie.said)
    sortie.ask("home")
    sortie.until(16.0 + LOST_AFTER)
    assert "home is not known any more" in sortie.refused()[0]
    for k, kind in enumerate(REARMED, start=17):
        sortie.ask(kind)
        sortie.until(k + LOST_AFTER)
    assert len(sortie.refused()) == 1  # home is where it was armed anew


@pytest.mark.system
def test_without_a_position_home_is_not_known() -> None:
    sortie = Sortie([(0.5, HANDS_OFF)]).until(2.0)
    sortie.ask("home")
    sortie.until(3.0)
    assert sortie.refused() == [
        "home is not known: no position has been measured since the drone was armed"
    ]
