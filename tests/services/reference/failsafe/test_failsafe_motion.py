"""How the reference moves through failsafes, and what gives the sticks back after a short loss."""

from typing import NamedTuple

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from messages.pilot import Course, PilotCommand
from messages.state import VehicleState
from services.reference.core import Settings
from services.reference.failsafe.table import SHORT_NS
from services.reference.guidance.axes import CENTRED_NS, CentredSticks, centred
from services.reference.settings import FailsafeSettings
from tests.services.reference.drone import DT, Drone, smooth
from tests.support.told import told

LIMIT, SURFACE = 6.0, 0.5  # [m]
QUICK = FailsafeSettings(
    depth_limit=LIMIT, surface_depth=SURFACE, pilot_patience=3.0, leak_patience=2.0
)
SETTINGS = Settings(failsafe=QUICK)
stick = st.sampled_from([-1.0, -0.4, 0.0, 0.3, 1.0])
there = st.sampled_from(["pilot", "pilot", "no pilot", "no state", "leak"])
GENERATE = [Phase.explicit, Phase.generate]  # a minute of flight is too long to be shrunk


def flying(depth: float = 3.0) -> Drone:
    return Drone(SETTINGS, depth=depth).armed()


def clean(flight: Drone, *, stops: bool = False) -> None:
    smooth(flight.flown, SETTINGS, stops=stops)
    assert max(each.depth.position for each in flight.flown) <= LIMIT + 1e-6


@pytest.mark.slow
@settings(max_examples=40, deadline=None, phases=GENERATE)
@given(st.lists(st.tuples(st.floats(0.1, 8.0), stick, stick, there, st.booleans()), max_size=10))
def test_through_every_stage_the_reference_stays_smooth_and_above_its_limit(
    course: list[tuple[float, float, float, str, bool]],
):
    flight = flying()
    for seconds, heave, yaw, who, resumes in course:
        flight.fly(seconds, heave=heave, yaw=yaw, there=who)
        if resumes:
            flight.ask("resume")
    clean(flight)


def test_full_stick_comes_to_rest_at_the_limit_and_up_is_free():
    flight = flying()
    flight.fly(5.75, heave=1.0)
    assert 0.05 < LIMIT - flight.depth < 0.6
    here = flight.depth
    let_go = flight.fly(5.0)
    assert here < let_go.depth.position < LIMIT - 1e-3
    end = flight.fly(20.0, heave=1.0)
    assert end.depth.position == pytest.approx(LIMIT, abs=1e-4)
    assert end.depth.velocity == pytest.approx(0.0, abs=1e-4)
    assert "depth_limit" in flight.status.conditions
    assert flight.fly(2.0, heave=-1.0).depth.velocity == -SETTINGS.heave.max_velocity
    assert "depth_limit" not in flight.status.conditions
    clean(flight)


def test_what_leads_below_the_limit_is_refused_in_words():
    flight = flying()
    assert flight.ask("goto", depth=1e5) == "100000 m is deeper than the depth limit, 6 m"
    assert flight.ask("goto", depth=LIMIT) == ""
    path = Course(waypoints=((0.0, 0.0, 3.0), (20.0, 0.0, 7.0)))
    assert flight.ask("follow", course=path) == "7 m is deeper than the depth limit, 6 m"


def test_a_path_ends_at_rest_before_the_ascent_begins():
    flight = flying()
    path = Course(waypoints=((0.0, 0.0, 3.0), (50.0, 0.0, 4.0)))
    assert flight.ask("follow", course=path) == ""
    flight.fly(10.0)
    flight.fly(40.0, there="leak")
    assert flight.status.reaction == "surface"
    assert flight.depth == pytest.approx(SURFACE, abs=0.011)
    assert flight.flown[-1].surge is None


def test_moving_sticks_do_nothing_until_the_pilot_resumes():
    flight = flying()
    flight.fly(1.0, there="no pilot")
    still = flight.fly(3.0, heave=1.0, yaw=1.0)
    assert flight.status.reaction == "stop"
    assert (still.depth.velocity, still.heading.velocity) == (0.0, 0.0)
    assert flight.status.resumable
    assert flight.ask("resume") == ""
    moving = flight.fly(3.0, heave=-1.0)
    assert flight.status.reaction is None
    assert moving.depth.velocity == -SETTINGS.heave.max_velocity
    clean(flight)


def test_resuming_during_the_ascent_stops_it_smoothly():
    flight = flying()
    flight.fly(8.0, there="no pilot")
    assert flight.status.reaction == "ascend"
    assert flight.fly(1.0).depth.velocity == pytest.approx(-QUICK.ascent_speed)
    assert flight.ask("resume") == ""
    assert flight.fly(3.0).depth.velocity == 0.0
    assert flight.depth > 1.0
    clean(flight)


def test_a_drone_above_the_surface_depth_does_not_go_down_to_it():
    flight = flying(depth=0.2)
    flight.fly(10.0, there="no pilot")
    assert flight.status.reaction == "surface"
    assert flight.depth == pytest.approx(0.2)


def test_without_a_state_the_ascent_waits_and_a_stop_request_does_not_end_it():
    flight = flying()
    flight.fly(5.0, there="no pilot")
    assert flight.fly(3.0, there="no state").depth.velocity == 0.0
    assert flight.status.reaction == "ascend"
    flight.fly(1.0, there="no pilot")
    assert flight.ask("stop") == ""
    flight.fly(40.0, there="no pilot")
    assert flight.status.reaction == "surface"
    clean(flight, stops=True)


