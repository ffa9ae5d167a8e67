"""Layout of the viewer: the page a pilot looks at first, and five more pages."""

from collections.abc import Sequence
from typing import NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from messages.cameras import FIRST
from services.marine.vehicle import Vehicle

TIMELINE = "dive"  # [s] since the dive began
WATER = 0x0A1E2BFF
# [s] Shown before the cursor, and after it: room for the legend, which else hides the curves.
BEFORE_S, AFTER_S = 45.0, 17.0
ALL = ("$origin/**",)  # below a path


class Plot(NamedTuple):
    """One plot: its path, what stands above it, and what is in it."""

    path: str
    name: str
    contents: Sequence[str] = ALL


Cell = Plot | tuple[Plot, ...] | rrb.View


def camera_path(camera: str) -> str:
    """Where a camera's pictures are in the viewer."""
    return "camera" if camera == FIRST else f"camera_{camera}"


def blueprint(vehicle: Vehicle, further: Sequence[str] = ()) -> rrb.Blueprint:
    """The layout for this vehicle.

    Args:
        further: cameras beside the first one.
    """
    grids = _grid("Motion", MOTION), _grid("Control", CONTROL), _grid("Sensors", SENSORS)
    pages = [_dive(vehicle), *grids, _link(), _camera(further), _grid("Health", HEALTH)]
    return rrb.Blueprint(
        rrb.Tabs(contents=pages, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
        auto_layout=False,
    )


def _dive(vehicle: Vehicle) -> rrb.Horizontal:
    left = rrb.Vertical(_scene(vehicle), _states(), row_shares=[1.6, 1])
    ways = ["$origin/link_down", "$origin/link_up", "$origin/stick", "/whole/screen"]
    middle = rrb.Vertical(
        _plot("depth", "Depth [m], positive down"),
        _plot("heading", "Heading [°], clockwise, turns added"),
        _plot("thrust", "Thrust [N]"),
        _plot("latency", "Latency [ms]", contents=ways),
    )
    right = rrb.Vertical(
        rrb.TextDocumentView(origin="/status", name="Status"),
        _plot("sticks", "Sticks, full = 1", limits=(-1.1, 1.1)),
        _log("Log"),
        row_shares=[1.6, 1, 1.4],
    )
    return rrb.Horizontal(left, middle, right, column_shares=[3, 2.4, 2], name="Dive")


def _scene(vehicle: Vehicle) -> rrb.Spatial3DView:
    flown = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    back = 3.5 * max(vehicle.size)
    return rrb.Spatial3DView(
        origin="/world/chase",  # travels with the vehicle but does not turn with it
        contents="/world/**",
        name=f"{vehicle.name} · orange: reference · pink: predicted now",
        background=WATER,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=(-0.8 * back, -back, -0.4 * back),
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, 0.0, -1.0),
        ),
        overrides={"world/path": [flown]},
    )


def _states() -> rrb.StateTimelineView:
    lanes = ("activity", "flight_mode", "armed", "failsafe", "link", "pilot")
    return rrb.StateTimelineView(
        origin="/state",
        contents=[f"$origin/{lane}" for lane in lanes],
        name="States",
        time_view=_window(),
    )


def _log(name: str, contents: list[str] | None = None) -> rrb.TextLogView:
    # Each line begins with its time; the viewer's own column is too narrow to be read.
    hidden = TimelineColumn(TIMELINE, visible=False)
    columns = rrb.TextLogColumns(timeline_columns=[hidden], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(
        origin="/log", contents=contents or "$origin/**", name=name, columns=columns
    )


def _grid(name: str, cells: Sequence[Cell], columns: int = 3) -> rrb.Grid:
    """A page of equal panels."""
    return rrb.Grid(*map(_cell, cells), grid_columns=columns, name=name)


def _cell(cell: Cell) -> rrb.View | rrb.Tabs:
    if isinstance(cell, Plot):
        return _plot(*cell)
    return rrb.Tabs(*(_plot(*tab) for tab in cell)) if isinstance(cell, tuple) else cell


def _camera(further: Sequence[str] = ()) -> rrb.Grid:
    """What the drone sees, and how late the pilot sees it."""
    pictures = {FIRST if further else "Picture": FIRST, **{name: name for name in further}}
    views = [
        rrb.Spatial2DView(origin=f"/{camera_path(camera)}", name=name)
        for name, camera in pictures.items()
    ]
    return _grid("Camera", [*views, *PICTURES], columns=2)


def _link() -> rrb.Grid:
    """The whole first, then what the link does to the messages, then what is made of it."""
    logs = [f"$origin/{name}" for name in ("link_monitor", "tether", "predictor")]
    return _grid("Link", [*LINK, _log("Link alarms", logs)])


def _plot(
    path: str,
    name: str,
    contents: Sequence[str] = ALL,
    limits: tuple[float, float] | None = None,
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=f"/{path}",
        contents=list(contents),
        name=name,
        axis_x=_window(),
        axis_y=None if limits is None else rrb.ScalarAxis(range=limits),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.RightTop),  # over what is not yet
    )


def _window() -> rrb.TimeAxis:
    """The newest, and room for a legend: of itself rerun has the cursor in the middle, and half of
    every plot of a dive that goes on would be empty."""
    edge = rr.TimeRangeBoundary.cursor_relative
    return rrb.TimeAxis(view_range=rr.TimeRange(edge(seconds=-BEFORE_S), edge(seconds=AFTER_S)))


