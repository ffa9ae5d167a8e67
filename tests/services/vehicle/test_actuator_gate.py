"""Nothing but a whole, timely, armed command of the epoch in force ever reaches a thruster."""

from math import inf, isfinite, nan
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.control import ThrusterCommand
from messages.events import Outbox
from services.marine.vehicle import Thruster
from services.vehicle.actuator_gate import LATCH_NS, ActuatorGate
from tests.support.told import told

MS = 1_000_000  # [ns]
LIMITS = ((-20.0, 30.0), (-35.0, 35.0))  # [N]
THRUSTERS = [
    Thruster(n, (0, 0, 0), (1, 0, 0), max_thrust=most, max_reverse=-least, dead_band=0.5)
    for n, (least, most) in zip(("port", "starboard"), LIMITS, strict=True)
]


def command(at: int, *thrust: float, ttl_ms: float = 200.0, **more: Any) -> ThrusterCommand:
    said: dict[str, Any] = {"epoch": 0, "armed": True} | more
    return ThrusterCommand(
        stamp_ns=at, sensor_ns=None, pilot_ns=None, thrust=thrust, ttl_ms=ttl_ms, **said
    )


class Gate(ActuatorGate):
    """With an outbox of its own."""

    def __init__(self) -> None:
        self.outbox = Outbox()
        super().__init__(THRUSTERS, self.outbox)

    def counted(self, command: ThrusterCommand, now: int) -> list[str]:
        self.obey(command, now)
        return told(self.outbox)


NEWTONS = st.one_of(st.floats(-100, 100), st.sampled_from([nan, inf, -inf, 0.0, 1e300]))


class Step(NamedTuple):
    """So much later a command comes (or none), and then the output is looked at."""

    later: int  # [ns]
    command: ThrusterCommand | None


@st.composite
def steps(draw: st.DrawFn) -> list[Step]:
    """Commands early, late, out of order, of any epoch, armed or not, whole or not."""
    now, taken = 1_000 * MS, list[Step]()
    for _ in range(draw(st.integers(1, 25))):
        later = draw(st.integers(0, 400 * MS))
        now += later
        said = None
        if draw(st.booleans()):
            said = command(
                now - draw(st.integers(-300 * MS, 500 * MS)),
                *draw(st.lists(NEWTONS, min_size=0, max_size=3)),
                ttl_ms=draw(st.one_of(st.floats(-10, 1500), st.sampled_from([nan, inf, 200.0]))),
                epoch=draw(st.integers(0, 3)),
                armed=draw(st.booleans()),
                gripper=draw(st.sampled_from([0.0, 1.0, -0.5, 1.5, nan, inf])),
            )
        taken.append(Step(later, said))
    return taken


@given(steps())
def test_the_law_of_the_gate(taken: list[Step]) -> None:
    gate, now = Gate(), 1_000 * MS
    for later, said in taken:
        now += later
        before, held, obeyed_ns = gate.command, gate.output(now), gate.obeyed_ns
        if said is None:
            gate.lapse(now)
        else:
            gate.obey(said, now)
        counted = told(gate.outbox)
        thrust, in_force = gate.output(now), gate.command
        assert len(thrust) == len(THRUSTERS)
        assert all(low <= f <= high for f, (low, high) in zip(thrust, LIMITS, strict=True))
        if said is not None and in_force is not said:  # refused: counted, and nothing changed
            assert any(name.endswith(":control/thrusters") for name in counted)
            assert in_force is before
            assert thrust == held
        moves = gate.gripper(now)
        assert moves == 0.0 or (in_force is not None and moves == in_force.gripper)
        assert -1.0 <= moves <= 1.0
        if any(thrust) or moves:
            assert in_force is not None
            assert in_force.armed
            assert gate.armed(now)
            assert all(map(isfinite, in_force.thrust))
            assert 0 <= in_force.ttl_ms <= 1000
            assert now <= in_force.stamp_ns + in_force.ttl_ms * MS
        if in_force is not None and before is not None:
            assert obeyed_ns is not None
            assert in_force.epoch >= before.epoch or now > obeyed_ns + LATCH_NS
            assert in_force.stamp_ns >= before.stamp_ns


