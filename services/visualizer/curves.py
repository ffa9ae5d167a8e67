"""All curves: path, topic, names, colours and how to read the numbers from a message.

Angles are converted to degrees, times to milliseconds, magnetic fields to microtesla. A reader
returns None where a value is unknown: that leaves a gap, never a zero.
"""

from collections.abc import Callable
from math import degrees, sqrt
from typing import Any

from messages import topics
from messages.aiding import AidSource
from messages.events import troubles
from messages.message import Estimate
from messages.reference import Reference
from messages.state import VehicleState
from messages.vehicle import Actuation
from services.marine.vehicle import Vehicle
from services.visualizer.curve import (
    AXES,
    ESTIMATE,
    MANY,
    REFERENCE,
    STICK,
    TRUTH,
    TRUTHS,
    Curve,
    CurveRow,
    Look,
    Read,
    in_degrees,
    known,
    number,
    way_ms,
)
from services.visualizer.felt_jerk import JerkLines
from services.visualizer.link_curves import link_curves
from services.visualizer.thruster_changes import LOOK as THRUSTER_CHANGES


def curves(vehicle: Vehicle) -> list[Curve]:
    """Every curve of a dive with this vehicle."""
    thrusters = tuple(t.name for t in vehicle.thruster)
    return [
        *_pilot(),
        *_sensors(),
        _aiding(),
        *_motion(),
        *_control(thrusters),
        *link_curves(),
        *_health(),
    ]


def computed() -> list[Look]:
    """Curves that are not read from single messages."""
    return [*JerkLines().looks, THRUSTER_CHANGES]


def _pilot() -> list[Curve]:
    command, four = topics.PILOT_COMMAND, ("surge", "sway", "heave", "yaw")
    return [
        Curve("sticks", command, four, AXES[:4], lambda m: (m.surge, m.sway, m.heave, m.yaw), 2),
        Curve("device_age", command, ("pad",), (STICK,), lambda m: (m.device_age_ms,)),
    ]


def _sensors() -> list[Curve]:
    imu, body, battery = topics.IMU, ("forward", "starboard", "down"), topics.BATTERY
    return [
        Curve("specific_force", imu, body, AXES[:3], lambda m: m.specific_force),
        Curve("angular_rate", imu, body, AXES[:3], lambda m: in_degrees(m.angular_rate)),
        Curve("magnetic_field", topics.MAGNETOMETER, body, AXES[:3], _microtesla),
        Curve("pressure", topics.PRESSURE, ("water",), (ESTIMATE,), lambda m: (m.pressure / 1e3,)),
        Curve("power/temperature", topics.PRESSURE, ("water",), (AXES[0],), _temperature),
        Curve("velocity/dvl", topics.DVL, ("surge, DVL", "sway, DVL"), AXES[4:], _dvl),
        Curve("altitude", topics.ALTITUDE, ("altimeter",), (ESTIMATE,), lambda m: (m.altitude,)),
        Curve("track/usbl", topics.USBL, ("north, USBL", "east, USBL"), AXES[4:], _usbl),
        Curve("power/voltage", battery, ("battery",), (AXES[1],), lambda m: (m.voltage,)),
        Curve("power/current", battery, ("battery",), (AXES[3],), lambda m: (m.current,)),
        Curve("power/leak", topics.LEAK, ("leak",), (AXES[5],), _wet),
        Curve("power/enclosure", topics.TEMPERATURE, ("inside",), (AXES[2],), _temperature),
        Curve("power/used", battery, ("used",), (AXES[4],), lambda m: (m.used_wh,)),
    ]


def _aiding() -> Curve:
    """What the estimator made of each measurement: the innovation within what it expects. A plot
    each, `aiding/<quantity>`."""
    names, colours = ("innovation", "+3σ", "-3σ"), (ESTIMATE, TRUTH, TRUTH)
    return Curve("aiding", topics.AIDING, names, colours, _within_band)


def _within_band(source: AidSource) -> CurveRow | None:
    if source.innovation is None or source.variance is None:
        return None
    unit = degrees(1.0) if source.unit.startswith("rad") else 1.0
    band = 3.0 * unit * sqrt(source.variance)
    return unit * source.innovation, band, -band


def _motion() -> list[Curve]:
    """Reference, estimate and truth of each motion."""
    return [
        *_three("depth", lambda m: m.depth.position, lambda m: m.depth, lambda m: m.position[2]),
        *_three("depth_rate", lambda m: m.depth.velocity, lambda m: m.depth_rate, _depth_rate),
        *_three("heading", lambda m: m.heading.position, lambda m: m.heading, _heading, degrees),
        *_three("yaw_rate", lambda m: m.heading.velocity, lambda m: m.yaw_rate, _yaw_rate, degrees),
        *_pair(
            "depth_acceleration", lambda m: m.depth.acceleration, lambda m: m.depth_acceleration
        ),
        *_references(),
        *_estimates(),
        *_autopilot(),
        *_truths(),
    ]


