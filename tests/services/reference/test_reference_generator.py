"""The pilot's state machine: arming, releasing, losing the pilot, and never a step."""

from itertools import pairwise
from math import dist, pi

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.control import Wrench
from messages.events import Outbox, note
from messages.pilot import Course, PilotRequest, RequestKind
from messages.reference import Motion
from messages.state import VehicleState
from messages.vehicle import PlaceAhead
from services.marine.attitude import wrapped
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.reference.failsafe.table import WatchedMessages
from services.reference.guidance.guidance import TURN_SHORT
from services.runtime.config.stack import Stack
from tests.services.reference.drone import DT, Drone, smooth
from tests.support.messages import example
from tests.support.said import state, sticks
from tests.support.told import told

touch = st.sampled_from([-1.0, -0.4, 0.0, 0.02, 0.3, 1.0])
GENERATE = [Phase.explicit, Phase.generate]  # a minute of flight is too long to be shrunk


def armed(settings: Settings | None = None) -> Drone:
    return Drone(settings).armed()


def test_what_cannot_be_is_refused_with_the_reason() -> None:
    guidance = Drone()
    guidance.generator.step(state(DT, phase="calibrating"), sticks(DT), DT)
    assert guidance.generator.activity == "starting"
    assert "does not know its depth" in guidance.ask("arm")
    guidance.fly(0.1)
    assert "not centred" in guidance.ask("arm", sticks(0, heave=0.5))
    assert guidance.ask("goto", depth=2.0) == "the drone is not armed"
    assert not guidance.generator.armed

    guidance = armed()
    assert "needs a depth or a heading" in guidance.ask("goto")
    assert "above the surface" in guidance.ask("goto", depth=-1.0)
    assert "does not know its position" in guidance.ask("goto", north=5.0, east=0.0)
    assert "needs north and east" in guidance.ask("goto", north=5.0)
    bad = Course(waypoints=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), min_radius=9.0)
    assert "this is no path: " in guidance.ask("follow", course=bad)
    assert guidance.ask("follow") == "follow needs a path"
    assert guidance.generator.activity == "piloted"


def test_the_pilot_reads_what_keeps_the_drone_from_being_ready() -> None:
    generator = Drone().generator

    def said(seen: VehicleState | None) -> str:
        generator.step(seen, None, DT)
        return note(generator.status(DT).notices)

    calibrating = replace(state(DT, phase="calibrating"), calibration_left=7.0)
    assert said(None).startswith("not ready: no usable samples of the drone's IMU")
    assert said(calibrating) == "calibrating: keep the drone still (7 s to go)"
    blocked = replace(calibrating, calibration_left=None, blocked_by="upside_down:sensor/imu")
    assert "(the IMU reads as if the drone lay upside down)" in said(blocked)
    assert said(None).startswith("not ready: no usable")
    assert said(state(DT)) == ""


def test_an_unplugged_pad_is_a_lost_pilot_although_its_sticks_read_zero() -> None:
    guidance = armed()
    guidance.fly(0.1, pilot="lost")
    assert guidance.status.failsafe == "pilot_lost"


def test_stop_ignores_the_sticks_until_they_were_centred() -> None:
    guidance = armed()
    guidance.fly(2.0, heave=1.0)
    guidance.ask("stop")
    assert guidance.fly(4.0, heave=1.0).depth.velocity == 0.0
    assert guidance.generator.activity == "stopping"
    guidance.fly(0.1)
    assert guidance.fly(3.0, heave=1.0).depth.velocity == Settings().heave.max_velocity


def test_a_disarm_that_control_hands_on_late_does_not_end_a_later_arming() -> None:
    """Control has obeyed it at once, and says so when `reference` speaks again."""
    guidance = armed()
    old = PilotRequest(stamp_ns=DT, id="old", kind="disarm")  # before the arming
    newest = PilotRequest(stamp_ns=guidance.now + 1, id="new", kind="disarm")
    assert not guidance.generator.handed_on(old, guidance.now + 2)
    assert guidance.fly(0.1).armed
    assert guidance.generator.handed_on(newest, guidance.now)
    assert not guidance.fly(0.1).armed


