"""Each fault does what it says, to that part only, until it is mended."""

from math import isnan
from typing import Any

import msgspec
import numpy as np
import pytest

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.sensors import LeakSample
from messages.simulator import FaultRequest
from services.marine.vehicle import Vehicle
from services.runtime.config.settings import nearest
from services.runtime.config.stack import Stack
from services.simulator.core import Settings, Simulator, WorldCheckpoint, at_the_surface
from services.simulator.faults import MEASURED, refusal
from services.simulator.service import decide
from services.simulator.settings import Dvl

MS = 1_000_000  # [ns]
PIONEER = Stack().section("vehicle", Vehicle)
ASKED = (10.0, -6.0, 4.0, 20.0)  # [N]
NAMES = ("port", "starboard", "lateral", "vertical")


def simulator(world: WorldCheckpoint | None = None, dvl: Dvl | None = None) -> Simulator:
    surface = at_the_surface(PIONEER, Settings())
    deep = msgspec.structs.replace(surface, state=(0.0, 0.0, 50.0, *surface.state[3:]))
    site = Settings(floor_depth=500.0 if dvl is None else 60.0, dvl=dvl)
    fresh = Simulator(PIONEER, site, 0, world or deep, Outbox())
    fresh.advance(0)
    return fresh


def request(part: str, fault: Any, value: float | None = None) -> FaultRequest:
    return FaultRequest(stamp_ns=0, id="x", part=part, fault=fault, value=value)


def drive(sim: Simulator, *thrust: float, since: int = 0, ms: int = 2000) -> int:
    """Command this for so long; returns the time [ns]."""
    for now in range(since, since + ms * MS, 50 * MS):
        command = ThrusterCommand(
            stamp_ns=now, sensor_ns=None, pilot_ns=None, thrust=thrust, armed=True
        )
        sim.obey(command, now)
    sim.advance(since + ms * MS)
    return since + ms * MS


@pytest.mark.parametrize("part", NAMES)
@pytest.mark.parametrize(
    ("fault", "value", "share"),
    [("dead", None, 0.0), ("reversed", None, -1.0), ("weak", 0.3, 0.3), ("weak", 0.0, 0.0)],
)
def test_a_thruster_does_as_its_fault_says_and_the_driver_reports_it(
    part: str, fault: str, value: float | None, share: float
) -> None:
    sim = simulator()
    sim.break_or_mend(request(part, fault, value), 0)
    now = drive(sim, *ASKED)
    expected = [t * (share if name == part else 1.0) for t, name in zip(ASKED, NAMES, strict=True)]
    assert sim.actuation().thrust == pytest.approx(expected, abs=1e-6)
    sim.break_or_mend(request(part, "none"), now)
    drive(sim, *ASKED, since=now)
    assert sim.actuation().thrust == pytest.approx(ASKED, abs=1e-6)


def test_a_stuck_thruster_keeps_its_thrust_whatever_it_is_told() -> None:
    sim = simulator()
    now = drive(sim, *ASKED)
    sim.break_or_mend(request("vertical", "stuck"), now)
    now = drive(sim, 0.0, 0.0, 0.0, -30.0, since=now)
    assert sim.actuation().thrust == pytest.approx((0.0, 0.0, 0.0, 20.0), abs=1e-6)
    sim.advance(now + 3000 * MS)  # even when commands no longer come
    assert sim.actuation().thrust[3] == pytest.approx(20.0, abs=1e-6)


def test_a_fault_does_not_make_thrust_jump() -> None:
    sim = simulator()
    now = drive(sim, *ASKED)
    before = sim.actuation().thrust
    sim.break_or_mend(request("port", "reversed"), now)
    assert sim.actuation().thrust == pytest.approx(before, abs=1e-9)


