"""A visit at a board as a pure state machine: packets and time in, packets out.

It asks, and listens. It arms nothing, moves nothing and sets no parameter. It speaks as a system
that the board takes no sticks from, sends no heartbeat, so that no failsafe of the board begins to
wait for the next one, and gives back the rates that it asked for. While the board is armed it asks
for no rates: somebody may be flying over the same link.
"""

from collections import Counter, deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from messages import events, topics
from messages.events import Outbox
from messages.units import Ns
from services.ardusub import board_check, telemetry
from services.ardusub.core import LEAK
from services.ardusub.settings import Settings
from services.ardusub.telemetry import NUMBERS, BoardClock, TelemetryStream, TelemetryStreams
from services.mavlink_io.packet import (
    ARDUPILOT,
    AUTOPILOT,
    MESSAGE_IDS,
    SUBMARINE,
    MavCommand,
    MavlinkPacket,
    MavModeFlag,
    command,
)

S = 1_000_000_000  # [ns]
NO_BOARD_NS = 4 * S  # [ns] heartbeats come once a second
NO_VERSION_NS = 3 * S
NOT_GRANTED_NS = 3 * S  # [ns] after which rates are measured, whatever was granted
ASK_NS = S // 2
TIMESYNC_NS = S // 5
DEFAULT_RATE = 0  # [µs] interval that means: as if nobody had asked
# Which are shown, and not judged.
OPTIONAL = ["BATT_MONITOR", "BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"]
Stage = Literal["heartbeat", "version", "parameters", "rates", "done"]


