"""All curves as one table: path, topic, names, colours and which numbers of a message they are.

Angles are converted to degrees, times to milliseconds, magnetic fields to microtesla. What is
unknown leaves a gap, never a zero.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees, sqrt
from typing import Any, cast

from messages import topics
from messages.events import troubles
from messages.link import DOWN_STAGES, UP_STAGES, Clock, Stage
from messages.message import Estimate
from messages.state import AidSource, VehicleState
from messages.topic import AnyTopic
from messages.video import PICTURE_STAGES, PictureAge
from services.marine.vehicle import Vehicle

CurveRow = Sequence[float]
Read = Callable[[Any], CurveRow | None]

# One colour per meaning, in every panel and in the scene. RGB.
REFERENCE, ESTIMATE, TRUTH = 0xFF9F2E, 0x4CA6FF, 0x9AA0A6
AXES = (0xEF6C6C, 0x66C285, 0x6C9DF0, 0xE0B04C, 0xB57EDC, 0x4FC4C4)
DOWN, UP, STICK = 0x5FD0C0, 0xC58BE8, 0xF2D34F
PREDICTED = 0xFF6FD8  # predicted present state: a colour of its own, because a pilot steers by it
TRUTHS = (0xB23B3B, 0x2F8F52, 0x3B66C4)  # of several axes in one panel: each axis, darker
BOUND = 0xC8CCD0  # the second line of a pair of limits
MANY = (*AXES, 0xF2D34F, 0xB6E34A, 0xF27FB2, 0xE8E8E8, 0xB08968, 0x7F8C8D)  # thrusters, services
LONGEST_MS = 60_000.0  # [ms] anything longer is a wrong stamp, not a latency
DEG = degrees(1.0)


@dataclass(frozen=True, slots=True)
class Look:
    """How curves that share an entity are drawn."""

    path: str
    names: tuple[str, ...]
    colours: tuple[int, ...]
    width: float = 1.5  # [px]


@dataclass(frozen=True, slots=True)
class Curve:
    """Curves that are read from one message; they share an entity."""

    topic: AnyTopic
    look: Look
    read: Read
    in_parts: bool = False  # a message that does not have it is of another source: no gap

    @property
    def path(self) -> str:
        return self.look.path


def curves(vehicle: Vehicle) -> list[Curve]:
    """Every curve of a dive with this vehicle."""
    return [*_pilot_and_sensors(), *_motion(), *_control(vehicle), *_link(), *_health()]


def _pilot_and_sensors() -> list[Curve]:
    body = ("forward", "starboard", "down")
    command, imu, battery = topics.PILOT_COMMAND, topics.IMU, topics.BATTERY
    sticks = ("surge", "sway", "heave", "yaw")
    dvl, usbl = ("surge, DVL", "sway, DVL"), ("north, USBL", "east, USBL")
    innovation = ("innovation", "+3σ", "-3σ")
    return [
        _row("sticks", command, sticks, AXES[:4], _fields(*sticks), 2),
        _row("device_age", command, "pad", STICK, _of("device_age_ms")),
        _row("specific_force", imu, body, AXES[:3], _of("specific_force")),
        _row("angular_rate", imu, body, AXES[:3], _of("angular_rate", DEG)),
        _row("magnetic_field", topics.MAGNETOMETER, body, AXES[:3], _of("field", 1e6)),
        _row("pressure", topics.PRESSURE, "water", ESTIMATE, _of("pressure", 1e-3)),
        _row("power/temperature", topics.PRESSURE, "water", AXES[0], _of("temperature")),
        _row("velocity/dvl", topics.DVL, dvl, AXES[4:], _of("velocity", part=slice(2))),
        _row("altitude", topics.ALTITUDE, "altimeter", ESTIMATE, _of("altitude")),
        _row("track/usbl", topics.USBL, usbl, AXES[4:], _fields("north", "east")),
        _row("power/voltage", battery, "battery", AXES[1], _of("voltage")),
        _row("power/current", battery, "battery", AXES[3], _of("current")),
        _row("power/leak", topics.LEAK, "leak", AXES[5], _of("wet")),
        _row("power/enclosure", topics.TEMPERATURE, "inside", AXES[2], _of("temperature")),
        _row("power/used", battery, "used", AXES[4], _of("used_wh")),
        # A plot each, `aiding/<quantity>`.
        _row("aiding", topics.AIDING, innovation, (ESTIMATE, TRUTH, TRUTH), _within_band),
    ]


def _motion() -> list[Curve]:
    """Reference, estimate and truth of each motion."""
    state, wanted, auto, truth = topics.STATE, topics.REFERENCE, topics.ESTIMATE, topics.TRUTH
    place, speed = ("north, truth", "east, truth"), ("surge, truth", "sway, truth", "heave, truth")
    tilt, ned, force = ("roll, truth", "pitch, truth"), ("north", "east", "down"), ("surge", "sway")
    return [
        *_three("depth", "depth.position", "depth", _of("position", part=slice(2, 3))),
        *_three("depth_rate", "depth.velocity", "depth_rate", _of("depth_rate")),
        *_three("heading", "heading.position", "heading", _of("heading", DEG), DEG),
        *_three(
            "yaw_rate",
            "heading.velocity",
            "yaw_rate",
            _of("angular_rate", DEG, slice(2, 3)),
            DEG,
        ),
        *_three("depth_acceleration", "depth.acceleration", "depth_acceleration"),
        _row("jerk/heave", wanted, "reference", REFERENCE, _of("depth.jerk")),
        _row("jerk/yaw", wanted, "reference", REFERENCE, _of("heading.jerk", DEG)),
        _row("yaw_acceleration", wanted, "reference", REFERENCE, _of("heading.acceleration", DEG)),
        _row("tilt", wanted, "reference", REFERENCE, _of("tilt.position", DEG)),
        _row("force_reference", wanted, force, AXES[:2], _fields("surge_force", "sway_force")),
        _row("track/north_reference", wanted, "north, reference", REFERENCE, _of("north.position")),
        _row("track/east_reference", wanted, "east, reference", STICK, _of("east.position")),
        _row("attitude/roll", state, "roll", AXES[0], _of("roll.value", DEG)),
        _row("attitude/pitch", state, "pitch", AXES[1], _of("pitch.value", DEG)),
        _row("uncertainty/depth", state, "depth", ESTIMATE, _of("depth.std", 100.0)),
        _row("uncertainty/heading", state, "heading", ESTIMATE, _of("heading.std", DEG)),
        _row("compass", state, "navigation", ESTIMATE, _navigation),
        _row("velocity/surge", state, "surge", AXES[0], _of("surge_velocity")),
        _row("velocity/sway", state, "sway", AXES[1], _of("sway_velocity")),
        _row("track/north", state, "north", AXES[0], _of("north")),
        _row("track/east", state, "east", AXES[1], _of("east")),
        _row("current/north", state, "north", AXES[0], _of("current_north")),
        _row("current/east", state, "east", AXES[1], _of("current_east")),
        _row("pressure_age", state, "pressure", ESTIMATE, _of("pressure_age_ms")),
        # What the vehicle's own autopilot estimates, in imported recordings.
        _part("depth/autopilot", auto, "autopilot", STICK, _of("depth")),
        _part("depth_rate/autopilot", auto, "autopilot", STICK, _of("depth_rate")),
        _part("heading/autopilot", auto, "autopilot", STICK, _of("heading", DEG)),
        _part("attitude/autopilot_roll", auto, "roll, autopilot", AXES[2], _of("roll", DEG)),
        _part("attitude/autopilot_pitch", auto, "pitch, autopilot", AXES[3], _of("pitch", DEG)),
        _row("velocity/truth", truth, speed, TRUTHS, _of("velocity")),
        _row("track/truth", truth, place, TRUTHS[:2], _of("position", part=slice(2))),
        _row("current/truth", truth, place, TRUTHS[:2], _of("current", part=slice(2))),
        _row("tether_pull", truth, ned, AXES[:3], _of("tether_pull")),
        _row("attitude/truth", truth, tilt, TRUTHS[:2], _fields("roll", "pitch", unit=DEG)),
    ]


def _control(vehicle: Vehicle) -> list[Curve]:
    thrusters = tuple(thruster.name for thruster in vehicle.thruster)
    colours = tuple(MANY[i % len(MANY)] for i in range(len(thrusters)))
    wrench, done = topics.WRENCH, topics.ACTUATION
    force, moment = ("surge", "sway", "heave"), ("roll", "pitch", "yaw")
    forces, moments, rgb = slice(3), slice(3, 6), AXES[:3]
    sensor, stick = _way("sensor_ns", "actuated_ns"), _way("pilot_ns", "actuated_ns")
    return [
        _row("force/wanted", wrench, force, rgb, _of("wanted", part=forces)),
        _row("force_achieved", wrench, force, rgb, _of("achieved", part=forces)),
        _row("moment/wanted", wrench, moment, rgb, _of("wanted", part=moments)),
        _row("moment_achieved", wrench, moment, rgb, _of("achieved", part=moments)),
        _row("integral/depth", wrench, "heave", ESTIMATE, _of("depth_integral")),
        _row("integral/yaw", wrench, "yaw", REFERENCE, _of("heading_integral")),
        _row("disturbance/force", wrench, force, rgb, _of("disturbance", part=forces)),
        _row("disturbance/moment", wrench, moment, rgb, _of("disturbance", part=moments)),
        _row("thrust_command", topics.THRUSTERS, thrusters, colours, _of("thrust")),
        _row("thrust", done, thrusters, colours, _of("thrust")),
        _row("drive_power", done, "thrusters", AXES[3], _of("power")),
        _row("latency/sensor", done, "sensor → thruster", AXES[1], sensor),
        # Of the pilot command behind the thrust: rises while commands do not arrive.
        _row("latency/stick", done, "age of stick", STICK, stick),
    ]


def _link() -> list[Curve]:
    """Delays, clocks, the latency budget, the prediction and the age of the picture."""
    clock, budget, ahead = topics.CLOCK, topics.LATENCY, topics.PREDICTION
    age, further = topics.PICTURE_AGE, topics.FURTHER_AGE
    stages = (*AXES, STICK)[: len(DOWN_STAGES)]
    total = ("light to picture p50", "p99")
    return [
        *_direction("down", DOWN),
        *_direction("up", UP),
        _row("link_p99/rtt", topics.LINK, "rtt p50", TRUTH, _of("rtt_ms")),
        _row("clock/offset", clock, "drone - topside", ESTIMATE, _of("offset_ns", 1e-6)),
        _row("clock/bound", clock, ("at least", "at most"), (TRUTH, BOUND), _bounds),
        _row("link_p99/ping", clock, "rtt, ping", STICK, _of("rtt_ms")),
        _row(
            "clock/turnaround",
            topics.CLOCK_PONG,
            "ping → pong on board",
            AXES[3],
            _way("heard_ns", "stamp_ns"),
        ),
        _row("pings", topics.CLOCK_PING, "sent", AXES[4], _of("seq")),
        _row("budget/down", budget, DOWN_STAGES, stages, _medians("down", DOWN_STAGES)),
        _row("budget_up/up", budget, UP_STAGES, AXES[:3], _medians("up", UP_STAGES)),
        _row("whole/stick", budget, "stick → thruster", REFERENCE, _of("stick_to_thruster_ms")),
        _row("whole/screen", budget, "sensor → screen", ESTIMATE, _of("sensor_to_screen_ms")),
        _row("shown", topics.SHOWN, (), (), _way("sensor_ns", "stamp_ns")),
        _row("depth/predicted", ahead, "predicted now", PREDICTED, _of("depth")),
        _row("heading/predicted", ahead, "predicted now", PREDICTED, _of("heading", DEG)),
        _row("picture/stages", age, PICTURE_STAGES, AXES[:3], _picture_stages),
        _row("picture/total", age, total, (UP, TRUTH), _fields("total.p50_ms", "total.p99_ms"), 2),
        _row("picture/now", age, "age now", STICK, _of("age_ms")),
        _row("picture_rate/pictures", age, "pictures", UP, _of("per_second")),
        _row("picture_rate/carried", age, "carried", DOWN, _of("heard_kbit")),
        _row("picture/further", further, (), (), _of("age_ms")),
        _row("picture_rate/pictures/further", further, (), (), _of("per_second")),
        _row("picture_rate/all", topics.CAMERA_SHARES, (), (), _of("total_kbit")),
        _row("picture_rate/carried/further", further, (), (), _of("heard_kbit")),
    ]


def _health() -> list[Curve]:
    """Per service: the entity `<path>/<service>` names itself."""
    reads: dict[str, Read] = {
        "calls": _of("loop_hz"),
        "late_p50": _of("lateness_p50_ms"),
        "late_p99": _of("lateness_p99_ms"),
        "processor": _of("cpu_percent"),
        "memory": _of("rss_mb"),
        "sent": _of("sent"),
        "received": _of("received"),
        "counted": lambda m: (float(troubles(m.counts)),),
    }
    return [_row(f"health/{name}", topics.HEALTH, (), (), read) for name, read in reads.items()]


# Rows of the table.


def _row(
    path: str,
    topic: AnyTopic,
    names: str | tuple[str, ...],
    colours: int | tuple[int, ...],
    read: Read,
    width: float = 1.5,
) -> Curve:
    """One name and colour, or several."""
    named = (names,) if isinstance(names, str) else names
    coloured = (colours,) if isinstance(colours, int) else colours
    return Curve(topic, Look(path, named, coloured[: len(named)], width), read)


def _part(path: str, topic: AnyTopic, name: str, colour: int, read: Read) -> Curve:
    return Curve(topic, Look(path, (name,), (colour,)), read, in_parts=True)


def _three(
    path: str, reference: str, estimate: str, truth: Read | None = None, unit: float = 1.0
) -> list[Curve]:
    seen = _of(estimate, unit)
    found = [
        _row(f"{path}/reference", topics.REFERENCE, "reference", REFERENCE, _of(reference, unit)),
        # The others are drawn on top of it.
        _row(f"{path}/estimate", topics.STATE, "estimate", ESTIMATE, seen, 3),
    ]
    if truth is not None:
        found.append(_row(f"{path}/truth", topics.TRUTH, "truth", TRUTH, truth))
    return found


def _direction(name: str, rgb: int) -> list[Curve]:
    """One direction of the link."""
    side, link = f"{name}_link", topics.LINK
    return [
        _row(f"latency/link_{name}", link, f"link {name}", rgb, _of(f"{side}.delay_p50_ms")),
        _row(f"link_p99/{name}", link, f"{name} p99", rgb, _of(f"{side}.delay_p99_ms")),
        _row(f"link_queue/{name}", link, name, rgb, _of(f"{side}.queued")),
        _row(f"link_loss/{name}", link, name, rgb, _of(f"{side}.loss", 100.0)),
        _row(f"link_rate/{name}", link, name, rgb, _of(f"{side}.rate_kbit")),
    ]


# How a message becomes numbers.


def _value(message: Any, names: Sequence[str]) -> Any:
    """The value of a field of a field; None where one of them is not known."""
    for name in names:
        if message is None:
            return None
        message = getattr(message, name)
    if isinstance(message, Estimate):
        return message.value if message.valid else None
    return message


def _of(field: str, unit: float = 1.0, part: slice | None = None) -> Read:
    """A number or numbers of a message, such as `depth.position`, each times a unit.

    Args:
        part: of several numbers; None: all.
    """
    names = field.split(".")

    def read(message: Any) -> CurveRow | None:
        value = _value(message, names)
        if value is None:
            return None
        if isinstance(value, Sequence):
            several = cast(Sequence[float], value)
            return [unit * one for one in (several if part is None else several[part])]
        return (unit * value,)

    return read


def _fields(*fields: str, unit: float = 1.0) -> Read:
    """Several fields; all of them are known, or none."""
    every = [field.split(".") for field in fields]

    def read(message: Any) -> CurveRow | None:
        values = [_value(message, names) for names in every]
        return None if None in values else [unit * value for value in values]

    return read


def _way(begin: str, end: str) -> Read:
    """[ms] From one stamp of a message to another."""

    def read(message: Any) -> CurveRow | None:
        began, ended = getattr(message, begin), getattr(message, end)
        if began is None or ended is None:
            return None
        way = (ended - began) / 1e6
        return (way,) if 0.0 <= way <= LONGEST_MS else None

    return read


def _medians(field: str, names: tuple[str, ...]) -> Read:
    def read(message: Any) -> CurveRow | None:
        stages: tuple[Stage, ...] | None = getattr(message, field)
        if stages is None or tuple(stage.name for stage in stages) != names:
            return None
        return [stage.p50_ms for stage in stages]

    return read


def _picture_stages(m: PictureAge) -> CurveRow | None:
    """Recordings of before have one more."""
    known = {stage.name: stage.p50_ms for stage in m.stages or ()}
    whole = known.keys() >= set(PICTURE_STAGES)
    return [known[name] for name in PICTURE_STAGES] if whole else None


def _within_band(source: AidSource) -> CurveRow | None:
    """What the estimator made of a measurement: the innovation within what it expects."""
    if source.innovation is None or source.variance is None:
        return None
    unit = DEG if source.unit.startswith("rad") else 1.0
    band = 3.0 * unit * sqrt(source.variance)
    return unit * source.innovation, band, -band


def _navigation(m: VehicleState) -> CurveRow | None:
    """[°] As the heading is counted, which goes on beyond a full turn: the two can be compared."""
    compass = m.heading_navigation
    if compass is None or not compass.valid:
        return None
    turned = degrees(m.heading.value)
    return (turned + (degrees(compass.value) - turned + 180.0) % 360.0 - 180.0,)


def _bounds(m: Clock) -> CurveRow | None:
    if m.offset_ns is None or m.bound_ns is None:
        return None
    return (m.offset_ns - m.bound_ns) / 1e6, (m.offset_ns + m.bound_ns) / 1e6
