"""What the drone holds in each mode, and that changing it is never felt."""

from itertools import pairwise
from math import dist, hypot, isfinite, pi, radians
from typing import Any, cast, get_args

import msgspec
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.pilot import Course, FlightMode, PilotAnswer, PilotCommand, RequestKind
from messages.reference import Motion, Reference
from messages.sensors import DvlSample
from messages.state import VehicleState
from services.marine.attitude import turned, wrapped
from services.reference.core import GuidanceCheckpoint, Settings
from services.reference.failsafe.table import WatchedMessages
from services.reference.guidance.axes import HELD_AXES
from services.reference.settings import StickForce
from tests.services.reference.drone import Drone
from tests.support import said
from tests.support.told import told

DT = 0.01  # [s]
PLACE_PATIENCE_S = 2.0  # [s] written out: an imported one would follow any change
GENERATE = [Phase.explicit, Phase.generate]  # half a minute of flight is too long to be shrunk
SETTINGS = Settings()
HOLD_NAMES: tuple[FlightMode, ...] = get_args(FlightMode)
MASS, DRAG = (14.0, 28.0, 20.0, 0.4), (25.0, 45.0, 25.0, 1.5)  # surge, sway, heave, yaw
WAY = Course(waypoints=((0.0, 0.0), (6.0, 0.0), (6.0, 6.0)), min_radius=1.5)


def sticks(
    surge: float = 0.0, sway: float = 0.0, heave: float = 0.0, yaw: float = 0.0, epoch: int = 0
) -> PilotCommand:
    return said.sticks(0, surge=surge, sway=sway, heave=heave, yaw=yaw, epoch=epoch)


class Sea(Drone):
    """A vehicle that is where the reference wants it on the axes that are held, and that drifts
    with its forces on the others."""

    def __init__(
        self,
        *,
        measures: bool = True,
        offset: float = 0.0,
        before: GuidanceCheckpoint | None = None,
    ) -> None:
        super().__init__(SETTINGS, before)
        self.measures, self.knows_place = measures, True
        self.slope, self.sees_bottom = 0.0, True  # [-] falling away to the north
        self.dvl: DvlSample | None = None
        self.knows_depth = True
        self.offset = offset  # [rad] north heading minus control heading
        self.at = [4.0, -3.0, 3.0, 0.0]  # north, east, depth, heading
        self.v = [0.0, 0.0, 0.0, 0.0]  # surge, sway, heave, yaw
        self.a_heave = 0.0
        self.stuck = False  # in its place
        self.behind = 0.0  # [m] south of where it is wanted
        self.seen: list[tuple[Reference, VehicleState | None]] = []

    def state(self) -> VehicleState:
        names = ("north", "east", "surge_velocity", "sway_velocity")
        over_ground = zip(names, (*self.at[:2], *self.v[:2]), strict=True)
        unknown = () if self.knows_depth else ("depth", "depth_rate")
        return said.state(
            self.now,
            invalid=unknown if self.knows_place else (*unknown, *names),
            depth=self.at[2],
            depth_rate=self.v[2],
            depth_acceleration=self.a_heave,
            heading=self.at[3],
            heading_navigation=wrapped(self.at[3] + self.offset),
            yaw_rate=self.v[3],
            **(dict(over_ground) if self.measures else {}),
        )

    def look_down(self) -> None:
        """Once a second an altitude, above a bottom that is 20 m deep where north is 0."""
        soon = self.dvl is not None and self.now % 1_000_000_000 > round(DT * 1e9)
        if soon or not self.measures:
            return
        altitude = max(0.0, 20.0 + self.slope * self.at[0] - self.at[2])
        velocity = (self.v[0], self.v[1], self.v[2])
        self.dvl = DvlSample(
            stamp_ns=self.now,
            velocity=velocity,
            std=0.01,
            altitude=altitude if self.sees_bottom else None,
        )
        self.generator.conditions.newest = WatchedMessages(dvl=self.dvl)

    def request(
        self, kind: RequestKind, command: PilotCommand | None = None, **more: Any
    ) -> PilotAnswer:
        return super().request(kind, command or sticks(epoch=self.epoch), **more)

    def sail(
        self, seconds: float, command: PilotCommand | None = None, *, lost: str = ""
    ) -> Reference:
        """Some time with these sticks, without a `pilot` or without a `state`."""
        for _ in range(max(1, round(seconds / DT))):
            self.now += round(DT * 1e9)
            state = None if lost == "state" else self.state()
            self.look_down()
            heard = replace(command or sticks(), epoch=self.epoch)
            self.step(state, None if lost == "pilot" else heard)
            self.seen.append((self.flown[-1], state))
            self._move(self.flown[-1])
        return self.seen[-1][0]

    def _move(self, r: Reference) -> None:
        if not r.armed:
            return
        forces = (r.surge_force, r.sway_force, r.heave_force or 0.0, r.yaw_moment or 0.0)
        a = [
            (f - d * v * abs(v)) / m for f, d, v, m in zip(forces, DRAG, self.v, MASS, strict=True)
        ]
        self.v = [v + x * DT for v, x in zip(self.v, a, strict=True)]
        self.a_heave = a[2]
        for axis, motion, free in ((2, r.depth, r.heave_force), (3, r.heading, r.yaw_moment)):
            if free is None:
                self.at[axis], self.v[axis] = motion.position, motion.velocity
            else:
                self.at[axis] += self.v[axis] * DT
        if r.heave_force is None:
            self.a_heave = r.depth.acceleration
        north = self.at[3] + self.offset
        if self.stuck:
            return
        if r.north is not None and r.east is not None:
            self.at[:2] = r.north.position - self.behind, r.east.position
            self.v[:2] = turned((r.north.velocity, r.east.velocity), -north)
        else:
            self.v[0] = self.v[0] if r.surge is None else r.surge.velocity
            vn, ve = turned((self.v[0], self.v[1]), north)
            self.at[:2] = self.at[0] + vn * DT, self.at[1] + ve * DT


