"""A short loss that has ended gives the sticks back to who centres them; nothing else does."""

from typing import NamedTuple

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.pilot import PilotCommand
from messages.sensors import LeakSample
from services.reference.failsafe.machine import FailsafeMachine, Holding
from services.reference.failsafe.table import SHORT_NS, table
from services.reference.failsafe.watch import WatchedMessages
from services.reference.guidance.axes import CENTRED_NS, CentredSticks, centred
from services.reference.settings import FailsafeSettings
from tests.services.reference.failsafe.test_failsafe_motion import DT, Flight
from tests.support.told import told

S = 1_000_000_000  # [ns]
GENERATE = [Phase.explicit, Phase.generate]  # a minute of flight is too long to be shrunk
TABLE = table(FailsafeSettings())
BRIEF = [row.name for row in TABLE if row.brief]


class Seen(NamedTuple):
    """What the drone had at one step."""

    state: bool
    command: PilotCommand | None  # admitted, and fresh
    reaction: str | None  # after the step
    epoch: int  # granted last


class Lost(Flight):
    """The drone, with pilots who take control from each other, and a memory of each step."""

    now: int

    def __init__(self) -> None:
        self.epoch, self.seen = 0, list[Seen]()  # epoch of the pilot whose sticks arrive
        super().__init__()

    def take(self, who: str) -> None:
        """The pilot of that name takes control by force; the next sticks are his."""
        self.ask("force", source=who)
        self.epoch = self.generator.authority.lease.epoch

    def live(self, seconds: float, heave: float = 0.0, there: str = "pilot") -> None:
        for _ in range(round(seconds * 100)):
            self.now += DT
            sticks = PilotCommand(
                stamp_ns=self.now, surge=0.0, sway=0.0, heave=heave, yaw=0.0, epoch=self.epoch
            )
            self.step(None if there == "nobody" else sticks, there)

    def step(self, command: PilotCommand | None, there: str = "pilot") -> None:
        authority = self.generator.authority
        if command is not None and authority.admits(command.epoch, self.now):
            authority.heard(command.epoch, self.now)
        else:
            command = None
        leak = LeakSample(stamp_ns=0, wet=there == "leak")
        self.generator.conditions.newest = WatchedMessages(leak=leak)
        state = None if there == "no state" else self.state()
        out = self.generator.step(state, command, self.now)
        assert out is not None
        self.depth = out.depth.position
        epoch = authority.lease.epoch
        self.seen.append(Seen(state is not None, command, self.reaction, epoch))


@pytest.mark.parametrize("what", ["nobody", "no state"])
@pytest.mark.parametrize("seconds", [0.5, 1.0, 1.9])
def test_after_a_short_loss_centred_sticks_are_enough(what: str, seconds: float) -> None:
    flight = Lost()
    flight.live(1.0, heave=0.5)
    flight.live(seconds, there=what)
    assert flight.reaction == "stop"
    flight.live(3.0, heave=1.0)
    assert flight.reaction == "stop"  # a stick that is held moves nothing
    assert flight.generator.status(flight.now).words.endswith("; centre the sticks to continue")
    flight.live(CENTRED_NS / S)
    assert flight.reaction == "stop"
    flight.live(0.02)
    assert flight.reaction is None
    assert "resumed:short_loss" in told(flight.generator.outbox)
    depth = flight.depth
    flight.live(2.0, heave=1.0)
    assert flight.depth > depth + 0.2


@pytest.mark.parametrize("what", ["nobody", "no state"])
def test_a_long_loss_asks_for_resume(what: str) -> None:
    flight = Lost()
    flight.live(2.1, there=what)
    flight.live(5.0)
    assert flight.reaction == "stop"
    assert flight.generator.status(flight.now).words.endswith("; press resume to continue")
    assert flight.ask("resume") == ""
    assert flight.reaction is None


@pytest.mark.parametrize("back", ["ann", "bob"])
@pytest.mark.parametrize("lost_first", [True, False])
def test_a_change_of_pilot_is_no_short_loss(back: str, lost_first: bool) -> None:
    flight = Lost()
    flight.take("ann")
    ann = flight.epoch
    flight.live(1.0)
    flight.live(0.4 if lost_first else 0.0, there="nobody")
    flight.take("bob")
    flight.live(0.5, there="nobody")
    flight.epoch = ann if back == "ann" else flight.epoch  # she may act on for two seconds
    flight.live(0.9)
    was_bob = not lost_first and back == "ann"  # nothing has changed since she was lost
    assert flight.reaction == (None if was_bob else "stop")


@settings(max_examples=100, deadline=None, phases=GENERATE)
@given(
    st.lists(
        st.tuples(
            st.floats(0.02, 2.6),
            st.sampled_from([0.0, 0.0, 0.0, 0.6]),
            st.sampled_from(["pilot", "pilot", "pilot", "nobody", "no state", "leak"]),
            st.sampled_from(["", "", "", "", "ann", "bob"]),
        ),
        min_size=2,
        max_size=12,
    )
)
def test_a_failsafe_ends_by_itself_only_after_short_losses_and_by_the_same_centred_pilot(
    course: list[tuple[float, float, str, str]],
) -> None:
    flight = Lost()
    flight.take("ann")
    flight.live(0.1)
    for seconds, heave, there, who in course:
        if who:
            flight.take(who)
        flight.live(seconds, heave=heave, there=there)
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
    flight = Lost()
    flight.live(seconds, there="nobody")
    for _ in range(5):  # each arrives alone, and is the newest for as long as it may act
        old = flight.sticks()
        for _ in range(CENTRED_NS // DT + 1):
            flight.now += DT
            flight.step(old)
        flight.live(0.05, there="nobody")
    assert flight.reaction == "stop"


@given(st.integers(1, 60))
def test_many_held_up_commands_that_arrive_at_once_give_nothing_back(count: int) -> None:
    watch = CentredSticks()
    for number in range(count):
        at_once = PilotCommand(stamp_ns=number * 2 * DT, surge=0.0, sway=0.0, heave=0.0, yaw=0.0)
        assert not watch.step(at_once, S + number)


@given(
    st.lists(
        st.tuples(
            st.sets(st.sampled_from([*BRIEF, "imu_lost", "leak"])),
            st.floats(0.01, 2.5),
            st.sampled_from([(1, 1), (1, 1), (1, 1), (1, 2)]),
        ),
        max_size=10,
    )
)
def test_what_gives_the_sticks_back_is_said_and_done(
    course: list[tuple[set[str], float, tuple[int, int]]],
) -> None:
    machine, now = FailsafeMachine(TABLE, Outbox(), armed=True), 0
    for names, seconds, pilot in course:
        holding = {name: Holding() for name in names}
        for part in (0.0, seconds):
            now += round(part * S)
            machine.step(holding, now, armed=True, at_surface=False, pilot=pilot)
            assert (machine.returns is None) == (machine.reaction is None)
            acting = {name for name in machine.memory if name in BRIEF}
            long = [machine.memory[name].long for name in acting]
            assert machine.returns != "centre" or not any(long)
        before = machine.memory
        gives = machine.returns == "centre" and machine.resumable
        again = FailsafeMachine(TABLE, Outbox(), before, armed=True)
        again.step(holding, now, armed=True, at_surface=False, pilot=pilot)
        again.give_back()
        assert (again.reaction is None) == (gives or machine.reaction is None)
