"""Height above the bottom: followed without a jerk, never too near, and given up with a word."""

import random
from collections.abc import Callable
from itertools import pairwise
from math import radians, tan
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec import UNSET
from msgspec.structs import replace

from messages.events import Outbox
from messages.reference import Motion, Reference
from messages.sensors import DvlSample
from messages.state import VehicleState
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.reference.failsafe.table import WatchedMessages
from services.reference.guidance.bottom import BAND, PATIENCE_S
from services.reference.settings import FailsafeSettings, VelocityAxis
from tests.services.reference.drone import DT, Drone, smooth
from tests.support.said import state, sticks
from tests.support.told import told

LATENCY_NS = 100_000_000  # [ns] of an altitude
NOISE = 0.05  # [m]
FLOOR = 0.5  # [m] floor_distance
SLOWER = VelocityAxis(0.2, 0.1, 0.15, 0.3, 0.15, 0.5)  # Minerva's
# [m] nearer than `floor_distance` at 0.5 m/s, where a slope of 20° down becomes one of 20° up.
NEARER, NEARER_SLOWER = 0.45, 0.9
STILL = Motion(0.0, 0.0, 0.0, 0.0)
BottomAt = Callable[[float], float]  # [m] depth at a way [m]


class Dive(Drone):
    """A vehicle that is where the reference wants it, over a bottom."""

    def __init__(
        self,
        bottom: BottomAt,
        height: float,
        heave: VelocityAxis | None = None,
        seed: int = 0,
        noise: float = NOISE,
        before: GuidanceCheckpoint | None = None,
        *,
        altimeter: bool = True,
        floor: float = FLOOR,
    ) -> None:
        self.settings = Settings(failsafe=FailsafeSettings(floor_distance=floor))
        if heave is not None:
            self.settings = replace(self.settings, heave=heave)
        super().__init__(self.settings, before, depth=bottom(0.0) - height)
        self.bottom, self.random, self.noise = bottom, random.Random(seed), noise
        self.altimeter, self.fish = altimeter, 0.0  # [m] too near, of the next altitude
        self.way, self.speed = 0.0, 0.0  # [m], [m/s] along it
        self.heights = list[float]()  # [m] at each step
        self.fly(3.0)
        assert self.ask("arm") == ""
        self.fly(1.0)

    def hold_height(self) -> str:
        return self.ask("mode", flight_mode="altitude_hold")

    def measured(self) -> WatchedMessages:
        """Once a second an altitude."""
        self.way += self.speed * DT / 1e9
        self.heights.append(self.height)
        newest = self.generator.conditions.newest
        return newest if self.now % 1_000_000_000 else WatchedMessages(dvl=self.sample())

    def sample(self) -> DvlSample | None:
        if not self.altimeter:
            return None
        steps = LATENCY_NS // DT
        found = self.heights[-1 - steps] + self.random.gauss(0.0, self.noise) - self.fish
        self.fish = 0.0
        return DvlSample(
            stamp_ns=self.now - steps * DT, velocity=(self.speed, 0.0, 0.0), std=0.01,
            altitude=max(0.0, found),
        )  # fmt: skip

    def state(self) -> VehicleState:
        moves = self.flown[-1].depth if self.flown and self.flown[-1].armed else STILL
        rate, acceleration = moves.velocity, moves.acceleration
        return state(self.now, depth=self.depth, depth_rate=rate, depth_acceleration=acceleration)

    @property
    def height(self) -> float:
        return self.bottom(self.way) - self.depth

    @property
    def nearest(self) -> float:
        return min(self.heights)

    @property
    def moved(self) -> float:
        depths = [reference.depth.position for reference in self.flown]
        return sum(abs(b - a) for a, b in pairwise(depths))


def flat(_: float) -> float:
    return 12.0


def hills(slopes: list[float], length: float, start: float) -> BottomAt:
    """[m] Straight pieces of this length, whose slopes are in degrees, falling away."""

    def depth(way: float) -> float:
        found = start
        for slope in slopes:
            found += tan(radians(slope)) * max(0.0, min(way, length))
            way -= length
        return found

    return depth


