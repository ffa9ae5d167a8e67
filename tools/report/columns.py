"""The topics that a report is made from, as columns of numbers.

A dive of hours has millions of messages, so each one is reduced to a few figures as it is read, and
beyond `BLOCK` rows of a stream these wait in a temporary file (124 MB for an hour of a dive, in the
folder that TMPDIR names) until a column or a part of it is asked for. A column is a float64 array
with one figure per message; None becomes NaN. Times are in ns of the vehicle's clock, exact in a
float64 for the first 104 days after the computer was started.
"""

import math
import os
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from tempfile import TemporaryFile
from typing import IO, Any, NamedTuple, cast, get_args
from weakref import finalize

import msgspec
import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.control import ThrusterCommand
from messages.link import DOWN_STAGES, UP_STAGES, Clock, LatencyBudget, Stage
from messages.message import Message
from messages.pilot import FlightMode, PilotCommand, PilotRequest
from messages.reference import Reference
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.topic import AnyTopic
from messages.vehicle import OWN_WAY, Actuation, Failsafe, Reaction, Truth, VehicleStatus
from messages.video import PICTURE_STAGES, PictureAge
from services.recorder.io.open_chunk import write_at
from services.runtime.config.disk import reason

Array = NDArray[np.float64]
Figures = tuple[float | None, ...]
FAILSAFES: tuple[Failsafe, ...] = get_args(Failsafe)  # a status has the place in these
BLOCK = 65_536  # rows: 11 minutes of a stream of 100 a second
FIGURE = 8  # [bytes]
REACTIONS: tuple[Reaction, ...] = get_args(Reaction)
FLIGHT_MODES: tuple[FlightMode, ...] = get_args(FlightMode)


class _Block(NamedTuple):
    begin: int  # number of its first row
    length: int  # rows
    where: int | Array  # [bytes] in the file, column by column; or the columns themselves


class RowBlocks:
    """Rows of figures, `BLOCK` at a time: those that were added are on disk, where it has room."""

    def __init__(self, width: int) -> None:
        self.count = 0
        self._width = width
        self._file: IO[bytes] | None = None
        self._blocks: list[_Block] = []

    def add(self, rows: Array, *, on_disk: bool) -> None:
        """
        Args:
            rows: shape (any, width).
            on_disk: they need not stay in memory.
        """
        columns = np.ascontiguousarray(rows.T)
        block: int | Array = columns
        if on_disk:
            try:
                block = self._write(columns)
            except OSError as error:  # full, or there is none: then they stay in memory
                _say_in_memory(reason(error))
        self._blocks.append(_Block(self.count, len(rows), block))
        self.count += len(rows)

    def add_bytes(self, rows: bytes | bytearray, *, on_disk: bool = True) -> None:
        """Float64, row by row."""
        self.add(np.frombuffer(rows).reshape(-1, self._width), on_disk=on_disk)

    def column(self, place: int, first: int, last: int) -> Array:
        """Rows `first` to before `last` of a column."""
        parts = [
            part
            for block in self._blocks
            if len(part := self._part(block, place, first - block.begin, last - block.begin))
        ]
        return parts[0] if len(parts) == 1 else np.concatenate([np.empty(0), *parts])

    def _part(self, block: "_Block", place: int, first: int, last: int) -> Array:
        first, last = max(0, first), min(block.length, last)
        if last <= first:
            return np.empty(0)
        if not isinstance(block.where, int):
            return block.where[place, first:last]
        assert self._file is not None
        at = block.where + FIGURE * (place * block.length + first)
        self._file.seek(at)
        return np.frombuffer(self._file.read(FIGURE * (last - first)))

    def _write(self, columns: Array) -> int:
        """
        Raises:
            OSError: there is no room for them.
        """
        if self._file is None:
            self._file = TemporaryFile(prefix="lindy-", buffering=0)  # noqa: SIM115
            finalize(self, self._file.close)  # it has no name: closed it is gone
        at = self._file.seek(0, os.SEEK_END)
        write_at(self._file, at, columns.tobytes())
        return at


@cache
def _say_in_memory(why: str) -> None:
    """Once for each reason: a long dive may need more memory than there is."""
    print(
        f"lindy: cannot write a temporary file: {why}; figures are kept in memory, "
        f"and TMPDIR names another folder for them",
        file=sys.stderr,
    )


