"""Text that is shown: states, log lines and the status page."""

import re
from collections import deque
from collections.abc import Callable
from typing import Any

import msgspec

from messages.control import ThrusterCommand
from messages.events import note
from messages.health import LogLine
from messages.identity import SideIdentity
from messages.link import Clock, LatencyBudget, LinkAnswer, LinkRequest, LinkStatus
from messages.message import Message, Notice
from messages.pilot import PilotAnswer, PilotCommand, PilotRequest
from messages.reference import Reference
from messages.sensors import BatterySample
from messages.simulator import FaultAnswer, FaultRequest
from messages.state import VehicleState
from messages.vehicle import Actuation, Truth, VehicleStatus
from messages.video import CameraChoice, FilmAnswer, FilmRequest
from services.vehicle_view import words
from services.vehicle_view.view import Newest, VehicleView, believed, vehicle_view
from services.visualizer.batch import Note

SIDES = 32  # that are named
REQUESTS_KEPT = 16  # several may wait for their answers at the same time

# Text of each state lane for a message. `rerun_writer.STATES` has a colour for each text.
LANES: dict[type[Message], list[tuple[str, Callable[[Any], str]]]] = {
    VehicleStatus: [
        ("activity", lambda m: m.activity),
        ("flight_mode", lambda m: m.flight_mode.replace("_", " ")),
        ("armed", lambda m: "armed" if m.armed else "disarmed"),
        ("failsafe", lambda m: "no failsafe" if m.failsafe == "none" else m.failsafe),
    ],
    PilotCommand: [("pilot", lambda m: f"pilot {m.pilot}")],
    LinkStatus: [("link", lambda m: "link up" if m.up else "link down")],
    Actuation: [("thrusters", lambda m: "stopped" if m.stale else "driven")],
    VehicleState: [("estimator", lambda m: m.phase)],
    Truth: [("floor", lambda m: "on the floor" if m.on_floor else "free")],
}


STATUS_PARTS = VehicleStatus | ThrusterCommand  # which say together whether it is armed
REQUESTS = PilotRequest | LinkRequest | FaultRequest | FilmRequest
ANSWERS = PilotAnswer | LinkAnswer | FaultAnswer | FilmAnswer
VIEWED: dict[type[Message], str] = {
    VehicleStatus: "status", VehicleState: "state", Reference: "reference",
    BatterySample: "battery", LinkStatus: "link", Clock: "clock", LatencyBudget: "latency",
}  # fmt: skip
NOTED = {
    *(*LANES, LogLine, SideIdentity),
    *(PilotRequest, PilotAnswer, LinkRequest, LinkAnswer, FaultRequest, FaultAnswer),
    *(FilmRequest, FilmAnswer, CameraChoice),
}  # may make notes


class Status:
    """Makes notes of messages, only of what has changed."""

    def __init__(self) -> None:
        self._lanes: dict[str, str] = {}
        self._newest: dict[type[Message], Message] = {}
        self._heard_ns: dict[type[Message], int] = {}
        self._requests = deque[str](maxlen=REQUESTS_KEPT)  # ids that were shown
        self._last_notices: tuple[Notice, ...] = ()
        self._large_camera = ""
        self._sides: dict[str, str] = {}  # which Lindy each side runs
        self._page = ""  # as last shown

    def hear(self, key: str, message: Message, time: int, start: int) -> list[Note]:
        """Notes that this message makes. `time` is [ns] since the dive began, at `start` [ns]."""
        self._newest[type(message)] = message
        self._heard_ns[type(message)] = start + time
        return [*self._changes(message, time), *self._lines(key, message, time)]

    def page(self, time: int, start: int) -> list[Note]:
        """The status page, if it has changed since it was last shown. `start`: [ns] the dive's."""
        text = self._status(start + time)
        if text == self._page:
            return []
        self._page = text
        return [Note("status", time, "document", text)]

    def _changes(self, message: Message, time: int) -> list[Note]:
        notes: list[Note] = []
        shown = self._believed if isinstance(message, STATUS_PARTS) else message
        for lane, say in () if shown is None else LANES.get(type(shown), ()):
            text = say(shown)
            if self._lanes.get(lane) != text:
                self._lanes[lane] = text
                notes.append(Note(f"state/{lane}", time, "state", text))
        return notes

    def _lines(self, key: str, message: Message, time: int) -> list[Note]:
        if isinstance(message, LogLine):
            text = f"{message.service}: {message.text}"
            return [_line(part_of_path(key.rpartition("/")[2]), time, text, message.level)]
        if isinstance(message, REQUESTS) and message.id not in self._requests:
            self._requests.append(message.id)  # a request is repeated until it is answered
            return [_line("pilot", time, f"pilot asks: {_asked(message)}")]
        if isinstance(message, ANSWERS):
            change = message.change if isinstance(message, LinkAnswer) else ""
            word = change or "granted" if message.accepted else f"refused: {message.reason}"
            level = "info" if message.accepted else "warning"
            return [_line("pilot", time, f"answer: {word}", level)]
        if isinstance(message, VehicleStatus) and message.notices != self._last_notices:
            self._last_notices = message.notices
            return [_line("vehicle", time, note(message.notices))] if message.notices else []
        if isinstance(message, CameraChoice) and message.camera != self._large_camera:
            self._large_camera = message.camera  # it is said again and again
            return [_line("pilot", time, f"the large camera: {message.camera}")]
        if isinstance(message, SideIdentity):
            return self._identity(message, time)
        return []

    def _identity(self, message: SideIdentity, time: int) -> list[Note]:
        text = f"{message.side} runs Lindy {message.version} for {message.vehicle}"
        if self._sides.get(message.side) == text or len(self._sides) >= SIDES:
            return []
        self._sides[message.side] = text
        return [_line("vehicle", time, text)]

    def _status(self, now: int) -> str:
        """The lines of a pilot's window, one below the other, and who has the sticks; what is wrong
        is bold."""
        view = self._view(now)
        lines = *words.head_up(view), words.Said(words.sticks(view), "plain")
        return "\n\n".join(
            f"**{text}**" if tone != "plain" else text for text, tone in lines if text
        )

    def _view(self, now: int) -> VehicleView:
        """By the times of arrival: stamps may be of another machine's clock."""
        found: dict[str, Any] = {}
        for kind, name in VIEWED.items():
            message = self._believed if kind is VehicleStatus else self._newest.get(kind)
            if message is not None:
                found[name] = msgspec.structs.replace(message, stamp_ns=self._heard_ns[kind])
        return vehicle_view(Newest(**found), now)

    @property
    def _believed(self) -> VehicleStatus | None:
        status: Any = self._newest.get(VehicleStatus)
        thrusters: Any = self._newest.get(ThrusterCommand)
        return None if status is None else believed(status, thrusters)


def part_of_path(name: str) -> str:
    """A name as one part of an entity's path."""
    return re.sub(r"[^a-z0-9_]", "_", name)


def _asked(message: REQUESTS) -> str:
    if isinstance(message, FaultRequest):
        return f"{message.part} {message.fault}"
    if isinstance(message, FilmRequest):
        return f"film {message.kind}"
    if isinstance(message, LinkRequest):
        return " ".join(["link", message.kind, message.profile or "", *message.settings]).strip()
    value = "" if message.value is None else f" {message.value:.2f}"
    return (
        f"{message.kind}{value}"
        if message.flight_mode is None
        else f"{message.kind} {message.flight_mode}"
    )


def _line(who: str, time: int, text: str, level: str = "info") -> Note:
    return Note(f"log/{who}", time, "log", f"{time / 1e9:6.1f} s  {text}", level)
