"""Guards of a reference: it waits for a vehicle that is held back, goes to where that comes to
rest, and asks for no more than the tilt allows."""

from itertools import pairwise
from math import exp, hypot, pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import UNSET, UnsetType

from messages.events import note
from messages.pilot import FlightMode, PilotCommand
from messages.reference import Reference
from messages.state import VehicleState
from services.reference.core import Settings
from services.reference.guidance.guards import (
    AHEAD_S,
    FALL_S,
    MOST_TILT,
    PATIENCE_S,
    SMOOTH_S,
    WORTH,
    ReferenceGovernor,
    Standstill,
    TiltLimit,
    is_released,
    tilt_of,
)
from services.reference.settings import FailsafeSettings
from services.reference.trajectory.minimum_jerk import Sample
from tests.services.reference.drone import Drone
from tests.support.said import state

most = st.floats(1e-3, 1e3)


@given(most, st.lists(st.floats(0.0, 1.0)))
def test_an_error_within_the_limit_is_left_alone(most: float, shares: list[float]) -> None:
    guard = ReferenceGovernor(most)
    assert all(guard.keep(most * x, 0.01, released=True) == 1.0 for x in shares)


@given(most, st.floats(0.0, 0.99) | st.floats(0.09, 0.11), st.booleans())
def test_it_holds_back_until_half_the_limit_and_once_released_until_a_tenth(
    most: float, share: float, released: bool
) -> None:
    guard = ReferenceGovernor(most)
    guard.keep(2 * most, 0.01, released=False)
    assert guard.blocked
    guard.keep(share * most, 0.01, released=released)
    end = 0.1 if released else 0.5
    assert guard.blocked == (share >= end) or abs(share - end) < 1e-9


@given(most, st.floats(0.2, 1.0), st.floats(0.0, 2.0))
def test_once_released_the_error_falls_to_a_third_every_half_second(
    most: float, begin: float, seconds: float
) -> None:
    """e⁻¹, with a tick of a thousandth of a second, until a tenth of the limit is left."""
    guard, error = ReferenceGovernor(most, blocked=True), begin * most
    for _ in range(round(1000 * seconds)):
        error *= guard.keep(error, 0.001, released=True)
    expected = max(begin * exp(-seconds / 0.5), 0.1)
    assert error == pytest.approx(expected * most, rel=0.01)


speed = st.floats(0.01, 2.0)


@given(speed, speed, st.booleans())
def test_a_stick_counts_as_released_when_the_reference_slows_down_or_rests(
    velocity: float, acceleration: float, down: bool
) -> None:
    v, a = (velocity, acceleration) if down else (-velocity, -acceleration)
    assert is_released(Sample(1.0, v, -a, 0.0))
    assert is_released(Sample(1.0, 0.0, 0.0, 0.0))
    assert not is_released(Sample(1.0, v, a, 0.0))
    assert not is_released(Sample(1.0, v, 0.0, 0.0))  # the stick is kept
    assert not is_released(Sample(1.0, 0.0, a, 0.0))  # it begins


@given(speed, speed, speed)
def test_a_place_is_released_by_all_of_its_motion(north: float, east: float, slower: float) -> None:
    """Slowing down north while speeding up east is a turn unless the speed falls."""
    motions = Sample(0.0, north, -slower, 0.0), Sample(0.0, east, slower, 0.0)
    assert is_released(*motions) == (east * slower < north * slower)
    assert not is_released(Sample(0.0, 0.0, 0.0, 0.0), Sample(0.0, east, 0.0, 0.0))


MOST_MOVED = 0.05  # [m]
DT = 0.01  # [s]
error = st.floats(-1.0, 1.0)
rates = st.floats(-0.5, 0.5)
row = st.tuples(error, rates, st.booleans())


