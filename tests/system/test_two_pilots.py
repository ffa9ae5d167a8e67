"""One drone and two topsides as processes: the second one waits, is told who has control, takes it
when it is offered, and its end disarms nothing that the first one flies."""

import re
from contextlib import ExitStack
from pathlib import Path

import pytest

from messages import topics
from tests.support.doors import free_endpoint
from tests.support.patience import until
from tests.support.started import Ear, Started, lindy

pytestmark = pytest.mark.system

REST = "t,surge,sway,heave,yaw\n0,0,0,0,0\n300,0,0,0,0\n"
DIVE = "t,surge,sway,heave,yaw\n0,0,0,1,0\n300,0,0,0,0\n"  # what must not be flown unasked


def asked(side: Started, *words: str) -> str:
    """What `lindy ask` says in the name of the pilot of this side."""
    done = lindy("ask", *words, "--dive", str(side.out))
    return (done.stdout + done.stderr).strip()


@pytest.mark.slow
def test_of_two_topsides_exactly_one_flies(tmp_path: Path) -> None:
    endpoint = free_endpoint()

    def topside(name: str, script: str) -> Started:
        words = (
            "up",
            "topside",
            "--connect",
            endpoint,
            "--grouped",
            "--set",
            f"gamepad.pilot={name}",
        )
        return sides.enter_context(Started(tmp_path / name, *words, script=script))

    with ExitStack() as sides:
        drone = Started(tmp_path / "drone", "up", "drone", "--listen", endpoint, "--grouped")
        sides.enter_context(drone)
        drone.until(lambda: drone.pid("reference"))
        ear = Ear(drone.running)
        sides.callback(ear.close)
        heard = ear.heard(topics.STATUS)

        def until_flown(pilot: str, *, armed: bool) -> None:
            def flown() -> bool:
                return bool(heard) and (heard[-1].pilot, heard[-1].armed) == (pilot, armed)

            until(flown, lambda: heard[-1:])

        ann = topside("ann", REST)
        until_flown("ann", armed=True)
        bob = topside("bob", DIVE)
        bob.until_said("ann has control; waiting")
        reason = asked(bob, "take")
        assert re.search(
            r"refuses \(take\): ann has had control for \d+ s; ask for an offer, or take by force",
            reason,
        ), reason
        assert "refuses (disarm): ann has had control for" in asked(bob, "disarm")
        bob.end()
        begin = len(heard)
        until(lambda: len(heard) > begin + 5, lambda: heard[-1:])
        assert {(s.pilot, s.armed) for s in heard[begin:]} == {("ann", True)}

        again = topside("bob2", DIVE)
        again.until_said("ann has control; waiting")
        assert asked(ann, "offer", "bob2").endswith(": offer: accepted")
        assert asked(again, "take").endswith(": take: accepted")
        until_flown("bob2", armed=True)
        assert "refuses (light): bob2 has had control" in asked(ann, "light", "1")
        assert asked(again, "light", "1").endswith(": light: accepted")
        for who, name in ((ann, "ann"), (again, "bob2")):
            assert asked(who, "take", "--force").endswith(": take: accepted")
            until_flown(name, armed=True)
        again.end()  # it has control: its end disarms and gives control up
        until_flown("", armed=False)
        epochs = [s.epoch for s in heard]
        assert epochs == sorted(epochs)