def armed(hold: FlightMode = "stabilised", **sea: object) -> Sea:
    drone = Sea(**sea)  # type: ignore[arg-type]
    drone.sail(0.05)
    assert drone.ask("mode", flight_mode=hold) == ""
    assert drone.ask("arm") == ""
    drone.sail(0.05)
    return drone


# Never a step.


def check(sea: Sea) -> None:
    """The laws of every flight: no step on a held axis, none in a force, holding begins where the
    vehicle is and as it moves, and every number is a number."""
    remains = [0.0, 0.0]  # [N, N m] heave force and yaw moment, when they were last said
    since = [0, 0]  # steps for which they were not said
    for (before, _), (after, state) in pairwise(sea.seen):
        assert all(map(isfinite, numbers(after)))
        if not (before.armed and after.armed):
            remains = [0.0, 0.0]
            continue
        for axis, name, force, most in (
            (SETTINGS.heave, "depth", "heave_force", SETTINGS.heave_force),
            (SETTINGS.yaw, "heading", "yaw_moment", SETTINGS.yaw_moment),
        ):
            was, now = getattr(before, force), getattr(after, force)
            if now is None:
                follows(getattr(before, name), getattr(after, name), axis.stop_jerk)
                if was is not None and state is not None:
                    a, b = getattr(after, name), getattr(state, name)
                    assert abs(a.position - b.value) <= (0.02 if name == "depth" else radians(0.5))
            i = int(name == "heading")
            if now is not None:
                assert_no_step(now, was, remains[i], since[i] * DT, most)
                remains[i], since[i] = now, 0
            else:
                since[i] += 1
        rate = SETTINGS.horizontal.stop_rate * DT + 1e-9
        forces = ((r.surge_force, r.sway_force) for r in (before, after))
        assert dist(*forces) <= rate
        assert (after.north is None) == (after.east is None)
        if after.north is None or after.east is None:
            continue
        if before.north is not None and before.east is not None:
            s = SETTINGS.place
            fast, turning = 1.5, 2.0  # [m/s], [rad/s] nothing here is faster
            jerk = s.stop_jerk + 2 * turning * s.stop_acceleration + (3.0 + turning**2) * fast
            follows(before.north, after.north, jerk)
            follows(before.east, after.east, jerk)
        elif state is not None and state.north is not None and state.east is not None:
            here = (state.north.value, state.east.value)
            assert dist((after.north.position, after.east.position), here) <= 0.02


def assert_no_step(
    now: float, was: float | None, remains: float, since: float, most: StickForce
) -> None:
    """A force changes no faster than it may. While an axis is held, what remains of its force fades
    unsaid for `since` [s]: it comes back as a part of itself, and after twice the fade as none."""
    step = most.max_rate * DT + 1e-9
    if was is not None:
        assert abs(now - was) <= step
        return
    fade = most.full / most.max_rate + most.max_rate / most.max_rate_change
    left = 0.0 if since > 2 * fade else remains
    assert min(0.0, left) - step <= now <= max(0.0, left) + step