@pytest.mark.parametrize(("speed", "least"), [(0.0, 0.65), (0.2, 0.95), (0.4, 1.25)])
def test_the_faster_it_goes_the_higher_a_stick_that_leads_down_ends(
    speed: float, least: float
) -> None:
    """At rest 0.15 m above `floor_distance`, and higher by the way of 1.5 s: what lies ahead nobody
    measures."""
    dive = Dive(flat, 3.0, noise=0.0)
    dive.speed = speed
    dive.fly(30.0, heave=1.0)
    assert dive.height == pytest.approx(least, abs=0.03)


def test_a_jump_of_the_pressure_moves_the_bottom_with_the_depth() -> None:
    """The vehicle has not moved: its height above the bottom is what it was."""
    generator = ReferenceGenerator(Settings(), Outbox())
    for tenth in range(1, 40):
        now, jump = tenth * 100_000_000, 1.5 if tenth > 30 else 0.0
        dvl = DvlSample(stamp_ns=now, velocity=(0.0, 0.0, 0.0), std=0.01, altitude=4.0)
        if tenth <= 30:  # none after the jump, which would teach it the same
            generator.conditions.newest = WatchedMessages(dvl=dvl)
        seen = state(now, depth=6.0 + jump, depth_moved=jump or UNSET)
        generator.step(seen, sticks(now), now)
        assert generator.status(now).altitude == pytest.approx(4.0)


slopes = st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=6)


@pytest.mark.slow
@pytest.mark.parametrize(("heave", "nearer"), [(None, NEARER), (SLOWER, NEARER_SLOWER)])
@settings(max_examples=25, deadline=None)
@given(slopes, st.floats(0.1, 0.5), st.integers(0, 1000))
def test_over_slopes_it_is_never_too_near_and_never_steps(
    heave: VelocityAxis | None, nearer: float, slopes: list[float], speed: float, seed: int
) -> None:
    dive = Dive(hills(slopes, 6.0, 30.0), FLOOR + BAND, heave, seed)
    assert dive.hold_height() == ""
    dive.fly(2.0)
    dive.speed = speed
    dive.fly(6.0 * len(slopes) / speed)
    assert dive.nearest >= FLOOR - nearer * speed / 0.5 - 2 * NOISE
    dive.speed = 0.0
    dive.fly(20.0)
    assert dive.height == pytest.approx(FLOOR + BAND, abs=0.25)
    assert dive.status.flight_mode == "altitude_hold"
    smooth(dive.flown, dive.settings)


@settings(max_examples=20, deadline=None)
@given(st.floats(-2.0, 1.4), st.floats(2.0, 4.0), st.integers(0, 1000))
def test_a_step_of_the_bottom_is_climbed_once_it_is_below(
    step: float, height: float, seed: int
) -> None:
    """`step` [m]: falling away."""
    dive = Dive(lambda way: 20.0 + (step if way > 3.0 else 0.0), height, seed=seed)
    assert dive.hold_height() == ""
    dive.speed = 0.3
    dive.fly(20.0)
    dive.speed = 0.0
    dive.fly(15.0)
    assert dive.nearest >= height + min(0.0, step) - 3 * NOISE
    assert dive.height == pytest.approx(height, abs=0.25)
    smooth(dive.flown, dive.settings)


@settings(max_examples=15, deadline=None)
@given(st.floats(-1.0, 1.0), st.floats(0.5, 3.0), st.integers(0, 1000))
@example(1.0, 2.0, 0)
def test_over_flat_ground_the_stick_is_that_of_depth_hold(
    heave: float, seconds: float, seed: int
) -> None:
    """The same motion, and the same point where it stops; where altitudes are noisy, one that is
    within the noise."""
    ends: list[Reference] = []
    for hold, noise in (("stabilised", 0.0), ("altitude_hold", 0.0), ("altitude_hold", NOISE)):
        dive = Dive(flat, 6.0, seed=seed, noise=noise)
        assert dive.ask("mode", flight_mode=hold) == ""
        dive.fly(0.5)
        dive.fly(seconds, heave=heave)
        dive.fly(5.0)
        ends.append(dive.flown[-1])
    assert ends[1].depth.velocity == 0.0 == ends[1].depth.acceleration
    assert ends[1].depth.position == pytest.approx(ends[0].depth.position, abs=1e-9)
    assert ends[2].depth.position == pytest.approx(ends[0].depth.position, abs=2 * NOISE)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.7, 3.5), st.integers(0, 1000))
