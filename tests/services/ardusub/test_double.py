"""The double against what was measured on ArduSub 4.5 and 4.8, in their own simulator."""

from collections.abc import Callable
from math import inf

import pytest

from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import MavlinkPacket, command
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble

MS, S = 1_000_000, 1_000_000_000  # [ns]
STACK = Stack(vehicle="bluerov2_heavy")
BOTH = pytest.mark.parametrize("version", ["4.5", "4.8"])


NEUTRAL = dict.fromkeys(range(1, 7), 1500)


class Bench:
    """A board alone, with a ground station that speaks at a steady rate."""

    def __init__(self, version: str = "4.8", **params: float) -> None:
        vehicle, settings = STACK.section("vehicle", Vehicle), STACK.section("simulator", Settings)
        self.board = BoardDouble(vehicle, settings, version=version, params=params)
        self.now = 0
        self.pulses: dict[int, int] | None = None  # override channels, sent every 20 ms
        self.heartbeats = True

    def override(self, pulses: dict[int, int], system: int = 255) -> None:
        fields = {f"chan{n}_raw": pulse for n, pulse in pulses.items()} | {"target_system": 1}
        self.board.hear(MavlinkPacket("RC_CHANNELS_OVERRIDE", fields, system, 1), self.now)

    def command(self, number: int, *params: float, system: int = 255) -> int:
        """Its result."""
        self.board.sent()
        self.board.hear(command(1, number, *params)._replace(system=system), self.now)
        (ack,) = (p for p in self.board.sent() if p.name == "COMMAND_ACK")
        return ack.fields["result"]

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> float:
        """[s] until then; infinite where it does not come."""
        began = self.now
        while (passed := (self.now - began) / S) < seconds:
            if until():
                return passed
            self.now += MS
            if self.heartbeats and self.now % S == 0:
                self.board.hear(MavlinkPacket("HEARTBEAT", {}, 255, 1), self.now)
            if self.pulses is not None and self.now % (20 * MS) == 0:
                self.override(self.pulses)
            self.board.advance(self.now)
        return inf

    def armed(self) -> "Bench":
        self.pulses = NEUTRAL
        self.run(0.1)
        assert self.command(400, 1) == 0
        self.run(0.6)
        return self


@BOTH
def test_up_drives_the_vertical_motors_below_1500_without_a_dead_band(version: str) -> None:
    bench = Bench(version).armed()
    bench.pulses = NEUTRAL | {3: 1502}
    bench.run(0.1)
    assert bench.board.servo[4:] == [1498] * 4
    bench.pulses = NEUTRAL | {5: 2000}  # clips
    bench.run(0.1)
    assert bench.board.servo[:4] == [1100, 1100, 1900, 1900]


@BOTH
def test_thrust_comes_half_a_second_after_arming_and_at_once(version: str) -> None:
    bench = Bench(version)
    bench.pulses = NEUTRAL | {5: 1900}  # off neutral, and it still arms
    bench.run(0.1)
    assert bench.command(400, 1) == 0
    took = bench.run(10.0, lambda: bench.board.servo[0] != 1500)
    assert took == pytest.approx(0.52, abs=0.03)
    assert bench.board.servo[0] == 1100


def test_only_the_newer_version_refuses_a_throttle_off_its_trim() -> None:
    for version, result in (("4.5", 0), ("4.8", 4)):
        bench = Bench(version)
        bench.override({3: 1900})
        assert bench.command(400, 1) == result


@BOTH
def test_an_override_of_another_system_is_ignored_but_its_commands_are_not(version: str) -> None:
    bench = Bench(version).armed()
    bench.override({5: 1700}, 254)
    assert bench.board.override[4] == 1500
    assert bench.command(400, 0, system=254) == 0
    assert not bench.board.armed


@BOTH
def test_a_released_channel_keeps_its_last_value(version: str) -> None:
    bench = Bench(version).armed()
    bench.pulses = {5: 1700}
    bench.run(0.5)
    bench.pulses = {5: 0}
    bench.run(5.0)
    assert bench.board.servo[2] == 1700


@BOTH
@pytest.mark.parametrize("timeout", [3.0, 0.5])
def test_the_pilot_input_failsafe_disarms_in_its_time(version: str, timeout: float) -> None:
    bench = Bench(version, FS_PILOT_TIMEOUT=timeout).armed()
    bench.pulses = {5: 1700}
    bench.run(0.5)
    bench.pulses = None
    took = bench.run(10.0, lambda: bench.board.servo[2] == 1500)
    assert took == pytest.approx(timeout, abs=0.03)
    assert not bench.board.armed
    assert bench.board.texts[-2:] == ["Lost manual control", "Disarming motors"]


@pytest.mark.parametrize(("version", "least", "most"), [("4.5", 2.4, 2.9), ("4.8", 5.0, 5.4)])
def test_the_ground_station_failsafe_disarms_in_its_time(
    version: str, least: float, most: float
) -> None:
    bench = Bench(version, FS_PILOT_INPUT=0).armed()
    bench.pulses, bench.heartbeats = None, False
    assert least <= bench.run(10.0, lambda: not bench.board.armed) <= most