@dataclass(slots=True)
class BoardVisit:
    """What was heard; it is whole when the stage is `done`."""

    settings: Settings
    motors: int
    seconds: float  # [s] for which rates are measured
    servos: Mapping[str, int] = field(default_factory=dict[str, int])  # of the outputs, by name
    stage: Stage = "heartbeat"
    heartbeat: dict[str, Any] | None = None  # newest of the board
    others: dict[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])
    version: int | None = None  # flight_sw_version of AUTOPILOT_VERSION
    leak: bool = False  # it said that there is one
    clock: BoardClock = field(default_factory=BoardClock)
    newest: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    rates: dict[str, float] = field(default_factory=dict[str, float])  # [1/s] as measured
    repeated_ns: int = 0  # [ns] longest time for which the IMU said one and the same
    lost: Outbox = field(default_factory=Outbox)  # is told of what could not be used
    unknown: int = 0  # frames of messages that nobody knows, whose check sum says nothing
    streams: TelemetryStreams = field(init=False)
    reader: board_check.ParameterReader = field(init=False)
    optional: board_check.ParameterReader = field(init=False)
    _imu: tuple[float, ...] = ()  # its newest value, …
    _imu_since: Ns = 0  # [ns] … and since when it has said so
    _since: Ns | None = None  # begin of the stage
    _measured_since: Ns | None = None
    _arrived: Counter[str] = field(default_factory=Counter[str])
    _questions: deque[Ns] = field(default_factory=lambda: deque[Ns](maxlen=16))
    _due: dict[str, Ns] = field(default_factory=dict[str, Ns])

    def __post_init__(self) -> None:
        board = self.settings.board
        self.reader = board_check.ParameterReader(board, [])
        self.optional = board_check.ParameterReader(board, OPTIONAL)
        self.streams = TelemetryStreams(board, _wanted(self.settings))

    @property
    def armed(self) -> bool:
        return self.heartbeat is not None and bool(
            self.heartbeat["base_mode"] & MavModeFlag.SAFETY_ARMED
        )

    @property
    def release(self) -> tuple[int, int]:
        """Major and minor version; 0, 0 while it is not known."""
        packed = self.version or 0
        return packed >> 24 & 0xFF, packed >> 16 & 0xFF

    @property
    def is_submarine(self) -> bool:
        """Does the board fly one, by ArduPilot?"""
        beat = self.heartbeat
        return beat is not None and (beat["autopilot"], beat["type"]) == (ARDUPILOT, SUBMARINE)

    @property
    def noise(self) -> int:
        """Reads with bytes outside of frames, frames with a wrong check sum, of no known message or
        of a flood, and datagrams of other senders."""
        kinds = (events.MALFORMED, events.OVERFLOWED, events.STRANGER)
        return self.unknown + sum(self.lost.counts[kind("mavlink").name] for kind in kinds)

    def hear(self, packet: MavlinkPacket, now: Ns) -> None:
        """One packet at its arrival [ns]."""
        self.unknown += not packet.fields
        if (packet.system, packet.component) != (self.settings.board, AUTOPILOT):
            if packet.name == "HEARTBEAT":
                self.others[packet.system, packet.component] = int(packet.fields["type"])
            return
        self.newest[packet.name] = packet.fields
        self._arrived[packet.name] += 1
        if packet.name in telemetry.IMU_MESSAGES:
            self._on_imu(packet.fields, now)
        else:
            self._on_answer(packet.name, packet.fields, now)

    def _on_answer(self, name: str, fields: dict[str, Any], now: Ns) -> None:
        """What the board says, but for its sensors."""
        if name == "HEARTBEAT":
            self.heartbeat = fields
        elif name == "AUTOPILOT_VERSION":
            self.version = int(fields["flight_sw_version"])
        elif name == "STATUSTEXT":
            self.leak |= fields["text"] == LEAK
        elif name == "PARAM_VALUE":
            for reader in (self.reader, self.optional):
                reader.heard(fields["param_id"], float(fields["param_value"]))
        elif name == "TIMESYNC":
            self._on_timesync(int(fields["ts1"]), int(fields["tc1"]), now)
        elif name == "COMMAND_ACK" and int(fields["command"]) == MavCommand.SET_MESSAGE_INTERVAL:
            self.streams.heard_ack(int(fields["result"]))

    def _on_imu(self, fields: dict[str, Any], now: Ns) -> None:
        value = tuple(fields[f"{axis}{part}"] for part in ("acc", "gyro") for axis in "xyz")
        if value != self._imu:
            self._imu, self._imu_since = value, now
        self.repeated_ns = max(self.repeated_ns, now - self._imu_since)

    def _on_timesync(self, sent: Ns, board: Ns, now: Ns) -> None:
        if board and sent in self._questions:
            self._questions.remove(sent)
            self.clock.answered(sent, board, now)

    def tick(self, now: Ns) -> list[MavlinkPacket]:
        """What is to be sent at `now` [ns]; to be called many times a second."""
        if self._since is None:
            self._since = now
        passed = now - self._since
        if self.stage == "heartbeat":
            return self._look_for_it(passed, now)
        if self.stage == "version":
            return self._ask_version(passed, now)
        if self.stage == "parameters":
            return self._ask_parameters(now)
        if self.stage == "rates":
            return self._measure(passed, now)
        return []

    def _enter(self, stage: Stage, now: Ns) -> None:
        self.stage, self._since = stage, now

    def _look_for_it(self, passed: Ns, now: Ns) -> list[MavlinkPacket]:
        """Where it waits for us, something has to be said first: the request for its version."""
        if self.heartbeat is not None:
            self._enter("version" if self.is_submarine else "done", now)
        elif passed > NO_BOARD_NS:
            self._enter("done", now)
        return self._version_request(now)

    def _ask_version(self, passed: Ns, now: Ns) -> list[MavlinkPacket]:
        if self.version is None:
            if passed > NO_VERSION_NS:
                self._enter("done", now)
            return self._version_request(now)
        old = self.release < board_check.OLDEST
        self._enter("done" if old else "parameters", now)
        self.reader.wanted = board_check.names(self.release, self.motors)
        functions = (f"SERVO{number}_FUNCTION" for number in self.servos.values())
        self.reader.optional = (*board_check.optional(self.release), *functions)
        return []

    def _version_request(self, now: Ns) -> list[MavlinkPacket]:
        if not self._is_due("version", ASK_NS, now):
            return []
        wanted = MESSAGE_IDS["AUTOPILOT_VERSION"]
        return [command(self.settings.board, MavCommand.REQUEST_MESSAGE, wanted)]

    def _ask_parameters(self, now: Ns) -> list[MavlinkPacket]:
        if self.reader.complete or self.reader.given_up:
            self._enter("rates", now)
        return self.reader.due(now)

    def _measure(self, passed: Ns, now: Ns) -> list[MavlinkPacket]:
        asked = [] if self.armed else self.streams.due(now)
        settled = all(s.granted or s.message is None for s in self.streams.streams)
        if self._measured_since is None and (settled or self.armed or passed > NOT_GRANTED_NS):
            self._measured_since = now
            self._arrived.clear()
        if self._measured_since is not None and now - self._measured_since >= self.seconds * S:
            seconds = (now - self._measured_since) / S
            self.rates = {name: count / seconds for name, count in self._arrived.items()}
            self._enter("done", now)
            return self._as_before()
        if self._is_due("timesync", TIMESYNC_NS, now):
            self._questions.append(now)
            asked.append(MavlinkPacket("TIMESYNC", {"tc1": 0, "ts1": now}))
        return asked + self.optional.due(now)

    def _as_before(self) -> list[MavlinkPacket]:
        return [
            command(
                self.settings.board,
                MavCommand.SET_MESSAGE_INTERVAL,
                NUMBERS[s.message],
                DEFAULT_RATE,
            )
            for s in self.streams.streams
            if s.granted and s.message is not None
        ]

    def _is_due(self, what: str, period: Ns, now: Ns) -> bool:
        if now < self._due.get(what, now):
            return False
        self._due[what] = now + period
        return True


def _wanted(settings: Settings) -> list[TelemetryStream]:
    """What the service asks for."""
    return [
        TelemetryStream(telemetry.IMU_MESSAGES, topics.IMU.hz),
        TelemetryStream((telemetry.PRESSURE_MESSAGE,), settings.pressure_rate),
        TelemetryStream((telemetry.BATTERY_MESSAGE,), topics.BATTERY.hz),
        TelemetryStream((telemetry.ENCLOSURE_MESSAGE,), telemetry.ENCLOSURE_HZ),
    ]