class StreamColumns:
    """The figures of one stream in the order of their first column, a time. Of a long dive a column
    is read from the disk whenever it is named."""

    def __init__(self, names: tuple[str, ...], rows: Array | RowBlocks) -> None:
        if not isinstance(rows, RowBlocks):
            blocks = RowBlocks(len(names))
            blocks.add(rows, on_disk=False)
            rows = blocks
        self.count = rows.count
        self._names, self._blocks = names, rows
        self._order: NDArray[np.intp] | None = None  # None: as they came
        times = self[names[0]]
        if np.any(times[1:] < times[:-1]):
            self._order = np.argsort(times, kind="stable")

    def __getitem__(self, name: str) -> Array:
        return self.part(name, 0, self.count)

    def part(self, name: str, first: int, last: int) -> Array:
        """Rows `first` to before `last` of a column."""
        place = self._names.index(name)
        if self._order is None:
            return self._blocks.column(place, first, last)
        return self._blocks.column(place, 0, self.count)[self._order[first:last]]

    def parts(self, *names: str) -> Iterator[Sequence[Array]]:
        """The same rows of some columns, at most `BLOCK` at a time; once without rows if there are
        none."""
        for first in range(0, max(1, self.count), BLOCK):
            yield [self.part(name, first, min(first + BLOCK, self.count)) for name in names]


class Gathering:
    """Collects the rows of one topic."""

    def __init__(
        self,
        names: tuple[str, ...],
        figures: Callable[[Any], Figures],
        block: int = BLOCK,
        put: Callable[[bytes | bytearray], None] | None = None,
    ) -> None:
        """
        Args:
            block: rows that are kept in memory.
            put: takes full blocks, row by row, where not these columns are to have them.
        """
        self._names = names
        self._figures = figures
        self._pack = struct.Struct(f"{len(names)}d").pack
        self._rows = bytearray()
        self._full = block * len(names) * FIGURE  # [bytes]
        self._blocks = RowBlocks(len(names))
        self._put = put or self._blocks.add_bytes

    def add(self, message: object, _log_ns: int = 0) -> None:
        figures = self._figures(message)
        rows = self._rows
        try:
            rows += self._pack(*figures)
        except struct.error:  # there is a None
            rows += self._pack(*(math.nan if figure is None else figure for figure in figures))
        if len(rows) >= self._full:
            self.put()

    def put(self) -> None:
        """Do not keep the rows so far in memory."""
        rows, self._rows = self._rows, bytearray()
        self._put(rows)

    def columns(self) -> StreamColumns:
        """The rows so far; no more can be added then."""
        self._blocks.add_bytes(self._rows, on_disk=False)
        return StreamColumns(self._names, self._blocks)


class StreamFigures(NamedTuple):
    """Which figures of a stream are kept."""

    topic: AnyTopic
    names: tuple[str, ...]
    figures: Callable[[Any], Figures]
    fields: tuple[str, ...] = ()  # that `figures` reads, where the message has many more

    @property
    def message(self) -> type[Message]:
        """As it is decoded from a recording: a number that nobody reads costs as much as others."""
        kind = self.topic.message
        if not self.fields:
            return kind
        read = [
            (field.name, field.type, msgspec.field(default=field.default))
            for field in msgspec.structs.fields(kind)
            if field.name in self.fields
        ]
        base, name = (Message,), kind.__name__
        return cast(type[Message], msgspec.defstruct(name, read, bases=base, kw_only=True))


def _command(m: PilotCommand) -> Figures:
    deflection = max(map(abs, (m.surge, m.sway, m.heave, m.yaw)))
    sticks = m.surge, m.sway, m.heave, m.yaw
    return m.stamp_ns, *sticks, deflection, m.pilot == "lost", m.epoch


def _request(m: PilotRequest) -> Figures:
    return m.stamp_ns, m.kind == "stop"


def _status(m: VehicleStatus) -> Figures:
    reaction = -1 if m.reaction is None else REACTIONS.index(m.reaction)
    own_way = m.activity in OWN_WAY
    flight_mode = FLIGHT_MODES.index(m.flight_mode)
    failsafe = FAILSAFES.index(m.failsafe)
    return m.stamp_ns, failsafe, reaction, m.since_ns, own_way, flight_mode, m.armed


def _state(m: VehicleState) -> Figures:
    moved = m.depth_moved or 0.0  # absent: no jump
    known = m.depth.valid, m.heading.valid
    felt = m.depth_acceleration.value, m.yaw_rate.value
    return m.sensor_ns, m.stamp_ns, m.depth.value, m.heading.value, moved, *known, *felt


def _reference(m: Reference) -> Figures:
    valid = m.stamp_ns if m.sensor_ns is None else m.sensor_ns
    depth, heading = msgspec.structs.astuple(m.depth), msgspec.structs.astuple(m.heading)
    return valid, m.stamp_ns, m.sensor_ns, m.pilot_ns, m.armed, m.epoch, *depth, *heading


