"""Layout of the viewer: the page a pilot looks at first, and five more pages."""

from collections.abc import Callable, Sequence

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TimelineColumn

from messages.cameras import FIRST
from services.marine.vehicle import Vehicle

TIMELINE = "dive"  # [s] since the dive began
WATER = 0x0A1E2BFF
# [s] Shown before the cursor, and after it: room for the legend, which else hides the curves.
BEFORE_S, AFTER_S = 45.0, 17.0


def camera_path(camera: str) -> str:
    """Where a camera's pictures are in the viewer."""
    return "camera" if camera == FIRST else f"camera_{camera}"


def blueprint(vehicle: Vehicle, further: Sequence[str] = ()) -> rrb.Blueprint:
    """The layout for this vehicle.

    Args:
        further: cameras beside the first one.
    """
    shown = {**PAGES, "camera": lambda: _camera(further)}
    pages = [_dive(vehicle), *(page() for page in shown.values())]
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


def _motion() -> rrb.Grid:
    return rrb.Grid(
        _plot("depth_rate", "Depth rate [m/s], positive down"),
        _plot("yaw_rate", "Yaw rate [°/s]"),
        _plot("attitude", "Roll and pitch [°]"),
        _plot("velocity", "Velocity, body [m/s]"),
        _plot("depth_acceleration", "Depth acceleration [m/s²]"),
        _plot("yaw_acceleration", "Yaw acceleration of the reference [°/s²]"),
        rrb.Tabs(
            _plot("jerk/heave", "Jerk of the reference, heave [m/s³]"),
            _plot("jerk/yaw", "Jerk of the reference, yaw [°/s³]"),
            _plot("tilt", "Camera tilt [°], up"),
        ),
        _plot("track", "Place [m], NED"),
        rrb.Tabs(
            _plot("current", "Current of the water [m/s], NED"),
            _plot("uncertainty/depth", "Depth, one standard deviation [cm]"),
            _plot("uncertainty/heading", "Heading, one standard deviation [°]"),
        ),
        grid_columns=3,
        name="Motion",
    )


def _control() -> rrb.Grid:
    return rrb.Grid(
        _plot("force", "Force wanted [N]"),
        _plot("moment", "Moment wanted [N m]"),
        _plot("thrust_command", "Thrust asked for [N]"),
        _plot("force_achieved", "Force achieved [N]"),
        _plot("moment_achieved", "Moment achieved [N m]"),
        _plot("force_reference", "Force reference [N]"),
        rrb.Tabs(
            _plot("disturbance/force", "Disturbance learnt [N]"),
            _plot("disturbance/moment", "Disturbance learnt [N m]"),
        ),
        rrb.Tabs(
            _plot("integral/depth", "Integrator [N]"),
            _plot("integral/yaw", "Integrator [N m]"),
            _plot("tether_pull", "Pull of the tether [N], NED"),
        ),
        rrb.Tabs(
            _plot("drive_power", "Electrical power [W]"),
            _plot("device_age", "Age of the pad's answer [ms]"),
        ),
        grid_columns=3,
        name="Control",
    )


def _sensors() -> rrb.Grid:
    return rrb.Grid(
        _plot("specific_force", "Specific force [m/s²]"),
        _plot("angular_rate", "Angular rate [°/s]"),
        _plot("magnetic_field", "Magnetic field [µT]"),
        rrb.Tabs(
            _plot("pressure", "Pressure [kPa]"),
            _plot("pressure_age", "Age of the pressure sample [ms]"),
            _plot("altitude", "Height above the bottom [m]"),
        ),
        rrb.Tabs(
            _plot("compass", "Heading with magnetometer [°], turns added"),
            _plot("power/voltage", "Battery [V]"),
            _plot("power/current", "Battery [A]"),
            _plot("power/used", "Battery, used [Wh]"),
            _plot(
                "power",
                "Temperature [°C]",
                contents=["$origin/temperature", "$origin/enclosure"],
            ),
            _plot("power/leak", "Leak, 1: wet"),
        ),
        *_innovations(),
        grid_columns=3,
        name="Sensors",
    )


