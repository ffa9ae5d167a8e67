"""Hold modes as ArduSub's flight modes (`custom_mode`), both ways.

A mode has the name of the ArduSub mode that behaves like it: ArduSub's ALT_HOLD holds depth and
heading, its SURFTRAK height and heading, its STABILIZE the heading alone. Depth alone is held by
none of them; it is shown as ALT_HOLD and cannot be chosen from a ground station.
"""

from messages.pilot import FlightMode
from messages.vehicle import OWN_WAY, VehicleStatus

NAMES = {0: "STABILIZE", 2: "ALT_HOLD", 4: "GUIDED", 16: "POSHOLD", 19: "MANUAL", 21: "SURFTRAK"}
GUIDED = 4  # the drone goes to a place or follows a path by itself

SHOWN: dict[FlightMode, int] = {
    "manual": 19,
    "heading_hold": 0,
    "depth_hold": 2,
    "stabilised": 2,
    "station_keeping": 16,
    "altitude_hold": 21,
}
CHOSEN: dict[int, FlightMode] = {
    19: "manual",
    0: "heading_hold",
    2: "stabilised",
    16: "station_keeping",
    21: "altitude_hold",
}


def custom_mode(status: VehicleStatus) -> int:
    return GUIDED if status.activity in OWN_WAY else SHOWN[status.flight_mode]


def choosable() -> str:
    """`STABILIZE (0), ALT_HOLD (2), …`"""
    return ", ".join(f"{NAMES[number]} ({number})" for number in sorted(CHOSEN))
