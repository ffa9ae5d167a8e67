"""The telemetry that is asked for, and whether it comes as often as asked.

An acknowledgement does not say which message it is about, so one is asked for at a time.
"""

from dataclasses import dataclass, field

from messages.units import Ns
from services.mavlink_io.numbers import MavCommand, MavResult
from services.mavlink_io.packet import MavlinkPacket, command

NUMBERS = {"HIGHRES_IMU": 105, "RAW_IMU": 27, "SCALED_PRESSURE2": 137, "SYS_STATUS": 1,
           "SCALED_PRESSURE": 29}  # fmt: skip
AGAIN_NS = 500_000_000  # [ns] before a request without an answer is repeated
WINDOW_NS = 5_000_000_000  # [ns] over which a rate is judged
ENOUGH = 0.9  # [-] of the rate that was asked for
STOPPED = 0.5  # [-] less than this, and it is asked for again


@dataclass(slots=True)
class TelemetryStream:
    """One kind of measurement, by the first of these messages that the board has."""

    messages: tuple[str, ...]
    hz: float
    granted: bool = False
    refused: int = 0  # of the messages, from the first
    heard: int = 0  # in this window

    @property
    def message(self) -> str | None:
        return self.messages[self.refused] if self.refused < len(self.messages) else None


@dataclass(slots=True)
class TelemetryStreams:
    board: int  # system
    streams: list[TelemetryStream]
    _asked: Ns | None = None
    _since: Ns | None = None  # begin of the window
    slow: dict[str, float] = field(default_factory=dict[str, float])  # [1/s] in the last window

    def counts(self, name: str) -> bool:
        """Note an arrival. Is this message the one in use?"""
        for stream in self.streams:
            if stream.message == name:
                stream.heard += 1
                return True
        return False

    def heard_ack(self, result: int) -> str | None:
        """The answer to the newest request. Returns the name of what the board cannot give."""
        stream = self._next
        if stream is None or self._asked is None:
            return None
        self._asked = None
        if result == MavResult.ACCEPTED:
            stream.granted = True
            return None
        stream.refused += 1
        return stream.messages[-1] if stream.message is None else None

    def due(self, now: Ns) -> list[MavlinkPacket]:
        """Requests to send now."""
        stream = self._next
        if stream is None or stream.message is None:
            return []
        if self._asked is not None and now - self._asked < AGAIN_NS:
            return []
        self._asked = now
        interval = round(1e6 / stream.hz)  # [µs]
        return [
            command(self.board, MavCommand.SET_MESSAGE_INTERVAL, NUMBERS[stream.message], interval)
        ]

    def judge(self, now: Ns) -> list[tuple[str, float, float]]:
        """At the end of a window: message, rate and the rate asked for [1/s] of what is slow."""
        if self._next is not None:
            self.pause()
            return []
        if self._since is None:
            self._restart(now)
        if self._since is None or now - self._since < WINDOW_NS:
            return []
        seconds, found = (now - self._since) / 1e9, list[tuple[str, float, float]]()
        for stream in self.streams:
            rate = stream.heard / seconds
            least = ENOUGH * stream.hz * seconds - 1  # one may just have missed the window
            if stream.message is not None and stream.heard < least:
                found.append((stream.message, rate, stream.hz))
                stream.granted = rate >= STOPPED * stream.hz
        self.slow = {name: rate for name, rate, _ in found}
        self._restart(now)
        return found

    def pause(self) -> None:
        """Nothing is judged of this window."""
        self._since = None

    def _restart(self, now: Ns) -> None:
        self._since = now
        for stream in self.streams:
            stream.heard = 0

    @property
    def _next(self) -> TelemetryStream | None:
        return next((s for s in self.streams if not s.granted and s.message is not None), None)
