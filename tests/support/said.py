"""What a vehicle and its services say, of plain numbers."""

from typing import Any

from messages.health import Health
from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.reference import Motion, Reference
from messages.sensors import ImuSample
from messages.state import VehicleState
from messages.vehicle import Actuation, Truth

STD = 0.01  # of every estimate that is given as a number
NEEDED = (
    "depth", "depth_rate", "depth_acceleration", "roll", "pitch", "heading", "yaw_rate",
)  # fmt: skip
OTHERS = (
    "heading_navigation", "north", "east", "surge_velocity", "sway_velocity", "current_north",
    "current_east",
)  # fmt: skip


def state(now: int = 0, *, invalid: tuple[str, ...] = (), **fields: Any) -> VehicleState:
    """Of a running vehicle at rest and level, at `now` [ns].

    Args:
        invalid: names of estimates that are not valid.
        fields: of the state; an estimate may be a number.
    """
    said: dict[str, Any] = {
        "stamp_ns": now,
        "sensor_ns": now,
        "phase": "running",
        "attitude": (1.0, 0.0, 0.0, 0.0),
        "heading_navigation": None,
        **dict.fromkeys(NEEDED, 0.0),
        **fields,
    }
    for name in (*NEEDED, *OTHERS):
        if isinstance(said.get(name), int | float):
            said[name] = Estimate(float(said[name]), STD, valid=name not in invalid)
    return VehicleState(**said)


def sticks(now: int = 0, **fields: Any) -> PilotCommand:
    """Centred, but for the fields of a command that are given."""
    said: dict[str, Any] = dict.fromkeys(("surge", "sway", "heave", "yaw"), 0.0) | fields
    return PilotCommand(stamp_ns=now, **said)


def imu(now: int = 0) -> ImuSample:
    """At rest and level."""
    return ImuSample(stamp_ns=now, specific_force=(0.0, 0.0, -9.81), angular_rate=(0.0, 0.0, 0.0))


def reference(now: int = 0, **fields: Any) -> Reference:
    """Of an armed drone that holds what it has, but for the fields that are given."""
    still = Motion(0.0, 0.0, 0.0, 0.0)
    said: dict[str, Any] = {
        "sensor_ns": now, "pilot_ns": None, "armed": True, "depth": still, "heading": still,
        "surge_force": 0.0, "sway_force": 0.0,
    }  # fmt: skip
    return Reference(stamp_ns=now, **(said | fields))


def truth(now: int = 0, depth: float = 0.0, heading: float = 0.0) -> Truth:
    """At rest and level."""
    return Truth(
        stamp_ns=now, position=(0.0, 0.0, depth), attitude=(1.0, 0.0, 0.0, 0.0),
        velocity=(0.0, 0.0, 0.0), angular_rate=(0.0, 0.0, 0.0), depth_rate=0.0, roll=0.0,
        pitch=0.0, heading=heading, on_floor=False,
    )  # fmt: skip


def actuation(now: int = 0, **fields: Any) -> Actuation:
    """Of a driver that was commanded at `now` [ns], but for the fields that are given."""
    said: dict[str, Any] = {
        "thrust": (), "actuated_ns": now, "sensor_ns": None, "pilot_ns": None, "stale": False,
        "power": 0.0,
    }  # fmt: skip
    return Actuation(stamp_ns=now, **(said | fields))


def health(service: str, late_ms: float | None = 0.0, /, **said: Any) -> Health:
    """Of a service that ran a second. What is given and is no field of it is a count, by the name
    of its event."""
    fields: dict[str, Any] = {
        "stamp_ns": 0, "loop_hz": 100.0, "lateness_p50_ms": 0.0, "lateness_p99_ms": late_ms,
        "cpu_percent": None, "rss_mb": None, "sent": 0, "received": 0, "counts": {},
    }  # fmt: skip
    own = {name: value for name, value in said.items() if name in Health.__struct_fields__}
    counts = {name: value for name, value in said.items() if name not in own}
    fields |= {"counts": counts, **own}
    return Health(service=service, **fields)
