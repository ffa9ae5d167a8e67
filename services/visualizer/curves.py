"""Which number of which message is which curve: path, names, colours and the way to read it.

Angles become degrees, times milliseconds, fields microtesla. A reader that returns None has
nothing to plot: what is unknown leaves a gap, never a zero.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any

from messages import topics
from messages.link import LinkStatus
from messages.message import Estimate
from messages.reference import Reference
from messages.topic import AnyTopic
from messages.vehicle import Actuation
from services.marine.vehicle import Vehicle

Row = Sequence[float]
Read = Callable[[Any], Row | None]

# One colour per meaning, in every panel and in the scene. RGB.
REFERENCE, ESTIMATE, TRUTH = 0xFF9F2E, 0x4CA6FF, 0x9AA0A6
AXES = (0xEF6C6C, 0x66C285, 0x6C9DF0, 0xE0B04C, 0xB57EDC, 0x4FC4C4)
DOWN, UP, STICK = 0x5FD0C0, 0xC58BE8, 0xF2D34F
LONGEST_MS = 60_000.0  # [ms] a longer way is a wrong stamp, not a latency


@dataclass(frozen=True, slots=True)
class Curve:
    """Curves that one message feeds at once; they share an entity."""

    path: str
    topic: AnyTopic
    names: tuple[str, ...]
    colours: tuple[int, ...]
    read: Read
    width: float = 1.5  # [px]


def curves(vehicle: Vehicle) -> list[Curve]:
    """Every curve of a dive with this vehicle."""
    thrusters = tuple(t.name for t in vehicle.thruster)
    return [*_pilot(), *_sensors(), *_motion(), *_control(thrusters), *_link(), *_health()]


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
        Curve("angular_rate", imu, body, AXES[:3], lambda m: _degrees(m.angular_rate)),
        Curve("magnetic_field", topics.MAGNETOMETER, body, AXES[:3], _microtesla),
        Curve("pressure", topics.PRESSURE, ("water",), (ESTIMATE,), lambda m: (m.pressure / 1e3,)),
        Curve("power/temperature", topics.PRESSURE, ("water [°C]",), (AXES[0],), _temperature),
        Curve("velocity/dvl", topics.DVL, ("surge, DVL", "sway, DVL"), AXES[4:], _dvl),
        Curve("track/usbl", topics.USBL, ("north, USBL", "east, USBL"), AXES[1:3], _usbl),
        Curve("power/voltage", battery, ("battery [V]",), (AXES[1],), lambda m: (m.voltage,)),
        Curve("power/current", battery, ("battery [A]",), (AXES[3],), lambda m: (m.current,)),
        Curve("power/used", battery, ("used [Wh]",), (AXES[4],), lambda m: (m.used_wh,)),
    ]


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
        *_truths(),
    ]


def _references() -> list[Curve]:
    both, colours, topic = ("depth", "heading"), (ESTIMATE, REFERENCE), topics.REFERENCE
    return [
        Curve("jerk", topic, both, colours, lambda m: (m.depth.jerk, degrees(m.heading.jerk))),
        Curve("yaw_acceleration", topic, ("reference",), (REFERENCE,), _yaw_acceleration),
        Curve("tilt", topic, ("reference",), (REFERENCE,), lambda m: (degrees(m.tilt.position),)),
        Curve("force_reference", topic, ("surge", "sway"), AXES[:2], _reference_force),
        Curve("latency/stick_reference", topic, ("stick → reference",), (STICK,), _stick_reference),
    ]


def _estimates() -> list[Curve]:
    topic = topics.STATE
    single: list[tuple[str, str, int, Read]] = [
        ("attitude/roll", "roll", AXES[0], lambda m: (degrees(m.roll.value),)),
        ("attitude/pitch", "pitch", AXES[1], lambda m: (degrees(m.pitch.value),)),
        ("uncertainty/depth", "depth [cm]", ESTIMATE, lambda m: (100 * m.depth.std,)),
        ("uncertainty/heading", "heading [°]", REFERENCE, lambda m: (degrees(m.heading.std),)),
        ("compass", "navigation", ESTIMATE, lambda m: _known(m.heading_navigation, degrees)),
        ("velocity/surge", "surge", AXES[0], lambda m: _known(m.surge_velocity)),
        ("velocity/sway", "sway", AXES[1], lambda m: _known(m.sway_velocity)),
        ("track/north", "north", AXES[0], lambda m: _known(m.north)),
        ("track/east", "east", AXES[1], lambda m: _known(m.east)),
        ("current/north", "north", AXES[0], lambda m: _known(m.current_north)),
        ("current/east", "east", AXES[1], lambda m: _known(m.current_east)),
        ("pressure_age", "pressure", ESTIMATE, lambda m: _number(m.pressure_age_ms)),
    ]
    return [Curve(path, topic, (name,), (rgb,), read) for path, name, rgb, read in single]


def _truths() -> list[Curve]:
    topic, grey = topics.TRUTH, (TRUTH, 0xC8CCD0, 0x6E747A)
    speed, place = ("surge, truth", "sway, truth", "heave, truth"), ("north, truth", "east, truth")
    tilt = ("roll, truth", "pitch, truth")
    return [
        Curve("velocity/truth", topic, speed, AXES[3:], lambda m: m.velocity),
        Curve("track/truth", topic, place, AXES[3:5], lambda m: m.position[:2]),
        Curve("attitude/truth", topic, tilt, grey[:2], lambda m: _degrees((m.roll, m.pitch))),
    ]


def _control(thrusters: tuple[str, ...]) -> list[Curve]:
    wrench, force, moment = topics.WRENCH, ("X", "Y", "Z"), ("K", "M", "N")
    colours = tuple(AXES[i % len(AXES)] for i in range(len(thrusters)))
    return [
        Curve("force/wanted", wrench, force, AXES[:3], lambda m: m.wanted[:3]),
        Curve("force_achieved", wrench, force, AXES[:3], lambda m: m.achieved[:3]),
        Curve("moment/wanted", wrench, moment, AXES[:3], lambda m: m.wanted[3:]),
        Curve("moment_achieved", wrench, moment, AXES[:3], lambda m: m.achieved[3:]),
        Curve("integral/depth", wrench, ("Z [N]",), (ESTIMATE,), lambda m: (m.depth_integral,)),
        Curve("integral/yaw", wrench, ("N [N m]",), (REFERENCE,), lambda m: (m.heading_integral,)),
        Curve("thrust_command", topics.THRUSTERS, thrusters, colours, lambda m: m.thrust),
        Curve("thrust", topics.ACTUATION, thrusters, colours, lambda m: m.thrust),
        Curve("drive_power", topics.ACTUATION, ("thrusters",), (AXES[3],), lambda m: (m.power,)),
        Curve("latency/sensor", topics.ACTUATION, ("sensor → thruster",), (ESTIMATE,), _sensor_way),
        Curve("latency/stick", topics.ACTUATION, ("stick → thruster",), (REFERENCE,), _stick_way),
    ]


def _link() -> list[Curve]:
    topic = topics.LINK

    def way(name: str, side: str, rgb: int) -> list[Curve]:
        def median(m: LinkStatus) -> Row | None:
            return _number(getattr(m, side).delay_p50_ms)

        def slowest(m: LinkStatus) -> Row | None:
            return _number(getattr(m, side).delay_p99_ms)

        def queue(m: LinkStatus) -> Row | None:
            return (float(getattr(m, side).queued), float(getattr(m, side).dropped))

        both = (f"{name} on the way", f"{name} dropped")
        return [
            Curve(f"latency/link_{name}", topic, (f"link {name}",), (rgb,), median),
            Curve(f"link_p99/{name}", topic, (f"{name} p99",), (rgb,), slowest),
            Curve(f"link_queue/{name}", topic, both, (rgb, TRUTH), queue),
        ]

    round_trip = Curve("link_p99/rtt", topic, ("rtt p50",), (TRUTH,), lambda m: _number(m.rtt_ms))
    return [*way("down", "down_link", DOWN), *way("up", "up_link", UP), round_trip]


def _health() -> list[Curve]:
    """Per service: the entity `<path>/<service>` names itself."""
    reads: list[tuple[str, Read]] = [
        ("health/calls", lambda m: (m.loop_hz,)),
        ("health/late_p50", lambda m: _number(m.lateness_p50_ms)),
        ("health/late_p99", lambda m: _number(m.lateness_p99_ms)),
        ("health/processor", lambda m: _number(m.cpu_percent)),
        ("health/memory", lambda m: _number(m.rss_mb)),
        ("health/sent", lambda m: (float(m.sent),)),
        ("health/received", lambda m: (float(m.received),)),
        ("health/counted", lambda m: (float(sum(m.counts.values())),)),
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
    def wanted(m: Reference) -> Row:
        return (unit(reference(m)),)

    return [
        Curve(f"{path}/reference", topics.REFERENCE, ("reference",), (REFERENCE,), wanted),
        Curve(
            f"{path}/estimate",
            topics.STATE,
            ("estimate",),
            (ESTIMATE,),
            lambda m: _known(estimate(m), unit),
            3.0,  # the others are drawn on top of it
        ),
    ]


def _known(estimate: Estimate | None, unit: Callable[[float], float] = float) -> Row | None:
    return None if estimate is None or not estimate.valid else (unit(estimate.value),)


def _number(value: float | None) -> Row | None:
    return None if value is None else (value,)


def _degrees(radians: Row) -> Row:
    return [degrees(value) for value in radians]


def _microtesla(m: Any) -> Row:
    return [1e6 * value for value in m.field]


def _temperature(m: Any) -> Row | None:
    return _number(m.temperature)


def _dvl(m: Any) -> Row:
    return m.velocity[:2]


def _usbl(m: Any) -> Row:
    return (m.north, m.east)


def _depth_rate(m: Any) -> float:
    return m.depth_rate


def _heading(m: Any) -> float:
    return m.heading


def _yaw_rate(m: Any) -> float:
    return m.angular_rate[2]


def _yaw_acceleration(m: Reference) -> Row:
    return (degrees(m.heading.acceleration),)


def _reference_force(m: Reference) -> Row:
    return (m.surge_force, m.sway_force)


def _stick_reference(m: Reference) -> Row | None:
    return _way_ms(m.pilot_ns, m.stamp_ns)


def _sensor_way(m: Actuation) -> Row | None:
    return _way_ms(m.sensor_ns, m.actuated_ns)


def _stick_way(m: Actuation) -> Row | None:
    return _way_ms(m.pilot_ns, m.actuated_ns)


def _way_ms(begin: int | None, end: int | None) -> Row | None:
    if begin is None or end is None:
        return None
    way = (end - begin) / 1e6
    return (way,) if 0.0 <= way <= LONGEST_MS else None
