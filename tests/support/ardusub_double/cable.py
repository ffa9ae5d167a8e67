"""A driver and a board, packet by packet, without a bus, a link or a clock."""

from typing import Any

from messages.control import ThrusterCommand
from messages.events import Outbox
from services.ardusub.authority import TakenCheckpoint
from services.ardusub.core import ArdusubDriver
from services.ardusub.core import Settings as ArdusubSettings
from services.marine.vehicle import Vehicle
from services.mavlink_io.packet import MavlinkPacket, command
from services.runtime.config.stack import Stack
from services.simulator.core import Settings
from tests.support.ardusub_double.board import BoardDouble

MS, S = 1_000_000, 1_000_000_000  # [ns]
STACK = Stack(vehicle="bluerov2_heavy")
VEHICLE = STACK.section("vehicle", Vehicle)
DOWN = (0.0, 0.0, 0.0, 0.0, 10.0, 10.0, 10.0, 10.0)  # [N]


class Cable:
    """A driver and a board, 1 ms apart; the driver is looked at 200 times a second."""

    def __init__(
        self, version: str = "4.8", settings: ArdusubSettings | None = None, **board: Any
    ) -> None:
        place = STACK.section("simulator", Settings)
        self.board = BoardDouble(VEHICLE, place, version=version, **board)
        self.settings = settings or ArdusubSettings()
        self.outbox = Outbox()
        self.driver = ArdusubDriver(VEHICLE, self.settings, self.outbox)
        self.now = 5 * S  # the board boots now, and our clock is another one
        self.sent: list[tuple[int, MavlinkPacket]] = []  # by the driver
        self.samples: list[tuple[int, Any]] = []
        self.counts = self.outbox.counts
        self.said: list[str] = []
        self.thrust: tuple[float, ...] | None = None  # [N] commanded 100 times a second
        self.armed = True
        self.period_ns = 10 * MS  # of the commands
        self.deaf = self.dumb = False  # the board: hears nothing, says nothing
        self.delay: int = 0  # [ms] of the way up
        self._up: list[tuple[int, MavlinkPacket]] = []

    def run(self, seconds: float) -> "Cable":
        end = self.now + round(seconds * S)
        while self.now < end:
            self.now += MS
            if self.thrust is not None and self.now % self.period_ns == 0:
                self._command(self.thrust)
            if (
                self.driver.path.gate.ends_ns is not None
                and self.now > self.driver.path.gate.ends_ns
            ):
                self.driver.lapse(self.now)
            self.board.advance(self.now)
            fresh = [] if self.dumb else self.board.sent()
            self._up += [(self.now + self.delay * MS, packet) for packet in fresh]
            if self.now % (5 * MS) == 0:
                self._look()
            self._pass_on()
        return self

    def _command(self, thrust: tuple[float, ...]) -> None:
        asked = ThrusterCommand(
            stamp_ns=self.now, sensor_ns=None, pilot_ns=None, thrust=thrust, armed=self.armed
        )
        self.driver.obey(asked, self.now)

    def _look(self) -> None:
        due = [packet for at, packet in self._up if at <= self.now]
        self._up = [(at, packet) for at, packet in self._up if at > self.now]
        for packet in due:
            self.driver.hear(packet, self.now)
        self.driver.tick(self.now)

    def _pass_on(self) -> None:
        done = self.driver.take()
        self.samples += [(self.now, sample) for sample in done.samples]
        self.said += [text for _, text, _ in self.outbox.said]
        self.outbox.said.clear()
        for packet in done.packets:
            self.sent.append((self.now, packet))
            if not self.deaf:
                self.board.hear(packet._replace(system=255, component=191), self.now)

    def restart(self, *, taken: bool) -> None:
        """Another process in the place of the driver, which died without a word."""
        self.driver = ArdusubDriver(
            VEHICLE, self.settings, self.outbox, TakenCheckpoint(taken=taken)
        )

    def accepted(self) -> "Cable":
        self.run(1.5)
        assert self.driver.stage == "accepted", (self.driver.stage, self.said)
        return self

    def flying(self) -> "Cable":
        self.accepted()
        self.thrust = DOWN
        self.run(1.5)
        assert self.board.servo[4] > 1600
        return self

    def another(self, number: int, *params: float) -> None:
        self.board.hear(command(1, number, *params)._replace(system=254), self.now)

    def of(self, name: str, since: int = 0) -> list[MavlinkPacket]:
        return [packet for at, packet in self.sent if packet.name == name and at >= since]

    def sticks(self, since: int = 0) -> list[list[int]]:
        return [
            [packet.fields[f"chan{n}_raw"] for n in range(1, 7)]
            for packet in self.of("RC_CHANNELS_OVERRIDE", since)
        ]