def flown(stop: Standstill, rows: list[tuple[float, float, bool]]) -> list[float]:
    return [
        stop.step(error, rates, DT * k, resting=resting, velocity=rates)
        for k, (error, rates, resting) in enumerate(rows)
    ]


@given(st.lists(row, max_size=300))
def test_it_moves_once_for_each_motion_at_rest_and_never_further_than_allowed(
    rows: list[tuple[float, float, bool]],
) -> None:
    moves = flown(Standstill(MOST_MOVED), rows)
    open_motions = 0
    for by, (off, _, resting) in zip(moves, rows, strict=True):
        open_motions = open_motions if resting else 1
        if by != 0.0:
            assert resting
            assert open_motions == 1
            open_motions = 0
            assert WORTH * MOST_MOVED <= abs(by) <= MOST_MOVED
            assert 0.0 <= by / off <= 1.0 + 1e-12


@given(error, st.floats(0.001, 0.5), st.integers(0, 70))
def test_it_waits_for_the_vehicle_to_turn_round(off: float, speed: float, steps: int) -> None:
    stop = Standstill(MOST_MOVED)
    coasting = [(0.0, speed, False), *[(2 * off, speed, True)] * (steps + 1)]
    assert not any(flown(stop, coasting))
    at = DT * len(coasting)
    expected = max(-MOST_MOVED, min(MOST_MOVED, off)) if abs(off) >= WORTH * MOST_MOVED else 0.0
    assert stop.step(off, -speed, at, resting=True) == expected == stop.moved
    assert stop.step(off, speed, at + DT, resting=True) == 0.0


def test_it_does_not_wait_longer_than_its_patience() -> None:
    rows = [(0.0, 0.02, False), *[(0.03, 0.02, True)] * round(2 * PATIENCE_S / DT)]
    moves = flown(Standstill(MOST_MOVED), rows)
    (when,) = [k for k, by in enumerate(moves) if by != 0.0]
    assert abs(DT * (when - 1) - PATIENCE_S) < 1.5 * DT
    assert moves[when] == 0.03


@given(st.lists(row, max_size=50), st.lists(st.tuples(error, rates, st.just(True))))
def test_a_motion_to_a_place_that_was_asked_for_is_left_there(
    before: list[tuple[float, float, bool]], after: list[tuple[float, float, bool]]
) -> None:
    stop = Standstill(MOST_MOVED)
    flown(stop, before)
    stop.cancel()
    assert not any(flown(stop, after))


MOST = MOST_TILT
tilt = st.floats(0.0, 3.14159)
maybe = st.one_of(st.none(), tilt)


def level(now: int, roll: float = 0.0, pitch: float = 0.0, *, valid: bool = True) -> VehicleState:
    unknown = () if valid else ("roll", "pitch")
    return state(now, invalid=unknown, depth=3.0, roll=roll, pitch=pitch)


class Tilting(Drone):
    """At full surge and half sway."""

    pitch = 0.0  # [rad]

    def state(self) -> VehicleState:
        return level(self.now, pitch=self.pitch)

    def at(self, seconds: float, pitch: float = 0.0, *, surge: float = 1.0) -> list[Reference]:
        self.pitch, before = pitch, len(self.flown)
        self.fly(seconds, surge=surge, sway=surge / 2)
        return self.flown[before:]

    @property
    def told(self) -> int:
        return self.generator.outbox.counts["clamped:reference.horizontal"]


def flight(hold: FlightMode = "stabilised") -> Tilting:
    drone = Tilting().armed()
    assert drone.ask("mode", flight_mode=hold) == ""
    return drone


@given(st.lists(maybe, max_size=200), st.one_of(st.none(), st.floats(0.0, 0.5 * MOST)))
def test_the_share_makes_no_step_and_once_the_tilt_is_gone_all_is_given_again(
    tilts: list[float | None], after: float | None
) -> None:
    limit = TiltLimit()
    shares = [1.0, *(limit.step(each, DT) for each in tilts)]
    assert all(0.0 <= share <= 1.0 for share in shares)
    furthest = pi * (1.0 + AHEAD_S / SMOOTH_S)
    assert all(abs(b - a) <= DT * furthest / MOST / FALL_S for a, b in pairwise(shares))
    for _ in range(3000):
        limit.step(after, DT)
    assert limit.share == 1.0


