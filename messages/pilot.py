"""The pilot's commands and requests. From `gamepad`, topside; received on board by `reference`."""

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, UnsetType

from messages.message import Answer, Message, Request
from messages.units import Count, Finite, Name, NotNegative, Stamp, Stick, Text, Ttl

Place = Annotated[tuple[Finite, ...], msgspec.Meta(min_length=2, max_length=3)]  # n, e(, down)
TTL_MS = 300.0  # [ms] a stick position older than this moves nothing


class PilotCommand(Message, frozen=True, kw_only=True):
    """Stick positions after dead-band, expo and gain. SNAME signs."""

    surge: Stick  # [-] + forward
    sway: Stick  # [-] + starboard
    heave: Stick  # [-] + down
    yaw: Stick  # [-] + clockwise seen from above
    tilt: Stick = 0.0  # [-] camera, + upwards
    pilot: Literal["present", "lost"] = "present"  # lost: the pad is unplugged, unlike centred
    source: Name = ""  # name of the pilot; else which pad, keyboard or script
    device_age_ms: NotNegative = 0.0  # [ms] since the input device last answered
    ttl_ms: Ttl = TTL_MS  # [ms] after stamp_ns this command must not move anything
    epoch: Count = 0  # authority epoch; a command of another epoch is refused
    # Held like a stick, and no request: what moves while a button is down must end with the newest
    # command, and may not be repeated, queued or carried out late.
    gripper: Stick = 0.0  # [-] + opens, - closes, 0 stands still


# output: set one of the vehicle file's outputs; light: the one called light
# lease: take control, or accept it where it is offered; force: take it from whoever has it;
# resume: end a failsafe, so that the sticks act again
# home: go to where it was first armed; unwind: turn back the whole turns since its start, because
# of the tether
RequestKind = Literal[
    "arm", "disarm", "stop", "light", "goto", "follow", "mode", "lease", "offer", "release",
    "force", "resume", "output", "home", "unwind",
]  # fmt: skip

MANOEUVRES: tuple[RequestKind, ...] = ("goto", "follow", "home", "unwind")  # it moves by itself

# Flight mode: what the drone holds by itself. On an axis that is not held, the stick is a force.
#   manual: nothing; depth_hold: depth; heading_hold: heading; stabilised: depth and heading;
#   station_keeping: depth, heading and position (for vehicles that measure their position)
#   altitude_hold: height above the bottom, and heading (for vehicles that measure their height)
FlightMode = Literal[
    "manual", "depth_hold", "heading_hold", "stabilised", "station_keeping", "altitude_hold"
]  # fmt: skip


class Course(msgspec.Struct, frozen=True):
    """A path to follow, as in a file of deploy/paths/. It begins where the drone is."""

    waypoints: Annotated[tuple[Place, ...], msgspec.Meta(min_length=2, max_length=1000)]  # [m]
    min_radius: Finite = 5.0  # [m] of every turn
    kind: Literal["approximating", "interpolating"] = "approximating"
    cruise: Finite = 0.3  # [m/s]
    acceleration: Finite = 0.15  # [m/s²] at most
    jerk: Finite = 0.3  # [m/s³] at most


class PilotRequest(Request, frozen=True, kw_only=True):
    """Something to be done once. Repeated with the same id until a `PilotAnswer` names that id."""

    kind: RequestKind
    value: Stick | None = None  # light, output: 0 … 1
    depth: Finite | None = None  # [m] goto: positive down
    heading: Finite | None = None  # [rad] goto: clockwise from north, shortest way
    north: Finite | None = None  # [m] goto, with east: straight there, NED
    east: Finite | None = None  # [m] goto
    course: Course | None = None  # follow
    flight_mode: FlightMode | None = None  # mode: what the drone is to hold
    to: Name = ""  # offer: name of one pilot; empty: to anybody
    source: Name = ""  # who asks, as in PilotCommand
    epoch: Count = 0  # authority epoch; who has another one may stop the drone, and ask for control
    output: Name = ""  # output: which one, by its name in the vehicle file


class StopDistance(msgspec.Struct, frozen=True):
    """How far the reference still moves from a stop request to standstill, and for how long."""

    depth: Finite  # [m] positive down
    heading: Finite  # [rad] positive clockwise
    seconds: NotNegative  # [s]
    # [m] Straight from here to there over the ground; absent: no position is measured.
    over_ground: NotNegative | UnsetType = UNSET


class PilotAnswer(Answer, frozen=True, kw_only=True):
    """The drone's answer to a request."""

    reason: Text = ""  # why the request was refused, in words for the pilot
    note: Text | UnsetType = UNSET  # granted: what else will come of it, in words for him
    stop: StopDistance | None = None  # stop: how far the drone still goes
    epoch: Count | None = None  # lease, force: authority epoch that commands must carry from now on
    cause_ns: Stamp | None = None  # [ns] stamp of the request
