"""What every page is shown: the vehicle, and what only a page shows of it."""

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
from msgspec import UNSET

from messages import topics
from messages.control import ThrusterCommand
from messages.events import FAILSAFE_ACTED
from messages.pilot import PilotCommand
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.cockpit.chart import Chart, Pair, ShownPlace, current
from services.marine.attitude import whole_turns
from services.marine.outputs import Output, OutputKind
from services.vehicle_view import ages
from services.vehicle_view.log_lines import LogEntry, printable
from services.vehicle_view.view import VehicleView, bearing
from services.vehicle_view.words import Tone

# [ms] of its age table: old from when on, and not shown from when on. The page ages what it has
# while nothing arrives, and adds the way to the browser.
AGES_MS = {
    name: (table.grey_ns / 1e6, table.gone_ns / 1e6)
    for name, table in (("state", ages.STATE), ("picture", ages.PICTURE))
}


# A sentence of the page's languages by its key, with the numbers in it. Of an event its name is the
# key; with `.short` it is its name in few words, with `.do` what the pilot can do.
Sentence = tuple[str, dict[str, float]]


class PageLine(msgspec.Struct, frozen=True, array_like=True):
    """A line of the log."""

    level: str
    at_s: float | None  # [s] of the dive; None: before
    times: int
    text: str  # service and sentence
    event: str  # name of its row in the event table; empty: none


class PageOutput(msgspec.Struct, frozen=True, array_like=True):
    """Of the vehicle file: a light, lasers, a gripper."""

    name: str
    kind: OutputKind
    value: float | None  # [-] 0 … 1, of a gripper -1 … 1; None: not known


class PageView(VehicleView, frozen=True, kw_only=True, omit_defaults=True):
    """One picture of the drone."""

    drone: str = ""  # its name
    said: tuple[tuple[str, Tone], ...] = ()  # sentences, the gravest first
    numbers: tuple[tuple[str, str], ...] = ()  # (label, text)
    thrust: tuple[float, ...] = ()  # [-] share of each thruster's most, signed
    sticks: tuple[float, ...] = ()  # [-] surge, sway, heave, yaw as sent to the drone
    filming_s: float | None = None  # [s] that a film runs; None: none does
    snapshots: int = 0  # that were taken
    acting: tuple[Sentence, ...] = ()  # what is lost, why, what the drone does, what the pilot must
    tools: tuple[PageOutput, ...] = ()  # outputs of the vehicle, in the order of its file
    lines: tuple[PageLine, ...] = ()  # the newest last
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
    place: ShownPlace | None = None  # of the drone
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


def acting(view: VehicleView) -> tuple[Sentence, ...]:
    """While the drone acts by itself; empty: it does not."""
    if not view.acts:
        return ()
    name = FAILSAFE_ACTED(view.failsafe).name
    since: dict[str, float] = {} if view.since_s is None else {"s": round(view.since_s)}
    more: dict[str, float] = {} if view.next_s is None else {"s": round(max(0.0, view.next_s))}
    return (
        (f"{name}.short", {}),
        ("over", {}) if view.resumable else (name, since),
        (f"does.{view.doing}", more),
        (_to_do(view, name), {}),
    )


def _to_do(view: VehicleView, name: str) -> str:
    if view.returns == "centre":
        return "do.centre"
    return "do.resume" if view.resumable else f"{name}.do"


def turns(state: VehicleState | None) -> int | None:
    """Of the drone, since its start and to starboard; None: its heading is not known."""
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
    said = entry.line
    return PageLine(said.level, entry.last_s, entry.times, printable(said), said.event)


def positions(command: PilotCommand | None, now: Ns) -> tuple[float, ...]:
    """Of the command that was sent last; none once it does not act any more."""
    if command is None or now > command.stamp_ns + command.ttl_ms * 1e6:
        return ()
    return command.surge, command.sway, command.heave, command.yaw


def thrust(
    command: ThrusterCommand | None, limits: Sequence[tuple[float, float]], now: Ns
) -> tuple[float, ...]:
    """
    Args:
        limits: [N] least and most thrust of each thruster.
    """
    command = ages.shown(topics.THRUSTERS, command, now)
    if command is None:
        return ()
    shares = zip(command.thrust, limits, strict=False)
    return tuple(round(n / (most if n > 0.0 else -least), 2) for n, (least, most) in shares)