def follows(a: Motion, b: Motion, jerk: float) -> None:
    """One motion goes on in the other."""
    assert abs(b.acceleration - a.acceleration) <= jerk * DT + 1e-6
    mean = (a.acceleration + b.acceleration) / 2
    assert abs(b.velocity - a.velocity - mean * DT) <= jerk * DT**2 / 2 + 1e-9
    mean = (a.velocity + b.velocity) / 2
    assert abs(b.position - a.position - mean * DT) <= jerk * DT**3 + 1e-9


def numbers(reference: Reference) -> list[float]:
    motions = (reference.depth, reference.heading, reference.surge, reference.north, reference.east)
    forces = (
        reference.surge_force, reference.sway_force, reference.heave_force, reference.yaw_moment
    )  # fmt: skip
    flat = [x for motion in motions if motion for x in msgspec.structs.astuple(motion)]
    return [x for x in (*flat, *forces) if x is not None]


stick = st.sampled_from([-1.0, -0.3, 0.0, 0.0, 0.02, 0.6, 1.0])
seconds = st.floats(0.01, 3.0)
place = st.floats(-4.0, 8.0)
deeds = st.one_of(
    st.tuples(st.just("mode"), st.sampled_from(HOLD_NAMES)),
    st.tuples(st.just("mode"), st.sampled_from(HOLD_NAMES)),
    st.tuples(st.just("sticks"), st.tuples(stick, stick, stick, stick), seconds),
    st.tuples(st.just("sticks"), st.tuples(stick, stick, stick, stick), seconds),
    st.tuples(st.just("wait"), seconds),
    st.tuples(st.just("stop")),
    st.tuples(st.just("lost"), st.sampled_from(["pilot", "state"]), seconds),
    st.tuples(st.just("place"), st.booleans()),
    st.tuples(st.just("bottom"), st.booleans(), st.floats(-0.4, 0.4)),
    st.tuples(st.just("goto"), st.floats(0.5, 6.0), st.floats(-3.0, 3.0)),
    st.tuples(st.just("there"), place, place),
    st.tuples(st.just("follow")),
    st.tuples(st.just("take"), st.sampled_from(["ann", "bob"])),
    st.tuples(st.just("disarm")),
    st.tuples(st.just("arm")),
)


def do(sea: Sea, deed: tuple[object, ...]) -> None:  # noqa: C901 - one line each
    match deed:
        case ("mode", str(hold)):
            sea.ask("mode", flight_mode=hold)
        case ("sticks", deflection, float(time)):
            sea.sail(time, sticks(*cast(tuple[float, float, float, float], deflection)))
        case ("wait", float(time)):
            sea.sail(time)
        case ("lost", str(who), float(time)):
            sea.sail(time, lost=who)
        case ("place", bool(known)):
            sea.knows_place = known
        case ("bottom", bool(seen), float(slope)):
            sea.sees_bottom, sea.slope = seen, slope
        case ("goto", depth, heading):
            sea.ask("goto", depth=depth, heading=heading)
        case ("there", north, east):
            sea.ask("goto", north=north, east=east, depth=2.0)
        case ("take", str(who)):
            sea.ask("force", source=who, epoch=0)
        case ("follow",):
            sea.ask("follow", course=WAY)
        case (str(kind),):
            sea.ask(cast(RequestKind, kind))
        case _:
            raise AssertionError(deed)


UP = (0.0, 0.0, -1.0, 0.0)
OVER_A_SLOPE: list[tuple[object, ...]] = [
    ("mode", "altitude_hold"),
    ("bottom", True, 0.3),
    ("sticks", (1.0, 0.0, 0.0, 0.0), 6.0),
    ("sticks", (1.0, 0.0, 1.0, 0.0), 2.0),
    ("there", 8.0, 4.0),
    ("wait", 3.0),
    ("mode", "station_keeping"),
    ("mode", "altitude_hold"),
    ("bottom", False, 0.3),
    ("sticks", (0.0, 0.6, 0.0, 0.0), 8.0),
]


def held_between(seconds: float, deflection: tuple[float, ...]) -> list[tuple[object, ...]]:
    """A force up, then depth is held for a while, then the stick is a force again."""
    return [
        ("mode", "heading_hold"),
        ("sticks", UP, 2.0),
        ("lost", "state", 0.3),
        ("sticks", deflection, seconds),
        ("mode", "heading_hold"),
    ]


