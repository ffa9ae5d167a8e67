"""What the pilot reads in the terminal during a dive: a screen on a terminal, otherwise a line
every few seconds. `render` and `plain` are pure: a view in, something printable out.

The screen fits the terminal's height. What a pilot needs comes first and is never left out: armed,
activity, alarm, depth, heading, flight mode, battery, sticks and link, then the newest log lines,
the last warnings among them. The services get the rows that are left; those that are gone or were
restarted are shown before the others.

Every alarm has rows of its own and is wrapped, because its end says what the pilot has to do.
"""

import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from textwrap import wrap
from typing import Protocol

from rich.console import Console, ConsoleDimensions, Group, RenderableType
from rich.live import Live
from rich.table import Table
from rich.text import Text

from messages.health import LogLine
from services.vehicle_view import words
from services.vehicle_view.log_lines import LogEntry, LogLines, brief, full, newest
from services.vehicle_view.view import VehicleView
from services.vehicle_view.words import known, number

STICKS = ("surge", "sway", "heave", "yaw")
HALF = 6  # [characters] of a stick's bar on either side of its centre
LINES = 6  # newest log lines shown at least, where there is room for them …
MOST_LINES = 24  # … and at most
PILOT_ROWS = 8  # above the log lines: title, state, motion, vehicle, 2 of sticks, 2 of the link
GAP = 1  # empty row
TABLE_HEADING = 1  # row
COLUMNS = 80  # of the narrowest terminal
ALARM_ROWS = 3  # of each alarm at most
INDENT = " " * 10  # of a log line's second row
LEVELS = {"info": "", "warning": "yellow", "error": "bold red"}


@dataclass(frozen=True, slots=True)
class ServiceView:
    name: str
    alive: bool
    sent_hz: float | None = None  # [1/s] messages
    late_ms: float | None = None  # [ms] 99th percentile
    cpu_percent: float | None = None  # [%] of a core
    restarts: int = 0
    troubles: int = 0  # everything counted as dropped, stale, malformed, saturated …
    process: str = ""  # that it shares with others
    begun: bool = True  # it is alive, or was once


class View(VehicleView, frozen=True, kw_only=True):
    """Everything on the screen, in the pilot's units. Unknown is None."""

    title: str
    elapsed_s: float | None = None  # [s] since arming
    length_s: float | None = None  # [s]
    sticks: tuple[float, float, float, float] | None = None  # [-] surge, sway, heave, yaw
    silent: tuple[str, ...] = ()  # processes that run but do not answer
    picture: str = ""  # what is wrong with the camera's picture
    services: tuple[ServiceView, ...] = ()
    lines: tuple[LogEntry, ...] = ()


def render(view: View, height: int | None = None, width: int = COLUMNS) -> RenderableType:
    """The whole screen. Nothing in it wraps from 80 columns on.

    Args:
        height, width: rows and columns there are; None: as many rows as are needed.
    """
    alarms, note = _alarms(view, width), "; ".join(words.notes(view))
    if len(_state(view, note)) > width:
        state = [_state(view, ""), *_wrapped("NOTE", note, "yellow", width)]
    else:
        state = [_state(view, note)]
    pilot: list[RenderableType] = [_title(view), *state, *alarms, _motion(view)]
    pilot += [_vehicle(view), _sticks(view), _link(view)]
    lines, services = LINES, len(view.services)
    if height is not None:
        rows = PILOT_ROWS - 1 + len(state) + len(alarms)
        free = height - rows - GAP
        lines = max(0, min(LINES, free))
        services = max(0, min(services, free - lines - GAP - TABLE_HEADING))
        lines = max(lines, min(MOST_LINES, free - services - GAP - TABLE_HEADING))
    shown: list[RenderableType] = [*pilot]
    if lines:
        shown += [Text(), *_lines(view, lines, width)]
    if services:
        shown += [Text(), _services(view, services)]
    return Group(*shown)


def plain(view: View) -> str:
    """The same in one line, for a log file or a pipe."""
    depth, heading = number(view.depth_m, "7.2f"), number(view.heading_deg, "6.1f")
    parts = [
        f"{_clock(view.elapsed_s)}  {known(view)}{'armed' if view.armed else 'disarmed'}"
        f" {words.doing(view)}",
        f"depth {depth} m  heading {heading}°{_age(view)}  rtt {number(view.rtt_ms, '.1f')} ms",
    ]
    if acts := words.failsafe(view):
        parts.append(acts)
    if acting := words.acting(view):
        parts.append(acting)
    if view.alarms:
        parts.append(f"LINK {words.alarm(view)}")
    if view.picture:
        parts.append(f"CAMERA {view.picture}")
    if view.silent:
        parts.append(f"NOT ANSWERING {', '.join(view.silent)}")
    parts += words.notes(view)
    processes = {service.process or service.name: service.restarts for service in view.services}
    if restarts := sum(processes.values()):
        parts.append(f"restarts {restarts}")
    return "  ".join(parts)


