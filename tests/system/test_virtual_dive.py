"""The whole chain on virtual time: what a pilot may rely on, whatever he does with the sticks."""

import hashlib

import pytest

from messages import topics
from tests.support.dive import Dive


def depth_after_release(dive: Dive, seconds: float) -> list[float]:
    truth = dive.heard(topics.TRUTH)
    dive.run(seconds)
    return [each.position[2] for each in truth]


def test_the_drone_stops_where_the_stick_was_let_go() -> None:
    dive = Dive("0,0,0,0,0\n1,0,0,1,0\n7,0,0,0,0\n30,0,0,0,0")
    references, truth = dive.heard(topics.REFERENCE), dive.heard(topics.TRUTH)
    dive.until_armed().run(7.0)
    let_go = truth[-1].position[2]
    depths = depth_after_release(dive, 10.0)
    final = references[-1].depth.position
    assert final - let_go < 0.75  # it is on its way down at 0.5 m/s
    assert max(depths) - final <= 0.10
    assert max(abs(depth - final) for depth in depths[-500:]) <= 0.05


def test_a_pilot_who_vanishes_leaves_the_drone_holding_its_depth() -> None:
    dive = Dive("0,0,0,0,0\n1,0.5,0,0.6,0\n60,0,0,0,0").until_armed().run(4.0)
    references = dive.heard(topics.REFERENCE)
    dive.host.kill("gamepad")
    dive.run(6.0)
    assert dive.statuses[-1].failsafe == "pilot_lost"
    depths = depth_after_release(dive, 5.0)
    assert max(depths) - min(depths) < 0.10
    assert references[-1].surge_force == 0.0


def test_dead_control_means_thrusters_stop_within_their_time_to_live() -> None:
    dive = Dive("0,0,0,0,0\n1,1,0,0,0\n60,0,0,0,0").until_armed().run(4.0)
    dive.host.kill("control")
    dive.run(1.2)
    assert dive.host.nodes["simulator"].counts["stale:control/thrusters"] == 1


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_seed_others() -> None:
    def digest(seed: int) -> str:
        dive = Dive("0,0,0,0,0\n1,0.5,0,1,0.3\n3,0,0,0,0", seed=seed)
        sha = hashlib.sha256()
        for side in ("drone", "topside"):
            dive.host.side(side).hear("**", lambda e: sha.update(e.key.encode() + e.payload))
        dive.run(8.0)
        return sha.hexdigest()

    assert digest(1) == digest(1)
    assert digest(1) != digest(2)
