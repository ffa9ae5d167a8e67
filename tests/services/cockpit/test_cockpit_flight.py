"""Pages fly the simulated vehicle on virtual time. See also tests/contract/test_any_pilot.py."""

from pathlib import Path
from typing import Any

import pytest

from messages.pilot import TTL_MS
from services.cockpit.core import SHOW_HZ, UNSEEN
from tests.support.pilots import PageDive

S = 1_000_000_000
MS = 1_000_000
ANN, BOB = 0, 1


@pytest.fixture
def dive(tmp_path: Path) -> PageDive:
    return PageDive(tmp_path).armed()


def test_a_page_sees_what_the_drone_does_and_chooses_its_mode_and_light(dive: PageDive):
    dive.steer(1.5, heave=0.6).steer(2.0)
    view = dive.view()
    assert view["depth_m"] == pytest.approx(dive.depth, abs=0.1)
    assert view["depth_wanted_m"] == pytest.approx(dive.depth, abs=0.2)
    assert (view["armed"], view["pilot"]) == (True, "ann")
    assert dive.you() == {
        "has_sticks": True, "in_control": True, "who": "you have the sticks",
        "delay_ms": dive.you()["delay_ms"],
    }  # fmt: skip
    dive.wish("mode", flight_mode="manual").steer(0.3)
    dive.wish("light").steer(0.3)
    assert (dive.status.flight_mode, dive.status.light) == ("manual", 1.0)


@pytest.mark.slow
def test_a_page_goes_to_a_depth_and_a_heading_and_sets_the_light_in_steps(dive: PageDive):
    dive.wish("goto", depth=1.5, heading_deg=40.0)
    assert dive.status.activity == "goto"
    while dive.status.activity == "goto":
        dive.steer(0.5)
    assert dive.depth == pytest.approx(1.5, abs=0.15)
    assert dive.view()["heading_deg"] == pytest.approx(40.0, abs=2.0)
    dive.wish("light", value=0.25).steer(0.3)
    assert dive.status.light == 0.25
    dive.wish("goto")  # to nowhere
    assert dive.counts["malformed:page"] == 1


def test_a_page_sets_outputs_and_is_told_what_the_vehicle_has(dive: PageDive):
    assert dive.view()["tools"] == [["light", "dimmer", 0.0]]
    dive.wish("output", output="light", value=0.75).steer(0.3)
    assert dive.status.light == 0.75
    assert dive.view()["tools"] == [["light", "dimmer", 0.75]]
    for wish in ("laser", "light_2"):
        dive.wish(wish).steer(0.3)
    assert dive.counts["refused_here:output"] == 2
    dive.wish("output", output="winch", value=1.0).steer(0.3)
    assert dive.counts["refused:output"] == 1
    assert dive.view()["water_c"] == pytest.approx(8.0, abs=0.1)


def lost_after(dive: PageDive, seconds: float = 2.0) -> float:
    """[ms] From now until no command of a present pilot acts any more."""
    began = dive.host.now
    dive.run(seconds)
    ends = [c.stamp_ns + c.ttl_ms * 1e6 for c in dive.commands if c.pilot == "present"]
    absent = [c.stamp_ns for c in dive.commands if c.pilot == "lost" and c.stamp_ns >= began]
    return (min([max(ends), *absent]) - began) / MS


@pytest.mark.slow
@pytest.mark.parametrize("how", ["hidden", "unplugged", "frozen", "closed", "silent"])
def test_each_loss_of_the_pilot_ends_the_motion_within_the_time_to_live(dive: PageDive, how: str):
    dive.open(BOB, watcher=True).steer(1.0, surge=0.6)
    match how:
        case "hidden" | "unplugged":
            dive.say("absent", why=how)
        case "frozen":
            stick: dict[str, Any] = {"surge": 0.6, "sway": 0.0, "heave": 0.0, "yaw": 0.0}
            dive.say("sticks", **stick, device="pad x", device_ms=1001.0)
        case "closed":
            dive.close()
        case _:
            pass
    assert lost_after(dive) <= TTL_MS
    assert dive.counts[f"lost:page_{how}"] == 1
    assert dive.status.failsafe == "pilot_lost"
    assert "lost" in dive.you(BOB)  # said on the other screens
    assert any("pilot lost" in line[3] for line in dive.browsers.pictures[BOB + 1]["log"])
    assert dive.commands[-1].pilot == "lost"
    assert dive.commands[-1].stamp_ns < dive.host.now - S // 2  # and then silence: the lease ends