def _references() -> list[Curve]:
    topic, wanted = topics.REFERENCE, (("reference",), (REFERENCE,))
    return [
        Curve("jerk/heave", topic, *wanted, lambda m: (m.depth.jerk,)),
        Curve("jerk/yaw", topic, *wanted, lambda m: (degrees(m.heading.jerk),)),
        Curve("yaw_acceleration", topic, ("reference",), (REFERENCE,), _yaw_acceleration),
        Curve("tilt", topic, ("reference",), (REFERENCE,), lambda m: (degrees(m.tilt.position),)),
        Curve("force_reference", topic, ("surge", "sway"), AXES[:2], _reference_force),
        Curve("track/north_reference", topic, ("north, reference",), (REFERENCE,), _north),
        Curve("track/east_reference", topic, ("east, reference",), (STICK,), _east),
    ]


def _estimates() -> list[Curve]:
    topic = topics.STATE
    single: list[tuple[str, str, int, Read]] = [
        ("attitude/roll", "roll", AXES[0], lambda m: (degrees(m.roll.value),)),
        ("attitude/pitch", "pitch", AXES[1], lambda m: (degrees(m.pitch.value),)),
        ("uncertainty/depth", "depth", ESTIMATE, lambda m: (100 * m.depth.std,)),
        ("uncertainty/heading", "heading", ESTIMATE, lambda m: (degrees(m.heading.std),)),
        ("compass", "navigation", ESTIMATE, _navigation),
        ("velocity/surge", "surge", AXES[0], lambda m: known(m.surge_velocity)),
        ("velocity/sway", "sway", AXES[1], lambda m: known(m.sway_velocity)),
        ("track/north", "north", AXES[0], lambda m: known(m.north)),
        ("track/east", "east", AXES[1], lambda m: known(m.east)),
        ("current/north", "north", AXES[0], lambda m: known(m.current_north)),
        ("current/east", "east", AXES[1], lambda m: known(m.current_east)),
        ("pressure_age", "pressure", ESTIMATE, lambda m: number(m.pressure_age_ms)),
    ]
    return [Curve(path, topic, (name,), (rgb,), read) for path, name, rgb, read in single]


def _autopilot() -> list[Curve]:
    """What the vehicle's own autopilot estimates, in imported recordings."""
    single: list[tuple[str, str, int, Read]] = [
        ("depth/autopilot", "autopilot", STICK, lambda m: number(m.depth)),
        ("depth_rate/autopilot", "autopilot", STICK, lambda m: number(m.depth_rate)),
        ("heading/autopilot", "autopilot", STICK, lambda m: _angle(m.heading)),
        ("attitude/autopilot_roll", "roll, autopilot", AXES[2], lambda m: _angle(m.roll)),
        ("attitude/autopilot_pitch", "pitch, autopilot", AXES[3], lambda m: _angle(m.pitch)),
    ]
    return [
        Curve(path, topics.ESTIMATE, (name,), (rgb,), read, in_parts=True)
        for path, name, rgb, read in single
    ]


def _navigation(m: VehicleState) -> CurveRow | None:
    """[°] As the heading is counted, which goes on beyond a full turn: the two can be compared."""
    found = known(m.heading_navigation, degrees)
    if found is None:
        return None
    turned = degrees(m.heading.value)
    return (turned + (found[0] - turned + 180.0) % 360.0 - 180.0,)


def _angle(radians: float | None) -> CurveRow | None:
    return None if radians is None else (degrees(radians),)


def _truths() -> list[Curve]:
    topic = topics.TRUTH
    speed, place = ("surge, truth", "sway, truth", "heave, truth"), ("north, truth", "east, truth")
    tilt = ("roll, truth", "pitch, truth")
    return [
        Curve("velocity/truth", topic, speed, TRUTHS, lambda m: m.velocity),
        Curve("track/truth", topic, place, TRUTHS[:2], lambda m: m.position[:2]),
        Curve("current/truth", topic, place, TRUTHS[:2], _current),
        Curve("tether_pull", topic, ("north", "east", "down"), AXES[:3], lambda m: m.tether_pull),
        Curve("attitude/truth", topic, tilt, TRUTHS[:2], lambda m: in_degrees((m.roll, m.pitch))),
    ]


