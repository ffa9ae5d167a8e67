"""Each fault does what it says, to that part only, until it is mended."""

from typing import Any

import msgspec
import numpy as np
import pytest
from msgspec import to_builtins

from messages.events import Outbox
from messages.sensors import LeakSample
from messages.simulator import FaultRequest
from services.runtime.config.settings import nearest
from services.simulator.core import Settings, Simulator, WorldCheckpoint
from services.simulator.faults import MEASURED, refusal
from services.simulator.service import decide
from services.simulator.settings import Dvl
from tests.services.simulator.hulls import MS, command, simulator

ASKED = (10.0, -6.0, 4.0, 20.0)  # [N]
NAMES = ("port", "starboard", "lateral", "vertical")
DEEP = Settings(floor_depth=500.0)


def request(part: str, fault: Any, value: float | None = None) -> FaultRequest:
    return FaultRequest(stamp_ns=0, id="x", part=part, fault=fault, value=value)


def drive(sim: Simulator, *thrust: float, since: int = 0, ms: int = 2000) -> int:
    """Command this for so long; returns the time [ns]."""
    for now in range(since, since + ms * MS, 50 * MS):
        sim.obey(command(now, *thrust), now)
    sim.advance(since + ms * MS)
    return since + ms * MS


@pytest.mark.parametrize(
    ("part", "fault", "value", "share"),
    [
        ("port", "dead", None, 0.0),
        ("starboard", "reversed", None, -1.0),
        ("lateral", "weak", 0.3, 0.3),
        ("vertical", "weak", 0.0, 0.0),
    ],
)
def test_a_thruster_does_as_its_fault_says_and_the_driver_reports_it(
    part: str, fault: str, value: float | None, share: float
) -> None:
    sim = simulator(DEEP)
    sim.break_or_mend(request(part, fault, value), 0)
    now = drive(sim, *ASKED)
    expected = [t * (share if name == part else 1.0) for t, name in zip(ASKED, NAMES, strict=True)]
    assert sim.actuation().thrust == pytest.approx(expected, abs=1e-6)
    sim.break_or_mend(request(part, "none"), now)
    assert sim.actuation().thrust == pytest.approx(expected, abs=1e-6)  # it does not jump
    drive(sim, *ASKED, since=now)
    assert sim.actuation().thrust == pytest.approx(ASKED, abs=1e-6)


def test_a_stuck_thruster_keeps_its_thrust_whatever_it_is_told() -> None:
    sim = simulator(DEEP)
    now = drive(sim, *ASKED)
    sim.break_or_mend(request("vertical", "stuck"), now)
    now = drive(sim, 0.0, 0.0, 0.0, -30.0, since=now)
    assert sim.actuation().thrust == pytest.approx((0.0, 0.0, 0.0, 20.0), abs=1e-6)
    sim.advance(now + 3000 * MS)  # even when commands no longer come
    assert sim.actuation().thrust[3] == pytest.approx(20.0, abs=1e-6)


def test_a_silent_sensor_says_nothing_and_is_mended_with_all_others() -> None:
    sim = simulator(DEEP)
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
    sim = simulator(DEEP)
    sim.break_or_mend(request("sensor/imu", "frozen"), 0)
    samples = list[Any]()
    for ms in range(0, 100, 10):
        sim.advance(ms * MS)
        samples.append(sim.imu())
    assert len({s.angular_rate for s in samples} | {s.specific_force for s in samples}) == 2
    assert [s.stamp_ns for s in samples] == [ms * MS for ms in range(0, 100, 10)]


def test_a_noisy_sensor_has_so_many_times_its_noise() -> None:
    def spread(*faults: FaultRequest) -> float:
        sim = simulator(DEEP)
        for fault in faults:
            sim.break_or_mend(fault, 0)
        readings = [sim.pressure() for _ in range(2000)]
        return float(np.std([sample.pressure for sample in readings if sample is not None]))

    usual = spread()
    assert spread(request("sensor/pressure", "noisy", 7.0)) == pytest.approx(7 * usual, rel=1e-6)
    assert spread(request("sensor/pressure", "noisy", 0.0)) < 1e-3


