"""What the drone does in a failsafe: within its limits, without a step, never below its limit."""

from itertools import pairwise

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import Course, PilotCommand, PilotRequest
from messages.reference import Reference
from messages.sensors import LeakSample
from messages.state import VehicleState
from services.reference.core import GuidanceCheckpoint, ReferenceGenerator, Settings
from services.reference.failsafe.watch import WatchedMessages
from services.reference.settings import FailsafeSettings
from tests.support.said import state
from tests.support.told import told

DT = 10_000_000  # [ns]
LIMIT, SURFACE = 6.0, 0.5  # [m]
QUICK = FailsafeSettings(
    depth_limit=LIMIT, surface_depth=SURFACE, pilot_patience=3.0, leak_patience=2.0
)
SETTINGS = Settings(failsafe=QUICK)
ROUNDING = 1e-9
stick = st.sampled_from([-1.0, -0.4, 0.0, 0.3, 1.0])
there = st.sampled_from(["pilot", "pilot", "nobody", "no state", "leak"])
GENERATE = [Phase.explicit, Phase.generate]  # a minute of flight is too long to be shrunk


class Flight:
    """An ideal drone that is always where the reference wants it; armed."""

    def __init__(self, depth: float = 3.0, before: GuidanceCheckpoint | None = None) -> None:
        self.generator = ReferenceGenerator(SETTINGS, Outbox(), before or GuidanceCheckpoint())
        self.now, self.depth, self.heading, self.asked = 0, depth, 0.0, 0
        self.flown: list[Reference] = []
        if before is None:
            self.fly(0.1, heave=0.0)
            assert self.ask("arm") == ""

    def ask(self, kind: str, **more: object) -> str:
        self.asked += 1
        request = PilotRequest(stamp_ns=self.now, id=f"{self.asked}", kind=kind, **more)  # type: ignore[arg-type]
        return self.generator.answer(request, self.sticks(), self.now).reason

    def sticks(self, heave: float = 0.0, yaw: float = 0.0) -> PilotCommand:
        return PilotCommand(stamp_ns=self.now, surge=0.0, sway=0.0, heave=heave, yaw=yaw)

    def state(self) -> VehicleState:
        return state(self.now, depth=self.depth, heading=self.heading)

    def fly(
        self, seconds: float, *, heave: float = 0.0, yaw: float = 0.0, there: str = "pilot"
    ) -> Reference:
        leak = LeakSample(stamp_ns=0, wet=there == "leak")
        self.generator.conditions.newest = WatchedMessages(leak=leak)
        for _ in range(round(seconds * 100)):
            self.now += DT
            command = None if there == "nobody" else self.sticks(heave, yaw)
            seen = None if there == "no state" else self.state()
            out = self.generator.step(seen, command, self.now)
            assert out is not None
            if out.armed:
                self.depth, self.heading = out.depth.position, out.heading.position
            self.flown.append(out)
        return self.flown[-1]

    @property
    def reaction(self) -> str | None:
        return self.generator.status(self.now).reaction


def smooth(flown: list[Reference], *, stops: bool = False) -> None:
    """No step in position, velocity or acceleration; jerk and depth within their limits."""
    s, step = SETTINGS, DT * 1e-9
    for before, after in pairwise(flown):
        for a, b, axis in (
            (before.depth, after.depth, s.heave),
            (before.heading, after.heading, s.yaw),
        ):
            jerk, most = (
                (axis.stop_jerk, axis.stop_acceleration)
                if stops
                else (axis.jerk, axis.max_acceleration)
            )
            assert abs(b.acceleration - a.acceleration) <= jerk * step + ROUNDING
            assert abs(b.velocity - a.velocity) <= most * step + ROUNDING
            assert abs(b.position - a.position) <= axis.max_velocity * 1.01 * step + ROUNDING
            assert abs(b.jerk) <= jerk * (1 + ROUNDING)
        assert after.depth.position <= LIMIT + 1e-6


@pytest.mark.slow
@settings(max_examples=40, deadline=None, phases=GENERATE)
@given(st.lists(st.tuples(st.floats(0.1, 8.0), stick, stick, there, st.booleans()), max_size=10))
def test_through_every_stage_the_reference_stays_smooth_and_above_its_limit(
    course: list[tuple[float, float, float, str, bool]],
):
    flight = Flight()
    for seconds, heave, yaw, who, resumes in course:
        flight.fly(seconds, heave=heave, yaw=yaw, there=who)
        if resumes:
            flight.ask("resume")
    smooth(flight.flown)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, phases=GENERATE)
@given(st.lists(st.tuples(st.floats(0.05, 4.0), st.floats(-1.0, 1.0)), max_size=12))
def test_any_heave_sticks_leave_the_reference_above_the_limit(course: list[tuple[float, float]]):
    flight = Flight(depth=5.0)
    for seconds, heave in course:
        flight.fly(seconds, heave=heave)
    smooth(flight.flown)


def test_full_stick_comes_to_rest_at_the_limit_and_up_is_free():
    flight = Flight()
    end = flight.fly(20.0, heave=1.0)
    assert end.depth.position == pytest.approx(LIMIT, abs=1e-6)
    assert end.depth.velocity == pytest.approx(0.0, abs=1e-9)
    assert "depth_limit" in flight.generator.status(flight.now).conditions
    assert flight.generator.outbox.counts["notice:depth_limit"] == 1
    assert flight.fly(2.0, heave=-1.0).depth.velocity == -SETTINGS.heave.max_velocity
    assert "depth_limit" not in flight.generator.status(flight.now).conditions
    smooth(flight.flown)


