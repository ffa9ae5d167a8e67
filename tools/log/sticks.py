"""What a simulation flies again of a recording: the pilot's sticks and requests, as a stick log
(`lindy log export --as sticks`), and when messages were sent and arrived (`--as trace`).

The recorder is on board, and puts the pilot's stamps on its own clock. So the pilot's commands give
the delay from topside to drone: arrival − stamp; a gap in the sequence numbers is a loss. Where the
ends have two clocks, a delay is as wrong as their offset is known (`log info`), at most.
"""

import json
from math import degrees, radians
from pathlib import Path
from typing import NamedTuple

import msgspec

from messages import topics
from messages.health import LogLine
from messages.link import LinkRequest
from messages.message import Message, Request
from messages.pilot import PilotCommand, PilotRequest
from messages.simulator import FaultRequest
from messages.text import harmless
from messages.vehicle import VehicleStatus
from services.gamepad.stick_log import COLUMNS, QUIET_NS
from services.piloting.sticks import CENTRED, Sticks
from services.runtime.config.errors import LindyError
from services.tether.profile import LONGEST_MS
from tools.exit_status import DONE, LOST
from tools.fresh import refuse_existing, write_fresh
from tools.recordings.progress import reading
from tools.recordings.recording import Recording, open_recording
from tools.text_table import counted

BEFORE_S = 0.005  # [s] by so much a message may arrive before it was sent: the offset's error
MOST_MISSING = 1000  # a larger gap in the count is another publisher, not a loss
TraceRow = tuple[float, float | None]  # sent [s], arrived [s] or lost


class HeardCommand(NamedTuple):
    """A pilot command on board."""

    seq: int
    sent: int  # [ns] by the recorder's clock
    arrived: int  # [ns]


def write_trace(recording: Path, out: Path) -> int:
    """Write a trace for `delay = { kind = "trace", file = … }` in a profile: CSV whose first line
    says how it was measured. Returns the exit status.

    Raises:
        LindyError: as `trace_of`, or the file is there already.
    """
    refuse_existing(out)
    rows, how = (
        trace_of(recording),
        "one way, down: arrival of pilot/command on board minus its stamp",
    )
    lines = (f"{sent:.6f},{'' if at is None else f'{at:.6f}'}\n" for sent, at in rows)
    write_fresh(out, f"# {how}\nsent_s,arrived_s\n{''.join(lines)}".encode())
    lost = sum(at is None for _, at in rows)
    print(f"{out}: {counted(len(rows), 'message')}, {lost} lost; {how}", flush=True)
    return 0


def trace_of(path: Path) -> list[TraceRow]:
    """In seconds since the first command was sent, ascending. A lost one was sent evenly between
    its neighbours.

    Raises:
        LindyError: there is no recording, no commands in it, or one arrived before it was sent, or
            later than any link model knows.
    """
    recording = open_recording(path)
    commands = [
        HeardCommand(message.seq, publish_ns, log_ns)
        for _, message, log_ns, publish_ns in recording.of(topics.PILOT_COMMAND)
        if isinstance(message, PilotCommand)
    ]
    # Before the clocks were known, the recorder took a command's arrival for its stamp.
    commands = [command for command in commands if command.sent != command.arrived] or commands
    if len(commands) < 2:
        raise LindyError(f"{path} holds no pilot commands, which tell the delays of a link")
    ordered = sorted(set(commands), key=lambda heard: (heard.sent, heard.seq))
    start = ordered[0].sent
    rows: list[TraceRow] = []
    before: HeardCommand | None = None
    for here in ordered:
        if before is not None and before.sent == here.sent:
            continue  # a copy
        if before is not None and 1 < here.seq - before.seq <= MOST_MISSING:
            step = (here.sent - before.sent) / (here.seq - before.seq)
            missing = range(1, here.seq - before.seq)
            rows += [((before.sent + k * step - start) / 1e9, None) for k in missing]
        sent, delay = (here.sent - start) / 1e9, (here.arrived - here.sent) / 1e9
        if not -BEFORE_S <= delay <= LONGEST_MS / 1e3:
            raise LindyError(
                f"{path}: a message sent at {sent:.3f} s arrived {delay:.3f} s later; "
                "the clocks of both ends differ, and their offset was not recorded"
            )
        rows.append((sent, sent + max(0.0, delay)))
        before = here
    return rows


HANDED_OVER = "has the sticks"  # how the pilot's log line ends when the drone is armed
APART_NS = 1000  # [ns] between two events of one instant: a row holds one
# Requests that are an event of the same name.
PLAIN = ("stop", "disarm", "arm", "light", "home", "unwind")
# Control is asked for, and a failsafe is ended, by every script itself.
BY_ITSELF = ("lease", "offer", "release", "force", "resume")
HEARD = (
    topics.PILOT_COMMAND, topics.PILOT_REQUEST, topics.FAULT_REQUEST, topics.LINK_REQUEST,
    topics.STATUS, topics.LOG,
)  # fmt: skip


