"""A stick log: CSV `t,surge,sway,heave,yaw[,tilt][,gripper][,event]`, seconds and -1 … 1, held
between rows.

Blank lines and comments (`# …`) may stand anywhere. `t` begins at 0 or later and grows from row to
row. The last row ends the script: from its time on the sticks are centred. An event belongs to its
row: `arm`, `disarm`, `stop`, `resume`, `light`, `light_2`, `laser` (toggle), `home`, `unwind`,
`goto depth=3 heading=90` (m, deg), `goto north=12 east=4`, `follow PATH`, `mode HOLD` and `output
NAME 0…1` happen at the row's time; during a `lost` row the pilot is lost and the sticks are 0
whatever the columns contain, until the next row. A deflected stick ends a goto or a follow. `fault
PART KIND [VALUE]`, `link set PROFILE`, `link set KEY=VALUE …`, `link set down` and `link set up`
are incidents: the requests of the verbs `lindy fault` and `lindy link`, sent from the topside.
`link profile NAME`, `link down` and `link up` are the same.
"""

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, nan
from operator import attrgetter
from typing import Literal, NamedTuple, cast, get_args

from messages.events import Outbox
from messages.link import LinkRequest
from messages.pilot import Course, FlightMode
from messages.simulator import FaultKind, FaultRequest
from services.piloting.pilot_intents import (
    FARTHEST,
    FollowIntent,
    GotoIntent,
    Intent,
    ModeIntent,
    OutputIntent,
    PlaceIntent,
    Press,
    goto,
)
from services.piloting.sticks import CENTRED, Incident, StickReading, Sticks

Event = Intent | Incident | Literal["lost"]
Courses = Callable[[str], Course]  # reads the path of a name; ValueError: why it cannot
WORDS: tuple[str, ...] = (*get_args(Press), "lost")
ALLOWED = (
    f"{', '.join(WORDS)}, goto depth=M heading=DEG, goto north=M east=M, follow PATH, mode HOLD, "
    "output NAME 0…1, fault PART KIND [VALUE], link set down, link set up, link set PROFILE, "
    "link set KEY=VALUE"
)
FLIGHT_MODES: tuple[str, ...] = get_args(FlightMode)


def event_of(cell: str, courses: Courses) -> Event | None:
    """What a cell of the column `event` means; nothing when it is empty.

    Raises:
        ValueError: names what was found and what is allowed.
    """
    word, _, rest = cell.partition(" ")
    match word:
        case "goto":
            return _goto(rest)
        case "follow":
            return _follow(rest.strip(), courses)
        case "mode":
            return _mode(rest.strip())
        case "output":
            return _output(rest.split())
        case "fault":
            return fault(rest.split())
        case "link":
            return link(rest.split())
        case _:
            return _one_word(cell)


def _one_word(cell: str) -> Event | None:
    if not cell:
        return None
    if cell not in WORDS:
        raise ValueError(f"event is {short(cell)}, expected one of {ALLOWED}")
    return cast(Event, cell)


def short(text: str) -> str:
    """Quoted for an error, long text shortened."""
    return repr(text if len(text) <= 40 else text[:40] + "…")


def _goto(rest: str) -> GotoIntent | PlaceIntent:
    given: dict[str, float] = {}
    for word in rest.split():
        name, _, text = word.partition("=")
        if name not in ("depth", "heading", "north", "east") or name in given:
            raise ValueError(
                f"goto: found {short(word)}, expected depth=M, heading=DEG or both, or north=M "
                f"and east=M"
            )
        try:
            given[name] = float(text)
        except ValueError:
            raise ValueError(f"goto: {name} is {short(text)}, expected a number") from None
    if "north" in given or "east" in given:
        if given.keys() != {"north", "east"} or not max(map(abs, given.values())) <= FARTHEST:
            raise ValueError(
                f"goto: found {short(rest)}, expected north=M and east=M, each within "
                f"{FARTHEST:g} m, and nothing else"
            )
        return PlaceIntent(given["north"], given["east"])
    return goto(given.get("depth"), given.get("heading"))


def _follow(name: str, courses: Courses) -> FollowIntent:
    """The path is read now, so that a mistake in it is named before the dive."""
    if not name:
        raise ValueError("follow needs a path: a name in deploy/paths or a .toml file")
    try:
        return FollowIntent(courses(name))
    except ValueError as error:
        raise ValueError(f"follow: {error}") from None


