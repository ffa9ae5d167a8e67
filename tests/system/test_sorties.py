"""Whole dives on virtual time: stops that once were none, a height over a slope, the way home."""

from math import degrees, dist, pi, tau

import numpy as np
import pytest

from messages.pilot import RequestKind
from services.estimation.aids import LOST_AFTER
from tests.support.dive import DEEP, HANDS_OFF, Sortie, SortieRow

CLEAN = (  # not zero: a sensor without any noise counts as frozen
    "simulator.pressure_std=10",
    "estimation.depth.pressure_std=100",
    "simulator.gyro_bias=0",
    "simulator.gyro_drift=0",
    "simulator.gyro_noise=1e-5",
    "simulator.accelerometer_bias=0",
    "simulator.accelerometer_noise=1e-4",
)
STICKS: list[SortieRow] = [(1.0, (0.7, 0.0, 0.6, 0.0)), (5.0, HANDS_OFF)]
LET_GO, OVER = 5.0, 10.0  # [s]


def comes_back(*overrides: str) -> float:
    """[m] From the deepest point after the release to where the vehicle settles."""
    sortie = Sortie(STICKS, seed=20090, overrides=(DEEP, *CLEAN, *overrides)).until(OVER)
    depth = sortie.columns(LET_GO, OVER).depth
    assert np.abs(depth[-1] - depth[0]) > 0.1, "it was no dive"
    return float(depth.max() - depth[-100:].mean())


@pytest.mark.slow
def test_a_vehicle_that_dives_at_high_surge_does_not_come_back() -> None:
    assert comes_back() < 0.002
    assert comes_back("control.coupling.heave=false") > 0.004


@pytest.mark.slow
def test_the_heading_does_not_rest_off_and_swing_later() -> None:
    """With this seed the estimate drifts by 0.4°, within the thrusters' dead-band, which is half a
    degree wide here. Nothing moves in it: pulses that held it within 0.2° swung it by a quarter.
    Beyond, one push swings it by up to 0.8°."""
    sortie = Sortie([(1.0, (0.0, 0.0, 1.0, 0.5)), (8.0, HANDS_OFF)], seed=5004).until(48.0)
    seen = sortie.columns(13.0)
    _, off = sortie.estimate_errors(seen, 13.0)
    known = seen.heading + off
    assert degrees(np.abs(known - seen.wanted_heading).max()) <= 0.5
    assert degrees(np.abs(seen.heading[200:] - seen.heading[:-200]).max()) <= 0.1  # in 2 s


@pytest.mark.slow
def test_a_turn_that_stops_while_the_vehicle_is_tilted_does_not_run_on() -> None:
    """Surge, dive and turn at once pitch it by more than twenty degrees."""
    together = (0.75, 0.48, 1.0, 0.5)
    sortie = Sortie([(1.0, together), (5.0, HANDS_OFF)], seed=1, overrides=(DEEP,)).until(10.0)
    under_way, after = sortie.columns(4.0, 5.0), sortie.columns(5.0)
    _, off = sortie.estimate_errors(under_way, 4.0)
    error = under_way.heading + off - under_way.wanted_heading
    assert degrees(np.abs(error[50:]).max()) <= 0.3
    assert degrees(after.heading.max() - after.heading[-100:].mean()) <= 0.3


# Height above the bottom, over a slope and without an altimeter.


SLOPE = 0.25  # [-] 14°, rising to the north
DEPTH = 10.0  # [m] of the bottom at the start
SITE = (f"simulator.floor_depth={DEPTH}", f"simulator.slope_north={-SLOPE}")
DVL = ("simulator.dvl.rate=1", "simulator.usbl.rate=1")
DIVES, AHEAD = (0.0, 0.0, 0.8, 0.0), (0.25, 0.0, 0.0, 0.0)
FLOOR_DISTANCE = 0.5  # [m] the Pioneer's
NEAREST = 1.0  # [m] below the height that is held, on the way up


def heights(sortie: Sortie, since: float) -> list[float]:
    """[m] True ones of the last so many seconds."""
    newest = sortie.truth[-1].stamp_ns
    return [
        DEPTH - SLOPE * m.position[0] - m.position[2]
        for m in sortie.truth
        if m.stamp_ns > newest - since * 1e9
    ]


@pytest.mark.slow
@pytest.mark.system
def test_up_a_slope_it_keeps_its_height_and_stops_there() -> None:
    hands = [(0.5, DIVES), (15.0, HANDS_OFF), (24.0, AHEAD), (39.0, HANDS_OFF)]
    sortie = Sortie(hands, overrides=(*SITE, *DVL)).until(20.0)
    sortie.hold("altitude_hold")
    sortie.until(23.0)
    assert sortie.flight_mode == "altitude_hold"
    wanted = sortie.status.altitude_wanted
    assert isinstance(wanted, float)
    assert wanted > 1.5
    sortie.until(52.0)
    assert sortie.truth[-1].position[0] > 3.6  # it has risen 0.9 m
    assert min(heights(sortie, 32.0)) > wanted - NEAREST
    assert heights(sortie, 1.0) == pytest.approx([wanted] * 100, abs=0.35)
    assert sortie.flight_mode == "altitude_hold"


# Back to where it was armed, and the tether's turns undone, by a BlueROV2 with a DVL.


REARMED: tuple[RequestKind, ...] = ("disarm", "arm", "home")
A50 = ("sensors.dvl=a50", "simulator.floor_depth=20")


@pytest.mark.slow
@pytest.mark.system
def test_it_goes_home_by_request_against_a_current() -> None:
    current = ("simulator.current.north=0.1", "simulator.current.east=-0.15")
    hands = [(0.5, (0.0, 0.0, 0.6, 0.0)), (6.0, (0.8, 0.3, 0.0, 0.1)), (16.0, HANDS_OFF)]
    sortie = Sortie(hands, vehicle="bluerov2_heavy", overrides=(*A50, *current))
    armed_at = sortie.truth[-1].position[:2]
    sortie.until(20.0)
    away = dist(sortie.truth[-1].position[:2], armed_at)
    assert away > 2.5
    depth = sortie.truth[-1].position[2]
    sortie.ask("home")
    sortie.until(60.0)
    assert not sortie.refused()
    assert dist(sortie.truth[-1].position[:2], armed_at) < 0.3 + 0.03 * away
    assert sortie.truth[-1].position[2] == pytest.approx(depth, abs=0.15)


@pytest.mark.slow
@pytest.mark.system
def test_it_turns_the_tethers_turns_back_and_looks_where_it_looked() -> None:
    hands = [(0.5, (0.0, 0.0, 0.6, 0.0)), (5.0, (0.0, 0.0, 0.0, 0.8)), (20.0, HANDS_OFF)]
    sortie = Sortie(hands, vehicle="bluerov2_heavy", overrides=A50).until(23.0)
    before = sortie.truth[-1].heading
    turns = round(before / tau)
    assert turns >= 1
    sortie.ask("unwind")
    sortie.until(45.0)
    assert not sortie.refused()
    assert sortie.truth[-1].heading == pytest.approx(before - turns * tau, abs=0.1)
    assert abs(sortie.truth[-1].heading) < pi + 0.1
    sortie.ask("unwind")
    sortie.until(46.0)
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