def test_after_a_short_loss_a_stick_that_is_still_deflected_moves_nothing(dive: PageDive):
    """And its page is told so."""
    dive.steer(1.0, surge=0.6).run(1.0)
    assert dive.status.failsafe == "pilot_lost"
    dive.steer(1.0, surge=0.6)  # held at zero until it is centred, which the drone takes for that
    assert dive.status.failsafe == "none"
    assert dive.commands[-1].surge == 0.0
    assert dive.you()["wants_rest"]
    dive.steer(0.3)
    assert "wants_rest" not in dive.you()
    dive.steer(0.3, surge=0.6)
    assert dive.commands[-1].surge > 0.0


@pytest.mark.slow
def test_after_a_loss_the_sticks_are_centred_first_and_holding_arm_resumes(dive: PageDive):
    dive.steer(1.0, surge=0.6).run(2.5)  # longer than what ends by itself
    assert dive.status.failsafe == "pilot_lost"
    dive.steer(0.5, surge=0.6)
    assert dive.commands[-1].pilot == "present"
    assert dive.commands[-1].surge == 0.0
    dive.say("wish", what="arm")  # of a hold that began before: it is not what is meant now
    dive.steer(0.5, surge=0.6)
    assert dive.status.failsafe == "pilot_lost"
    assert dive.counts["void:hold"] == 1
    dive.say("wish", what="resume")  # deflected or not: the stick still moves nothing
    dive.steer(0.5, surge=0.6)
    assert dive.status.failsafe == "none"
    assert dive.commands[-1].surge == 0.0
    dive.steer(0.1)
    dive.steer(0.5, surge=0.6)
    assert dive.commands[-1].surge == 0.6
    assert "lost" not in dive.you()


def test_sticks_that_waited_in_a_network_move_nothing(dive: PageDive):
    """The page goes on, but what it says arrives as an answer to a picture of long ago."""
    dive.browsers.cut.add(ANN + 1)
    dive.steer(2.0, surge=0.6)
    assert dive.counts["lost:page_silent"] == 1
    assert dive.status.failsafe == "pilot_lost"
    assert all(c.pilot == "lost" for c in dive.commands if c.stamp_ns > dive.host.now - S)
    dive.say("wish", what="light")
    dive.run(0.5)
    assert dive.counts["expired:wish"] == 1
    assert dive.status.light == 0.0
    dive.say("wish", what="disarm")  # never too late
    dive.run(0.5)
    assert not dive.status.armed


def test_a_slow_page_is_left_out_and_catches_up(dive: PageDive):
    dive.browsers.cut.add(BOB + 1)
    dive.open(BOB, watcher=True)
    dive.steer(2.0)
    shown = dive.browsers.shown[BOB + 1]
    assert shown <= UNSEEN
    assert dive.counts["dropped:page"] >= SHOW_HZ
    dive.browsers.cut.clear()
    dive.say("seen", BOB, seen=dive.browsers.pictures[ANN + 1]["n"] - 40)  # the last that it got
    dive.steer(0.5)
    assert dive.browsers.shown[BOB + 1] > shown + 5


def test_a_watcher_commands_nothing(dive: PageDive):
    dive.open(BOB, watcher=True)
    for what in ("take", "force", "stop", "disarm", "arm", "light"):
        dive.wish(what, BOB)
        dive.steer(0.02)
    dive.steer(0.1, BOB, surge=1.0)
    dive.say("absent", BOB, why="hidden")
    dive.steer(0.2)
    assert dive.counts["refused:watcher"] == 12
    assert dive.status.armed
    assert dive.status.activity == "piloted"
    assert max(abs(c.surge) for c in dive.commands) == 0.0


@pytest.mark.parametrize("how", ["hidden", "silent"])
def test_a_page_that_is_gone_keeps_the_sticks_for_two_seconds(dive: PageDive, how: str):
    dive.open(BOB).steer(0.1)
    if how == "hidden":
        dive.say("absent", ANN, why="hidden")
    dive.run(1.0)
    assert dive.you(BOB)["taken"]
    dive.wish("take", BOB)
    assert not dive.you(BOB).get("has_sticks")
    dive.run(1.5)
    assert not dive.you(BOB).get("taken")
    dive.wish("take", BOB)
    dive.steer(0.5, BOB)
    assert dive.you(BOB)["has_sticks"]
    assert dive.you(BOB)["in_control"]


