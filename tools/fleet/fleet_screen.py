"""`lindy fleet` as a screen, as lines and as JSON. Pure: rows in, something printable out."""

import json
from collections.abc import Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from tools.fleet.names import clean
from tools.fleet.watching import FleetRow

HEADING = ("name", "activity", "depth", "heading", "battery", "link", "who flies", "alarms")
UNKNOWN = "–"
LONGEST = 24  # [characters] of a name or an activity
FRAME = 3  # rows of the screen that are no drones: title, heading, one left free
LOSS_SHOWN = 0.01  # [-] a smaller share is not worth a word


def screen(
    rows: Sequence[FleetRow], remarks: Sequence[str], title: str, height: int
) -> RenderableType:
    """All drones by name; where they are too many for the terminal, the most urgent first.

    Args:
        remarks: what was not listed, in words.
        title: one line about all of them.
        height: rows of the terminal.
    """
    room = max(1, height - FRAME - len(remarks) - 1)
    shown, hidden = _fitting(rows, room)
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), expand=False)
    for heading in HEADING:
        right = heading in ("depth", "heading")
        table.add_column(heading, no_wrap=True, justify="right" if right else "left")
    for row in shown:
        cells = [Text(cell) for cell in _cells(row)]
        cells[0].stylize("bold")
        cells[-1].stylize("bold red" if row.alarms else "")
        table.add_row(*cells)
    below = [_hidden(hidden)] if hidden else []
    return Group(Text(title), table, *map(Text, [*below, *remarks]))


def title_of(rows: Sequence[FleetRow], place: str, router_answers: bool) -> str:
    """One line about all of them.

    Args:
        place: where was asked.
    """
    if not router_answers:
        known = "; this is what was heard last" if rows else ""
        return f"the router at {place} does not answer{known}"
    if not rows:
        return f"no drone can be reached at {place}"
    there = [row for row in rows if not row.gone]
    armed = sum(row.armed for row in there)
    flown = sum(bool(row.pilot) for row in there)
    alarmed = sum(bool(row.alarms) for row in there)
    gone = f"; {len(rows) - len(there)} gone" if len(there) < len(rows) else ""
    counts = f"{armed} armed, {flown} flown, {alarmed} with an alarm"
    return f"{len(there)} drones at {place}: {counts}{gone}"


def line(row: FleetRow) -> str:
    """One drone on a line of its own."""
    return "  ".join(cell for cell in _cells(row) if cell and cell != UNKNOWN)


def news(row: FleetRow) -> tuple[object, ...]:
    """A drone gets another line when this changes."""
    heads = tuple(alarm.partition(" for ")[0].partition(",")[0] for alarm in row.alarms)
    return row.activity, row.armed, row.pilot, heads


def as_json(rows: Sequence[FleetRow], remarks: Sequence[str], router_answers: bool) -> str:
    """For programs."""
    drones = [row._asdict() for row in rows]
    about = {"drones": drones, "not_listed": [*remarks], "router_answers": router_answers}
    return json.dumps(about)


def _fitting(rows: Sequence[FleetRow], room: int) -> tuple[list[FleetRow], list[FleetRow]]:
    """Those that are shown, and those for whom there is no room."""
    if len(rows) <= room:
        return [*rows], []
    first = sorted(rows, key=_urgency)  # else they stay in their order
    return first[: room - 1], first[room - 1 :]


def _urgency(row: FleetRow) -> int:
    """0: to be seen first. A name anybody can announce: it takes no drone's place."""
    if not row.speaks:
        return 5
    if row.gone:
        return 4
    if row.failsafe:
        return 0
    if row.alarms:
        return 1 if row.armed else 2
    return 3


def _hidden(rows: Sequence[FleetRow]) -> str:
    alarmed = sum(bool(row.alarms) for row in rows)
    return f"and {len(rows)} more, {alarmed} of them with an alarm: the window is too low"


def _cells(row: FleetRow) -> tuple[str, ...]:
    return (
        clean(row.name, LONGEST),
        clean(f"{row.activity}{', armed' if row.armed else ''}", LONGEST) or UNKNOWN,
        UNKNOWN if row.depth_m is None else f"{row.depth_m:.1f} m",
        UNKNOWN if row.heading_deg is None else f"{row.heading_deg:03.0f}°",
        row.battery or UNKNOWN,
        _link(row),
        clean(row.pilot, LONGEST) or "nobody",
        "; ".join(clean(alarm) for alarm in row.alarms),
    )


def _link(row: FleetRow) -> str:
    if row.age_s is None:
        return UNKNOWN
    lost = row.loss is not None and row.loss >= LOSS_SHOWN
    return f"{row.age_s:.1f} s" + (f", {100 * (row.loss or 0.0):.0f} % lost" if lost else "")
