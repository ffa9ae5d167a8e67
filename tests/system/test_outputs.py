"""Gripper, lasers and lights in dives on virtual time: what the vehicle does when the link is cut,
a service hangs or the pilot disarms."""

from functools import cache

import pytest

from messages import topics
from messages.control import THRUST_TTL_MS
from messages.pilot import TTL_MS
from tests.support.dive import DEEP, Dive

S, MS = 1_000_000_000, 1_000_000  # [ns]
OUTPUTS = (
    'vehicle.output=[{name="light",kind="dimmer"},'
    '{name="lasers",kind="switch",off_after=2.0},{name="gripper",kind="gripper"}]'
)
HEAD = "t,surge,sway,heave,yaw,gripper,event\n"
GRIPS = 2 * S  # [ns] after the hand-over: from then on the pilot opens the gripper


class ToolDive(Dive):
    """A script flown to its end or to `seconds` after arming."""

    def __init__(self, script: str, seconds: float, kill: dict[float, str] | None = None) -> None:
        super().__init__(HEAD + script, overrides=[OUTPUTS, DEEP])
        self.driven = self.heard(topics.ACTUATION)
        self.commands = self.heard(topics.PILOT_COMMAND, "topside")
        self.began_ns = self.until_armed().host.now
        for at, name in (kill or {}).items():
            self.run(at).host.kill(name)
        self.host.run(self.began_ns + round(seconds * S))

    def driven_at(self, t: float) -> dict[str, float]:
        """[-] By name, `t` [s] after arming."""
        at = self.began_ns + round(t * S)
        return next(m.outputs for m in self.driven if m.stamp_ns >= at)

    def moves(self, name: str) -> list[int]:
        """[ns] after arming, of every report in which the output is not 0."""
        return [m.stamp_ns - self.began_ns for m in self.driven if m.outputs.get(name)]


def rows(*each: str) -> str:
    return "\n".join(each)


@cache
def cut() -> ToolDive:
    """The link is cut while the gripper opens, and comes back while its button is still down."""
    return ToolDive(
        rows(
            "0,0,0,0,0,0,output lasers 1", "1,0,0,0,0,0,output light 0.5", "2,0,0,0,0,1,",
            "3,0,0,0,0,1,link down", "9,0,0,0,0,1,link up", "14,0,0,0,0,0,", "20,0,0,0,0,-1,",
            "22,0,0,0,0,0,", "30,0,0,0,0,0,",
        ),
        26.0,
    )  # fmt: skip


@pytest.mark.slow
def test_a_gripper_stands_still_at_most_one_life_of_its_commands_after_the_link_was_cut() -> None:
    dive = cut()
    opens = [at for at in dive.moves("gripper") if at < 9 * S]
    assert opens[0] < 2.2 * S
    assert 3.0 * S < opens[-1] <= 3 * S + round((TTL_MS + THRUST_TTL_MS) * MS)
    assert all(m.gripper == 1.0 for m in dive.commands if m.stamp_ns - dive.began_ns > 2.1 * S
               and m.stamp_ns - dive.began_ns < 13.9 * S)  # fmt: skip


@pytest.mark.slow
def test_a_button_held_through_the_loss_moves_nothing_until_it_was_let_go() -> None:
    dive = cut()
    later = [at for at in dive.moves("gripper") if at > 9 * S]
    assert later
    assert min(later) >= 20 * S
    assert dive.driven_at(21.0)["gripper"] == -1.0
    assert dive.driven_at(22.5)["gripper"] == 0.0


def test_lasers_go_off_as_long_after_the_cut_as_the_file_says_and_the_light_stays() -> None:
    dive = cut()
    on = dive.moves("lasers")
    assert on[0] < 0.3 * S
    assert 4.5 * S < on[-1] <= 3 * S + 2 * S + round((TTL_MS + 250) * MS)
    assert dive.driven_at(8.0)["light"] == 0.5
    assert dive.driven_at(25.0) == {"light": 0.5, "lasers": 0.0, "gripper": 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("dies", ["reference", "control", "gamepad", "tether"])
def test_a_gripper_stands_still_when_any_service_above_the_driver_dies(dies: str) -> None:
    """Nobody starts it again."""
    dive = ToolDive(rows("0,0,0,0,0,0,", "2,0,0,0,0,1,", "30,0,0,0,0,0,"), 6.0, {3.0: dies})
    opens = dive.moves("gripper")
    assert 2.9 * S < opens[-1] <= 3 * S + round((TTL_MS + THRUST_TTL_MS) * MS)


def test_a_disarm_turns_lasers_off_and_ends_the_gripper_at_once() -> None:
    dive = ToolDive(
        rows("0,0,0,0,0,0,output lasers 1", "2,0,0,0,0,1,", "3,0,0,0,0,1,disarm",
             "5,0,0,0,0,1,output lasers 1", "8,0,0,0,0,0,"),
        7.0,
    )  # fmt: skip
    for name in ("gripper", "lasers"):
        moved = dive.moves(name)
        assert 2.9 * S < moved[-1] <= 3 * S + 150 * MS, name


def test_the_status_says_every_output() -> None:
    said = [m.outputs for m in cut().statuses]
    assert {each["gripper"] for each in said} == {0.0, 1.0, -1.0}
    assert {each["lasers"] for each in said} == {0.0, 1.0}
    assert cut().statuses[-1].light == 0.5
