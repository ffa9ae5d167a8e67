"""What every page is shown: the vehicle, and what only a page shows of it."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
from msgspec import UNSET

from messages import events
from messages.events import Severity
from messages.pilot import PilotCommand
from messages.state import VehicleState
from messages.text import harmless
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.cockpit.past import Chart, Pair, Position, current
from services.marine.attitude import whole_turns
from services.marine.outputs import Output, OutputKind
from services.vehicle_view import ages
from services.vehicle_view.log_lines import LogEntry, printable
from services.vehicle_view.view import VehicleView, bearing

# [ms] of its age table: old from when on, and not shown from when on. The page ages what it has
# while nothing arrives, and adds the way to the browser.
AGES_MS = {
    name: (table.grey_ns / 1e6, table.gone_ns / 1e6)
    for name, table in (("state", ages.STATE), ("picture", ages.PICTURE))
}
PILOTS = (Severity.FAILSAFE, Severity.DANGER, Severity.PILOT, Severity.SENSOR)
# A busy computer is nothing to fly by.
BUSY = (events.SERVICE_LATE.noticed.name,)


class PageLine(msgspec.Struct, frozen=True, array_like=True):
    """A line of the log."""

    level: str
    at_s: float | None  # [s] of the dive; None: before
    times: int
    text: str  # of what is not for the pilot with its service
    event: str  # name of its row in the event table; empty: none
    pilots: bool  # it is for the pilot; False: of processes, messages and recordings


class PageOutput(msgspec.Struct, frozen=True, array_like=True):
    """An output of the vehicle file: a light, lasers, a gripper."""

    name: str
    kind: OutputKind
    value: float | None  # [-] 0 … 1, of a gripper -1 … 1; None: not known


class PageView(VehicleView, frozen=True, kw_only=True, omit_defaults=True):
    """One picture of the drone."""

    drone: str = ""  # its name
    sticks: tuple[float, ...] = ()  # [-] surge, sway, heave, yaw as sent to the drone
    filming_s: float | None = None  # [s] that a film runs; None: none does
    snapshots: int = 0  # that were taken
    tools: tuple[PageOutput, ...] = ()  # outputs of the vehicle, in the order of its file
    fov_deg: float | None = None  # [deg] that the large picture is wide
    looks_deg: tuple[float, float] = (0.0, 0.0)  # [deg] tilt and yaw of its camera's axis
    large: str = ""  # name of its camera
    # Name of each camera, the first one first, and whether the link has no room for it; empty:
    # there is one only.
    cameras: tuple[tuple[str, bool], ...] = ()
    dive_s: float | None = None  # [s] since the drone was first armed
    left_min: float | None = None  # [min] until the battery is empty
    inside_c: float | None = None  # [°C] in the enclosure
    water_c: float | None = None  # [°C] as the depth sensor measures it
    place: Position | None = None  # of the drone
    compass_deg: float | None = None  # [deg] heading by the compass; that of the tape is another
    home: Pair | None = None  # [m] north, east of where it was first armed
    goal: Pair | None = None  # [m] north, east of where it goes
    waypoints: tuple[Pair, ...] = ()  # [m] of the path that it follows: the next ones
    current: Pair | None = None  # [m/s] of the water, north and east
    turns: int | None = None  # of the tether: whole turns of the drone to starboard


def shown_outputs(outputs: Sequence[Output], values: Mapping[str, float]) -> tuple[PageOutput, ...]:
    """
    Args:
        values: [-] by name; of those that are left out nothing is known.
    """
    return tuple(PageOutput(o.name, o.kind, values.get(o.name)) for o in outputs)


def turns(state: VehicleState | None) -> int | None:
    """Turns of the drone since its start, to starboard; None: its heading is not known."""
    if state is None or not state.heading.valid:
        return None
    return whole_turns(state.heading.value)


def chart_view(
    chart: Chart, state: VehicleState | None, status: VehicleStatus | None
) -> dict[str, Any]:
    """The fields of the map, from the newest state and status that are shown."""
    compass = None if state is None else state.heading_navigation
    goal = None if status is None or status.goal is UNSET else status.goal
    ahead = () if status is None or status.waypoints is UNSET else status.waypoints
    return {
        "place": chart.place(),
        "compass_deg": bearing(compass.value) if compass is not None and compass.valid else None,
        "home": chart.home(),
        "goal": goal,
        "waypoints": tuple((round(each.north, 2), round(each.east, 2)) for each in ahead),
        "current": current(state),
    }


def line(entry: LogEntry) -> PageLine:
    """As a page lists it. What a pilot need not know of is kept apart, with its service."""
    said = entry.line
    row = events.row_of(said.event) if said.event else None
    pilots = row is not None and row.severity in PILOTS and row.name not in BUSY
    text = harmless(said.text).replace("\n", "�") if pilots else printable(said)
    return PageLine(said.level, entry.last_s, entry.times, text, said.event, pilots)


def positions(command: PilotCommand | None, now: Ns) -> tuple[float, ...]:
    """Sticks of the command that was sent last; none once it does not act any more."""
    if command is None or now > command.stamp_ns + command.ttl_ms * 1e6:
        return ()
    return command.surge, command.sway, command.heave, command.yaw
