"""What the pilot reads in the terminal during a dive. Pure: a view in, something printable out.

The screen fits the terminal's height. What a pilot needs comes first and is never left out: armed,
mode, alarm, depth, heading, hold, battery, sticks and link, then the newest log lines. The services
get the rows that are left; those that are gone or were restarted are shown before the others.
"""

from dataclasses import dataclass, field

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from messages.counts import short
from tools.live.log_lines import LogEntry, brief

STICKS = ("surge", "sway", "heave", "yaw")
HALF = 6  # [characters] of a stick's bar on either side of its centre
LINES = 6  # newest log lines shown
PILOT_ROWS = 8  # above the log lines: title, state, motion, vehicle, 2 of sticks, 2 of the link
GAP = 1  # empty row
TABLE_HEADING = 1  # row
OLD_MS = 150.0  # [ms] the age of depth and heading is shown from here on
UNKNOWN = "–"
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


@dataclass(frozen=True, slots=True)
class View:
    """Everything on the screen, in the pilot's units. Unknown is None."""

    title: str
    elapsed_s: float | None = None  # [s] since arming
    length_s: float | None = None  # [s]
    mode: str = "starting"
    hold: str = ""  # what the drone holds by itself
    light: float | None = None  # [-] 0 … 1
    battery_v: float | None = None  # [V]
    used_wh: float | None = None  # [Wh] since power-on
    capacity_wh: float | None = None  # [Wh] when full
    armed: bool = False
    last_known: bool = False  # no status arrives: armed, mode and failsafe are those of the last
    failsafe: str = "none"
    since_s: float | None = None  # [s] since its condition began
    next_s: float | None = None  # [s] until the next reaction begins
    words: str = ""  # what has happened, what the drone does and what ends it
    note: str = ""
    age_ms: float | None = None  # [ms] of depth and heading
    depth_m: float | None = None
    depth_wanted_m: float | None = None
    heading_deg: float | None = None  # [0, 360)
    heading_wanted_deg: float | None = None
    sticks: tuple[float, float, float, float] | None = None  # [-] surge, sway, heave, yaw
    down_ms: float | None = None  # [ms] median delay to the drone
    up_ms: float | None = None  # [ms] median delay to the pilot
    rtt_ms: float | None = None
    stick_ms: float | None = None  # [ms] stick to thruster
    screen_ms: float | None = None  # [ms] sensor to screen
    alarm: str = ""  # what is wrong with the link
    silent: tuple[str, ...] = ()  # processes that run but do not answer
    lost: int = 0  # messages the link has dropped
    services: list[ServiceView] = field(default_factory=list[ServiceView])
    lines: list[LogEntry] = field(default_factory=list[LogEntry])


def render(view: View, height: int | None = None) -> RenderableType:
    """The whole screen. Nothing in it wraps from 80 columns on.

    Args:
        height: rows there are; None: as many as are needed.
    """
    pilot: list[RenderableType] = [_title(view), _state(view), *_alarm(view), _motion(view)]
    pilot += [_vehicle(view), _sticks(view), _link(view)]
    lines, services = LINES, len(view.services)
    if height is not None:
        rows = PILOT_ROWS + len(_alarm(view))
        lines = max(0, min(LINES, height - rows - GAP))
        services = max(0, min(services, height - rows - GAP - lines - GAP - TABLE_HEADING))
    shown: list[RenderableType] = [*pilot]
    if lines:
        shown += [Text(), *_lines(view, lines)]
    if services:
        shown += [Text(), _services(view, services)]
    return Group(*shown)


def plain(view: View) -> str:
    """The same in one line, for a log file or a pipe."""
    depth, heading = _number(view.depth_m, "7.2f"), _number(view.heading_deg, "6.1f")
    parts = [
        f"{_clock(view.elapsed_s)}  {_known(view)}{'armed' if view.armed else 'disarmed'}"
        f" {view.mode}",
        f"depth {depth} m  heading {heading}°{_old(view.age_ms)}"
        f"  rtt {_number(view.rtt_ms, '.1f')} ms",
    ]
    if failsafe := _failsafe(view):
        parts.append(failsafe)
    if view.words:
        parts.append(f"{_known(view)}{view.words}")
    if view.alarm:
        parts.append(f"LINK {view.alarm}")
    if view.silent:
        parts.append(f"NOT ANSWERING {', '.join(view.silent)}")
    if view.note:
        parts.append(view.note)
    processes = {service.process or service.name: service.restarts for service in view.services}
    if restarts := sum(processes.values()):
        parts.append(f"restarts {restarts}")
    return "  ".join(parts)


def _failsafe(view: View) -> str:
    """What acts, since when, and when it does more."""
    coming = "" if view.next_s is None else f"in {max(0.0, view.next_s):.0f} s"
    if view.failsafe == "none":
        return f"FAILSAFE {coming}" if coming else ""
    since = "" if view.since_s is None else f" for {view.since_s:.0f} s"
    name = short(f"failsafe:{view.failsafe}")
    return f"FAILSAFE {name}{since}" + (f", next {coming}" if coming else "")