class SticksRow(NamedTuple):
    at_ns: int  # [ns] since the sticks were handed over
    sticks: Sticks
    event: str = ""


class RecordedSticks(NamedTuple):
    rows: list[SticksRow]  # at least one
    paths: dict[str, str]  # TOML files by the name that an event gives them
    source: str  # who had the sticks
    remarks: list[str]  # what a stick log cannot say
    began_ns: int = 0  # [ns] when the sticks were handed over, by the clock of the stamps


class HeardSticks:
    """What the pilot said, in the order of its sending."""

    def __init__(self) -> None:
        self.commands: list[PilotCommand] = []
        self.requests: dict[str, Request] = {}  # the first of each id
        self.began_ns: int | None = None  # [ns] when the sticks were handed over
        self.armed_ns: int | None = None  # [ns] as the drone itself said, where the log is missing
        self._epoch = 0

    def add(self, message: Message) -> None:
        match message:
            case PilotCommand() if message.epoch >= self._epoch:  # of the pilot in control
                self._epoch = message.epoch
                self.commands.append(message)
            case PilotRequest() | FaultRequest() | LinkRequest():
                self.requests.setdefault(message.id, message)
            case LogLine() if self.began_ns is None and message.text.endswith(HANDED_OVER):
                self.began_ns = message.stamp_ns
            case VehicleStatus() if self.armed_ns is None and message.armed:
                self.armed_ns = message.stamp_ns
            case _:
                pass


def write_sticks(recording: Path, out: Path) -> int:
    """Write the pilot's sticks and requests as a stick log; a path that was followed is written
    beside it. Returns the exit status: 3 where the recording is damaged or was not finished.

    Raises:
        LindyError: there is no recording, nobody flew in it, or the file is there already.
    """
    if out.suffix != ".csv" or {",", "#"} & set(str(out)):
        raise LindyError(f"--out {out}: expected a name that ends in .csv, without comma or #")
    refuse_existing(out)
    opened = open_recording(recording)
    with reading("reading", opened.size) as opened.advance:
        found = sticks_of(opened, f"{out.with_suffix('')}_")
    for name, text in found.paths.items():
        write_fresh(Path(name), text.encode())
    write_fresh(out, as_csv(found, f"the sticks of {found.source}, from {recording}").encode())
    seconds = found.rows[-1].at_ns / 1e9
    files = ", ".join([str(out), *found.paths])
    rows = counted(len(found.rows), "row")
    print(f"{rows}, {seconds:.1f} s, written to {files}", flush=True)
    for remark in [*found.remarks, *opened.damage]:
        print(harmless(remark), flush=True)
    print(f"to fly them: lindy simulate --pilot script:{out}", flush=True)
    return LOST if opened.damage else DONE


def sticks_of(recording: Recording, prefix: str = "") -> RecordedSticks:
    """
    Args:
        prefix: what the names of the files in `paths` begin with.

    Raises:
        LindyError: it is empty, or nobody flew in it.
    """
    heard = HeardSticks()
    recording.require_messages()
    for _, message, *_ in recording.of(*HEARD):
        heard.add(message)
    began = heard.armed_ns if heard.began_ns is None else heard.began_ns
    commands = sorted(heard.commands, key=lambda command: command.stamp_ns)
    commands = [c for c in commands if began is not None and c.stamp_ns >= began]
    if began is None or not commands:
        what = "the drone was never armed" if began is None else "there are no pilot commands"
        raise LindyError(f"{recording.files[0]} holds no sticks to fly again: {what}")
    remarks: list[str] = []
    if heard.began_ns is None:
        remarks.append("times count from the drone's own arming: the pilot's log line is missing")
    events = RequestEvents(prefix, remarks)
    timed = [
        (request.stamp_ns - began, event)
        for request in sorted(heard.requests.values(), key=lambda request: request.stamp_ns)
        if request.stamp_ns >= began and (event := events.of(request))
    ]
    rows = _with_end(_with_events(_changes(commands, began), timed), commands[-1].stamp_ns - began)
    return RecordedSticks(rows, events.paths, commands[-1].source, remarks, began)