def _output(rest: list[str]) -> OutputIntent:
    try:
        name, value = rest[0], float(rest[1]) if rest[1:] else nan
    except (IndexError, ValueError):
        name, value = "", nan
    if len(rest) != 2 or not 0.0 <= value <= 1.0:
        raise ValueError(
            f"output: found {short(' '.join(rest))}, expected a name of the vehicle file and a "
            f"number from 0 to 1"
        )
    return OutputIntent(name, value)


def _mode(hold: str) -> ModeIntent:
    if hold not in FLIGHT_MODES:
        raise ValueError(f"mode: found {short(hold)}, expected one of {', '.join(FLIGHT_MODES)}")
    return ModeIntent(cast(FlightMode, hold))


FAULTS: tuple[str, ...] = get_args(FaultKind)
FAULT_FORM = "fault PART KIND, or fault PART KIND VALUE"
LINK_FORM = "link set down, link set up, link set PROFILE or link set KEY=VALUE …"


def fault(words: list[str]) -> FaultRequest:
    """The words after `fault`. Only the simulator knows which parts there are, and which value a
    kind takes.

    Raises:
        ValueError: names what was found and what is allowed.
    """
    if len(words) not in (2, 3):
        raise ValueError(f"fault: found {' '.join(words)!r}, expected {FAULT_FORM}")
    part, kind, *rest = words
    if kind not in FAULTS:
        raise ValueError(f"fault: KIND is {kind!r}, expected one of {', '.join(FAULTS)}")
    value = _finite(rest[0]) if rest else None
    return FaultRequest(stamp_ns=0, id="", part=part, fault=cast(FaultKind, kind), value=value)


def link(words: list[str]) -> LinkRequest:
    """The words after `link`. Only the link's model knows its profiles and keys.

    Raises:
        ValueError: names what was found and what is allowed.
    """
    match words:
        case ["down" | "up" as kind] | ["set", "down" | "up" as kind]:
            return LinkRequest(stamp_ns=0, id="", kind=kind)
        case ["profile" | "set" as word, name] if word == "profile" or "=" not in name:
            return LinkRequest(stamp_ns=0, id="", kind="profile", profile=name)
        case ["set", _, *_]:
            return LinkRequest(stamp_ns=0, id="", kind="set", settings=tuple(words[1:]))
        case _:
            raise ValueError(f"link: found {' '.join(words)!r}, expected {LINK_FORM}")


def in_words(incident: Incident) -> str:
    """As in a stick log."""
    if isinstance(incident, FaultRequest):
        value = "" if incident.value is None else f" {incident.value:g}"
        return f"fault {incident.part} {incident.fault}{value}"
    words = [incident.profile] if incident.profile else incident.settings or [incident.kind]
    return " ".join(["link set", *words])


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value):
        raise ValueError(f"fault: VALUE is {text!r}, expected a finite number")
    return value


COLUMNS = ("t", "surge", "sway", "heave", "yaw")
OPTIONAL = ("tilt", "gripper", "event")  # after the others, in any order
HEADING = f"{','.join(COLUMNS)} with or without {' and '.join(OPTIONAL)}"
LONGEST_S = 86_400.0  # [s] a day


class StickLogRow(NamedTuple):
    at_ns: int  # [ns] since the script began
    sticks: Sticks
    event: Event | None = None


BEFORE = StickLogRow(0, CENTRED)


@dataclass(frozen=True)
class StickLog:
    """What the sticks do from the moment they are handed over."""

    rows: tuple[StickLogRow, ...]  # at least one, in order of time

    @property
    def duration_ns(self) -> int:
        """[ns] When the script has ended."""
        return self.rows[-1].at_ns

    @property
    def duration(self) -> float:
        """[s] When the script has ended."""
        return self.duration_ns / 1e9

    def at(self, elapsed_ns: int) -> StickLogRow:
        """The row that holds `elapsed_ns` [ns] after the script began; centred sticks before the
        first row and from the end on."""
        index = bisect_right(self.rows, elapsed_ns, key=attrgetter("at_ns")) - 1
        if index < 0 or elapsed_ns >= self.duration_ns:
            return BEFORE
        row = self.rows[index]
        return row._replace(sticks=CENTRED) if row.event == "lost" else row