def _control(thrusters: tuple[str, ...]) -> list[Curve]:
    wrench, force = topics.WRENCH, ("surge", "sway", "heave")
    moment = ("roll", "pitch", "yaw")
    colours = tuple(MANY[i % len(MANY)] for i in range(len(thrusters)))
    return [
        Curve("force/wanted", wrench, force, AXES[:3], lambda m: m.wanted[:3]),
        Curve("force_achieved", wrench, force, AXES[:3], lambda m: m.achieved[:3]),
        Curve("moment/wanted", wrench, moment, AXES[:3], lambda m: m.wanted[3:]),
        Curve("moment_achieved", wrench, moment, AXES[:3], lambda m: m.achieved[3:]),
        Curve("integral/depth", wrench, ("heave",), (ESTIMATE,), lambda m: (m.depth_integral,)),
        Curve("integral/yaw", wrench, ("yaw",), (REFERENCE,), lambda m: (m.heading_integral,)),
        Curve("disturbance/force", wrench, force, AXES[:3], lambda m: m.disturbance[:3]),
        Curve("disturbance/moment", wrench, moment, AXES[:3], lambda m: m.disturbance[3:]),
        Curve("thrust_command", topics.THRUSTERS, thrusters, colours, lambda m: m.thrust),
        Curve("thrust", topics.ACTUATION, thrusters, colours, lambda m: m.thrust),
        Curve("drive_power", topics.ACTUATION, ("thrusters",), (AXES[3],), lambda m: (m.power,)),
        Curve("latency/sensor", topics.ACTUATION, ("sensor → thruster",), (AXES[1],), _sensor_way),
        Curve("latency/stick", topics.ACTUATION, ("age of stick",), (STICK,), _stick_way),
    ]


def _health() -> list[Curve]:
    """Per service: the entity `<path>/<service>` names itself."""
    reads: list[tuple[str, Read]] = [
        ("health/calls", lambda m: (m.loop_hz,)),
        ("health/late_p50", lambda m: number(m.lateness_p50_ms)),
        ("health/late_p99", lambda m: number(m.lateness_p99_ms)),
        ("health/processor", lambda m: number(m.cpu_percent)),
        ("health/memory", lambda m: number(m.rss_mb)),
        ("health/sent", lambda m: (float(m.sent),)),
        ("health/received", lambda m: (float(m.received),)),
        ("health/counted", lambda m: (float(troubles(m.counts)),)),
    ]
    return [Curve(path, topics.HEALTH, (), (), read) for path, read in reads]


# How a number becomes a row.


def _three(
    path: str,
    reference: Callable[[Any], float],
    estimate: Callable[[Any], Estimate],
    truth: Callable[[Any], float],
    unit: Callable[[float], float] = float,
) -> list[Curve]:
    grey = Curve(f"{path}/truth", topics.TRUTH, ("truth",), (TRUTH,), lambda m: (unit(truth(m)),))
    return [*_pair(path, reference, estimate, unit), grey]


def _pair(
    path: str,
    reference: Callable[[Any], float],
    estimate: Callable[[Any], Estimate],
    unit: Callable[[float], float] = float,
) -> list[Curve]:
    def wanted(m: Reference) -> CurveRow:
        return (unit(reference(m)),)

    return [
        Curve(f"{path}/reference", topics.REFERENCE, ("reference",), (REFERENCE,), wanted),
        Curve(
            f"{path}/estimate",
            topics.STATE,
            ("estimate",),
            (ESTIMATE,),
            lambda m: known(estimate(m), unit),
            3.0,  # the others are drawn on top of it
        ),
    ]


def _microtesla(m: Any) -> CurveRow:
    return [1e6 * value for value in m.field]


def _temperature(m: Any) -> CurveRow | None:
    return number(m.temperature)


def _wet(m: Any) -> CurveRow | None:
    return None if m.wet is None else (float(m.wet),)


def _dvl(m: Any) -> CurveRow | None:
    return None if m.velocity is None else m.velocity[:2]


def _usbl(m: Any) -> CurveRow:
    return (m.north, m.east)


def _depth_rate(m: Any) -> float:
    return m.depth_rate


def _heading(m: Any) -> float:
    return m.heading


def _yaw_rate(m: Any) -> float:
    return m.angular_rate[2]


def _yaw_acceleration(m: Reference) -> CurveRow:
    return (degrees(m.heading.acceleration),)


def _reference_force(m: Reference) -> CurveRow:
    return (m.surge_force, m.sway_force)


def _sensor_way(m: Actuation) -> CurveRow | None:
    return way_ms(m.sensor_ns, m.actuated_ns)


def _stick_way(m: Actuation) -> CurveRow | None:
    """Age of the pilot command behind the thrust: rises while commands do not arrive."""
    return way_ms(m.pilot_ns, m.actuated_ns)


def _north(m: Reference) -> CurveRow | None:
    return None if m.north is None else (m.north.position,)


def _east(m: Reference) -> CurveRow | None:
    return None if m.east is None else (m.east.position,)


def _current(m: Any) -> CurveRow:
    return m.current[:2]
