"""While a process between the pilot and the drone hangs, another one takes its place, and the
disarm arrives. In real processes; on virtual time test_fault_matrix.py says how soon."""

from pathlib import Path

import pytest

from services.runtime.node.requests import GIVE_UP_NS
from tests.support.faults.modes import MODES
from tests.support.faults.observed import Observed
from tests.support.faults.real_dive import real_dive
from tests.support.patience import until

pytestmark = pytest.mark.slow
STABILISED = next(mode for mode in MODES if mode.name == "stabilised")


def at_rest(seen: Observed, since: int) -> bool:
    """Has a thruster command of this time or later reached the thrusters, and none of it turns?"""
    later = [actuation for actuation in seen.actuations if actuation.stamp_ns > since]
    return bool(later) and not any(abs(newtons) > 0.01 for newtons in later[-1].thrust)


@pytest.mark.parametrize("name", ["tether", "hub_topside", "hub_drone"])
def test_a_disarm_arrives_while_the_way_to_the_drone_hangs(tmp_path: Path, name: str) -> None:
    with real_dive(STABILISED, tmp_path) as dive:
        dive.wait_steady(1.0)
        dive.stop(name)  # for ever
        asked = again = dive.now
        dive.ask(kind="disarm")

        def obeyed() -> bool:
            nonlocal again
            dive.run(0.1)
            if dive.now - again > GIVE_UP_NS:  # a busy computer: the pilot was told, and asks again
                again = dive.now
                dive.ask(kind="disarm")
            return any(a.accepted and a.stamp_ns > asked for a in dive.seen.answers) and at_rest(
                dive.seen, asked
            )

        until(obeyed, lambda: dive.screen[-500:])
        dive.run(2.0)
        assert at_rest(dive.seen, dive.now - 1_000_000_000)
        assert not dive.seen.statuses[-1].armed
        assert f"{name} is started again" in dive.screen
        assert dive.alive