@settings(max_examples=60, deadline=None, phases=GENERATE)
@example(done=held_between(1.1, (0.0, 0.0, 0.0, 0.0)), offset=0.0, measures=False)
@example(done=held_between(2.0, UP), offset=0.0, measures=False)
@given(st.lists(deeds, max_size=14), st.floats(-pi, pi), st.booleans())
@example([("follow",), ("wait", 0.8), ("lost", "state", 1.5)], 1.9, True)
@example(OVER_A_SLOPE, 0.3, True)
def test_whatever_happens_there_is_never_a_step(
    done: list[tuple[object, ...]], offset: float, measures: bool
) -> None:
    sea = armed(offset=offset, measures=measures)
    for deed in done:
        do(sea, deed)
    sea.sail(0.5)
    check(sea)


# Each mode.


@pytest.mark.parametrize("hold", HOLD_NAMES)
def test_what_is_held_has_a_reference_and_what_is_not_a_force(hold: FlightMode) -> None:
    sea, held = armed(hold), HELD_AXES[hold]
    all_sticks = sticks(surge=1.0, sway=1.0, heave=1.0, yaw=1.0)
    reference = sea.sail(3.0, all_sticks)
    s = SETTINGS
    assert reference.heave_force == (None if held.depth else s.heave_force.full)
    assert reference.yaw_moment == (None if held.heading else s.yaw_moment.full)
    assert (reference.north is not None) == held.place == (reference.surge_force == 0.0)
    if held.depth:
        assert reference.depth.velocity == s.heave.max_velocity
    if held.heading:
        assert reference.heading.velocity == s.yaw.max_velocity
    assert sea.status.flight_mode == hold
    check(sea)
    sea.ask("disarm")  # no force is left
    reference = sea.sail(0.02)
    assert not any((reference.heave_force, reference.yaw_moment, reference.surge_force))


@settings(max_examples=25, deadline=None)
@given(
    st.tuples(stick, stick, stick, stick),
    st.sampled_from(HOLD_NAMES),
    st.floats(0.1, 4.0),
    st.floats(-pi, pi),
)
def test_holding_begins_as_the_vehicle_moves_and_ends_at_rest(
    deflection: tuple[float, float, float, float], hold: FlightMode, when: float, offset: float
) -> None:
    sea = armed("manual", offset=offset)
    moved = sticks(*deflection)
    sea.sail(when, moved)
    before, heading = list(sea.v), sea.at[3]
    sea.ask("mode", moved, flight_mode=hold)
    first = sea.sail(DT)
    if first.heave_force is None:
        assert abs(first.depth.velocity - before[2]) < 0.02
    if first.yaw_moment is None:
        assert abs(first.heading.velocity - before[3]) < 0.05
    if first.north is not None and first.east is not None:
        over_ground = turned((before[0], before[1]), heading + offset)
        assert dist((first.north.velocity, first.east.velocity), over_ground) < 0.02
    end = sea.sail(6.0)
    for motion, free in ((end.depth, end.heave_force), (end.heading, end.yaw_moment)):
        assert free is not None or motion.velocity == motion.acceleration == 0.0
    assert end.north is None or end.north.velocity == end.north.acceleration == 0.0
    check(sea)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.5, 3.0), st.sampled_from(HOLD_NAMES))
def test_a_lost_pilot_means_rest_and_hold_in_every_mode(when: float, hold: FlightMode) -> None:
    sea = armed(hold)
    sea.sail(when, sticks(surge=1.0, heave=1.0, yaw=-1.0))
    end, later = sea.sail(6.0, lost="pilot"), sea.sail(1.0, lost="pilot")
    assert end.heave_force is end.yaw_moment is None
    assert end.depth.velocity == end.heading.velocity == end.surge_force == 0.0
    assert later.depth.position == end.depth.position
    assert later.heading.position == end.heading.position
    assert told(sea.generator.outbox) == ["failsafe:pilot_lost"]
    safe = "station_keeping" if hold == "station_keeping" else "stabilised"
    assert sea.status.flight_mode == safe
    sea.sail(0.1)  # the pilot is back, and nothing is let go
    assert sea.status.flight_mode == safe
    check(sea)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.5, 3.0), st.sampled_from(HOLD_NAMES))