def as_csv(sticks: RecordedSticks, heading: str) -> str:
    """The text of a stick log; `heading` is a comment in its first line."""
    grips = any(row.sticks.gripper for row in sticks.rows)  # else there is no column of it
    names = ("tilt", "gripper") if grips else ("tilt",)
    lines = [f"# {harmless(' '.join(heading.split()))}", ",".join((*COLUMNS, *names, "event"))]
    for row in sticks.rows:
        numbers = row.sticks if grips else row.sticks[:-1]
        whole, rest = divmod(row.at_ns, 10**9)
        seconds = f"{whole}.{rest:09d}".rstrip("0").rstrip(".")
        cells = (repr(number).removesuffix(".0") for number in numbers)
        lines.append(",".join([seconds, *cells, row.event]))
    return "\n".join(lines) + "\n"


class RequestEvents:
    """Requests as events of a stick log."""

    def __init__(self, prefix: str, remarks: list[str]) -> None:
        self.paths: dict[str, str] = {}
        self._prefix, self._remarks = prefix, remarks

    def of(self, request: Request) -> str:
        """Empty: a script does this by itself, or cannot."""
        event = ""
        match request:
            case PilotRequest():
                event = self._of_pilot(request)
            case FaultRequest():
                value = "" if request.value is None else f" {request.value!r}"
                event = f"fault {request.part} {request.fault}{value}"
            case LinkRequest():
                words = ("link", request.kind, request.profile or "", *request.settings)
                event = " ".join(filter(None, words))
            case _:
                pass
        # A name of a stranger's could hold further rows of the script.
        sayable = event.isprintable() and not {",", "#"} & {*event}
        return event if sayable else self._unsaid(event)

    def _of_pilot(self, request: PilotRequest) -> str:
        kind = request.kind
        if kind == "light" and request.value not in (0.0, 1.0):
            return f"output light {request.value!r}"
        if kind == "goto" and request.north is not None:
            if request.depth is not None:
                return self._unsaid("goto north east depth")
            return f"goto north={request.north!r} east={request.east!r}"
        if kind in PLAIN:
            return kind
        if kind == "output":
            return f"output {request.output} {request.value!r}"
        if kind == "goto":
            depth = "" if request.depth is None else f" depth={request.depth!r}"
            heading = "" if request.heading is None else f" heading={in_degrees(request.heading)}"
            return f"goto{depth}{heading}"
        if kind == "mode":
            return f"mode {request.flight_mode}"
        if kind == "follow" and request.course is not None:
            table: dict[str, object] = msgspec.to_builtins(request.course)
            text = "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())
            names = {known: name for name, known in self.paths.items()}  # as in deploy/paths
            name = names.get(text, f"{self._prefix}path{len(self.paths) + 1}.toml")
            self.paths[name] = text
            return f"follow {name}"
        return "" if kind in BY_ITSELF else self._unsaid(kind)

    def _unsaid(self, what: str) -> str:
        self._remarks.append(f"a stick log cannot say {what!r}: it is left out")
        return ""


def in_degrees(heading: float) -> str:
    """The shortest number of degrees that gives exactly this angle [rad], if there is one."""
    exact = degrees(heading)
    for digits in range(16):
        if radians(round(exact, digits)) == heading:
            return repr(round(exact, digits))
    return repr(exact)


def _changes(commands: list[PilotCommand], began: int) -> list[SticksRow]:
    """A row wherever the sticks, or the pilot's presence, change."""
    rows: list[SticksRow] = []
    for c in commands:
        sticks = Sticks(c.surge, c.sway, c.heave, c.yaw, c.tilt, c.gripper)
        row = SticksRow(c.stamp_ns - began, sticks, "lost" if c.pilot == "lost" else "")
        if not rows or row[1:] != rows[-1][1:]:
            if rows and rows[-1].at_ns == row.at_ns:
                rows.pop()
            rows.append(row)
    return rows


def _with_events(rows: list[SticksRow], events: list[tuple[int, str]]) -> list[SticksRow]:
    """The same sticks, with a row for each event."""
    taken = {row.at_ns: row for row in rows}
    for at, event in events:
        while at in taken and taken[at].event:
            at += APART_NS
        before = taken[max((other for other in taken if other <= at), default=rows[0].at_ns)]
        taken[at] = SticksRow(at, before.sticks, event)
        if before.event == "lost":
            taken[at + APART_NS] = SticksRow(at + APART_NS, CENTRED, "lost")
    return [taken[at] for at in sorted(taken)]


def _with_end(rows: list[SticksRow], last_ns: int) -> list[SticksRow]:
    """A script ends with its last row, and disarms by itself a while later: where the pilot did the
    same, that row is the end; else the pilot's own disarming is."""
    *before, last = rows
    if last.event != "disarm":
        return rows if last_ns <= last.at_ns else [*rows, SticksRow(last_ns, CENTRED)]
    end = SticksRow(last.at_ns - QUIET_NS, CENTRED)
    if last.sticks != CENTRED or (before and before[-1].at_ns > end.at_ns):
        return rows
    return [*before, end] if not before or before[-1].at_ns < end.at_ns else before
