"""The vehicle's controller: what it does when its inputs are missing, late or wild."""

import math
import re
from math import cos, sin
from pathlib import Path

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from messages.control import Wrench
from messages.events import Outbox
from messages.message import Estimate
from messages.reference import Motion, Reference
from messages.state import VehicleState
from services.control.core import LONGEST_NS, Controller, Settings, at_sample
from services.control.laws import RollPitchGains
from services.marine.vehicle import Vehicle
from services.runtime.config.errors import LindyError
from services.runtime.config.stack import Stack
from services.runtime.hosts.stack_file import ServiceSpec
from services.runtime.hosts.virtual_host import VirtualHost
from tests.support import said
from tests.support.told import told

PIONEER = Stack().section("vehicle", Vehicle)
HEAVY = Stack(vehicle="bluerov2_heavy").section("vehicle", Vehicle)
GAINS = Stack().section("control", Settings)
MS = 1_000_000  # [ns]


def controller() -> Controller:
    return Controller(Settings(), PIONEER, Outbox())


def state(depth: float = 1.0, *, valid: bool = True) -> VehicleState:
    unknown = () if valid else ("depth", "depth_rate")
    return said.state(0, invalid=unknown, sensor_ns=7, depth=depth)


def reference(depth: float = 1.0, surge: float = 0.0, *, armed: bool = True) -> Reference:
    moved = Motion(depth, 0.0, 0.0, 0.0)
    return said.reference(0, sensor_ns=7, pilot_ns=5, armed=armed, depth=moved, surge_force=surge)


def test_too_shallow_means_thrust_downwards() -> None:
    wrench, command = controller().step(reference(depth=1.1), state(depth=1.0), 0)
    assert wrench.wanted[2] > 0
    assert command.thrust[3] > 0
    assert (command.sensor_ns, command.pilot_ns) == (7, 5)


def test_without_an_arming_or_a_state_thrusters_stop_and_the_command_says_whether_they_may_turn():
    for armed in (True, False):
        law, asked = controller(), reference(depth=5.0, surge=30.0, armed=armed)
        _, command = law.step(asked, state(), 0)
        assert (command.armed, any(command.thrust)) == (armed, armed)
        _, blind = law.step(asked, None, 0)
        assert (blind.armed, any(blind.thrust)) == (armed, False)  # a state may come back
        assert told(law.outbox).count("stale:state") == armed
    _, nothing_heard = controller().step(None, state(), 0)
    assert (nothing_heard.armed, any(nothing_heard.thrust)) == (False, False)


def test_when_the_reference_dies_the_last_position_is_held_without_surge() -> None:
    law = controller()
    law.step(reference(depth=1.2, surge=30.0), state(), 0)
    wrench, _ = law.step(None, state(depth=1.2), 10_000_000)
    assert wrench.wanted[0] == 0.0
    assert abs(wrench.wanted[2]) < 1.0
    assert law.step(None, state(depth=1.0), 20_000_000)[0].wanted[2] > 5.0


def test_a_result_that_is_not_finite_never_reaches_a_thruster() -> None:
    law = controller()
    _, command = law.step(reference(surge=math.inf), state(), 0)
    assert set(command.thrust) == {0.0}
    assert "not_finite:wrench" in law.outbox.counts


def test_a_saturation_is_counted_once_per_passage_and_a_demand_that_cannot_be_met_once() -> None:
    law = controller()

    def ask(surge: float, k: int) -> None:
        law.step(reference(surge=surge), replace(state(), sensor_ns=k * 10 * MS), k * 10 * MS)

    for k in range(10):
        ask(100.0, k)
    assert law.outbox.counts.total() == 1
    assert next(iter(law.outbox.counts)).startswith("saturated:")
    ask(1.0, 10)
    ask(100.0, 11)
    assert law.outbox.counts.total() == 2
    no_sway = [thruster for thruster in PIONEER.thruster if thruster.name != "lateral"]
    law = Controller(Settings(), replace(PIONEER, thruster=no_sway), Outbox())
    for k in range(5):
        law.step(replace(reference(), sway_force=5.0), state(), k * 10 * MS)
    assert told(law.outbox) == ["undriven:sway"]