@given(st.floats(-100, 100), st.floats(0, 1000), st.integers(0, 1000 * MS), st.integers(1, 10**12))
def test_it_is_zero_at_the_very_instant_after_a_life_has_ended(
    newtons: float, ttl_ms: float, age: int, after: int
) -> None:
    gate, heard = Gate(), 2_000 * MS
    gate.obey(command(heard - age, newtons, 0.0, ttl_ms=ttl_ms, gripper=1.0), heard)
    if gate.ends_ns is None:
        assert age > round(ttl_ms * MS)
        return
    assert gate.ends_ns == heard - age + round(ttl_ms * MS)
    assert gate.output(gate.ends_ns) == (max(-20.0, min(30.0, newtons)), 0.0)
    assert gate.output(gate.ends_ns + after) == (0.0, 0.0)
    assert (gate.gripper(gate.ends_ns), gate.gripper(gate.ends_ns + after)) == (1.0, 0.0)
    assert not gate.armed(gate.ends_ns + after)
    ended = gate.ends_ns + after
    told(gate.outbox)
    gate.lapse(ended)
    assert told(gate.outbox) == ["stale:control/thrusters"]
    gate.lapse(ended)
    assert told(gate.outbox) == []


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (command(500 * MS, nan, 0.0), "malformed"),
        (command(500 * MS, 1.0, 1.0, ttl_ms=1001.0), "malformed"),
        (command(500 * MS, 1.0, 1.0, ttl_ms=nan), "malformed"),
        (command(500 * MS, 1.0), "wrong_length"),
        (command(601 * MS, 1.0, 1.0), "from_future"),
        (command(299 * MS, 1.0, 1.0), "expired"),
        (command(399 * MS, 1.0, 1.0), "reordered"),
        (command(500 * MS, 1.0, 1.0, epoch=6), "wrong_epoch"),
        (command(500 * MS, 1.0, 1.0, epoch=7, armed=False), "disarmed"),
    ],
)
def test_every_refusal_has_its_name(wrong: ThrusterCommand, reason: str) -> None:
    gate = Gate()
    assert gate.counted(command(400 * MS, 5.0, 6.0, epoch=7), 400 * MS) == []
    assert gate.counted(wrong, 500 * MS) == [f"{reason}:control/thrusters"]
    held = (0.0, 0.0) if reason == "disarmed" else (5.0, 6.0)
    assert gate.output(500 * MS) == held
    assert gate.output(601 * MS) == (0.0, 0.0) or reason == "disarmed"


def test_what_is_beyond_a_limit_is_held_to_it_and_counted_by_name() -> None:
    gate = Gate()
    assert gate.counted(command(0, -21.0, 35.0), 0) == ["saturated:port"]
    assert gate.output(0) == (-20.0, 35.0)


def test_armed_without_thrust_is_not_disarmed() -> None:
    gate = Gate()
    assert not gate.armed(0)
    assert gate.counted(command(0, 0.0, 0.0), 0) == []
    assert gate.armed(200 * MS)
    assert not gate.armed(200 * MS + 1)
    assert gate.counted(command(300 * MS, 0.0, 0.0, armed=False), 300 * MS)[1:] == []
    assert not gate.armed(300 * MS)


def test_commands_act_again_after_a_silence_and_one_from_a_little_ahead_lives_no_longer() -> None:
    gate = Gate()
    gate.obey(command(90 * MS, 5.0, 5.0), 0)
    assert gate.ends_ns == 200 * MS
    assert gate.counted(command(900 * MS, 4.0, 4.0), 900 * MS) == ["stale:control/thrusters"]
    assert gate.output(900 * MS) == (4.0, 4.0)


def test_an_older_epoch_acts_again_once_the_newer_one_has_been_silent() -> None:
    gate = Gate()
    gate.obey(command(0, 5.0, 5.0, epoch=10**9), 0)
    second = 1_000_000_000  # [ns]
    assert gate.counted(command(second, 4.0, 4.0, epoch=3), second)[-1].startswith("wrong_epoch")
    assert gate.output(second) == (0.0, 0.0)
    assert gate.counted(command(second + 1, 4.0, 4.0, epoch=3), second + 1) == []
    assert gate.output(second + 1) == (4.0, 4.0)