def _title(view: View) -> Table:
    row = Table.grid(expand=True, padding=(0, 1))
    row.add_column(no_wrap=True, overflow="ellipsis", ratio=1)
    row.add_column(no_wrap=True, justify="right")
    clock = _clock(view.elapsed_s)
    if view.length_s is not None:
        clock += f" of {_clock(view.length_s)}"
    row.add_row(Text(f"Lindy  {view.title}", style="bold"), clock)
    return row


def _state(view: View) -> Text:
    style = "bold white on red" if view.armed and not view.last_known else "dim"
    return Text.assemble(
        (_known(view), "yellow"),
        (" ARMED " if view.armed else " DISARMED ", style),
        f"  {view.mode}",
        (f"  {_failsafe(view)}", "bold red"),
        (f"  {view.note}" if view.note else "", "yellow"),
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _known(view: View) -> str:
    """What stands before the state of a drone that is not heard any more."""
    return "last known: " if view.last_known else ""


def _alarm(view: View) -> list[Text]:
    """Rows of their own, so that none is cut by another; none when all is well."""
    alarms = [f"LINK   {view.alarm}"] if view.alarm else []
    if view.silent:
        more = len(view.silent) - 1
        alarms.insert(0, f"SILENT {view.silent[0]}" + (f" +{more}" if more else ""))
    rows = ["  ".join(alarms)] if alarms else []
    if view.words:
        rows.insert(0, f"DRONE  {_known(view)}{view.words}")
    return [Text(row, "bold red", overflow="ellipsis", no_wrap=True) for row in rows]


def _motion(view: View) -> Text:
    depth, wanted_depth = _number(view.depth_m, "7.2f"), _number(view.depth_wanted_m, ".2f")
    heading, wanted = _number(view.heading_deg, "6.1f"), _number(view.heading_wanted_deg, ".1f")
    return Text.assemble(
        ("depth  ", "dim"), (f"{depth} m", "bold"), (f"  reference {wanted_depth} m", "dim"),
        ("   heading ", "dim"), (f"{heading}°", "bold"), (f"  reference {wanted}°", "dim"),
        (_old(view.age_ms), "yellow"),
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _vehicle(view: View) -> Text:
    light = None if view.light is None else 100.0 * view.light
    battery = f"{_number(view.battery_v, '.1f')} V"
    if view.used_wh is not None:
        battery += f", {view.used_wh:.1f} Wh used"
        battery += "" if view.capacity_wh is None else f" of {view.capacity_wh:.0f}"
    return Text.assemble(
        ("hold   ", "dim"), f"{view.hold.replace('_', ' ') or UNKNOWN:<15}",
        ("  light ", "dim"), f"{_number(light, '.0f')} %",
        ("   battery ", "dim"), battery,
        overflow="ellipsis", no_wrap=True,
    )  # fmt: skip


def _old(age_ms: float | None) -> str:
    return "" if age_ms is None or age_ms <= OLD_MS else f"  {age_ms / 1e3:.1f} s old"


def _sticks(view: View) -> Table:
    grid = Table.grid(padding=(0, 1))
    values: tuple[float | None, ...] = view.sticks or (None,) * len(STICKS)
    cells = [
        Text.assemble((f"{name:<6}", "dim"), bar(value), f" {_number(value, '+.2f'):>5}")
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
        f"down {_number(view.down_ms, '.1f')} ms   up {_number(view.up_ms, '.1f')} ms",
        f"   round trip {_number(view.rtt_ms, '.1f')} ms   lost {view.lost}",
        ("\n       ", ""),
        f"stick to thruster {_number(view.stick_ms, '.1f')} ms",
        f"   sensor to screen {_number(view.screen_ms, '.1f')} ms",
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
    for title in ("sent/s", "late p99 [ms]", "CPU [%]", "restarts", "counted"):
        table.add_column(Text(title), justify="right", no_wrap=True)
    for row in shown:
        style = "" if row.alive else "bold red"
        table.add_row(
            Text(row.name if row.alive else f"{row.name} gone", style=style),
            *([Text(row.process, style="dim")] if shared else []),
            _number(row.sent_hz, ".0f"),
            _number(row.late_ms, ".2f"),
            _number(row.cpu_percent, ".0f"),
            Text(str(row.restarts), style="yellow" if row.restarts else "dim"),
            Text(str(row.troubles), style="yellow" if row.troubles else "dim"),
        )
    if left_out := len(view.services) - len(shown):
        table.add_row(Text(f"and {left_out} more", style="dim"))
    return table


def most_important(services: list[ServiceView], most: int) -> list[ServiceView]:
    """Those that are gone first, then those that were restarted, then the rest; shown in the order
    of the stack."""
    ranked = sorted(services, key=lambda service: (service.alive, -service.restarts))
    return [service for service in services if service in ranked[:most]]


def _lines(view: View, most: int) -> list[Text]:
    lines = [
        Text(brief(entry), LEVELS[entry.line.level], overflow="ellipsis", no_wrap=True)
        for entry in view.lines[-most:]
    ]
    return lines + [Text()] * (most - len(lines))


def _number(value: float | None, form: str) -> str:
    return UNKNOWN if value is None else format(value, form)


def _clock(seconds: float | None) -> str:
    if seconds is None:
        return "--:--"
    return f"{int(seconds) // 60:02d}:{int(seconds) % 60:02d}"