# Forces of the pilot's, and changes of who decides.


def test_an_axis_that_is_not_held_gets_the_pilots_force_and_of_a_silent_pilot_nothing() -> None:
    law = controller()
    asked = replace(reference(depth=3.0), heave_force=4.0, yaw_moment=-0.7)
    wrench, _ = law.step(asked, state(depth=1.0), 0)
    assert (wrench.wanted[2], wrench.wanted[5]) == (4.0, -0.7)
    wrench, _ = law.step(None, state(depth=1.0), 10_000_000)
    assert (wrench.wanted[2], wrench.wanted[5]) == (0.0, 0.0)


@settings(max_examples=60, deadline=None)
@given(st.floats(-0.2, 0.2), st.floats(-20.0, 20.0), st.booleans())
def test_a_change_of_mode_is_not_felt_at_the_change(
    error: float, force: float, into_hold: bool
) -> None:
    law = controller()
    held = reference(depth=1.0 + error)
    ways = held, replace(held, heave_force=force, yaw_moment=force / 20)
    first, then = reversed(ways) if into_hold else ways
    before = [law.step(first, state(), k * 10_000_000)[0].wanted for k in range(20)][-1]
    at = law.step(then, state(), 200_000_000)[0].wanted
    assert at[2] == pytest.approx(before[2], abs=1e-9)
    assert at[5] == pytest.approx(before[5], abs=1e-9)
    after = [law.step(then, state(), k * 10_000_000)[0].wanted for k in range(21, 60)][-1]
    if not into_hold:
        assert after[2] == force  # the old way is forgotten


# What was learnt.


def sinking(law: Controller, force: float, seconds: float) -> list[Wrench]:
    """Hold a vehicle of ours, pushed by `force` [N] down; dead-band apart, exact."""
    z = v = 0.0
    wrenches: list[Wrench] = []
    for k in range(round(seconds * 100)):
        seen = replace(state(z), sensor_ns=k * 10_000_000, depth_rate=Estimate(v, 0.01))
        wrench, _ = law.step(reference(0.0), seen, k * 10_000_000)
        wrenches.append(wrench)
        v += (wrench.achieved[2] + force - (0.38 + 25.5 * abs(v)) * v) / 19.86 * 0.01
        z += v * 0.01
    return wrenches


def test_the_disturbance_is_told_and_forgotten_when_disarmed() -> None:
    law = Controller(GAINS, PIONEER, Outbox())
    learnt = sinking(law, 6.0, 10.0)[-1]
    assert learnt.disturbance[2] == pytest.approx(6.0, abs=0.5)
    assert learnt.depth_integral == -learnt.disturbance[2]
    disarmed, _ = law.step(reference(armed=False), state(), 11 * 10**9)
    assert disarmed.disturbance == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert law.step(reference(), state(), 11 * 10**9)[0].depth_integral == 0.0


def test_what_cannot_be_trusted_teaches_nothing() -> None:
    law = Controller(GAINS, PIONEER, Outbox())
    learnt = sinking(law, 6.0, 5.0)[-1].disturbance[2]
    blind = replace(state(), depth_rate=Estimate(5.0, 0.1, False))
    before = law.step(reference(0.0), blind, 5 * 10**9)[0].disturbance[2]
    assert before == pytest.approx(learnt, abs=0.5)  # from before: a fault is found out late
    for k in range(1, 50):
        wrench, _ = law.step(reference(0.0), blind, 5 * 10**9 + k * 10_000_000)
        assert wrench.disturbance[2] == before
    for k in range(50):
        stale, _ = law.step(reference(0.0), None, 6 * 10**9 + k * 10_000_000)
        assert stale.disturbance[2] == before


def test_a_saturated_axis_does_not_learn() -> None:
    law = Controller(GAINS, PIONEER, Outbox())
    wrenches = sinking(law, 200.0, 1.0)
    learnt = {wrench.disturbance[2] for wrench in wrenches if wrench.saturated}
    assert sum(wrench.saturated for wrench in wrenches) > 50
    assert len(learnt) == 1  # what it was when the thruster was full