def test_a_home_that_was_lost_is_where_the_drone_is_armed_next() -> None:
    guidance = Drone()
    before = GuidanceCheckpoint(home_lost=True)
    guidance.generator = ReferenceGenerator(Settings(), Outbox(), before)
    guidance.place = (3.0, -2.0)
    guidance.fly(0.2)
    assert guidance.generator.checkpoint.home is None
    assert guidance.ask("arm") == ""
    guidance.fly(0.2)
    home = guidance.generator.checkpoint.home
    assert home is not None
    assert (home.north, home.east) == pytest.approx((3.0, -2.0))


@pytest.mark.parametrize(
    ("mode", "then", "taken", "told_of"),
    [
        ("heading_hold", None, "heading_hold", []),
        ("heading_hold", "stop", "stabilised", []),
        ("heading_hold", "disarm", "stabilised", []),
        ("station_keeping", None, "stabilised", ["refused:mode"]),  # not to be had at rest
    ],
)
def test_a_mode_asked_for_while_stopping_is_taken_up_at_rest_unless_something_else_is_asked(
    mode: str, then: RequestKind | None, taken: str, told_of: list[str]
) -> None:
    guidance = armed()
    guidance.fly(2.0, heave=1.0)
    guidance.ask("stop")
    answer = guidance.request("mode", flight_mode=mode)
    assert answer.accepted
    assert answer.note == "the drone is stopping; it changes when it is at rest"
    guidance.fly(0.2)
    assert guidance.generator.activity == "stopping"
    assert guidance.status.flight_mode == "stabilised"
    if then is not None:
        guidance.ask(then)
    told(guidance.generator.outbox)
    guidance.fly(4.0)
    assert guidance.status.flight_mode == taken
    assert told(guidance.generator.outbox) == told_of


def test_held_back_by_the_floor_the_reference_waits() -> None:
    guidance, s = armed(), Settings()
    for _ in range(1000):
        guidance.depth = 1.0
        out = guidance.fly(DT / 1e9, heave=1.0)
        assert out.depth.position <= 1.0 + s.heave.max_error + 1e-9
    assert guidance.generator.outbox.counts["clamped:reference.depth"] == 1


@pytest.mark.parametrize(("achieved", "most"), [(6.0, TURN_SHORT), (9.0, 0.5)])
def test_where_all_thrust_does_not_turn_it_fast_enough_the_heading_waits(
    achieved: float, most: float
) -> None:
    """Also where heave is what the thrusters lack, but only a lack of yaw makes the turn wait."""
    guidance = armed()
    generator, now = guidance.generator, guidance.now
    wanted, got = (0.0, 0.0, 50.0, 0.0, 0.0, 9.0), (0.0, 0.0, 35.0, 0.0, 0.0, achieved)
    furthest = 0.0
    for step in range(500):
        now += DT
        turned = 0.7 * step * DT / 1e9  # [rad] of the 1.05 rad/s that are asked for
        wrench = example(Wrench, now, wanted=wanted, achieved=got, saturated=True)
        generator.conditions.newest = WatchedMessages(wrench=wrench)
        out = generator.step(state(now, heading=turned), sticks(0, yaw=1.0), now)
        assert out is not None
        furthest = max(furthest, out.heading.position - turned)
    assert 0.9 * most < furthest <= most + 1e-9


def test_without_a_state_it_stops_smoothly_and_keeps_its_rate() -> None:
    guidance = armed()
    before = guidance.fly(3.0, heave=1.0).depth
    first = guidance.fly(DT / 1e9, there="no state", heave=1.0).depth
    assert abs(first.velocity - before.velocity) < 0.01
    end = guidance.fly(5.0, there="no state", heave=1.0)
    assert end.depth.velocity == 0.0
    assert end.sensor_ns is None
    assert guidance.status.failsafe == "state_lost"


def test_goto_arrives_exactly_at_depth_and_heading_the_shortest_way() -> None:
    guidance = armed()
    guidance.fly(6.0, yaw=1.0)
    guidance.fly(3.0)
    turned = guidance.heading
    assert guidance.ask("goto", depth=3.0, heading=0.5) == ""
    assert guidance.generator.activity == "goto"
    end = guidance.fly(15.0)
    assert abs(end.depth.position - 3.0) < 1e-9
    assert abs(wrapped(end.heading.position - 0.5)) < 1e-9
    assert abs(end.heading.position - turned) <= pi
    assert guidance.generator.activity == "piloted"
    smooth(guidance.flown, Settings(), stops=True)