def _thrusters(m: ThrusterCommand) -> Figures:
    ahead = astern = 0
    for k, thrust in enumerate(m.thrust):
        if thrust > 0.0:
            ahead |= 1 << k
        elif thrust < 0.0:
            astern |= 1 << k
    return m.stamp_ns, m.sensor_ns, len(m.thrust), ahead, astern


def _actuation(m: Actuation) -> Figures:
    squared = sum(thrust * thrust for thrust in m.thrust)
    return m.stamp_ns, m.actuated_ns, m.sensor_ns, m.pilot_ns, squared, m.power


def _truth(m: Truth) -> Figures:
    return m.stamp_ns, m.position[2], m.heading


def _latency(m: LatencyBudget) -> Figures:
    down = _medians(m.down, len(DOWN_STAGES))
    up = _medians(m.up, len(UP_STAGES))
    return m.stamp_ns, *down, *up, m.stick_to_thruster_ms, m.sensor_to_screen_ms


def _medians(stages: tuple[Stage, ...] | None, count: int) -> Figures:
    if stages is None or len(stages) != count:
        return (None,) * count
    return tuple(stage.p50_ms for stage in stages)


def _picture(m: PictureAge) -> Figures:
    stages = _medians(m.stages, len(PICTURE_STAGES))
    total = (None, None) if m.total is None else (m.total.p50_ms, m.total.p99_ms)
    return m.stamp_ns, *stages, *total, m.per_second, m.checked


def _clock(m: Clock) -> Figures:
    return m.stamp_ns, m.offset_ns, m.bound_ns, m.drift_ppm


LATENCY = (
    "stamp",
    *(f"down {stage}" for stage in DOWN_STAGES),  # [ms]
    *(f"up {stage}" for stage in UP_STAGES),  # [ms]
    *("stick", "screen"),  # [ms]
)


PICTURE = ("stamp", *PICTURE_STAGES, "p50", "worst", "rate", "checked")  # [ns, ms …, 1/s, -]


def _battery(m: BatterySample) -> Figures:
    return m.stamp_ns, m.used_wh, m.capacity_wh


MOTION = ("position", "velocity", "acceleration", "jerk", "jerk limit")
REFERENCE = (
    *("valid", "stamp", "sensor", "pilot", "armed", "epoch"),
    *(f"heave {part}" for part in MOTION),  # [m, m/s, m/s², m/s³ ×2]
    *(f"yaw {part}" for part in MOTION),  # [rad, rad/s, rad/s², rad/s³ ×2]
)
STATUS = ("stamp", "failsafe", "reaction", "since", "own way", "flight mode", "armed")
COMMAND = ("stamp", "surge", "sway", "heave", "yaw", "deflection", "lost", "epoch")
STATE = (
    *("sensor", "stamp", "heave", "yaw"),  # [ns, ns, m, rad]
    *(
        "moved",
        "heave known",
        "yaw known",
        "heave acceleration",
        "yaw rate",
    ),  # [m, -, -, m/s², rad/s]
)
COMMANDED = ("stamp", "sensor", "count", "ahead", "astern")  # thrusters; bit k: thruster k turns so
WANTED = (
    StreamFigures(topics.PILOT_COMMAND, COMMAND, _command),
    StreamFigures(topics.PILOT_REQUEST, ("stamp", "stop"), _request),
    StreamFigures(topics.STATUS, STATUS, _status),
    StreamFigures(
        topics.STATE,
        STATE,
        _state,
        ("sensor_ns", "depth_moved", "depth", "depth_acceleration", "heading", "yaw_rate"),
    ),
    StreamFigures(
        topics.REFERENCE,
        REFERENCE,
        _reference,
        ("sensor_ns", "pilot_ns", "epoch", "armed", "depth", "heading"),
    ),
    StreamFigures(topics.THRUSTERS, COMMANDED, _thrusters),
    StreamFigures(
        topics.ACTUATION,
        ("stamp", "actuated", "sensor", "pilot", "thrust_squared", "power"),  # [ns ×4, N², W]
        _actuation,
    ),
    StreamFigures(topics.BATTERY, ("stamp", "used", "capacity"), _battery),  # [ns, Wh, Wh]
    StreamFigures(topics.LATENCY, LATENCY, _latency),
    StreamFigures(topics.PICTURE_AGE, PICTURE, _picture),
    StreamFigures(topics.CLOCK, ("stamp", "offset", "bound", "drift"), _clock),  # [ns ×3, ppm]
    StreamFigures(
        topics.TRUTH, ("stamp", "heave", "yaw"), _truth, ("position", "heading")
    ),  # [ns, m, rad]
)
FURTHER_WANTED = StreamFigures(topics.FURTHER_AGE, PICTURE, _picture)  # of every member
