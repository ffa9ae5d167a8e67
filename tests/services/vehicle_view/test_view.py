"""What the pilot is shown of the vehicle, as numbers in their places, and what is old or gone."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from messages import topics
from messages.control import ThrusterCommand
from messages.events import CONDITIONS, short, told
from messages.message import Estimate, Notice
from messages.reference import Motion, Reference
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.vehicle import Failsafe, Reaction, VehicleStatus
from services.runtime.hosts.virtual_host import VirtualHost
from services.vehicle_view import ages, words
from services.vehicle_view.ages import GONE_AT_LEAST_NS, GREY_AT_LEAST_NS
from services.vehicle_view.io.ports import VehiclePorts
from services.vehicle_view.view import OVERRULED_NS, Newest, VehicleView, believed, vehicle_view
from services.vehicle_view.words import head_up, notes
from tests.support.messages import example

S = 1_000_000_000
FAILSAFES: list[Failsafe] = ["leak", "state_lost", "pilot_lost", "link_lost"]
REACTIONS: list[Reaction] = ["stop", "ascend", "surface"]


def status(**fields: object) -> VehicleStatus:
    return VehicleStatus(**({"stamp_ns": 0, "activity": "piloted", "armed": True} | fields))  # type: ignore[arg-type]


def state(depth: float = 3.0) -> VehicleState:
    return example(VehicleState, phase="running", depth=Estimate(depth, 0.1))


def test_the_age_table_is_that_of_the_topic_table():
    for topic in topics.ALL:
        if topic.stale_after_ns is None:
            continue
        grey, gone = ages.ages(topic)
        assert topic.stale_after_ns <= grey < gone
        assert grey >= GREY_AT_LEAST_NS
        assert gone >= GONE_AT_LEAST_NS


@given(st.integers(0, 20 * S))
def test_what_is_old_is_said_so_and_what_is_gone_is_not_shown(now: int):
    battery = BatterySample(stamp_ns=0, voltage=15.0, current=1.0, used_wh=66.5, capacity_wh=266.0)
    view = vehicle_view(Newest(status=status(), state=state(), battery=battery), now)
    assert (view.depth_m is None) == (now > ages.STATE.gone_ns)
    assert view.old == bool(words.old(view)) == (ages.STATE.grey_ns < now <= ages.STATE.gone_ns)
    assert (view.charge is None) == (now > ages.BATTERY.gone_ns)
    assert view.charge in (None, 0.75)
    assert view.last_known == (now > ages.STATUS.grey_ns)
    assert view.last_known == any(note.startswith("no status from the") for note in notes(view))
    assert (view.light is None) == view.last_known
    assert view.armed  # as far as anybody knows


@given(st.sampled_from(FAILSAFES), st.sampled_from(REACTIONS), st.booleans(), st.text(max_size=9))
def test_in_a_failsafe_nobody_is_told_that_he_has_the_sticks(
    failsafe: Failsafe, reaction: Reaction, yours: bool, pilot: str
):
    acts = status(
        failsafe=failsafe, reaction=reaction, pilot=pilot, since_ns=0, returns="centre",
        acting=(Notice(f"failsafe:{failsafe}"),), conditions=(failsafe,),
    )  # fmt: skip
    view = vehicle_view(Newest(status=acts), S // 2)
    assert "has the sticks" not in words.sticks(view, yours=yours)
    assert "you have" not in words.sticks(view, yours=yours)
    assert view.doing != "piloted"
    assert words.said(view)[0].tone == "alarm"
    text = words.said(view)[0].text
    assert f": {CONDITIONS[failsafe].sentence}; the drone " in text
    assert text.endswith("; centre the sticks to continue")
    ended = vehicle_view(Newest(status=msgspec.structs.replace(acts, conditions=())), S // 2)
    assert f"{short(f'failsafe:{failsafe}')} has ended; the drone" in words.acting(ended)


def test_a_drone_that_acted_before_the_link_went_is_still_known_to_rise() -> None:
    acts = status(failsafe="pilot_lost", reaction="stop", since_ns=0, next_ns=60 * S)
    view = vehicle_view(Newest(status=acts), 34 * S)
    assert (view.silent_s, view.next_s) == (34.0, 26.0)
    assert words.failsafe(view) == "FAILSAFE pilot lost, rises in 26 s"


def test_a_drone_that_nobody_moves_holds_nothing() -> None:
    acts = status(failsafe="state_lost", reaction="stop", since_ns=0)
    for conditions in ((), ("board_silent",), ("control_silent", "service_silent")):
        said = msgspec.structs.replace(acts, conditions=conditions)
        seen = vehicle_view(Newest(status=said), 0)
        assert seen.doing == ("not obeyed" if conditions else "holding")
        nobody = "nothing moves the drone: its board or control does not answer"
        assert words.acting(seen) == (nobody if conditions else "the drone has stopped and holds")


@pytest.mark.parametrize(("speed", "doing"), [(0.2, "stopping"), (0.0, "holding")])
def test_a_stop_in_a_failsafe_is_over_once_the_drone_stands(speed: float, doing: str) -> None:
    """However long nobody takes the sticks."""
    acts = status(activity="stopping", failsafe="pilot_lost", reaction="stop", since_ns=0)
    still, moves = Motion(1.0, 0.0, 0.0, 0.0), Motion(1.0, speed, 0.0, 0.0)
    wanted = Reference(
        stamp_ns=0, sensor_ns=None, pilot_ns=None, armed=True, depth=still, heading=moves,
        surge_force=0.0, sway_force=0.0,
    )  # fmt: skip
    assert vehicle_view(Newest(status=acts, reference=wanted), 0).doing == doing


def test_a_pilot_who_has_stopped_the_drone_is_told_to_centre_the_sticks():
    view = vehicle_view(Newest(status=status(activity="stopping")), 0)
    assert [each.text for each in words.said(view)] == [words.STOPPING]


@given(st.booleans(), st.booleans(), st.integers(0, S), st.integers(0, S))
def test_a_drone_that_control_has_disarmed_is_not_called_armed(
    said: bool, armed: bool, status_ns: int, command_ns: int
) -> None:
    """A hung `reference` has not heard the disarm, and its last status says armed."""
    command = ThrusterCommand(
        stamp_ns=command_ns, sensor_ns=0, pilot_ns=None, thrust=(), armed=armed
    )
    told = status(armed=said, stamp_ns=status_ns)
    overruled = not armed and command_ns - status_ns > OVERRULED_NS
    assert believed(told, command) == status(armed=said and not overruled, stamp_ns=status_ns)
    assert believed(told, None) == told


@given(st.none() | st.floats(0.0, 1e4), st.floats(0.0, 1e4))
def test_charge_is_known_where_the_capacity_is(capacity: float | None, used: float):
    sample = BatterySample(stamp_ns=0, voltage=1.0, current=0.0, used_wh=used, capacity_wh=capacity)
    charge = vehicle_view(Newest(battery=sample), 0).charge
    assert (charge is None) == (not capacity)
    assert charge is None or 0.0 <= charge <= 1.0


@pytest.mark.parametrize(("name", "tone"), [("battery_low", "warning"), ("leak", "alarm")])
def test_water_inside_is_an_alarm_also_where_the_pilot_flies_on(name: str, tone: str):
    """By its code, whatever the sentence says."""
    notice = Notice(f"notice:{name}")
    status = VehicleStatus(stamp_ns=0, activity="piloted", armed=True, notices=(notice,))
    assert words.others(vehicle_view(Newest(status), 0)) == [(told(notice), tone)]


# The head-up numbers: everything that a pilot must see, each always in its place.


CALM = VehicleView(
    activity="piloted",
    doing="piloted",
    flight_mode="station_keeping",
    light=0.5,
    battery_v=15.94,
    used_wh=12.3,
    charge=0.95,
    armed=True,
    age_ms=42.0,
    depth_m=12.345,
    depth_wanted_m=12.4,
    heading_deg=359.9,
    heading_wanted_deg=0.1,
    rtt_ms=23.4,
)
number = st.none() | st.floats(-1e4, 1e4)
text = st.text(max_size=300)
noted = st.lists(st.builds(Notice, text, more=text), max_size=3).map(tuple)
views = st.builds(
    VehicleView,
    activity=text, doing=text, flight_mode=text, light=number,
    battery_v=number, used_wh=number,
    armed=st.booleans(), silent_s=number, failsafe=st.sampled_from(["none", "pilot_lost"]),
    since_s=number, next_s=number, acting=noted, notices=noted, age_ms=number, depth_m=number,
    depth_wanted_m=number, heading_deg=number, heading_wanted_deg=number, rtt_ms=number,
    alarms=noted,
)  # fmt: skip


@given(views)
def test_every_line_of_a_window_stays_in_its_place_with_all_words_of_what_is_wrong(
    view: VehicleView,
):
    lines = head_up(view)
    assert len(lines) == len(head_up(VehicleView()))
    shown = lines[-1]
    assert (shown.tone == "alarm") == bool(
        view.failsafe != "none" or view.next_s is not None or view.alarms
    )
    acts = view.acting if view.acts else ()
    for part in (each.more for each in (*acts, *view.alarms, *view.notices)):
        assert part in shown.text


def test_old_numbers_and_the_last_known_state_are_warnings():
    lines = head_up(replace(CALM, age_ms=2345.0, silent_s=4.0))
    assert [tone for _, tone in lines[:2]] == ["warning", "warning"]
    assert lines[0].text == "last known: ARMED"
    assert "2.3 s old" in lines[5].text


def test_a_screen_hears_commands_that_come_too_late_to_act() -> None:
    """Over a slow link they do, and that is no trouble of the screen's."""
    host = VirtualHost()
    says = host.node("control", ["drone"]).publisher(topics.THRUSTERS)
    screen = host.node("screen", ["drone"])
    ports = VehiclePorts(screen)
    command = ThrusterCommand(stamp_ns=0, sensor_ns=None, pilot_ns=None, thrust=(0.0,))
    host.run(S)
    says.put(command)
    host.run(2 * S)
    assert ports.thrusters(host.now) is not None
    assert not screen.counts
