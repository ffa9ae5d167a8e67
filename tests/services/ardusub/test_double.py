"""The double against what was measured on ArduSub 4.5 and 4.8, in their own simulator."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import MavlinkPacket
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tests.support.ardusub_double import udp
from tests.support.ardusub_double.board import BoardDouble
from tests.support.ardusub_double.motors import motor_pulses
from tests.support.ardusub_double.settings import defaults

MS, S = 1_000_000, 1_000_000_000  # [ns]
STACK = Stack(vehicle="bluerov2_heavy")
BOTH = pytest.mark.parametrize("version", ["4.5", "4.8"])


class Bench:
    """A board alone, with a ground station that speaks at a steady rate."""

    def __init__(self, version: str = "4.8", **params: float) -> None:
        vehicle, settings = STACK.section("vehicle", Vehicle), STACK.section("simulator", Settings)
        self.board = BoardDouble(vehicle, settings, version=version, params=params)
        self.now, self.heard = 0, list[tuple[int, MavlinkPacket]]()
        self.pulses: dict[int, int] | None = None  # override channels, sent every 20 ms
        self.heartbeats = True

    def say(self, name: str, system: int = 255, **fields: Any) -> None:
        self.board.hear(MavlinkPacket(name, fields, system, 1), self.now)

    def override(self, system: int = 255, **channels: int) -> None:
        self.say("RC_CHANNELS_OVERRIDE", system, target_system=1, **channels)

    def command(self, number: int, *params: float, system: int = 255) -> int | None:
        fields = {f"param{i}": p for i, p in enumerate([*params, 0, 0, 0, 0, 0, 0, 0][:7], 1)}
        self.say("COMMAND_LONG", system, target_system=1, command=number, **fields)
        self.collect()
        acks = [p for _, p in self.heard if p.name == "COMMAND_ACK"]
        return acks[-1].fields["result"] if acks else None

    def collect(self) -> None:
        self.heard += [(self.now, packet) for packet in self.board.sent()]

    def run(self, seconds: float) -> Iterator[float]:
        """Yields the seconds passed, every millisecond."""
        began = self.now
        while self.now < began + round(seconds * S):
            self.now += MS
            if self.heartbeats and self.now % S == 0:
                self.say("HEARTBEAT")
            if self.pulses is not None and self.now % (20 * MS) == 0:
                self.override(**{f"chan{n}_raw": pulse for n, pulse in self.pulses.items()})
            self.board.advance(self.now)
            self.collect()
            yield (self.now - began) / S

    def pass_time(self, seconds: float) -> None:
        for _ in self.run(seconds):
            pass

    def until(self, condition: Any, seconds: float = 10.0) -> float:
        return next((passed for passed in self.run(seconds) if condition()), float("inf"))

    def arm(self) -> None:
        self.pulses = dict.fromkeys(range(1, 7), 1500)
        self.pass_time(0.1)
        assert self.command(400, 1) == 0
        self.pass_time(0.6)


def pulses(frame: int, **axes: float) -> list[int]:
    order = ("roll", "pitch", "yaw", "throttle", "forward", "lateral")
    params = {**defaults("4.8"), "FRAME_CONFIG": float(frame)}
    return motor_pulses([axes.get(name, 0.0) for name in order], params)


def test_a_full_group_is_scaled_on_the_heavy_frame_and_clipped_on_the_other() -> None:
    full = {"forward": 1.0, "lateral": 1.0, "yaw": 1.0}
    assert pulses(2, **full)[:4] == [1633, 1100, 1633, 1633]
    assert pulses(1, **full)[:4] == [1900, 1100, 1900, 1900]


def test_the_rear_pair_of_the_vectored_frame_gives_way_to_the_throttle() -> None:
    assert pulses(1, forward=1.0, throttle=1.0)[:4] == [1100, 1100, 1500, 1500]
    assert pulses(1, forward=1.0, throttle=0.5)[:4] == [1100, 1100, 1700, 1700]
    assert pulses(2, forward=1.0, throttle=1.0)[:4] == [1100, 1100, 1900, 1900]


@BOTH
def test_up_drives_the_vertical_motors_below_1500_without_a_dead_band(version: str) -> None:
    bench = Bench(version)
    bench.arm()
    bench.pulses = {**dict.fromkeys(range(1, 7), 1500), 3: 1502}
    bench.pass_time(0.1)
    assert bench.board.servo[4:] == [1498] * 4
    bench.pulses[3] = 1500
    bench.pulses[5] = 2000  # clips
    bench.pass_time(0.1)
    assert bench.board.servo[:4] == [1100, 1100, 1900, 1900]


def test_a_throttle_trim_of_the_other_version_breaks_neutral() -> None:
    bench = Bench("4.5", RC3_TRIM=1500)
    bench.arm()
    assert bench.board.servo[4:] != [1500] * 4


def test_lowering_acro_yaw_p_lowers_manual_yaw() -> None:
    bench = Bench(ACRO_YAW_P=3.375 / 2)
    bench.arm()
    bench.pulses = {**dict.fromkeys(range(1, 7), 1500), 4: 1900}
    bench.pass_time(0.1)
    assert bench.board.servo[:4] == [1700, 1300, 1300, 1700]


@BOTH
def test_thrust_comes_half_a_second_after_arming_and_at_once(version: str) -> None:
    bench = Bench(version)
    bench.pulses = {**dict.fromkeys(range(1, 7), 1500), 5: 1900}  # off neutral, and it still arms
    bench.pass_time(0.1)
    assert bench.command(400, 1) == 0
    took = bench.until(lambda: bench.board.servo[0] != 1500)
    assert took == pytest.approx(0.52, abs=0.03)
    assert bench.board.servo[0] == 1100


def test_only_the_newer_version_refuses_a_throttle_off_its_trim() -> None:
    for version, result in (("4.5", 0), ("4.8", 4)):
        bench = Bench(version)
        bench.override(chan3_raw=1900)
        assert bench.command(400, 1) == result


@BOTH
def test_inputs_are_taken_at_50_hz(version: str) -> None:
    bench = Bench(version)
    bench.arm()
    delays = list[float]()
    for n in range(40):
        bench.pass_time(0.0371)  # at any phase
        pulse = 1600 if n % 2 else 1650
        bench.override(chan5_raw=pulse)
        bench.pulses = {**dict.fromkeys(range(1, 7), 1500), 5: pulse}
        delays.append(bench.until(lambda at=pulse: bench.board.servo[2] == at))
    assert max(delays) <= 0.026
    assert sorted(delays)[20] <= 0.02


@BOTH
def test_an_override_of_another_system_is_ignored_but_its_commands_are_not(version: str) -> None:
    bench = Bench(version)
    bench.arm()
    bench.override(254, chan5_raw=1700)
    assert bench.board.override[4] == 1500
    assert bench.command(400, 0, system=254) == 0
    assert not bench.board.armed


@BOTH
def test_a_released_channel_keeps_its_last_value(version: str) -> None:
    bench = Bench(version)
    bench.arm()
    bench.pulses = {5: 1700}
    bench.pass_time(0.5)
    bench.pulses = {5: 0}
    bench.pass_time(5.0)
    assert bench.board.servo[2] == 1700


@BOTH
def test_without_the_failsafe_the_last_value_stays_for_ever(version: str) -> None:
    bench = Bench(version, FS_PILOT_INPUT=0)
    bench.arm()
    bench.pulses = {5: 1700}
    bench.pass_time(0.5)
    bench.pulses = None
    bench.pass_time(12.0)
    assert bench.board.servo[2] == 1700


@BOTH
@pytest.mark.parametrize("timeout", [3.0, 0.5])
def test_the_pilot_input_failsafe_disarms_in_its_time(version: str, timeout: float) -> None:
    bench = Bench(version, FS_PILOT_TIMEOUT=timeout)
    bench.arm()
    bench.pulses = {5: 1700}
    bench.pass_time(0.5)
    bench.pulses = None
    took = bench.until(lambda: bench.board.servo[2] == 1500)
    assert took == pytest.approx(timeout, abs=0.03)
    assert not bench.board.armed
    assert bench.board.texts[-2:] == ["Lost manual control", "Disarming motors"]


def test_the_warning_failsafe_stays_armed_and_obeys_the_next_override() -> None:
    bench = Bench(FS_PILOT_INPUT=1)
    bench.arm()
    bench.pulses = None
    bench.pass_time(3.2)
    assert bench.board.armed
    bench.pulses = {5: 1700}
    bench.pass_time(0.05)
    assert bench.board.servo[2] == 1700


@pytest.mark.parametrize(("version", "least", "most"), [("4.5", 2.4, 2.9), ("4.8", 5.0, 5.4)])
def test_the_ground_station_failsafe_disarms_in_its_time(
    version: str, least: float, most: float
) -> None:
    bench = Bench(version, FS_PILOT_INPUT=0)
    bench.arm()
    bench.pulses, bench.heartbeats = None, False
    assert least <= bench.until(lambda: not bench.board.armed) <= most


def test_overrides_alone_feed_the_ground_station_failsafe() -> None:
    bench = Bench("4.5")
    bench.arm()
    bench.heartbeats = False
    bench.pass_time(9.0)
    assert bench.board.armed


def test_armed_without_any_input_ever_it_stays_armed() -> None:
    bench = Bench()
    bench.command(400, 1)
    bench.pass_time(5.0)
    assert bench.board.armed


@BOTH
def test_acks(version: str) -> None:
    bench = Bench(version)
    assert bench.command(176, 1, 2) == 0
    assert bench.command(176, 1, 99) == 4
    assert bench.command(31999) == 3
    assert bench.command(511, 105, 10_000) == (2 if version == "4.5" else 0)  # HIGHRES_IMU


@BOTH
@pytest.mark.parametrize("hz", [10, 50, 100, 200])
def test_streams_come_at_the_rate_that_was_asked_for(version: str, hz: int) -> None:
    bench = Bench(version)
    bench.command(511, 27, 1e6 / hz)
    bench.pass_time(2.0)
    stamps = [p.fields["time_usec"] for _, p in bench.heard if p.name == "RAW_IMU"]
    assert len(stamps) == pytest.approx(2 * hz, abs=2)


@BOTH
def test_a_pressure_is_sent_again_until_the_next_is_taken_over(version: str) -> None:
    bench = Bench(version)
    bench.command(511, 137, 25_000)
    bench.pass_time(3.0)
    sent = [p.fields["press_abs"] for _, p in bench.heard if p.name == "SCALED_PRESSURE2"]
    assert len(sent) == pytest.approx(120, abs=2)
    changes = [n for n in range(1, len(sent)) if sent[n] != sent[n - 1]]
    assert 20 <= len(changes) <= 30  # two in a row may be the same by chance
    assert {(after - before) % 4 for before, after in pairwise(changes)} == {0}


def test_nothing_but_heartbeats_comes_unasked() -> None:
    bench = Bench("4.5")
    bench.pass_time(3.0)
    assert {p.name for _, p in bench.heard} == {"HEARTBEAT"}
    assert len(bench.heard) in (3, 4)


def test_entering_manual_makes_the_inputs_neutral() -> None:
    bench = Bench()
    bench.override(chan5_raw=1700)
    bench.command(176, 1, 0)
    bench.command(176, 1, 19)
    assert bench.board.override[:6] == [1500.0] * 6


def test_a_leak_is_said_every_20_s_but_not_in_the_first() -> None:
    bench = Bench()
    bench.board.leaking = True
    bench.pass_time(65.0)
    said = [at / S for at, p in bench.heard if p.fields.get("text") == "Leak Detected"]
    assert said == pytest.approx([20.0, 40.0, 60.0], abs=0.1)


@BOTH
def test_lights_follow_channel_9_in_the_older_version_only(version: str) -> None:
    bench = Bench(version)
    bench.override(chan9_raw=1900)
    bench.pass_time(0.1)
    assert bench.board.light == (1900 if version == "4.5" else 1100)


def test_full_stick_is_as_fast_as_the_vehicle_of_the_file() -> None:
    """Not ArduSub's own hull: the one below the motors is Lindy's simulator."""
    bench = Bench()
    bench.arm()
    bench.pulses = {**dict.fromkeys(range(1, 7), 1500), 3: 1100}
    bench.pass_time(4.0)
    truth = bench.board.hull.simulator.truth()
    assert truth.depth_rate > 0.5
    bench.pulses = {**dict.fromkeys(range(1, 7), 1500), 4: 1600}
    bench.pass_time(2.0)
    assert bench.board.hull.simulator.truth().angular_rate[2] > 0.2


@pytest.mark.parametrize(
    ("vehicle", "assignments", "words"),
    [
        ("nosuch", [], "unknown vehicle 'nosuch'"),
        ("pioneer", [], "8 motors and the vehicle file has 4 thrusters"),
        ("bluerov2_heavy", ["NOSUCH=3"], "--set NOSUCH=3: unknown parameter"),
        ("bluerov2_heavy", ["FS_PILOT_INPUT=x"], "FS_PILOT_INPUT=x: expected NAME=NUMBER"),
    ],
)
def test_a_mistake_at_its_command_line_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    vehicle: str,
    assignments: list[str],
    words: str,
) -> None:
    options = [word for assignment in assignments for word in ("--set", assignment)]
    monkeypatch.setattr("sys.argv", ["udp", "--to", "1", "--vehicle", vehicle, *options])
    with pytest.raises(SystemExit) as ended:
        udp.main()
    assert ended.value.code == 2
    assert words in capsys.readouterr().err