def test_a_biased_sensor_is_off_by_so_much_in_its_unit() -> None:
    sim, whole = simulator(DEEP), simulator(DEEP)
    for part, off in (("sensor/imu", 0.1), ("sensor/magnetometer", 1e-5), ("sensor/pressure", 2e4)):
        sim.break_or_mend(request(part, "biased", off), 0)
    biased, sound = (
        [to_builtins(each) for each in (of.imu(), of.magnetometer(), of.pressure())]
        for of in (sim, whole)
    )
    for k, name, off in ((0, "angular_rate", 0.1), (0, "specific_force", 0.0), (1, "field", 1e-5)):
        assert biased[k][name] == pytest.approx([x + off for x in sound[k][name]])
    assert biased[2]["pressure"] == pytest.approx(sound[2]["pressure"] + 2e4)


@pytest.mark.parametrize("kind", ["biased", "broken", "frozen", "noisy"])
def test_a_faulty_dvl_without_a_bottom_has_no_velocity(kind: Any) -> None:
    sim, device = simulator(DEEP), Dvl(reach=5.0)
    sim.break_or_mend(request("sensor/dvl", kind, 0.1), 0)
    sample = sim.dvl(device)
    assert sample is not None
    assert sample.velocity is None


@pytest.mark.parametrize(
    ("part", "fault", "value", "words"),
    [
        ("port", "silent", None, "port cannot be silent; possible: none, dead, reversed, weak"),
        ("port", "weak", 1.5, "weak needs a value from 0 to 1"),
        ("port", "dead", 0.5, "dead takes no value"),
        ("sensor/leak", "hot", None, "sensor/leak cannot be hot; possible: none, silent, wet"),
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
    sim = simulator(DEEP)
    now = drive(sim, *ASKED)
    for broken in (request("vertical", "stuck"), request("sensor/pressure", "silent")):
        sim.break_or_mend(broken, now)
    world = msgspec.json.decode(msgspec.json.encode(sim.world()), type=WorldCheckpoint)
    again = simulator(DEEP, before=world)
    assert again.truth().faults == sim.truth().faults
    assert again.pressure() is None
    drive(again, 0.0, 0.0, 0.0, 0.0)
    assert again.actuation().thrust == pytest.approx((0.0, 0.0, 0.0, 20.0), abs=1e-3)


def alarm(sim: Simulator, part: str, fault: str) -> None:
    answer = decide(sim, request(part, fault), 0, Outbox())
    assert answer.accepted, answer.reason


def test_what_a_pilot_must_know_of_can_be_simulated_until_it_is_mended() -> None:
    sim = simulator(DEEP)
    sound = sim.leak(), sim.battery(), sim.temperature()
    assert sound[0] == LeakSample(stamp_ns=0, wet=False)
    assert sound[1] is not None
    for part, fault in (("leak", "wet"), ("battery", "critical"), ("temperature", "hot")):
        alarm(sim, part, fault)
    battery, hot = sim.battery(), sim.temperature()
    assert sim.leak() == LeakSample(stamp_ns=0, wet=True)
    assert battery is not None
    assert battery.used_wh is not None
    assert battery.capacity_wh is not None
    assert 1 - battery.used_wh / battery.capacity_wh == pytest.approx(0.08)
    assert battery.voltage < sound[1].voltage
    assert hot is not None
    assert hot.temperature == 85.0
    for part in ("leak", "sensor/battery", "temperature"):
        alarm(sim, part, "none")
    assert (sim.leak(), sim.battery(), sim.temperature()) == sound


def test_a_dvl_loses_its_lock_or_locks_on_fish() -> None:
    device = Dvl(std=1e-9, altitude_std=0.0)
    sim = simulator(Settings(dvl=device))
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
