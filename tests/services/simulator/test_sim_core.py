"""Commands take effect when they are heard, end when their time is over, and nothing is silent."""

from itertools import pairwise
from math import exp, pi

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from messages.events import Outbox
from messages.sensors import BatterySample
from messages.simulator import FaultRequest
from services.simulator.core import Settings, Simulator, WorldCheckpoint, at_the_surface
from services.simulator.propulsion import Battery
from tests.services.simulator.hulls import MS, PIONEER, command, simulator, world
from tests.support.told import told


def test_it_begins_at_rest_floating_level_on_the_heading_asked_for() -> None:
    about = Settings(start_heading=1.2)
    sim = Simulator(PIONEER, about, 0, at_the_surface(PIONEER, about), Outbox())
    for ms in range(0, 1000, 10):
        sim.advance(ms * MS)
    truth = sim.truth()
    assert truth.position == pytest.approx((0.0, 0.0, PIONEER.floating_depth))
    assert (truth.roll, truth.pitch) == pytest.approx((0.0, 0.0))
    assert truth.heading == pytest.approx(1.2)
    assert truth.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert not truth.on_floor


def test_a_sea_too_shallow_to_float_in_is_refused() -> None:
    with pytest.raises(ValueError, match="floor_depth"):
        at_the_surface(PIONEER, Settings(floor_depth=0.3))


def test_before_the_first_command_the_thrusters_are_stopped_and_nothing_is_counted() -> None:
    outbox = Outbox()
    sim = simulator(outbox=outbox)
    sim.advance(1000 * MS)
    assert told(outbox) == []
    assert sim.actuation().stale
    assert sim.actuation().actuated_ns is None


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 9_999_999))
def test_a_command_takes_effect_at_the_instant_it_is_heard(offset: int) -> None:
    outbox, late = Outbox(), 10 * MS
    sim = simulator(outbox=outbox)
    sim.obey(command(offset, 0.0, 0.0, 20.0, 0.0), offset)
    assert told(outbox) == []
    sim.advance(late)
    actuation = sim.actuation()
    lag = PIONEER.thruster[2].time_constant
    expected = 20.0 * (1 - exp(-(late - offset) / 1e9 / lag))
    assert actuation.thrust[2] == pytest.approx(expected, abs=1e-9)
    assert actuation.actuated_ns == offset
    assert (actuation.sensor_ns, actuation.pilot_ns) == (offset - 1, offset - 2)
    assert not actuation.stale


def test_a_stale_command_ends_at_the_end_of_its_life_and_is_counted_once() -> None:
    outbox = Outbox()
    sim = simulator(outbox=outbox)
    sim.obey(command(0, 30.0, 30.0, 0.0, 0.0), 0)
    sim.advance(200 * MS)
    assert told(outbox) == []
    running = sim.actuation().thrust[0]
    sim.advance(201 * MS)
    assert told(outbox) == ["stale:control/thrusters"]
    sim.advance(500 * MS)
    assert told(outbox) == []
    assert sim.actuation().stale
    assert abs(sim.actuation().thrust[0]) < 0.05 * running


def test_staleness_does_not_depend_on_how_often_the_world_is_looked_at() -> None:
    outboxes = Outbox(), Outbox()
    seldom, often = (simulator(outbox=outbox) for outbox in outboxes)
    for sim in (seldom, often):
        sim.obey(command(0, 30.0, 30.0, 5.0, 10.0, ttl_ms=123.4), 0)
    for ms in range(1, 401):
        often.advance(ms * MS)
    seldom.advance(400 * MS)
    assert [told(outbox) for outbox in outboxes] == [["stale:control/thrusters"]] * 2
    # The steps are cut elsewhere: the integrator's own error, 5 µm here.
    assert often.truth().position == pytest.approx(seldom.truth().position, abs=1e-5)


def test_time_never_runs_backwards() -> None:
    sim = simulator()
    sim.obey(command(0, 30.0, 30.0, 5.0, 10.0), 0)
    sim.advance(100 * MS)
    before = sim.world()
    sim.advance(50 * MS)
    assert sim.world() == before
    assert sim.truth().stamp_ns == 100 * MS


def battery(sim: Simulator) -> BatterySample:
    sample = sim.battery()
    assert sample is not None
    return sample