@pytest.mark.parametrize("hold", ["manual", "heading_hold"])
def test_where_the_depth_is_not_held_a_downward_force_fades_out_above_the_limit(hold: str):
    flight = flying(depth=LIMIT - 2.0)
    assert flight.ask("mode", flight_mode=hold) == ""
    full = SETTINGS.heave_force.full
    assert flight.fly(2.0, heave=1.0).heave_force == pytest.approx(full)
    flight.depth = LIMIT - 0.5
    assert flight.fly(2.0, heave=1.0).heave_force == pytest.approx(full / 2)
    flight.depth = LIMIT + 1.0
    assert flight.fly(2.0, heave=1.0).heave_force == pytest.approx(0.0)
    assert flight.fly(2.0, heave=-1.0).heave_force == pytest.approx(-full)


S = 1_000_000_000  # [ns]


class Seen(NamedTuple):
    """What the drone had at one step."""

    state: bool
    command: PilotCommand | None  # admitted, and fresh
    reaction: str | None  # after the step
    epoch: int  # granted last


class Lost(Drone):
    """The drone, with pilots who take control from each other, and a memory of each step."""

    def __init__(self) -> None:
        super().__init__(SETTINGS, depth=3.0)
        self.seen = list[Seen]()

    def take(self, who: str) -> None:
        """The pilot of that name takes control by force; the next sticks are his."""
        self.ask("force", source=who, epoch=0)

    def step(self, state: VehicleState | None, command: PilotCommand | None) -> None:
        admits = self.generator.authority.admits
        heard = command if command is not None and admits(command.epoch, self.now) else None
        super().step(state, command)
        epoch = self.generator.authority.lease.epoch
        self.seen.append(Seen(state is not None, heard, self.status.reaction, epoch))


@pytest.mark.parametrize(("what", "seconds"), [("no pilot", 0.5), ("no state", 1.9)])
def test_after_a_short_loss_centred_sticks_are_enough(what: str, seconds: float) -> None:
    flight = Lost().armed()
    flight.fly(1.0, heave=0.5)
    flight.fly(seconds, there=what)
    assert flight.status.reaction == "stop"
    flight.fly(3.0, heave=1.0)
    assert flight.status.reaction == "stop"  # a stick that is held moves nothing
    assert flight.status.returns == "centre"
    flight.fly(CENTRED_NS / S)
    assert flight.status.reaction == "stop"
    flight.fly(0.02)
    assert flight.status.reaction is None
    assert "resumed:short_loss" in told(flight.generator.outbox)
    depth = flight.depth
    flight.fly(2.0, heave=1.0)
    assert flight.depth > depth + 0.2


@pytest.mark.parametrize("back", ["ann", "bob"])
@pytest.mark.parametrize("lost_first", [True, False])
def test_a_change_of_pilot_is_no_short_loss(back: str, lost_first: bool) -> None:
    flight = Lost().armed()
    flight.take("ann")
    ann = flight.epoch
    flight.fly(1.0)
    flight.fly(0.4 if lost_first else 0.0, there="no pilot")
    flight.take("bob")
    flight.fly(0.5, there="no pilot")
    flight.epoch = ann if back == "ann" else flight.epoch  # she may act on for two seconds
    flight.fly(0.9)
    was_bob = not lost_first and back == "ann"  # nothing has changed since she was lost
    assert flight.status.reaction == (None if was_bob else "stop")


@settings(max_examples=60, deadline=None, phases=GENERATE)
@given(
    st.lists(
        st.tuples(
            st.floats(0.02, 2.6),
            st.sampled_from([0.0, 0.0, 0.0, 0.6]),
            st.sampled_from(["pilot", "pilot", "pilot", "no pilot", "no state", "leak"]),
            st.sampled_from(["", "", "", "", "ann", "bob"]),
        ),
        min_size=2,
        max_size=12,
    )
)
def test_a_failsafe_ends_by_itself_only_after_short_losses_and_by_the_same_centred_pilot(
    course: list[tuple[float, float, str, str]],
) -> None:
    flight = Lost().armed()
    flight.take("ann")
    flight.fly(0.1)
    for seconds, heave, there, who in course:
        if who:
            flight.take(who)
        flight.fly(seconds, heave=heave, there=there)
    began = None
    for number, now in enumerate(flight.seen):
        acted = number > 0 and flight.seen[number - 1].reaction is not None
        if now.reaction is not None and not acted:
            began = number
        if acted and now.reaction is None:
            assert began is not None
            acting = flight.seen[began:number]
            assert max(map(len, stretches(acting))) * DT < SHORT_NS
            last = flight.seen[number - round(CENTRED_NS / DT) : number + 1]
            assert all(each.state for each in last)
            assert all(each.command is not None and centred(each.command) for each in last)
            assert len({each.epoch for each in [*acting, now]}) == 1
            assert {each.command.epoch for each in last if each.command} == {now.epoch}


def stretches(seen: list[Seen]) -> list[list[Seen]]:
    """Parts in which something was lost without a break."""
    found = [list[Seen]()]
    for each in seen:
        if each.command is None or not each.state:
            found[-1].append(each)
        elif found[-1]:
            found.append([])
    return found


@given(st.floats(0.1, 1.9))
def test_one_old_command_that_stays_fresh_gives_nothing_back(seconds: float) -> None:
    flight = Lost().armed()
    flight.fly(seconds, there="no pilot")
    for _ in range(5):  # each arrives alone, and is the newest for as long as it may act
        old = flight.sticks()
        for _ in range(CENTRED_NS // DT + 1):
            flight.now += DT
            flight.step(flight.state(), old)
        flight.fly(0.05, there="no pilot")
    assert flight.status.reaction == "stop"


@given(st.integers(1, 60))
def test_many_held_up_commands_that_arrive_at_once_give_nothing_back(count: int) -> None:
    watch = CentredSticks()
    for number in range(count):
        at_once = PilotCommand(stamp_ns=number * 2 * DT, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
        assert not watch.step(at_once, S + number)