@given(st.floats(0.1, 1.0))
def test_a_growing_tilt_is_met_before_it_passes_the_limit(speed: float) -> None:
    """[rad/s] At a steady rate, as it will be a second later, once the rate has been seen."""
    limit, seconds = TiltLimit(), 0.0
    while limit.step(speed * seconds, DT) == 1.0:
        seconds += DT
    ahead = AHEAD_S * (1.0 - exp(-seconds / SMOOTH_S))
    assert speed * (seconds + ahead) == pytest.approx(MOST, abs=4.0 * speed * DT)


@settings(max_examples=40)
@given(st.floats(0.2, 2.5), st.floats(0.2, 1.0), st.floats(0.2, 1.0))
def test_with_a_hull_that_answers_late_it_comes_to_rest(
    full: float, slow: float, late: float
) -> None:
    """A hull whose speed follows the share within `slow` [s], and its tilt the square of the speed
    within `late` [s]; `full` [rad] if nothing were taken."""
    limit, speed, tilt = TiltLimit(), 0.0, 0.0
    for step in range(6000):
        speed += DT / slow * (limit.step(tilt, DT) - speed)
        tilt += DT / late * (full * speed * speed - tilt)
        if step > 5000:
            assert tilt == pytest.approx(min(full, MOST), abs=0.02)


@settings(max_examples=50)
@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_the_tilt_is_that_of_the_vertical(roll: float, pitch: float) -> None:
    found = tilt_of(level(0, roll, pitch))
    assert found is not None
    assert max(abs(roll), abs(pitch)) - 1e-6 <= found <= hypot(roll, pitch) + 1e-6
    assert tilt_of(level(0, roll, pitch, valid=False)) is None


def test_surge_and_sway_shrink_together_within_their_limits_and_come_back() -> None:
    drone, s = flight(), Settings().horizontal
    full = drone.at(3.0)[-1]
    assert (full.surge_force, full.sway_force) == (s.max_surge, s.max_sway / 2)
    assert drone.told == 0
    less = drone.at(2.0, 1.2 * MOST)
    again = drone.at(12.0)
    assert 0.0 <= less[-1].surge_force < 0.5 * s.max_surge
    assert (again[-1].surge_force, again[-1].sway_force) == (s.max_surge, s.max_sway / 2)
    for a, b in pairwise([full, *less, *again]):
        assert b.sway_force * s.max_surge == pytest.approx(b.surge_force * s.max_sway / 2)
        step = hypot(b.surge_force - a.surge_force, b.sway_force - a.sway_force)
        assert step <= s.max_rate * DT + 1e-9
    assert drone.told == 1
    drone.at(1.0, 1.2 * MOST)
    assert drone.told == 2


def test_it_is_said_only_where_something_is_taken_away() -> None:
    drone = flight()
    drone.at(2.0, 2.0 * MOST, surge=0.0)
    assert drone.told == 0
    assert "tilts" not in note(drone.status.notices)
    drone.at(1.0, 2.0 * MOST)
    assert drone.told == 1
    assert "tilts" in note(drone.status.notices)
    free = flight("heading_hold")  # the depth is not held: nothing is taken away
    assert free.at(3.0, 2.0 * MOST)[-1].surge_force == Settings().horizontal.max_surge
    assert free.told == 0


# The depth is held where the vehicle comes to a standstill, unless it was asked for.


DEPTH, HEADING = 0.02, 0.006  # [m], [rad] by which the vehicle runs past every stop