@settings(max_examples=15, deadline=None, phases=GENERATE)
@given(st.floats(0.0, 6.0), touch, touch)
def test_the_pilot_takes_over_from_goto_at_any_moment_without_a_step(
    when: float, heave: float, yaw: float
) -> None:
    guidance = armed()
    guidance.ask("goto", depth=3.0, heading=2.5)
    guidance.fly(when)
    guidance.fly(2.0, heave=heave, yaw=yaw)
    guidance.fly(3.0)
    smooth(guidance.flown, Settings(), stops=True)


def course(**more: object) -> Course:
    points = ((0.0, 0.0, 2.0), (15.0, 0.0, 2.5), (15.0, 15.0, 3.0))
    return Course(waypoints=points, min_radius=3.0, **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_path_is_followed_to_its_end_in_heading_depth_and_pace() -> None:
    guidance = armed()
    assert guidance.ask("follow", course=course()) == ""
    assert guidance.generator.activity == "follow"
    guidance.fly(130.0)
    end = guidance.flown[-1]
    assert guidance.generator.activity == "piloted"
    assert [text for _, text, _ in guidance.generator.outbox.said] == ["the end of the path"]
    assert abs(end.heading.position - pi / 2) < 1e-9
    assert abs(end.depth.position - 3.0) < 1e-9
    assert end.surge is None
    fastest = max(r.surge.velocity for r in guidance.flown if r.surge)
    assert abs(fastest - 0.3) < 1e-9
    smooth(guidance.flown, Settings(), stops=True)


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["stop", "pilot_lost", "sticks"])
@pytest.mark.parametrize("vehicle", ["bluerov2_heavy", "minerva", "pioneer"])
def test_a_path_ends_by_the_limits_of_the_place(vehicle: str, ending: str) -> None:
    """Along a path the drone moves as it moves in the plane, whatever it can do up and down."""
    s = Stack(vehicle=vehicle).section("reference", Settings)
    guidance = armed(s)
    guidance.ask("follow", course=course(acceleration=0.05, jerk=0.05))
    guidance.fly(30.0)
    begun = len(guidance.flown)
    if ending == "stop":
        guidance.ask("stop")
    guidance.fly(8.0, heave=0.5, there="no pilot" if ending == "pilot_lost" else "pilot")
    limits = s.place.stop if ending == "stop" else s.place.limits
    paces = [r.surge for r in guidance.flown[begun:] if r.surge is not None]
    assert paces[0].velocity > 0.25
    assert guidance.flown[-1].surge is None
    braking = max(-pace.acceleration for pace in paces)
    assert 0.5 * limits.acceleration < braking <= limits.acceleration * (1 + 1e-9)
    assert max(abs(pace.jerk) for pace in paces) <= limits.jerk * (1 + 1e-9)


@pytest.mark.parametrize("down", [2.0, -0.8])
def test_a_stop_on_a_path_that_slopes_says_how_far_down_it_goes(down: float) -> None:
    guidance = armed()
    slope = Course(waypoints=((0.0, 0.0, 1.0), (12.0, 0.0, 1.0 + down)))
    assert guidance.ask("follow", course=slope) == ""
    guidance.fly(12.0)
    before = guidance.flown[-1]
    stop = guidance.request("stop").stop
    assert stop is not None
    guidance.fly(4.0)
    assert stop.depth * down > 0.0
    assert guidance.flown[-1].depth.position - before.depth.position == pytest.approx(stop.depth)


def test_the_camera_stops_smoothly_at_the_end_of_its_range() -> None:
    guidance, s = armed(), Settings().tilt
    guidance.fly(0.3, tilt=1.0)
    guidance.fly(1.0)
    between = guidance.flown[-1].tilt
    assert 0.0 < between.position < s.highest
    assert between.velocity == 0.0
    guidance.fly(4.0, tilt=1.0)
    assert abs(guidance.flown[-1].tilt.position - s.highest) < 1e-9
    for before, after in pairwise(guidance.flown):
        step = abs(after.tilt.acceleration - before.tilt.acceleration)
        assert step <= s.jerk * DT * 1e-9 + 1e-9
        assert s.lowest - 1e-9 <= after.tilt.position <= s.highest + 1e-9


def places(ahead: tuple[PlaceAhead, ...]) -> list[tuple[float, float]]:
    return [(each.north, each.east) for each in ahead]