def test_a_silent_sensor_says_nothing_and_is_mended_with_all_others() -> None:
    sim = simulator()
    sim.break_or_mend(request("sensor/pressure", "silent"), 0)
    sim.break_or_mend(request("port", "dead"), 0)
    assert sim.pressure() is None
    assert sim.imu() is not None
    assert sim.silent == ["sensor/pressure"]
    assert sim.truth().faults == ("sensor/pressure: silent", "port: dead")
    sim.break_or_mend(request("all", "none"), 0)
    assert sim.pressure() is not None
    assert sim.truth().faults == ()


def test_a_frozen_sensor_repeats_itself_with_new_stamps() -> None:
    sim = simulator()
    sim.break_or_mend(request("sensor/imu", "frozen"), 0)
    samples = list[Any]()
    for ms in range(0, 100, 10):
        sim.advance(ms * MS)
        samples.append(sim.imu())
    assert len({s.angular_rate for s in samples} | {s.specific_force for s in samples}) == 2
    assert [s.stamp_ns for s in samples] == [ms * MS for ms in range(0, 100, 10)]


def test_a_noisy_sensor_has_so_many_times_its_noise() -> None:
    def spread(*faults: FaultRequest) -> float:
        sim = simulator()
        for fault in faults:
            sim.break_or_mend(fault, 0)
        readings = [sim.pressure() for _ in range(2000)]
        return float(np.std([sample.pressure for sample in readings if sample is not None]))

    usual = spread()
    assert spread(request("sensor/pressure", "noisy", 7.0)) == pytest.approx(7 * usual, rel=1e-6)
    assert spread(request("sensor/pressure", "noisy", 0.0)) < 1e-3


def test_a_biased_sensor_is_off_by_so_much_in_its_unit() -> None:
    sim, whole = simulator(), simulator()
    for part, off in (("sensor/imu", 0.1), ("sensor/magnetometer", 1e-5), ("sensor/pressure", 2e4)):
        sim.break_or_mend(request(part, "biased", off), 0)
    imu, field, pressure = sim.imu(), sim.magnetometer(), sim.pressure()
    imu0, field0, pressure0 = whole.imu(), whole.magnetometer(), whole.pressure()
    assert imu is not None
    assert imu0 is not None
    assert field is not None
    assert field0 is not None
    assert pressure is not None
    assert pressure0 is not None
    assert imu.angular_rate == pytest.approx([x + 0.1 for x in imu0.angular_rate])
    assert imu.specific_force == imu0.specific_force
    assert field.field == pytest.approx([x + 1e-5 for x in field0.field])
    assert pressure.pressure == pytest.approx(pressure0.pressure + 2e4)


@pytest.mark.parametrize("kind", ["biased", "broken", "frozen", "noisy"])
def test_a_faulty_dvl_without_a_bottom_has_no_velocity(kind: Any) -> None:
    sim, device = simulator(), Dvl(reach=5.0)
    sim.break_or_mend(request("sensor/dvl", kind, 0.1), 0)
    sample = sim.dvl(device)
    assert sample is not None
    assert sample.velocity is None


def test_a_broken_sensor_says_what_no_receiver_can_read() -> None:
    sim = simulator()
    sim.break_or_mend(request("sensor/imu", "broken"), 0)
    sample = sim.imu()
    assert sample is not None
    assert all(isnan(x) for x in (*sample.angular_rate, *sample.specific_force))
    with pytest.raises(msgspec.ValidationError):
        msgspec.msgpack.decode(msgspec.msgpack.encode(sample), type=type(sample))