def test_an_emergency_stop_keeps_its_word_in_every_mode(when: float, hold: FlightMode) -> None:
    sea = armed(hold)
    moved = sticks(surge=0.7, sway=-1.0, heave=1.0, yaw=-1.0)
    sea.sail(when, moved)
    before = sea.seen[-1][0]
    stop = sea.request("stop", moved).stop
    assert stop is not None
    sea.sail(stop.seconds + 2 * DT, moved)
    end = sea.sail(1.0, moved)
    assert abs(end.depth.position - before.depth.position - stop.depth) < 1e-9
    assert abs(end.heading.position - before.heading.position - stop.heading) < 1e-9
    assert end.depth.velocity == end.heading.velocity == end.surge_force == 0.0
    assert (end.north is None) == (stop.over_ground is UNSET) == (before.north is None)
    if end.north and end.east and before.north and before.east:
        assert hypot(end.north.velocity, end.north.acceleration) == 0.0
        went = [
            now.position - then.position
            for now, then in ((end.north, before.north), (end.east, before.east))
        ]
        assert isinstance(stop.over_ground, float)
        assert abs(hypot(*went) - stop.over_ground) < 1e-4
    assert sea.generator.activity == "stopping"
    sea.sail(0.1)
    assert sea.generator.activity == "piloted"
    check(sea)


# When a mode can be had, and for how long.


def test_what_is_not_measured_is_not_held_and_a_stop_is_waited_for() -> None:
    sea = armed("manual")
    assert "what to hold" in sea.ask("mode")
    sea.knows_place = sea.knows_depth = False
    sea.sail(0.02)
    for measures in (sea, armed(measures=False)):
        assert "does not know its position" in measures.ask("mode", flight_mode="station_keeping")
    assert "does not know its depth" in sea.ask("mode", flight_mode="depth_hold")
    assert sea.status.flight_mode == "manual"
    assert sea.ask("mode", flight_mode="heading_hold") == ""
    sea.ask("stop")
    assert "ask again when it is at rest" in sea.ask("goto", depth=1.0)


def test_a_place_not_measured_for_too_long_is_let_go_and_said() -> None:
    sea = armed("station_keeping")
    sea.sail(1.0, sticks(surge=1.0))
    sea.knows_place = False
    assert sea.sail(PLACE_PATIENCE_S - 0.05, sticks(surge=1.0)).north is not None
    assert sea.sail(0.2, sticks(surge=1.0)).north is None
    assert [event for _, _, event in sea.generator.outbox.said] == ["lost:place"]
    assert sea.generator.outbox.counts == {"lost:place": 1}
    assert sea.status.flight_mode == "stabilised"
    sea.knows_place = True
    assert sea.sail(3.0).north is None  # not before it is asked for again
    assert sea.ask("mode", flight_mode="station_keeping") == ""
    assert sea.sail(0.1).north is not None
    check(sea)


def test_arming_brings_back_the_mode_that_was_asked_for_if_it_can_be_had() -> None:
    sea = armed("manual")
    sea.sail(0.1, lost="pilot")
    sea.sail(0.1)
    assert sea.status.flight_mode == "stabilised"
    sea.ask("disarm")
    assert sea.status.flight_mode == "manual"
    assert sea.ask("arm") == ""
    assert sea.status.flight_mode == "manual"
    sea.ask("mode", flight_mode="station_keeping")
    sea.ask("disarm")
    sea.knows_place = False
    sea.sail(0.1)
    told(sea.generator.outbox)
    assert sea.ask("arm") == ""
    assert sea.status.flight_mode == "stabilised"
    assert told(sea.generator.outbox) == ["refused:station_keeping"]


@pytest.mark.parametrize("hold", HOLD_NAMES)
def test_a_restart_in_mid_dive_goes_on_in_the_same_mode(hold: FlightMode) -> None:
    kept = armed(hold).generator.checkpoint
    assert kept.armed
    sea = Sea(before=msgspec.json.decode(msgspec.json.encode(kept), type=GuidanceCheckpoint))
    reference = sea.sail(0.1)
    assert (reference.heave_force is None, reference.yaw_moment is None) == HELD_AXES[hold][:2]
    assert (reference.north is not None) == HELD_AXES[hold].place
    assert sea.status.flight_mode == hold


# A place that is held.


