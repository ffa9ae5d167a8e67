"""`lindy fleet` as a screen, as lines and as JSON. Pure: rows in, something printable out."""

import json
from collections.abc import Iterable, Sequence

from rich.cells import cell_len, set_cell_size
from rich.text import Text

from tools.fleet.names import clean
from tools.fleet.watching import FleetRow

COLUMNS = ("name", "activity", "depth", "heading", "battery", "link", "who flies")
TO_THE_RIGHT = ("depth", "heading")
DISPENSABLE = ("battery", "heading", "link", "who flies", "depth", "activity")  # the first first
ALARMS = "alarms"
GAP, INDENT = "  ", "    "
UNKNOWN = "–"
LONGEST = 24  # [characters] of a name or an activity
FRAME = 3  # rows of the screen that are no drones: title, heading, one left free
LOSS_SHOWN = 0.01  # [-] a smaller share is not worth a word


def screen(
    rows: Sequence[FleetRow], remarks: Sequence[str], title: str, width: int, height: int
) -> Text:
    """All drones by name; where they are too many for the terminal, the most urgent first. What is
    wrong with a drone stands beside it, in a narrow window below it; its name is always there.

    Args:
        remarks: what was not listed, in words.
        title: one line about all of them.
        width: columns of the terminal.
        height: its rows.
    """
    every = [_cells(row) for row in rows]
    widths = _widths(every, width)
    dropped = [column for column in COLUMNS if column not in widths]
    narrow = [f"no room for {', '.join(dropped)}: the window is too narrow"] if dropped else []
    longest = max((cell_len(_alarms(row)) for row in rows), default=0)
    beside = _across(widths.values()) + len(GAP) + longest <= width
    room = max(1, height - FRAME - len(remarks) - len(narrow) - 1)
    shown, hidden = _fitting(rows, room, beside=beside)
    heading = _line({column: column for column in COLUMNS}, widths)
    lines = [Text(title), Text(heading + (GAP + ALARMS if beside else ""), "dim")]
    for row in shown:
        line = Text(_line(_cells(row), widths))
        line.stylize("bold", 0, widths["name"])
        alarms = Text(_alarms(row), "bold red")
        lines += [Text(GAP).join([line, alarms])] if beside else [line]
        lines += [Text(INDENT) + alarms] if row.alarms and not beside else []
    below = [_hidden(hidden)] if hidden else []
    lines += map(Text, [*below, *narrow, *remarks])
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return Text("\n").join(lines)


def _widths(rows: Sequence[dict[str, str]], width: int) -> dict[str, int]:
    """Of the columns for which there is room."""
    found = {
        column: max(map(cell_len, [column, *(row[column] for row in rows)])) for column in COLUMNS
    }
    for column in DISPENSABLE:
        if _across(found.values()) > width:
            del found[column]
    return found


def _across(widths: Iterable[int]) -> int:
    each = [*widths]
    return sum(each) + len(GAP) * (len(each) - 1)


def _line(cells: dict[str, str], widths: dict[str, int]) -> str:
    return GAP.join(
        " " * (width - cell_len(cells[column])) + cells[column]
        if column in TO_THE_RIGHT
        else set_cell_size(cells[column], width)
        for column, width in widths.items()
    )


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
    cells = [*_cells(row).values(), _alarms(row)]
    return GAP.join(cell for cell in cells if cell and cell != UNKNOWN)


def news(row: FleetRow) -> tuple[object, ...]:
    """A drone gets another line when this changes."""
    heads = tuple(alarm.partition(" for ")[0].partition(",")[0] for alarm in row.alarms)
    return row.activity, row.armed, row.pilot, heads


def as_json(rows: Sequence[FleetRow], remarks: Sequence[str], router_answers: bool) -> str:
    """For programs."""
    drones = [row._asdict() for row in rows]
    about = {"drones": drones, "not_listed": [*remarks], "router_answers": router_answers}
    return json.dumps(about)


def _fitting(
    rows: Sequence[FleetRow], room: int, *, beside: bool
) -> tuple[list[FleetRow], list[FleetRow]]:
    """Those that are shown, and those for whom there is no room.

    Args:
        beside: alarms take no rows of their own.
    """
    costs = {row.name: 1 if beside or not row.alarms else 2 for row in rows}
    if sum(costs.values()) <= room:
        return [*rows], []
    first = sorted(rows, key=_urgency)  # else they stay in their order
    left = room - 1  # a line says how many are hidden
    for number, row in enumerate(first):
        left -= costs[row.name]
        if left < 0:
            return first[:number], first[number:]
    return first, []


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


def _cells(row: FleetRow) -> dict[str, str]:
    return {
        "name": clean(row.name, LONGEST),
        "activity": clean(f"{row.activity}{', armed' if row.armed else ''}", LONGEST) or UNKNOWN,
        "depth": UNKNOWN if row.depth_m is None else f"{row.depth_m:.1f} m",
        "heading": UNKNOWN if row.heading_deg is None else f"{row.heading_deg:03.0f}°",
        "battery": row.battery or UNKNOWN,
        "link": _link(row),
        "who flies": clean(row.pilot, LONGEST) or "nobody",
    }


def _alarms(row: FleetRow) -> str:
    return "; ".join(clean(alarm) for alarm in row.alarms)


def _link(row: FleetRow) -> str:
    if row.age_s is None:
        return UNKNOWN
    lost = row.loss is not None and row.loss >= LOSS_SHOWN
    return f"{row.age_s:.1f} s" + (f", {100 * (row.loss or 0.0):.0f} % lost" if lost else "")
