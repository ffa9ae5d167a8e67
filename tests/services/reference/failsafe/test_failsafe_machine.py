"""The failsafe table and its state machine: what may never happen, whatever the conditions do."""

from itertools import pairwise
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.events import Outbox
from messages.message import Notice
from messages.vehicle import Failsafe
from services.reference.failsafe.machine import FailsafeMachine, Holding
from services.reference.failsafe.table import ACTING, SEVERITY, table
from services.reference.settings import FailsafeSettings, Settings
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from tests.support.told import told

S = 1_000_000_000  # [ns]
TABLE = table(FailsafeSettings())
NAMES = [row.name for row in TABLE]
conditions = st.sets(st.sampled_from(NAMES), max_size=6)
pauses = st.floats(0.01, 40.0)  # [s]


def machine() -> FailsafeMachine:
    return FailsafeMachine(TABLE, Outbox(), armed=True)


def severity(machine: FailsafeMachine) -> int:
    return -1 if machine.reaction is None else SEVERITY.index(machine.reaction)


class Clocked:
    """A machine with its clock, armed."""

    def __init__(self) -> None:
        self.machine, self.now = machine(), 0

    def hold(self, *names: str, seconds: float = 0.01, level: int = 0, surface: bool = False):
        """These conditions hold for a while, judged at its beginning and at its end."""
        for part in (0.0, seconds):
            self.now += round(part * S)
            holding = {name: Holding(level) for name in names}
            self.machine.step(holding, self.now, armed=True, at_surface=surface)
        return self.machine.reaction


@given(st.lists(st.tuples(conditions, pauses), max_size=12))
def test_a_reaction_never_ends_and_never_becomes_milder_without_an_act(
    course: list[tuple[set[str], float]],
):
    clocked, worst = Clocked(), -1
    for names, seconds in course:
        clocked.hold(*names, seconds=seconds)
        assert severity(clocked.machine) >= worst
        worst = severity(clocked.machine)


@given(st.lists(st.tuples(st.sampled_from(NAMES), pauses), max_size=12))
def test_the_gravest_reaction_acts_and_every_condition_is_listed(course: list[tuple[str, float]]):
    clocked, held = Clocked(), set[str]()
    for name, seconds in course:
        held.add(name)
        clocked.hold(*held, seconds=seconds)
        assert set(clocked.machine.holding) == held
        reached = [
            row.stages[clocked.machine.memory[row.name].stage] for row in TABLE if row.name in held
        ]
        acting = [stage.reaction for stage in reached if stage.reaction in ACTING]
        assert clocked.machine.reaction == max(acting, key=SEVERITY.index, default=None)


@given(st.lists(st.tuples(conditions, pauses), min_size=1, max_size=6))
def test_what_has_ended_is_never_named_while_as_grave_a_condition_holds(
    course: list[tuple[set[str], float]],
):
    clocked = Clocked()
    for names, seconds in course:
        clocked.hold(*names, seconds=seconds)
        machine = clocked.machine
        if (named := machine.acting) is None:
            continue
        memory = machine.memory

        def reaction(name: str, machine: FailsafeMachine = machine) -> str:
            (row,) = [row for row in TABLE if row.name == name]
            return row.stages[machine.memory[name].stage].reaction

        as_grave = [
            name
            for name, each in memory.items()
            if each.holds and each.overruled is None and reaction(name) == reaction(named.name)
        ]
        assert memory[named.name].holds or not as_grave


@given(conditions, pauses, st.booleans())
def test_after_a_resume_that_was_granted_nothing_acts(names: set[str], seconds: float, ended: bool):
    clocked = Clocked()
    clocked.hold(*names, seconds=seconds)
    if ended:
        clocked.hold(seconds=0.1)
    acted = clocked.machine.reaction
    reason = clocked.machine.resume()
    assert clocked.machine.reaction is (acted if reason else None)
    if ended and acted is not None:
        assert reason == ""


@given(conditions, pauses)
def test_a_restart_ends_no_failsafe(names: set[str], seconds: float):
    before = Clocked()
    before.hold(*names, seconds=seconds, surface=True)
    old = before.machine
    after = FailsafeMachine(TABLE, Outbox(), dict(old.memory), True, old.surfaced)
    after.step({}, before.now + S, armed=True, at_surface=False)
    assert after.reaction == old.reaction


@given(conditions, st.lists(st.floats(0.001, 3.0), min_size=1, max_size=40))
def test_the_time_of_a_stage_does_not_depend_on_how_often_it_is_looked_at(
    names: set[str], looks: list[float]
):
    often, once = Clocked(), Clocked()
    often.hold(*names)
    once.hold(*names)
    for pause in looks:
        often.hold(*names, seconds=pause)
    once.now = often.now
    assert once.hold(*names, seconds=0.0) == often.machine.reaction