def test_held_back_the_place_waits_and_let_go_it_gives_in() -> None:
    sea = armed("station_keeping")
    sea.sail(0.1)
    sea.stuck = True
    most = SETTINGS.place.max_error
    for _ in range(100):
        out = sea.sail(0.1, sticks(surge=1.0, sway=0.5))
        assert out.north is not None
        assert out.east is not None
        assert dist((out.north.position, out.east.position), sea.at[:2]) <= most + 1e-9
    assert told(sea.generator.outbox) == ["clamped:reference.place"]
    out = sea.sail(6.0)
    assert out.north is not None
    assert out.east is not None
    assert dist((out.north.position, out.east.position), sea.at[:2]) <= most / 10


# Paths by measurement.


def last_place(sea: Sea) -> tuple[float, float]:
    """The newest place reference there was."""
    places = [(r.north, r.east) for r, _ in sea.seen]
    north, east = next((n, e) for n, e in reversed(places) if n and e)
    return north.position, east.position


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["stabilised", "station_keeping"])
@pytest.mark.parametrize("offset", [0.0, 1.0, -2.5])
def test_a_path_begins_where_the_drone_is_and_is_run_in_four_degrees(
    hold: FlightMode, offset: float
) -> None:
    sea = armed(hold, offset=offset)
    begin = list(sea.at[:2])
    assert sea.ask("follow", course=WAY) == ""
    seen = len(sea.seen)
    while sea.generator.activity == "follow":
        sea.sail(1.0)
    flown = [r for r, _ in sea.seen[seen:]]
    assert dist(last_place(sea), (begin[0] + 6.0, begin[1] + 6.0)) < 1e-6
    assert abs(wrapped(sea.at[3] + offset - pi / 2)) < 0.011
    assert all(r.surge is None for r in flown)
    speed = max(hypot(r.north.velocity, r.east.velocity) for r in flown if r.north and r.east)
    assert speed == pytest.approx(WAY.cruise)
    assert (sea.sail(2.0).north is not None) == (hold == "station_keeping")
    check(sea)


@pytest.mark.slow
@settings(max_examples=10, deadline=None, phases=GENERATE)
@given(place, place, st.floats(0.0, 2.0), stick, st.floats(-pi, pi))
def test_goto_a_place_ends_there_however_it_drifted_before(
    north: float, east: float, drift: float, surge: float, offset: float
) -> None:
    sea = armed(offset=offset)
    sea.sail(drift, sticks(surge=surge))  # still moving when it is asked
    assert sea.ask("goto", north=north, east=east) == ""
    for _ in range(120):
        sea.sail(1.0)
        if sea.generator.activity == "piloted":
            break
    assert sea.generator.activity == "piloted"
    assert dist(last_place(sea), (north, east)) < 0.05
    check(sea)


def test_the_path_waits_for_a_drone_that_is_held_back_in_its_place() -> None:
    sea = armed()
    sea.ask("follow", course=WAY)
    sea.sail(12.0)
    sea.stuck = True
    end = sea.sail(12.0)
    assert end.north is not None
    assert end.north.velocity == 0.0
    assert dist(last_place(sea), sea.at[:2]) < 1.3  # the tolerance, and the way to stand still
    sea.stuck = False
    sea.sail(45.0)
    assert [text for _, text, _ in sea.generator.outbox.said] == ["the end of the path"]


@settings(max_examples=8, deadline=None, phases=GENERATE)
@given(st.floats(0.0, 12.0))
def test_a_new_path_on_the_way_along_one_begins_from_the_reference(when: float) -> None:
    sea = armed()
    sea.ask("follow", course=WAY)
    sea.sail(when)
    sea.behind = 0.2
    sea.sail(0.5)
    begun = len(sea.seen)
    sea.ask("goto", north=0.0, east=0.0)
    sea.sail(3.0)
    north = [r.north.position for r, _ in sea.seen[begun - 1 :] if r.north]
    assert len(north) == len(sea.seen) - begun + 1
    assert all(abs(b - a) < 0.005 for a, b in pairwise(north))


def test_a_path_whose_place_is_lost_goes_on_blind_at_the_same_pace() -> None:
    sea = armed()
    sea.ask("follow", course=WAY)
    sea.sail(15.0)
    sea.knows_place = False
    last = sea.sail(PLACE_PATIENCE_S - 0.05)
    blind = sea.sail(0.2)
    assert last.north is not None
    assert last.surge is None
    assert blind.north is None
    assert blind.surge is not None
    assert blind.surge.velocity == pytest.approx(WAY.cruise)
    assert sea.generator.activity == "follow"
    assert told(sea.generator.outbox) == ["lost:place"]
    check(sea)
