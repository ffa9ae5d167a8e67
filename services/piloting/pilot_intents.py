"""Requests that a pilot can make: with a button, or in a script with arguments."""

import math
from typing import Literal, NamedTuple

from messages.pilot import MANOEUVRES, Course, FlightMode, PilotRequest, RequestKind
from messages.units import Ns

DEEPEST = 11_000.0  # [m] no sea is deeper
FARTHEST = 100_000.0  # [m] north or east
TURN = 360.0  # [deg] a heading is given within one turn either way

# What a button can ask for. light_2: the second dimmer of the vehicle file; laser: its first switch
Press = Literal[
    "arm", "disarm", "stop", "light", "light_2", "laser", "resume", "home", "unwind"
]  # fmt: skip


class GotoIntent(NamedTuple):
    """Go to a depth, to a heading or to both; None: keep it as it is."""

    depth: float | None = None  # [m] positive down
    heading: float | None = None  # [rad] clockwise from north


class PlaceIntent(NamedTuple):
    """Go straight to a place, at this depth or height."""

    north: float  # [m]
    east: float  # [m]


class FollowIntent(NamedTuple):
    course: Course


class ModeIntent(NamedTuple):
    flight_mode: FlightMode


class OutputIntent(NamedTuple):
    name: str  # in the vehicle file
    value: float | None = None  # [-] 0 … 1; None: on or off, whichever it is not


class Held(NamedTuple):
    """A key or button was held for a second. It asks for what it meant when that began."""

    press: Press
    began_ns: Ns


Asked = Press | GotoIntent | PlaceIntent | FollowIntent | ModeIntent | OutputIntent
Intent = Asked | Held


def goto(depth: float | None, heading_deg: float | None) -> GotoIntent:
    """A goto in metres and degrees, as a person writes it, converted to the drone's units.

    Raises:
        ValueError: neither is given, or one is out of its range; says what is allowed.
    """
    if depth is None and heading_deg is None:
        raise ValueError("goto needs a depth, a heading or both")
    _check("depth", depth, 0.0, DEEPEST, "m")
    _check("heading", heading_deg, -TURN, TURN, "deg")
    return GotoIntent(depth, None if heading_deg is None else math.radians(heading_deg))


def _check(name: str, value: float | None, low: float, high: float, unit: str) -> None:
    if value is not None and not low <= value <= high:  # NaN is in no range
        raise ValueError(
            f"goto: {name} is {value:g}, expected a number from {low:g} to {high:g} {unit}"
        )


OVERRULES: dict[RequestKind, tuple[RequestKind, ...]] = {
    "stop": ("arm", "resume", *MANOEUVRES, "mode"),
    "disarm": ("arm", "resume", *MANOEUVRES),
    "mode": (*MANOEUVRES, "mode"),
    **dict.fromkeys(MANOEUVRES, (*MANOEUVRES, "mode")),
    "light": ("light",),
}  # newer request → older requests that are no longer repeated


def overrules(newer: PilotRequest, older: PilotRequest) -> bool:
    if newer.kind == "output":
        return (older.kind, older.output) == ("output", newer.output)
    return older.kind in OVERRULES.get(newer.kind, ())