def test_roll_and_pitch_are_held_level_when_told_to_where_thrusters_drive_them() -> None:
    level = RollPitchGains(kp=5.0, kd=1.0)
    law = Controller(Settings(roll=level), HEAVY, Outbox())
    rolled = replace(state(), roll=Estimate(0.1, 0.01), pitch=Estimate(0.2, 0.01))
    wrench, _ = law.step(reference(), rolled, 0)
    assert wrench.wanted[3] == pytest.approx(-0.5)
    assert wrench.wanted[4] == 0.0
    later = replace(rolled, sensor_ns=7 + 10_000_000, roll=Estimate(0.11, 0.01))
    wrench, _ = law.step(reference(), later, 10_000_000)
    assert wrench.wanted[3] == pytest.approx(-0.55 - 1.0)  # falling at 1 rad/s
    for axis in ("roll", "pitch"):
        refused = rf"control.{axis}: kp = 5 and kd = 1, but the thrusters"
        with pytest.raises(ValueError, match=refused):
            Controller(replace(Settings(), **{axis: level}), PIONEER, Outbox())


# Whatever messages say, thrust is finite and within its limits.

number = st.one_of(st.floats(-1e9, 1e9), st.sampled_from([0.0, 1e9, -1e9, 1e-300, math.pi, 5e-324]))
maybe = st.one_of(st.none(), number)
estimate = st.builds(Estimate, value=number, std=st.just(0.1), valid=st.booleans())
motion = st.builds(Motion, position=number, velocity=number, acceleration=number, jerk=number)
rest = st.one_of(st.none(), motion)
references = st.builds(
    Reference, stamp_ns=st.just(0), sensor_ns=st.just(7), pilot_ns=st.just(5),
    armed=st.sampled_from([True, True, True, False]), depth=motion, heading=motion,
    surge_force=number, sway_force=number, heave_force=maybe, yaw_moment=maybe, surge=rest,
    north=rest, east=rest,
)  # fmt: skip
MEASURED = ("depth", "depth_rate", "heading", "yaw_rate", "roll", "pitch")
PERHAPS = ("heading_navigation", "north", "east", "surge_velocity", "sway_velocity")
FLOWS = ("current_north", "current_east")
states = st.fixed_dictionaries(
    {"sensor_ns": st.integers(0, 10**12)}
    | dict.fromkeys(MEASURED, estimate)
    | dict.fromkeys((*PERHAPS, *FLOWS), st.one_of(st.none(), estimate))
).map(lambda parts: replace(state(), **parts))
inputs = st.tuples(st.one_of(st.none(), references), st.one_of(st.none(), states))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    st.sampled_from([Stack(), Stack(vehicle="bluerov2_heavy")]),
    st.lists(st.tuples(inputs, st.integers(-(10**9), 10**10)), min_size=1, max_size=12),
)
def test_no_message_makes_a_wild_thrust(
    stack: Stack,
    steps: list[tuple[tuple[Reference | None, VehicleState | None], int]],
) -> None:
    vehicle = stack.section("vehicle", Vehicle)
    law = Controller(stack.section("control", Settings), vehicle, Outbox())
    for (asked, seen), now in steps:
        wrench, command = law.step(asked, seen, now)
        for thrust, thruster in zip(command.thrust, vehicle.thruster, strict=True):
            assert thruster.limits[0] <= thrust <= thruster.limits[1]
        for message in (wrench, command):  # what we say is what the bus lets through
            msgspec.convert(msgspec.to_builtins(message), type(message))


# On a busy computer: what is measured counts, and not when it is handled.


def swinging(at: int) -> Reference:
    t = at / 1e9
    swing = Motion(0.2 * sin(t), 0.2 * cos(t), -0.2 * sin(t), -0.2 * cos(t))
    depth = replace(swing, position=2.0 + swing.position)
    return said.reference(at, depth=depth, heading=swing, surge_force=3.0)