class Pilot(Drone):
    """Of a vehicle that is a little deeper and further round than the reference was planned."""

    late = False
    off = 0.0  # [-] of DEPTH and HEADING
    learnt: float | UnsetType = UNSET  # [m] of where it came to rest

    def step(self, state: VehicleState | None, command: PilotCommand | None) -> None:
        depth, heading = self.depth, self.heading
        super().step(state, command)
        out = self.flown[-1]
        moves = out.depth.velocity != 0.0, out.heading.velocity != 0.0
        self.depth = out.depth.position + self.off * DEPTH if moves[0] else depth
        self.heading = out.heading.position + self.off * HEADING if moves[1] else heading

    def state(self) -> VehicleState:
        late = ("depth_acceleration",) if self.late else ()
        return state(
            self.now,
            invalid=late,
            depth=self.depth,
            heading=self.heading,
            depth_corrected=self.learnt,
        )

    @property
    def moved(self) -> object:
        return self.status.depth_moved


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_stop_of_the_sticks_ends_where_the_vehicle_is_and_says_by_how_much(sign: float) -> None:
    pilot = Pilot().armed()
    pilot.off = sign
    moving = pilot.fly(2.0, heave=0.5, yaw=0.5)
    assert moving.depth.velocity != 0.0
    assert pilot.moved == UNSET
    held = pilot.fly(4.0)
    assert held.depth.velocity == 0.0 == held.depth.acceleration
    assert held.depth.position == pytest.approx(pilot.depth, abs=1e-12)
    assert held.heading.position == pytest.approx(pilot.heading - sign * HEADING, abs=1e-5)
    assert pilot.moved == pytest.approx(sign * DEPTH, abs=1e-5)
    later = pilot.fly(5.0)
    assert (later.depth, later.heading) == (held.depth, held.heading)


def test_what_is_learnt_of_the_place_of_a_stop_moves_what_is_held_for_some_seconds() -> None:
    pilot = Pilot().armed()
    pilot.learnt = 0.0
    pilot.fly(2.0, heave=0.5)
    held = pilot.fly(2.0).depth.position
    pilot.learnt = 0.01
    assert pilot.fly(1.0).depth.position == pytest.approx(held + 0.01, abs=1e-9)
    pilot.learnt = -0.5  # never by more than a stop moves it at all
    assert pilot.fly(1.0).depth.position == pytest.approx(held - 0.05, abs=1e-9)
    pilot.fly(4.0)
    pilot.learnt = -0.48
    assert pilot.fly(1.0).depth.position == pytest.approx(held - 0.05, abs=1e-9)


def test_a_depth_and_a_heading_that_were_asked_for_are_held() -> None:
    pilot = Pilot().armed()
    pilot.off = 1.0
    pilot.ask("goto", depth=2.5, heading=0.4)
    pilot.learnt = 0.0
    pilot.fly(14.0)
    pilot.learnt = 0.02
    held = pilot.fly(1.0)
    assert held.depth.position == pytest.approx(2.5)
    assert held.heading.position == pytest.approx(0.4)
    assert pilot.moved == UNSET
    pilot.late = True  # without the accelerometer a standstill is known too late
    pilot.fly(2.0, heave=0.5, yaw=0.5)
    held = pilot.fly(4.0)
    assert held.depth.position == pytest.approx(pilot.depth - DEPTH)


def test_the_depth_limit_is_not_passed_and_a_stick_held_down_there_moves_nothing() -> None:
    pilot = Pilot(Settings(failsafe=FailsafeSettings(depth_limit=3.0))).armed()
    pilot.off = 1.0
    at_limit = pilot.fly(15.0, heave=1.0)
    assert at_limit.depth.position == pytest.approx(3.0, abs=1e-4)
    for held in (pilot.fly(3.0, heave=1.0), pilot.fly(3.0)):
        assert held.depth.position <= 3.0 + 1e-9
        assert held.depth.position == pytest.approx(3.0, abs=1e-4)