def test_a_pilot_who_is_away_gets_a_stop_then_an_ascent_then_the_surface():
    clocked = Clocked()
    assert clocked.hold("pilot_lost") == "stop"
    assert clocked.hold("pilot_lost", seconds=59.9) == "stop"
    assert clocked.hold("pilot_lost", seconds=0.2) == "ascend"
    assert clocked.hold("pilot_lost", seconds=10.0, surface=True) == "surface"
    assert clocked.hold(seconds=10.0, surface=False) == "surface"
    assert clocked.machine.resumable
    assert clocked.machine.resume() == ""
    assert clocked.hold() is None


def test_resume_is_refused_in_words_while_the_pilot_is_away():
    clocked = Clocked()
    assert "nothing to resume" in clocked.machine.resume()
    clocked.hold("pilot_lost", "state_lost")
    assert clocked.machine.resume() == "drone's state lost: its motion is not known, still"
    assert not clocked.machine.resumable
    names = [each.code for each in clocked.machine.acts]
    assert set(clocked.machine.holding) == {name.removeprefix("failsafe:") for name in names}
    clocked.hold()
    assert [each.code for each in clocked.machine.acts] == names
    assert len(names) == 2
    assert clocked.machine.holding == ()


def test_an_overruled_leak_acts_again_only_after_it_has_ended():
    clocked = Clocked()
    assert clocked.hold("leak") is None
    assert clocked.hold("leak", seconds=10.0) == "ascend"
    assert clocked.machine.resume() == ""
    assert clocked.hold("leak", seconds=1000.0) is None
    assert clocked.machine.notices == (Notice("notice:leak"),)
    clocked.hold()
    assert clocked.hold("leak", seconds=10.1) == "ascend"


def test_an_overruled_battery_acts_again_once_it_is_worse():
    clocked = Clocked()
    clocked.hold("battery_critical", seconds=10.1)
    assert clocked.machine.resume() == ""
    assert clocked.hold("battery_critical", seconds=100.0) is None
    assert clocked.hold("battery_critical", seconds=10.1, level=1) == "ascend"


def test_a_leak_can_be_overruled_before_it_acts_but_not_by_resuming_from_a_lost_pilot():
    clocked = Clocked()
    clocked.hold("leak", seconds=1.0)
    assert clocked.machine.resume() == ""
    assert clocked.hold("leak", seconds=100.0) is None
    clocked = Clocked()
    clocked.hold("pilot_lost")
    clocked.hold("leak", seconds=1.0)
    assert clocked.machine.resume() == ""
    assert clocked.hold("leak", seconds=10.0) == "ascend"


def test_while_disarmed_nothing_acts_and_the_stages_begin_with_the_arming():
    clocked = Clocked()
    clocked.hold("leak", seconds=20.0)
    clocked.machine.disarm()
    clocked.now += 100 * S
    clocked.machine.step({"leak": Holding()}, clocked.now, armed=False, at_surface=False)
    assert clocked.machine.reaction is None
    assert clocked.machine.notices == (Notice("notice:leak"),)
    assert clocked.hold("leak", seconds=9.9) is None
    assert clocked.hold("leak", seconds=0.2) == "ascend"
    clocked.hold()
    clocked.machine.disarm()  # ends what has ended
    assert clocked.hold() is None


def test_stages_come_in_order_and_become_graver_and_every_row_that_acts_has_a_word():
    for row in TABLE:
        assert row.stages[0].after == 0.0
        for before, after in pairwise(row.stages):
            assert before.after <= after.after
            assert SEVERITY.index(before.reaction) < SEVERITY.index(after.reaction)
            assert after.reaction == "ascend"  # so screens say of it: rises in 43 s
    assert {row.name for row in TABLE if row.acts} == set(get_args(Failsafe)) - {"none"}


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("surface_depth=99", "must be above depth_limit"),
        ("battery_critical=0.3", "must be less than battery_low"),
        ("ascent_speed=2", "must not be above heave.max_velocity"),
    ],
)
def test_a_table_that_contradicts_itself_is_refused_with_the_option(assignment: str, words: str):
    option = f"reference.failsafe.{assignment}"
    stack = Stack(overrides=["reference.failsafe.depth_limit=90", option])
    with pytest.raises(LindyError, match=f"--set {option}.*{words}"):
        stack.section("reference", Settings)


@pytest.mark.parametrize(
    ("name", "at_first", "later"),
    [
        ("leak", ["notice:leak"], ["failsafe:leak"]),
        ("battery_critical", ["notice:battery_critical"], ["failsafe:battery_critical"]),
        ("pilot_lost", ["failsafe:pilot_lost"], []),  # acts at once
    ],
)
def test_a_condition_is_said_once_when_it_begins_and_once_when_it_acts_later(
    name: str, at_first: list[str], later: list[str]
):
    clocked = Clocked()
    clocked.hold(name, seconds=9.0)
    assert told(clocked.machine.outbox) == at_first
    clocked.hold(name, seconds=9.0)
    assert told(clocked.machine.outbox) == later