def test_a_fish_does_not_move_it(near: float, seed: int) -> None:
    moved: list[float] = []
    for fish in (0.0, near):
        dive = Dive(flat, 4.0, seed=seed)
        assert dive.hold_height() == ""
        dive.fly(5.0)
        dive.fish = fish
        dive.fly(6.0)
        moved.append(dive.moved)
    assert abs(moved[1] - moved[0]) < 0.1


@pytest.mark.parametrize("back", [False, True])
def test_without_an_altitude_the_depth_is_held_until_height_is_asked_for_again(back: bool) -> None:
    dive = Dive(hills([-10.0], 100.0, 30.0), 3.0)
    assert dive.hold_height() == ""
    dive.speed = 0.3
    dive.fly(10.0)
    assert dive.status.altitude_wanted == pytest.approx(3.0, abs=0.2)
    dive.altimeter = False
    dive.fly(PATIENCE_S + 2.0)
    assert dive.status.flight_mode == "stabilised"
    assert dive.status.altitude is UNSET
    assert dive.status.altitude_wanted is UNSET
    assert told(dive.generator.outbox).count("lost:altitude") == 1
    before = dive.fly(2.0).depth
    dive.altimeter = back
    dive.speed = 0.0
    after = dive.fly(10.0).depth
    assert after.position == before.position
    smooth(dive.flown, dive.settings)
    for kind in ("disarm", "arm"):
        assert dive.ask(kind) == ""
        dive.fly(1.0)
    assert dive.status.flight_mode == "stabilised"
    assert (dive.hold_height() == "") == back


def test_a_vehicle_that_sinks_does_not_move_the_bottom() -> None:
    """An altitude belongs to the depth at its own time."""
    dive = Dive(flat, 6.0, noise=0.0)
    for _ in range(20):
        dive.fly(0.2, heave=1.0)
        assert dive.status.altitude == pytest.approx(dive.height, abs=0.02)


@pytest.mark.parametrize("deed", ["stop", "goto", "turn", "lost"])
def test_what_the_drone_does_by_itself_goes_on_at_a_depth_but_a_turn_at_the_height(
    deed: str,
) -> None:
    dive = Dive(flat, 3.0)
    assert dive.hold_height() == ""
    dive.fly(2.0)
    match deed:
        case "stop":
            assert dive.ask("stop") == ""
        case "goto":
            assert dive.ask("goto", depth=5.0) == ""
        case "turn":
            assert dive.ask("goto", heading=1.0) == ""
        case _:
            dive.fly(0.5, there="no pilot")
    assert dive.status.flight_mode == ("altitude_hold" if deed == "turn" else "stabilised")


def test_a_restarted_service_goes_on_holding_the_height() -> None:
    memory = GuidanceCheckpoint(
        armed=True, flight_mode="altitude_hold", asked="altitude_hold", armed_ns=1
    )
    dive = Dive(flat, 3.0, before=memory)
    assert dive.status.flight_mode == "altitude_hold"
    dive.fly(5.0)
    assert dive.status.altitude_wanted == pytest.approx(3.0, abs=0.15)
    blind = Dive(flat, 3.0, before=memory, altimeter=False)
    blind.fly(PATIENCE_S)
    assert blind.status.flight_mode == "stabilised"


def test_disarmed_no_height_is_remembered() -> None:
    dive = Dive(flat, 3.0)
    assert dive.hold_height() == ""
    dive.fly(2.0)
    assert dive.ask("disarm") == ""
    dive.depth = 4.0
    dive.fly(2.0)
    assert dive.ask("arm") == ""
    out = dive.fly(5.0)
    assert dive.status.flight_mode == "altitude_hold"
    assert out.depth.position == pytest.approx(4.0, abs=0.05)


