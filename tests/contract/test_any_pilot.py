"""What every pilot promises, whatever he flies with: a page, a ground station, a node of ROS 2."""

from pathlib import Path

import pytest

from tests.support.pilots import GroundStationDive, PageDive, PilotedDive, RosDive

LOST_NS = 330_000_000  # [ns] 300 ms, a state's period and the link
PILOTS = pytest.mark.parametrize("pilot", [PageDive, GroundStationDive, RosDive])


@PILOTS
def test_he_arms_dives_a_metre_lets_go_and_the_drone_holds(
    pilot: type[PilotedDive], tmp_path: Path
) -> None:
    dive = pilot(tmp_path).armed()
    assert dive.status.pilot == pilot.called
    start = dive.depth
    while dive.depth < start + 1.0:
        dive.steer(0.2, heave=1.0)
    held = dive.steer(3.0).depth
    for _ in range(2):
        assert abs(dive.steer(0.5).depth - held) < 0.1
    dive.disarm()
    assert not dive.steer(0.5).status.armed


@PILOTS
def test_a_second_one_and_rubbish_move_nothing_and_silence_is_a_lost_pilot(
    pilot: type[PilotedDive], tmp_path: Path
) -> None:
    dive = pilot(tmp_path).armed()
    if isinstance(dive, PageDive):
        dive.open(1)
    for _ in range(20):
        dive.sticks(1, heave=1.0)
        dive.steer(1.0 / dive.hz)
    for _ in range(5):
        dive.rubbish()
    assert dive.counts[dive.outranked] == 20
    dive.disarm(1)
    assert dive.steer(0.3).status.armed
    assert {command.heave for command in dive.commands} == {0.0}
    assert dive.counts[dive.malformed] == 5
    require_lost_when_silent(dive.steer(1.0, heave=1.0))
    dive.steer(0.3).arm()  # who goes on does so deliberately
    dive.steer(0.3)
    assert (dive.status.failsafe, dive.status.armed) == ("none", True)
    dive.steer(0.5, heave=1.0)
    assert dive.commands[-1].heave > 0.0


def require_lost_when_silent(dive: PilotedDive) -> None:
    """Within the time to live, and moving sticks alone do not end it."""
    silent = dive.host.now - round(1e9 / dive.hz)  # the last sticks
    dive.run(2.5)
    lost = next(status for status in dive.statuses if status.failsafe == "pilot_lost")
    assert lost.stamp_ns - silent <= LOST_NS
    present = [each for each in dive.commands if each.pilot == "present"]
    assert present[-1].stamp_ns - silent <= LOST_NS
    held = dive.depth
    dive.steer(1.0, heave=1.0)
    assert abs(dive.depth - held) < 0.1
    assert dive.status.failsafe == "pilot_lost"