def _innovations() -> list[rrb.Tabs]:
    """What the estimator made of the measurements: each within its band, unless it is rejected."""
    return [
        rrb.Tabs(*(_plot(f"aiding/{source}", f"Innovation: {words}") for source, words in group))
        for group in INNOVATIONS
    ]


def _link() -> rrb.Grid:
    """The whole first, then what the link does to the messages, then what is made of it."""
    ends = ["$origin/**", "/latency/stick", "/latency/sensor"]
    logs = [f"$origin/{name}" for name in ("link_monitor", "tether", "predictor")]
    return rrb.Grid(
        _plot("whole", "End to end [ms]", contents=ends),
        rrb.Tabs(
            _plot("budget", "Stick to thruster [ms]"),
            _plot("budget_up", "Sensor to screen [ms]"),
            _plot("shown", "Screens [ms]"),
        ),
        _plot("link_p99", "Link delay p99, round trip [ms]"),
        _plot("link_loss", "Lost [%]"),
        _plot("link_queue", "Messages on the link"),
        _plot("link_rate", "Carried [kbit/s]"),
        rrb.Tabs(
            _plot("foresight", "Depth prediction error [cm]"),
            _plot("foresight_heading", "Heading prediction error [°]"),
        ),
        rrb.Tabs(
            _plot("clock", "Clocks: drone minus topside [ms]"),
            _plot("pings", "Pings sent"),
        ),
        _log("Link alarms", logs),
        grid_columns=3,
        name="Link",
    )


def _camera(further: Sequence[str] = ()) -> rrb.Grid:
    """What the drone sees, and how late the pilot sees it."""
    pictures = {FIRST if further else "Picture": FIRST, **{name: name for name in further}}
    return rrb.Grid(
        *(
            rrb.Spatial2DView(origin=f"/{camera_path(camera)}", name=name)
            for name, camera in pictures.items()
        ),
        _plot("picture", "Age of the picture [ms], by stage"),
        rrb.Tabs(
            _plot("picture_rate/pictures", "Pictures [1/s]"),
            _plot("picture_rate/carried", "Carried [kbit/s]"),
            _plot("picture_rate/all", "All cameras may send [kbit/s], by the large one"),
        ),
        grid_columns=2,
        name="Camera",
    )


def _health() -> rrb.Grid:
    return rrb.Grid(
        rrb.Tabs(
            _plot("health/counted", "Dropped, stale, refused …"),
            _plot("health/sent", "Sent"),
            _plot("health/received", "Received"),
        ),
        _plot("health/calls", "Handler calls [1/s]"),
        rrb.Tabs(
            _plot("health/late_p99", "Lateness p99 [ms]"),
            _plot("health/late_p50", "Lateness p50 [ms]"),
        ),
        _plot("health/processor", "Processor [% of a core]"),
        _plot("health/memory", "Memory [MB]"),
        grid_columns=3,
        name="Health",
    )


def _plot(
    path: str,
    name: str,
    *,
    limits: tuple[float, float] | None = None,
    contents: list[str] | None = None,
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=f"/{path}",
        contents=contents or "$origin/**",
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


# Panels of the Sensors page, each with a tab for every source of `messages/aiding.py` in it.
INNOVATIONS = (
    (("pressure", "depth [m]"),),
    (
        ("compass", "compass [°]"),
        ("rest_x", "gyroscope at rest, x [°/s]"),
        ("rest_y", "gyroscope at rest, y [°/s]"),
        ("rest_z", "gyroscope at rest, z [°/s]"),
    ),
    (
        ("hull_north", "thrust and drag, north [m/s²]"),
        ("hull_east", "thrust and drag, east [m/s²]"),
    ),
    (
        ("dvl_surge", "DVL, surge [m/s]"),
        ("dvl_sway", "DVL, sway [m/s]"),
        ("usbl_north", "USBL, north [m]"),
        ("usbl_east", "USBL, east [m]"),
    ),
)
# The pages behind the first one, which alone depends on the vehicle.
PAGES: dict[str, Callable[[], rrb.Grid]] = {
    "motion": _motion,
    "control": _control,
    "sensors": _sensors,
    "link": _link,
    "camera": _camera,
    "health": _health,
}