# A panel is a plot, or several in tabs: their path and what stands above them.
MOTION = (
    Plot("depth_rate", "Depth rate [m/s], positive down"),
    Plot("yaw_rate", "Yaw rate [°/s]"),
    Plot("attitude", "Roll and pitch [°]"),
    Plot("velocity", "Velocity, body [m/s]"),
    Plot("depth_acceleration", "Depth acceleration [m/s²]"),
    Plot("yaw_acceleration", "Yaw acceleration of the reference [°/s²]"),
    (
        Plot("jerk/heave", "Jerk of the reference, heave [m/s³]"),
        Plot("jerk/yaw", "Jerk of the reference, yaw [°/s³]"),
        Plot("tilt", "Camera tilt [°], up"),
    ),
    Plot("track", "Place [m], NED"),
    (
        Plot("current", "Current of the water [m/s], NED"),
        Plot("uncertainty/depth", "Depth, one standard deviation [cm]"),
        Plot("uncertainty/heading", "Heading, one standard deviation [°]"),
    ),
)
CONTROL = (
    Plot("force", "Force wanted [N]"),
    Plot("moment", "Moment wanted [N m]"),
    Plot("thrust_command", "Thrust asked for [N]"),
    Plot("force_achieved", "Force achieved [N]"),
    Plot("moment_achieved", "Moment achieved [N m]"),
    Plot("force_reference", "Force reference [N]"),
    (
        Plot("disturbance/force", "Disturbance learnt [N]"),
        Plot("disturbance/moment", "Disturbance learnt [N m]"),
    ),
    (
        Plot("integral/depth", "Integrator [N]"),
        Plot("integral/yaw", "Integrator [N m]"),
        Plot("tether_pull", "Pull of the tether [N], NED"),
    ),
    (
        Plot("drive_power", "Electrical power [W]"),
        Plot("device_age", "Age of the pad's answer [ms]"),
    ),
)
SENSORS = (
    Plot("specific_force", "Specific force [m/s²]"),
    Plot("angular_rate", "Angular rate [°/s]"),
    Plot("magnetic_field", "Magnetic field [µT]"),
    (
        Plot("pressure", "Pressure [kPa]"),
        Plot("pressure_age", "Age of the pressure sample [ms]"),
        Plot("altitude", "Height above the bottom [m]"),
    ),
    (
        Plot("compass", "Heading with magnetometer [°], turns added"),
        Plot("power/voltage", "Battery [V]"),
        Plot("power/current", "Battery [A]"),
        Plot("power/used", "Battery, used [Wh]"),
        Plot("power", "Temperature [°C]", ("$origin/temperature", "$origin/enclosure")),
        Plot("power/leak", "Leak, 1: wet"),
    ),
    # What the estimator made of each source of `messages/state.py`: within its band, unless it is
    # rejected.
    (Plot("aiding/pressure", "Innovation: depth [m]"),),
    (
        Plot("aiding/compass", "Innovation: compass [°]"),
        Plot("aiding/rest_x", "Innovation: gyroscope at rest, x [°/s]"),
        Plot("aiding/rest_y", "Innovation: gyroscope at rest, y [°/s]"),
        Plot("aiding/rest_z", "Innovation: gyroscope at rest, z [°/s]"),
    ),
    (
        Plot("aiding/hull_north", "Innovation: thrust and drag, north [m/s²]"),
        Plot("aiding/hull_east", "Innovation: thrust and drag, east [m/s²]"),
    ),
    (
        Plot("aiding/dvl_surge", "Innovation: DVL, surge [m/s]"),
        Plot("aiding/dvl_sway", "Innovation: DVL, sway [m/s]"),
        Plot("aiding/usbl_north", "Innovation: USBL, north [m]"),
        Plot("aiding/usbl_east", "Innovation: USBL, east [m]"),
    ),
)
LINK = (
    Plot("whole", "End to end [ms]", (*ALL, "/latency/stick", "/latency/sensor")),
    (
        Plot("budget", "Stick to thruster [ms]"),
        Plot("budget_up", "Sensor to screen [ms]"),
        Plot("shown", "Screens [ms]"),
    ),
    Plot("link_p99", "Link delay p99, round trip [ms]"),
    Plot("link_loss", "Lost [%]"),
    Plot("link_queue", "Messages on the link"),
    Plot("link_rate", "Carried [kbit/s]"),
    (Plot("clock", "Clocks: drone minus topside [ms]"), Plot("pings", "Pings sent")),
)
PICTURES = (
    Plot("picture", "Age of the picture [ms], by stage"),
    (
        Plot("picture_rate/pictures", "Pictures [1/s]"),
        Plot("picture_rate/carried", "Carried [kbit/s]"),
        Plot("picture_rate/all", "All cameras may send [kbit/s], by the large one"),
    ),
)
HEALTH = (
    (
        Plot("health/counted", "Dropped, stale, refused …"),
        Plot("health/sent", "Sent"),
        Plot("health/received", "Received"),
    ),
    Plot("health/calls", "Handler calls [1/s]"),
    (Plot("health/late_p99", "Lateness p99 [ms]"), Plot("health/late_p50", "Lateness p50 [ms]")),
    Plot("health/processor", "Processor [% of a core]"),
    Plot("health/memory", "Memory [MB]"),
)
