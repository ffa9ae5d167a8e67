"""Height above the bottom in whole dives on virtual time, over a slope and without an altimeter."""

import pytest

from tests.support.sortie import HANDS_OFF, Sortie

SLOPE = 0.25  # [-] 14°, rising to the north
DEPTH = 10.0  # [m] of the bottom at the start
SITE = (f"simulator.floor_depth={DEPTH}", f"simulator.slope_north={-SLOPE}")
DVL = ("simulator.dvl.rate=1", "simulator.usbl.rate=1")
DIVES, AHEAD = (0.0, 0.0, 0.8, 0.0), (0.25, 0.0, 0.0, 0.0)
FLOOR_DISTANCE = 0.5  # [m] the Pioneer's
NEAREST = 1.0  # [m] below the height that is held, on the way up


def flown(vehicle_ahead: float) -> Sortie:
    hands = [(0.5, DIVES), (15.0, HANDS_OFF), (24.0, AHEAD), (24.0 + vehicle_ahead, HANDS_OFF)]
    return Sortie(hands, overrides=(*SITE, *DVL))


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
    sortie = flown(25.0).until(20.0)
    sortie.hold("altitude_hold")
    sortie.until(23.0)
    assert sortie.flight_mode == "altitude_hold"
    wanted = sortie.status.altitude_wanted
    assert isinstance(wanted, float)
    assert wanted > 1.5
    sortie.until(70.0)
    assert sortie.truth[-1].position[0] > 6.0  # it has risen 1.5 m
    assert min(heights(sortie, 50.0)) > wanted - NEAREST
    assert heights(sortie, 1.0) == pytest.approx([wanted] * 100, abs=0.35)
    assert sortie.flight_mode == "altitude_hold"


@pytest.mark.slow
@pytest.mark.system
def test_without_its_altimeter_it_holds_the_depth_until_it_is_asked_again() -> None:
    sortie = flown(6.0).until(20.0)
    sortie.hold("altitude_hold")
    sortie.until(26.0)
    sortie.set_faults("sensor/dvl", "silent")
    sortie.until(32.0)
    assert sortie.flight_mode == "stabilised"
    assert sortie.counts["lost:altitude"] == 1
    held = sortie.references[-1].depth.position
    sortie.set_faults("sensor/dvl", "none")
    sortie.until(40.0)
    assert sortie.flight_mode == "stabilised"
    assert sortie.references[-1].depth.position == pytest.approx(held, abs=0.06)
    sortie.hold("altitude_hold")
    sortie.until(41.0)
    assert sortie.flight_mode == "altitude_hold"


@pytest.mark.system
def test_a_drone_without_an_altimeter_says_so() -> None:
    sortie = Sortie([(0.5, HANDS_OFF)]).until(2.0)
    sortie.hold("altitude_hold")
    sortie.until(3.0)
    assert sortie.refused() == ["the drone does not measure its height above the bottom"]
    assert sortie.flight_mode == "stabilised"