def test_power_and_used_energy_grow_with_thrust_to_the_power_three_halves() -> None:
    idle, half, full = simulator(), simulator(), simulator()
    hotel = Settings().hotel_power
    for sim, thrust in ((idle, 0.0), (half, 17.5), (full, 35.0)):
        for ms in range(0, 2000, 10):
            sim.obey(command(ms * MS, thrust, 0.0, 0.0, 0.0), ms * MS)
    drawn = [sim.actuation().power - hotel for sim in (idle, half, full)]
    assert drawn[0] == 0.0
    assert drawn[2] == pytest.approx(Settings().thruster_power, rel=1e-3)
    assert drawn[1] == pytest.approx(drawn[2] / 2**1.5, rel=1e-3)
    assert battery(idle).used_wh == pytest.approx(hotel * 1.99 / 3600, rel=1e-6)
    used = [battery(sim).used_wh or 0.0 for sim in (idle, half, full)]
    assert used[0] < used[1] < used[2]
    assert battery(full).voltage < battery(idle).voltage


def test_at_full_thrust_astern_a_weaker_thruster_draws_the_same_power() -> None:
    thrusters = [msgspec.structs.replace(t, max_reverse=14.0) for t in PIONEER.thruster]
    fed = Battery(msgspec.structs.replace(PIONEER, thruster=thrusters), Settings())
    drawn = list[float]()
    for newtons in (35.0, -14.0):
        fed.feed([newtons, 0.0, 0.0, 0.0], 1.0)
        drawn.append(fed.power)
    assert drawn[0] == drawn[1] == Settings().thruster_power + Settings().hotel_power


def test_an_empty_battery_is_said_and_reads_finite_values() -> None:
    sim = simulator(before=world(used_wh=200.0))
    assert sim.battery_empty
    assert 0 < battery(sim).voltage < 16.8
    assert not simulator().battery_empty


def test_heading_accumulates_past_a_half_turn() -> None:
    sim = simulator()
    headings = list[float]()
    for ms in range(0, 20_000, 10):
        sim.obey(command(ms * MS, 10.0, -10.0, 0.0, 0.0), ms * MS)
        headings.append(sim.truth().heading)
    assert headings[-1] > 2 * pi
    assert max(abs(b - a) for a, b in pairwise(headings)) < 0.1


def test_a_remembered_world_goes_on_as_if_nothing_had_happened() -> None:
    first = simulator()
    first.obey(command(0, 20.0, 10.0, 5.0, 10.0, ttl_ms=10_000.0), 0)
    first.advance(1000 * MS)
    copy = msgspec.json.decode(msgspec.json.encode(first.world()), type=WorldCheckpoint)
    assert copy.fits(PIONEER)
    second = Simulator(PIONEER, Settings(), 0, copy, Outbox())
    for sim, t0 in ((first, 1000 * MS), (second, 5000 * MS)):
        sim.advance(t0)
        sim.obey(command(t0, 0.0, 0.0, 0.0, 0.0), t0)
        sim.advance(t0 + 700 * MS)
    assert second.world().state == pytest.approx(first.world().state, abs=1e-9)
    assert second.truth().heading == pytest.approx(first.truth().heading, abs=1e-9)
    assert battery(second).used_wh == pytest.approx(battery(first).used_wh)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1e9, 1e9)] * 4), min_size=1, max_size=20))
def test_no_command_however_absurd_makes_the_world_unreadable(
    thrusts: list[tuple[float, float, float, float]],
) -> None:
    sim = simulator()
    for i, thrust in enumerate(thrusts):
        sim.obey(command(i * 50 * MS, *thrust), i * 50 * MS)
    said = (sim.imu(), sim.magnetometer(), sim.pressure(), sim.battery(), sim.truth())
    for message in (*said, sim.actuation()):
        msgspec.msgpack.decode(msgspec.msgpack.encode(message), type=type(message))


def test_the_water_is_measured_by_the_depth_sensor_and_not_while_that_is_silent() -> None:
    sim = simulator()

    def water() -> float | None:
        sample = sim.temperature()
        assert sample is not None
        return sample.water

    assert water() is None  # nothing was measured yet
    sample = sim.pressure()
    assert sample is not None
    assert water() == sample.temperature
    sim.break_or_mend(FaultRequest(stamp_ns=0, id="1", part="sensor/pressure", fault="silent"), 10)
    assert water() is None