@pytest.mark.parametrize(
    ("part", "fault", "value", "words"),
    [
        ("port", "silent", None, "port cannot be silent; possible: none, dead, reversed, weak"),
        ("sensor/imu", "dead", None, "sensor/imu cannot be dead; possible: none, silent"),
        ("all", "dead", None, "all cannot be dead; possible: none"),
        ("port", "weak", None, "weak needs a value from 0 to 1"),
        ("port", "weak", 1.5, "weak needs a value from 0 to 1"),
        ("sensor/imu", "noisy", -1.0, "noisy needs a value from 0 to 1000"),
        ("port", "dead", 0.5, "dead takes no value"),
        ("sensor/leak", "hot", None, "sensor/leak cannot be hot; possible: none, silent, wet"),
        ("sensor/leak", "noisy", None, "sensor/leak cannot be noisy"),
        ("sensor/pressure", "wet", None, "sensor/pressure cannot be wet; possible: none, silent"),
        ("port", "empty", None, "port cannot be empty; possible: none, dead"),
        ("port", "none", None, ""),
        ("sensor/pressure", "biased", -300.0, ""),
    ],
)
def test_what_makes_no_sense_is_refused(
    part: str, fault: str, value: float | None, words: str
) -> None:
    reason = refusal(request(part, fault, value), NAMES, [*MEASURED], nearest)
    assert reason.startswith(words)
    assert bool(reason) == bool(words)


def test_faults_survive_a_restart() -> None:
    sim = simulator()
    now = drive(sim, *ASKED)
    for broken in (request("vertical", "stuck"), request("sensor/pressure", "silent")):
        sim.break_or_mend(broken, now)
    world = msgspec.json.decode(msgspec.json.encode(sim.world()), type=WorldCheckpoint)
    again = simulator(world)
    assert again.truth().faults == sim.truth().faults
    assert again.pressure() is None
    drive(again, 0.0, 0.0, 0.0, 0.0)
    assert again.actuation().thrust == pytest.approx((0.0, 0.0, 0.0, 20.0), abs=1e-3)


def alarm(sim: Simulator, part: str, fault: str) -> None:
    answer = decide(sim, request(part, fault), 0, Outbox())
    assert answer.accepted, answer.reason


def test_what_a_pilot_must_know_of_can_be_simulated_until_it_is_mended() -> None:
    sim = simulator()
    assert sim.leak() == LeakSample(stamp_ns=0, wet=False)
    full, warm = sim.battery(), sim.temperature()
    assert full is not None
    assert warm is not None
    alarm(sim, "leak", "wet")
    alarm(sim, "battery", "critical")
    alarm(sim, "temperature", "hot")
    battery, hot = sim.battery(), sim.temperature()
    assert sim.leak() == LeakSample(stamp_ns=0, wet=True)
    assert battery is not None
    assert battery.used_wh is not None
    assert battery.capacity_wh is not None
    assert 1 - battery.used_wh / battery.capacity_wh == pytest.approx(0.08)
    assert battery.voltage < full.voltage
    assert hot is not None
    assert hot.temperature == 85.0
    for part in ("leak", "sensor/battery", "temperature"):
        alarm(sim, part, "none")
    assert (sim.battery(), sim.temperature()) == (full, warm)
    assert sim.leak() == LeakSample(stamp_ns=0, wet=False)


def test_a_dvl_loses_its_lock_or_locks_on_fish() -> None:
    device = Dvl(std=1e-9, altitude_std=0.0)
    sim = simulator(dvl=device)
    bottom = sim.dvl(device)
    assert bottom is not None
    assert bottom.altitude is not None
    assert bottom.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert decide(sim, request("dvl", "no_lock"), 0, Outbox()).accepted
    nothing = sim.dvl(device)
    assert nothing is not None
    assert (nothing.velocity, nothing.altitude) == (None, None)
    assert decide(sim, request("dvl", "wrong_lock", 0.3), 0, Outbox()).accepted
    fish = sim.dvl(device)
    assert fish is not None
    assert fish.velocity == pytest.approx((-0.3, 0.0, 0.0), abs=1e-6)
    assert fish.altitude == pytest.approx(bottom.altitude / 2)
    refused = decide(sim, request("dvl", "wrong_lock"), 0, Outbox())
    assert "wrong_lock needs a value from -5 to 5" in refused.reason