def parse(data: bytes, courses: Courses) -> StickLog:
    """The script in a CSV file; `courses` reads the paths it names.

    Raises:
        ValueError: names the line, what was found there and what is allowed.
    """
    lines = [(n, line) for n, line in enumerate(_text(data).split("\n"), 1) if _bare(line)]
    if not lines:
        raise ValueError(f"line 1: the file is empty; expected the heading {HEADING}")
    names = _heading(*lines[0])
    rows: list[StickLogRow] = []
    for number, line in lines[1:]:
        row = _row(number, _cells(line), names, courses)
        if rows and row.at_ns <= rows[-1].at_ns:
            last = rows[-1].at_ns / 1e9
            raise ValueError(
                f"line {number}: t is {row.at_ns / 1e9:g}, expected more than the {last:g} before"
            )
        rows.append(row)
    if not rows:
        raise ValueError(f"line {lines[0][0]}: no row follows the heading; expected at least one")
    return StickLog(tuple(rows))


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")  # spreadsheets like to begin with a byte-order mark
    except UnicodeDecodeError as error:
        number = data[: error.start].count(b"\n") + 1
        found = data[error.start]
        raise ValueError(
            f"line {number}: found the byte 0x{found:02x}, expected a text file (UTF-8)"
        ) from None


def _bare(line: str) -> str:
    return line.partition("#")[0].strip()


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in _bare(line).split(",")]


def _heading(number: int, line: str) -> list[str]:
    """Names of the columns."""
    names = _cells(line)
    required, more = tuple(names[: len(COLUMNS)]), names[len(COLUMNS) :]
    if required != COLUMNS or not set(more) <= set(OPTIONAL) or len(set(more)) < len(more):
        raise ValueError(f"line {number}: found {short(line)}, expected the heading {HEADING}")
    return names


def _row(number: int, cells: list[str], names: list[str], courses: Courses) -> StickLogRow:
    """Optional columns may be empty, or left out at the end of a row."""
    if not len(COLUMNS) <= len(cells) <= len(names):
        expected = " or ".join(str(n) for n in range(len(COLUMNS), len(names) + 1))
        raise ValueError(f"line {number}: found {len(cells)} columns, expected {expected}")
    cell = dict(zip(names, cells, strict=False))
    seconds = _number(number, "t", cell["t"], 0.0, LONGEST_S)
    sticks = Sticks(
        *(_number(number, name, cell[name], -1.0, 1.0) for name in COLUMNS[1:]),
        tilt=_number(number, "tilt", cell.get("tilt") or "0", -1.0, 1.0),
        gripper=_number(number, "gripper", cell.get("gripper") or "0", -1.0, 1.0),
    )
    return StickLogRow(round(seconds * 1e9), sticks, _event(number, cell.get("event", ""), courses))


def _number(number: int, name: str, cell: str, low: float, high: float) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not low <= value <= high:  # NaN is in no range
        raise ValueError(
            f"line {number}: {name} is {short(cell)}, expected a number from {low:g} to {high:g}"
        )
    return value


def _event(number: int, cell: str, courses: Courses) -> Event | None:
    try:
        return event_of(cell, courses)
    except ValueError as error:
        raise ValueError(f"line {number}: {error}") from None


QUIET_NS = 3_000_000_000  # [ns] of centred sticks after the script, before the drone is disarmed


class Cue(NamedTuple):
    at_ns: int  # [ns] since the script began
    what: Intent | Incident


class Player:
    """Each event happens once: `played` events have happened, before a restart included."""

    def __init__(self, name: str, script: StickLog, outbox: Outbox, played: int = 0) -> None:
        self.name = f"script {name}"
        self.played = played
        self._script, self._outbox = script, outbox
        self._cues = [
            Cue(row.at_ns, row.event)
            for row in script.rows
            if row.event is not None and row.event != "lost"
        ]
        self._cues.append(Cue(script.duration_ns + QUIET_NS, "disarm"))
        self._changes = [row.at_ns for row in script.rows] + [self._cues[-1].at_ns]

    def read(self, now: int, began: int | None) -> StickReading:
        """Sticks of this instant, and all events that are due and have not happened yet."""
        if began is None:
            return StickReading()
        presses, incidents = list[Intent](), list[Incident]()
        while self.played < len(self._cues) and self._cues[self.played].at_ns <= now - began:
            what = self._cues[self.played].what
            self.played += 1
            if isinstance(what, Incident):
                incidents.append(what)
            else:
                presses.append(what)
            if self.played == len(self._cues):
                self._outbox.say("info", "the script has ended")
        row = self._script.at(now - began)
        return StickReading(
            sticks=row.sticks,
            present=row.event != "lost",
            at_rest=row.sticks.at_rest,
            presses=tuple(presses),
            incidents=tuple(incidents),
        )

    def next_ns(self, now: int, began: int) -> int | None:
        """[ns] Time of the next row, or of the disarming after the last one."""
        index = bisect_right(self._changes, now - began)
        return None if index == len(self._changes) else began + self._changes[index]