def test_letting_go_just_above_the_limit_stops_there():
    flight = Flight()
    flight.fly(5.75, heave=1.0)
    assert 0.05 < LIMIT - flight.depth < 0.5
    here = flight.depth
    end = flight.fly(5.0)
    assert here < end.depth.position < LIMIT - 1e-3
    smooth(flight.flown)


def test_what_leads_below_the_limit_is_refused_in_words():
    flight = Flight()
    assert flight.ask("goto", depth=1e5) == "100000 m is deeper than the depth limit, 6 m"
    assert flight.ask("goto", depth=LIMIT) == ""
    path = Course(waypoints=((0.0, 0.0, 3.0), (20.0, 0.0, 7.0)))
    assert flight.ask("follow", course=path) == "7 m is deeper than the depth limit, 6 m"


def test_a_path_ends_at_rest_before_the_ascent_begins():
    flight = Flight()
    path = Course(waypoints=((0.0, 0.0, 3.0), (50.0, 0.0, 4.0)))
    assert flight.ask("follow", course=path) == ""
    flight.fly(10.0)
    flight.fly(40.0, there="leak")
    assert flight.reaction == "surface"
    assert flight.depth == pytest.approx(SURFACE, abs=0.011)
    assert flight.flown[-1].surge is None


def test_moving_sticks_do_nothing_until_the_pilot_resumes():
    flight = Flight()
    flight.fly(1.0, there="nobody")
    still = flight.fly(3.0, heave=1.0, yaw=1.0)
    assert flight.reaction == "stop"
    assert (still.depth.velocity, still.heading.velocity) == (0.0, 0.0)
    assert flight.generator.status(flight.now).resumable
    assert flight.ask("resume") == ""
    moving = flight.fly(3.0, heave=-1.0)
    assert flight.reaction is None
    assert moving.depth.velocity == -SETTINGS.heave.max_velocity
    smooth(flight.flown)


def test_resuming_during_the_ascent_stops_it_smoothly():
    flight = Flight()
    flight.fly(8.0, there="nobody")
    assert flight.reaction == "ascend"
    assert flight.fly(1.0).depth.velocity == pytest.approx(-QUICK.ascent_speed)
    assert flight.ask("resume") == ""
    assert flight.fly(3.0).depth.velocity == 0.0
    assert flight.depth > 1.0
    smooth(flight.flown)


def test_a_drone_above_the_surface_depth_does_not_go_down_to_it():
    flight = Flight(depth=0.2)
    flight.fly(10.0, there="nobody")
    assert flight.reaction == "surface"
    assert flight.depth == pytest.approx(0.2)


def test_without_a_state_the_ascent_waits():
    flight = Flight()
    flight.fly(5.0, there="nobody")
    assert flight.fly(3.0, there="no state").depth.velocity == 0.0
    assert flight.reaction == "ascend"
    flight.fly(40.0, there="nobody")
    assert flight.reaction == "surface"
    smooth(flight.flown)


def test_a_stop_request_during_the_ascent_does_not_end_it():
    flight = Flight()
    flight.fly(5.0, there="nobody")
    assert flight.ask("stop") == ""
    flight.fly(30.0, there="nobody")
    assert flight.reaction == "surface"
    smooth(flight.flown, stops=True)


def test_a_restart_of_the_service_goes_on_with_the_ascent():
    first = Flight()
    first.fly(5.0, there="nobody")
    assert first.reaction == "ascend"
    second = Flight(first.depth, first.generator.checkpoint)
    second.now = first.now
    second.fly(1.0)  # the pilot is back, and has not resumed
    assert second.reaction == "ascend"
    second.fly(30.0)
    assert second.depth == pytest.approx(SURFACE, abs=0.011)
    smooth(second.flown)


@pytest.mark.parametrize("hold", ["manual", "heading_hold"])
def test_where_the_depth_is_not_held_a_downward_force_fades_out_above_the_limit(hold: str):
    flight = Flight(depth=LIMIT - 2.0)
    assert flight.ask("mode", flight_mode=hold) == ""
    full = SETTINGS.heave_force.full
    assert flight.fly(2.0, heave=1.0).heave_force == pytest.approx(full)
    flight.depth = LIMIT - 0.5
    assert flight.fly(2.0, heave=1.0).heave_force == pytest.approx(full / 2)
    flight.depth = LIMIT + 1.0
    assert flight.fly(2.0, heave=1.0).heave_force == pytest.approx(0.0)
    assert flight.fly(2.0, heave=-1.0).heave_force == pytest.approx(-full)


def test_a_leak_is_said_when_it_is_noticed_and_again_when_the_drone_rises():
    flight = Flight()
    flight.fly(1.0, there="leak")
    assert flight.generator.outbox.counts["notice:leak"] == 1
    assert "failsafe:leak" not in flight.generator.outbox.counts
    flight.fly(SETTINGS.failsafe.leak_patience, there="leak")
    said = [event for event in told(flight.generator.outbox) if event.endswith(":leak")]
    assert said == ["notice:leak", "failsafe:leak"]
