"""What a vehicle and its services say, of plain numbers."""

from typing import Any

from messages.health import Health
from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.state import VehicleState

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


def health(service: str, late_ms: float | None = 0.0, **counts: int) -> Health:
    """Of a service that ran a second; `counts` by the names of events."""
    return Health(
        stamp_ns=0,
        service=service,
        loop_hz=100.0,
        lateness_p50_ms=0.0,
        lateness_p99_ms=late_ms,
        cpu_percent=None,
        rss_mb=None,
        sent=0,
        received=0,
        counts=counts,
    )