def late(at: int) -> VehicleState:
    """A vehicle that does what it should, a little late."""
    t = at / 1e9 - 0.1
    rate, angle = 0.2 * cos(t), 0.2 * sin(t)
    return said.state(
        at, depth=2.0 + angle, depth_rate=rate, depth_acceleration=-angle, heading=angle,
        yaw_rate=rate,
    )  # fmt: skip


def wrenches(steps: list[tuple[int, int]], *, delayed: bool) -> list[Wrench]:
    """Steps of (period, delay) [ms]; a period of 0 is another step with the same sample."""
    law, sensor_ns = Controller(GAINS, PIONEER, Outbox()), 1000 * MS
    said: list[Wrench] = []
    for period, delay in steps:
        sensor_ns += period * MS
        now = sensor_ns + (delay * MS if delayed else 0)
        wrench, _ = law.step(swinging(sensor_ns), late(sensor_ns), now)
        said.append(replace(wrench, stamp_ns=0))
    return said


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from([0, 10, 10, 10, 20, 40, 100]), st.integers(0, 45)),
        min_size=10,
        max_size=60,
    )
)
def test_handling_delays_change_no_wrench(steps: list[tuple[int, int]]) -> None:
    assert wrenches(steps, delayed=True) == wrenches(steps, delayed=False)


@pytest.mark.parametrize("gap_ms", [10, 300])
def test_a_long_gap_teaches_nothing_and_is_counted_once(gap_ms: int) -> None:
    law, rest = Controller(GAINS, PIONEER, Outbox()), Motion(2.0, 0.0, 0.0, 0.0)

    def step(at: int, rate: float) -> Wrench:
        asked = replace(swinging(at), depth=rest)
        seen = said.state(at, depth=2.0, depth_rate=rate)
        return law.step(asked, seen, at)[0]

    learnt = [step(k * 10 * MS, 0.0) for k in range(50)][-1].disturbance[2]
    pushed = step((490 + gap_ms) * MS, 0.5).disturbance[2]
    assert (pushed == learnt) == (gap_ms > 50)
    assert told(law.outbox) == (["gap:state"] if gap_ms > 50 else [])


@given(st.integers(0, 10**9), st.integers(-100, 100))
def test_a_reference_is_run_on_to_the_sample_of_the_state(at: int, lead: int) -> None:
    there = at + 10**9 + lead * MS
    ahead, asked = at_sample(swinging(at + 10**9), there), swinging(there)
    error = 0.2 * (lead / 1e3) ** 4 / 24 + 1e-12  # of the fourth derivative
    assert ahead.depth.position == pytest.approx(asked.depth.position, abs=error)
    assert ahead.heading.position == pytest.approx(asked.heading.position, abs=error)
    assert ahead.depth.velocity == pytest.approx(asked.depth.velocity, abs=2e-4)


def test_a_reference_of_no_sample_or_of_another_clock_stays_as_it_is() -> None:
    asked = swinging(10**9)
    assert at_sample(asked, 10**9) is asked
    assert at_sample(asked, 10**9 + LONGEST_NS + 1) is asked
    alone = replace(asked, sensor_ns=None)
    assert at_sample(alone, 10**9 + MS) is alone


ROW = ServiceSpec(sides=["drone"])


def test_a_vehicle_that_cannot_be_flown_is_refused_by_the_name_of_its_file(tmp_path: Path) -> None:
    sound, broken = Stack().vehicle_path.read_text(), tmp_path / "broken.toml"
    vertical = r'name = "vertical"(.*?)direction = \[0.0, 0.0, 1.0\]'
    broken.write_text(
        re.sub(
            vertical, r'name = "vertical"\1direction = [0.0, 1.0, 0.0]', sound,
            count=1, flags=re.DOTALL,
        )
    )  # fmt: skip
    with pytest.raises(LindyError, match=r"broken\.toml(:\d+)?: .*cannot drive heave"):
        VirtualHost().add("control", ROW, Stack(vehicle=str(broken)))