def test_a_stop_is_confirmed_to_its_page_and_waits_for_the_drone(dive: PageDive):
    assert not dive.you().get("stops")
    dive.wish("stop")
    dive.steer(0.5)
    assert dive.you()["stops"] == 1
    assert not dive.you().get("stop_waits")  # the drone has answered
    dive.host.kill("tether")
    dive.wish("stop")
    dive.steer(0.3)
    assert dive.you()["stops"] == 2
    assert dive.you()["stop_waits"]


def test_a_second_page_waits_until_the_sticks_are_given_back_but_may_stop(dive: PageDive):
    dive.open(BOB).steer(0.1)
    assert dive.you(BOB)["taken"]
    dive.wish("take", BOB)
    dive.steer(0.1)
    dive.steer(0.1, BOB, surge=1.0)
    dive.wish("light", BOB)
    assert dive.counts["not_the_holder:page"] == 7
    assert dive.you()["has_sticks"]
    dive.steer(0.5, surge=0.6)
    dive.wish("stop", BOB)
    dive.steer(0.3)
    assert "stop" in dive.asked
    dive.wish("give_back").run(0.3)
    assert dive.status.pilot == ""
    assert dive.counts["lost:page_silent"] == 0  # deliberate
    dive.wish("take", BOB)
    dive.steer(0.5, BOB)
    assert dive.you(BOB)["in_control"]
    assert dive.status.pilot == "ann"


def test_of_two_pages_that_both_hold_arm_the_one_with_the_sticks_arms(tmp_path: Path):
    dive = PageDive(tmp_path).open().open(BOB)
    for page in (ANN, BOB):  # to hold begins with taking the sticks
        dive.wish("take", page)
    while dive.status.activity != "ready":
        dive.steer(0.5)
    for page in (BOB, ANN):  # and ends with the wish
        dive.wish("arm", page)
    dive.steer(0.5)
    assert dive.status.armed
    assert dive.status.pilot == "ann"
    assert dive.counts["not_the_holder:page"] == 2  # BOB's two wishes
    assert dive.asked == ["lease", "arm"]


def test_a_gamepad_s_lease_holds_against_a_page_until_offered_or_forced(tmp_path: Path):
    dive = PageDive(tmp_path, "0,0,0,0,0\n60,0,0,0,0\n").open()
    while not dive.statuses or not dive.status.armed:
        dive.run(0.5)
    assert dive.status.pilot == "script script"
    dive.wish("take").steer(0.3, surge=0.5)
    assert dive.status.pilot == "script script"
    assert dive.counts["refused:lease"] == 1
    assert not dive.you().get("in_control")
    assert max(abs(c.surge) for c in dive.commands) == 0.0  # nothing is published meanwhile
    dive.wish("force").steer(0.5)
    assert dive.status.pilot == "ann"
    dive.steer(0.3, surge=0.5)
    assert dive.commands[-1].surge == 0.5
    dive.wish("offer").steer(0.2)
    assert "offer" in dive.asked
    dive.wish("give_back").run(0.5)
    assert dive.status.pilot == ""


def test_sticks_from_the_future_or_of_an_unknown_picture_are_not_believed(dive: PageDive):
    """Centred before and not lost yet, so that only their age keeps them from acting."""
    ages = [(-(10**9), 0.0), (10**9, 0.0), (1, 1e9), (25, 60_000.0), (25, 1_100.0)]
    for lost, (back, held_ms) in enumerate(ages, start=1):
        dive.steer(1.5)
        seen = max(0, dive.browsers.pictures[ANN + 1]["n"] - back)
        for _ in range(5):
            dive.say("sticks", surge=0.9, sway=0.0, heave=0.0, yaw=0.0, seen=seen, held_ms=held_ms)
            dive.run(1.0 / dive.hz)
        assert dive.counts["lost:page_silent"] == lost
        assert max(abs(c.surge) for c in dive.commands) == 0.0
    dive.steer(1.5)
    seen = dive.browsers.pictures[ANN + 1]["n"] - 5  # 200 ms ago, and young enough
    dive.say("sticks", surge=0.9, sway=0.0, heave=0.0, yaw=0.0, seen=seen, held_ms=100.0)
    dive.run(0.05)
    assert dive.commands[-1].surge == 0.9