@pytest.mark.slow
def test_of_a_path_the_next_way_points_are_said_until_each_is_passed() -> None:
    """From where the drone is: the path is given from its own first way-point on."""
    guidance = armed()
    guidance.place = (20.0, -10.0)
    guidance.fly(0.1)
    corners = ((0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (60.0, 30.0))
    course = Course(waypoints=corners, min_radius=2.0, cruise=1.0)
    assert guidance.ask("follow", course=course) == ""
    guidance.fly(5.0)
    there = [(n + 20.0, e - 10.0) for n, e in corners]
    seen = list[object]()
    for _ in range(80):
        guidance.fly(2.0)
        status = guidance.status
        assert status.goal is UNSET
        ahead = [] if status.waypoints is UNSET else places(status.waypoints)
        assert [*map(pytest.approx, ahead)] == there[len(there) - len(ahead) :]
        if not seen or seen[-1] != len(ahead):
            seen.append(len(ahead))
    assert seen == [3, 2, 1, 0]
    assert guidance.generator.activity == "piloted"


def test_of_a_long_path_a_few_way_points_are_said_and_of_a_blind_one_none() -> None:
    corners = tuple((10.0 * k, 0.0) for k in range(40))
    for place, number in ((0.0, 0.0), 8), (None, 0):
        guidance = armed()
        guidance.place = place
        guidance.fly(0.1)
        assert guidance.ask("follow", course=Course(waypoints=corners)) == ""
        guidance.fly(5.0)
        assert guidance.generator.activity == "follow"
        ahead = guidance.status.waypoints
        assert (ahead is UNSET) == (number == 0)
        if ahead is not UNSET:
            assert [*map(pytest.approx, places(ahead))] == list(corners[1 : number + 1])


def test_goto_a_place_turns_there_runs_the_distance_and_stops() -> None:
    guidance = armed()
    guidance.place = (2.0, 1.0)
    guidance.fly(0.1)
    assert guidance.ask("goto", north=2.0, east=9.0, depth=2.0) == ""
    end = guidance.fly(40.0)
    assert guidance.place is not None
    assert dist(guidance.place, (2.0, 9.0)) < 1e-6
    assert abs(end.heading.position - pi / 2) < 1e-9
    assert abs(end.depth.position - 2.0) < 1e-9
    assert guidance.generator.activity == "piloted"
    assert all(r.surge is None for r in guidance.flown)  # nothing of it was blind
    smooth(guidance.flown, Settings(), stops=True)


# On a busy computer: the reference is of the sensors' time, not of when it is handled.


MS, PERIOD_MS = 1_000_000, 10  # [ns], [ms]
SILENT_AFTER = 10  # [periods] as the service waits
# How many states come in a row, and for how many periods none does, after that.
stretches = st.lists(st.tuples(st.integers(1, 60), st.integers(0, 30)), min_size=1, max_size=6)


def under_way(sensor_ns: int) -> VehicleState:
    """A vehicle that moves as it is asked to."""
    t = sensor_ns / 1e9
    return state(sensor_ns, depth=2.0 + 0.4 * t, heading=0.5 * t)


def handled(moves: list[tuple[int, int]], latency_ms: int) -> list[tuple[Motion, Motion]]:
    """Depth and heading of every reference, sticks away from the centre all the time."""
    generator, k = ReferenceGenerator(Settings(), Outbox()), 100
    said: list[tuple[Motion, Motion]] = []

    def step(*, heard: bool) -> None:
        nonlocal k
        k += 1
        now = (k * PERIOD_MS + latency_ms) * MS
        seen = under_way(k * PERIOD_MS * MS) if heard else None
        out = generator.step(seen, sticks(now, heave=1.0, yaw=1.0), now)
        assert out is not None
        said.append((out.depth, out.heading))

    step(heard=True)
    answer = generator.answer(PilotRequest(stamp_ns=0, id="1", kind="arm"), sticks(), 0)
    assert answer.accepted, answer.reason
    for states, silence in moves:
        for _ in range(states):
            step(heard=True)
        if silence > SILENT_AFTER:
            k += SILENT_AFTER
            for _ in range(silence - SILENT_AFTER):
                step(heard=False)
    return said


@settings(max_examples=40, deadline=None)
@given(stretches, st.integers(1, 80))
def test_the_same_samples_handled_later_give_the_same_reference(
    moves: list[tuple[int, int]], latency_ms: int
) -> None:
    assert handled(moves, latency_ms) == handled(moves, 0)