def _title(view: View) -> Table:
    row = Table.grid(expand=True, padding=(0, 1))
    row.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    row.add_column(no_wrap=True, justify="right")
    clock = _clock(view.elapsed_s)
    if view.length_s is not None:
        clock += f" of {_clock(view.length_s)}"
    row.add_row(Text(f"Lindy  {view.title}", style="bold"), clock)
    return row


def _state(view: View, note: str) -> Text:
    style = "bold black on yellow" if view.armed and not view.last_known else "dim"
    return Text.assemble(
        (known(view), "yellow"),
        (f" {words.armed(view)} ", style),
        f"  {words.doing(view)}",
        (f"  {words.failsafe(view)}", "bold red"),
        (f"  {note}" if note else "", "yellow"),
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _alarms(view: View, width: int) -> list[Text]:
    """Rows of their own, the gravest first; none when all is well."""
    alarms = [("DRONE", acting)] if (acting := words.acting(view)) else []
    alarms += [("SILENT", _silent(view))] if view.silent else []
    alarms += [("LINK", words.alarm(view))] if view.alarms else []
    alarms += [("CAMERA", view.picture)] if view.picture else []
    return [row for name, text in alarms for row in _wrapped(name, text, "bold red", width)]


def _wrapped(name: str, text: str, style: str, width: int) -> list[Text]:
    """In as many rows as it needs, up to `ALARM_ROWS`."""
    rows = wrap(text, width - 7, max_lines=ALARM_ROWS, placeholder=" …")
    return [_row(f"{'' if n else name:<6} {row}", style) for n, row in enumerate(rows)]


def _row(text: str, style: str) -> Text:
    return Text(text, style, overflow="ellipsis", no_wrap=True)


def _silent(view: View) -> str:
    more = len(view.silent) - 1
    return view.silent[0] + (f" +{more}" if more else "")


def _motion(view: View) -> Text:
    depth, wanted_depth = number(view.depth_m, "6.2f"), number(view.depth_wanted_m, ".2f")
    heading, wanted = number(view.heading_deg, "5.1f"), number(view.heading_wanted_deg, ".1f")
    return Text.assemble(
        ("depth  ", "dim"), (f"{depth} m", "bold"), (f"  reference {wanted_depth} m", "dim"),
        ("  heading ", "dim"), (f"{heading}°", "bold"), (f"  reference {wanted}°", "dim"),
        (_age(view), "yellow"),
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _vehicle(view: View) -> Text:
    return Text.assemble(
        ("mode   ", "dim"), f"{words.flight_mode(view):<15}",
        *(part for label, text in words.numbers(view) for part in ((f"  {label} ", "dim"), text)),
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _age(view: View) -> str:
    return f"  {old}" if (old := words.old(view)) else ""


def _sticks(view: View) -> Table:
    grid = Table.grid(padding=(0, 1))
    values: tuple[float | None, ...] = view.sticks or (None,) * len(STICKS)
    cells = [
        Text.assemble((f"{name:<6}", "dim"), bar(value), f" {number(value, '+.2f'):>5}")
        for name, value in zip(STICKS, values, strict=True)
    ]
    grid.add_row(cells[0], Text("   "), cells[1])
    grid.add_row(cells[2], Text("   "), cells[3])
    return grid


def bar(value: float | None) -> str:
    """A stick's deflection as 13 characters, centre in the middle."""
    filled = 0 if value is None else round(max(-1.0, min(1.0, value)) * HALF)
    left = "█" * max(0, -filled)
    right = "█" * max(0, filled)
    return f"{left:·>{HALF}}│{right:·<{HALF}}"


def _link(view: View) -> Text:
    return Text.assemble(
        ("link   ", "dim"),
        f"down {number(view.down_ms, '.1f')} ms   up {number(view.up_ms, '.1f')} ms",
        f"   round trip {number(view.rtt_ms, '.1f')} ms   lost {number(view.lost_s, '.1f')} s",
        ("\n       ", ""),
        f"stick to thruster {number(view.stick_ms, '.1f')} ms",
        f"   sensor to screen {number(view.screen_ms, '.1f')} ms",
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _services(view: View, rows: int) -> Table:
    """At most so many rows below the heading; where that is not enough, the last says how many
    services are left out."""
    shown = view.services
    if len(shown) > rows:
        shown = most_important(shown, rows - 1)
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="dim")
    table.add_column(Text("service"), no_wrap=True, min_width=12)
    if shared := any(row.process for row in view.services):
        table.add_column(Text("process"), no_wrap=True)
    for title in ("sent/s", "late p99 [ms]", "CPU [%]", "restarts", "problems"):
        table.add_column(Text(title), justify="right", no_wrap=True)
    for row in shown:
        style = "" if row.alive else "bold red" if row.begun else "dim"
        missing = "" if row.alive else " gone" if row.begun else " starting"
        table.add_row(
            Text(f"{row.name}{missing}", style=style),
            *([Text(row.process, style="dim")] if shared else []),
            number(row.sent_hz, ".0f"),
            number(row.late_ms, ".2f"),
            number(row.cpu_percent, ".0f"),
            Text(str(row.restarts), style="yellow" if row.restarts else "dim"),
            Text(str(row.troubles), style="yellow" if row.troubles else "dim"),
        )
    if left_out := len(view.services) - len(shown):
        table.add_row(Text(f"and {left_out} more", style="dim"))
    return table


def most_important(services: Sequence[ServiceView], most: int) -> list[ServiceView]:
    """Those that are gone first, then those that were restarted, then the rest; shown in the order
    of the stack."""
    ranked = sorted(services, key=lambda service: (service.alive, -service.restarts))
    return [service for service in services if service in ranked[:most]]


def _lines(view: View, most: int, width: int) -> list[Text]:
    """The newest log lines in `most` rows. Rows that are free go to the ends of warnings and errors
    that are longer than a row, the newest first."""
    entries = newest(view.lines, most)
    free = most - len(entries)
    rows: list[Text] = []
    for entry in reversed(entries):
        style, shown = LEVELS[entry.line.level], [brief(entry)]
        if free and entry.line.level != "info" and len(shown[0]) > width:
            shown = wrap(shown[0], width, max_lines=2, subsequent_indent=INDENT, placeholder=" …")
            free -= len(shown) - 1
        rows = [_row(row, style) for row in shown] + rows
    return rows + [Text()] * (most - len(rows))


def _clock(seconds: float | None) -> str:
    if seconds is None:
        return "--:--"
    return f"{int(seconds) // 60:02d}:{int(seconds) % 60:02d}"


SCREEN_S = 0.25  # [s] between two screens
LINE_S = 5.0  # [s] between two lines
Make = Callable[[ConsoleDimensions], RenderableType]  # for a terminal of this size


class Display(Protocol):
    def show(self, look: Callable[[], View]) -> None:
        """Show the view that `look` makes, if the next one is due."""
        ...

    def line(self, line: LogLine, at_s: float | None) -> None:
        """A log line has arrived, `at_s` [s] after arming; the screen gets it with its view."""
        ...


class ScreenDisplay:
    def __init__(self, draw: Callable[[Make], None]) -> None:
        self._draw = draw
        self._next_s = 0.0

    def show(self, look: Callable[[], View]) -> None:
        if (now := time.monotonic()) >= self._next_s:
            self._next_s = now + SCREEN_S
            self._draw(lambda size: render(look(), size.height - 1, max(COLUMNS, size.width)))

    def line(self, line: LogLine, at_s: float | None) -> None:
        pass


class PrintedLines:
    """Log lines on stdout. One that is repeated is printed the first, tenth, hundredth … time, and
    a warning or an error also when it comes back after a while."""

    def __init__(self) -> None:
        self._lines = LogLines()

    def line(self, line: LogLine, at_s: float | None) -> None:
        """A log line has arrived, `at_s` [s] after arming."""
        if (entry := self._lines.add(line, at_s)) is not None:
            _print(entry)

    def finish(self) -> None:
        """Print the lines that were repeated since they were printed last."""
        for entry in self._lines.unprinted():
            _print(entry)


def _print(entry: LogEntry) -> None:
    with suppress(OSError):  # whoever read it may be gone, and the dive goes on
        print(full(entry), flush=True)


class LineDisplay(PrintedLines):
    def __init__(self) -> None:
        super().__init__()
        self._next_s = 0.0

    def show(self, look: Callable[[], View]) -> None:
        if (now := time.monotonic()) >= self._next_s:
            self._next_s = now + LINE_S
            line = plain(look())
            with suppress(OSError):  # whoever read it may be gone, and the dive goes on
                print(line, flush=True)


@contextmanager
def display() -> Generator[Display]:
    """A screen if stdout is a terminal, otherwise lines."""
    if not sys.stdout.isatty():
        shown = LineDisplay()
        try:
            yield shown
        finally:
            shown.finish()
        return
    with drawn_anew() as draw:
        yield ScreenDisplay(draw)


@contextmanager
def drawn_anew(console: Console | None = None) -> Generator[Callable[[Make], None]]:
    """Yields a function that draws; what it drew before goes. The cursor stands in the row below:
    a terminal scrolls when its last row is full.

    Args:
        console: default: the standard output.
    """
    # No refresh thread: the screen must not compete with the bus for the processor.
    with Live(console=console or Console(), auto_refresh=False, transient=True) as live:
        before = live.console.size

        def draw(make: Make) -> None:
            nonlocal before
            size = live.console.size
            if size != before:  # the terminal has wrapped the rows anew, nobody knows where
                live.stop()
                live.console.clear()
                live.start()
                before = size
            live.update(make(size), refresh=True)

        yield draw