def held_at(height: float, mode: str = "stabilised", **how: Any) -> Dive:
    dive = Dive(flat, height, **how)
    assert dive.ask("mode", flight_mode=mode) == ""
    dive.fly(1.0)
    return dive


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0.2, 3.0), st.floats(-1.0, 1.0)), max_size=4),
    st.sampled_from([None, SLOWER]),
    st.sampled_from(["stabilised", "depth_hold"]),
    st.integers(0, 1000),
)
@example([(12.0, 1.0)], None, "stabilised", 0)
def test_where_a_depth_is_held_no_stick_leads_into_the_bottom(
    course: list[tuple[float, float]], heave: VelocityAxis | None, mode: str, seed: int
) -> None:
    dive = held_at(2.5, mode, heave=heave, seed=seed)
    for seconds, stick in course:
        dive.fly(seconds, heave=stick)
    dive.fly(25.0, heave=1.0)
    assert dive.nearest >= FLOOR + BAND - 3 * NOISE
    assert dive.height == pytest.approx(FLOOR + BAND, abs=3 * NOISE)
    assert dive.flown[-1].depth.velocity == pytest.approx(0.0, abs=2 * NOISE)
    smooth(dive.flown, dive.settings)


def test_the_pilot_is_told_once_and_up_is_free() -> None:
    dive = held_at(2.0)
    dive.fly(20.0, heave=1.0)
    assert set(dive.status.conditions) & {"floor_limit", "near_floor"} == {"floor_limit"}
    assert dive.generator.outbox.counts["notice:floor_limit"] == 1
    end = dive.fly(2.0, heave=-1.0)
    assert end.depth.velocity == -dive.settings.heave.max_velocity
    assert "floor_limit" not in dive.status.conditions
    dive.fly(20.0, heave=1.0)
    assert dive.ask("stop") == ""
    dive.fly(3.0)
    assert "floor_limit" not in dive.status.conditions


@pytest.mark.parametrize("mode", ["stabilised", "altitude_hold"])
def test_a_stick_held_down_at_the_floor_leads_no_deeper_without_an_altitude(mode: str) -> None:
    dive = held_at(2.0, mode)
    dive.fly(20.0, heave=1.0)
    dive.altimeter, before = False, dive.depth
    end = dive.fly(2 * PATIENCE_S + 10.0, heave=1.0)
    assert dive.depth == pytest.approx(before, abs=3 * NOISE)
    assert end.depth.velocity == 0.0
    assert "floor_limit" in dive.status.conditions
    dive.fly(0.1)
    again = dive.fly(3.0, heave=1.0)  # let go of: it is the pilot's
    assert again.depth.velocity == dive.settings.heave.max_velocity
    smooth(dive.flown, dive.settings)


def test_what_was_released_or_typed_or_set_or_not_measured_goes_to_the_bottom() -> None:
    manual = held_at(2.0, "manual")
    assert manual.fly(2.0, heave=1.0).heave_force == manual.settings.heave_force.full
    typed = held_at(2.0)
    assert typed.ask("goto", depth=flat(0.0) - 0.1) == ""
    typed.fly(15.0)
    assert typed.height == pytest.approx(0.1, abs=0.01)
    assert "near_floor" in typed.status.conditions
    free = held_at(2.0, floor=0.0)
    assert free.fly(3.0, heave=1.0).depth.velocity == free.settings.heave.max_velocity
    blind = held_at(4.0)
    blind.altimeter = False
    blind.fly(PATIENCE_S + 1.0)
    blind.fly(8.0, heave=1.0)
    assert blind.height < FLOOR


def test_the_answer_to_a_depth_at_the_bottom_says_what_comes_of_it() -> None:
    dive = Dive(flat, 4.0, noise=0.0)
    below = dive.request("goto", depth=30.0)
    assert below.accepted
    land = "the bottom is at 12.0 m here: the drone will land on it and press down"
    assert below.note == land
    near = dive.request("goto", depth=flat(0.0) - 0.3)
    assert near.note == "the drone will come to rest 0.3 m above the bottom"
    assert dive.request("goto", depth=flat(0.0) - FLOOR - 0.1).note is UNSET
    assert dive.request("goto", heading=1.0).note is UNSET
    refused = dive.request("goto", depth=1e4)
    assert "deeper than the depth limit" in refused.reason
    assert refused.note is UNSET
    dive.altimeter = False
    dive.fly(PATIENCE_S + 1.0)
    assert dive.request("goto", depth=30.0).note is UNSET
