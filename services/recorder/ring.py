"""Holds a recording back until something happens, and keeps the seconds before it."""

from collections import deque

from messages.film import FilmRequest
from messages.link import LatencyBudget
from messages.message import Message
from messages.pilot import PilotRequest
from messages.vehicle import VehicleStatus
from services.recorder.core import RecordedRow

ABOUT_CONTROL = ("lease", "offer", "release", "force")  # who may fly: asked before anything happens
ROW_BYTES = 400  # [bytes] of memory that a row takes besides its data


class Ring:
    """The newest rows: at most `seconds` of them, and at most `most_bytes` of memory.

    Attributes:
        holds: rows are kept here, and not written yet.
    """

    def __init__(self, seconds: float, most_bytes: float) -> None:
        self.holds = seconds > 0.0
        self._span_ns = round(seconds * 1e9)
        self._most_bytes = most_bytes
        self._rows: deque[RecordedRow] = deque()
        self._bytes = 0

    def keep(self, row: RecordedRow) -> int:
        """Keep a row; returns how many messages were dropped although they are not too old yet."""
        self._rows.append(row)
        self._bytes += ROW_BYTES + len(row.data)
        while row.log_ns - self._rows[0].log_ns > self._span_ns:
            self._drop()
        dropped = 0
        while self._bytes > self._most_bytes and len(self._rows) > 1:
            dropped += not self._drop().is_view
        return dropped

    def release(self) -> list[RecordedRow]:
        """Everything that was kept, in order; from now on nothing is held back."""
        self.holds = False
        rows = list(self._rows)
        self._rows.clear()
        return rows

    def _drop(self) -> RecordedRow:
        row = self._rows.popleft()
        self._bytes -= ROW_BYTES + len(row.data)
        return row


def trigger(message: Message) -> str | None:
    """Why a recording begins with this message, in words; None: it does not."""
    if isinstance(message, VehicleStatus):
        if message.armed:
            return "the drone is armed"
        if message.failsafe != "none":
            return f"failsafe {message.failsafe}"
        if message.conditions:
            return f"the drone noticed {message.conditions[0]}"
    if isinstance(message, PilotRequest) and message.kind not in ABOUT_CONTROL:
        return f"the pilot asks for {message.kind}"
    if isinstance(message, FilmRequest):
        return "the pilot films"
    if isinstance(message, LatencyBudget) and message.alarm:
        return f"link alarm: {message.alarm}"
    return None
