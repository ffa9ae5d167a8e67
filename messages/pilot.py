"""What the pilot says. From `gamepad`, topside; heard on board by `reference`."""

from typing import Annotated, Literal

import msgspec

from messages.message import Answer, Message, Request
from messages.units import Finite, NotNegative, Stamp, Stick, Ttl

Place = Annotated[tuple[Finite, ...], msgspec.Meta(min_length=2, max_length=3)]  # n, e(, down)
TTL_MS = 300.0  # [ms] a stick position older than this moves nothing


class PilotCommand(Message, frozen=True, kw_only=True):
    """Where the sticks are, after dead-band, expo and gain. SNAME signs."""

    surge: Stick  # [-] + forward
    sway: Stick  # [-] + starboard
    heave: Stick  # [-] + down
    yaw: Stick  # [-] + clockwise seen from above
    tilt: Stick = 0.0  # [-] camera, + upwards
    pilot: Literal["present", "lost"] = "present"  # lost: the pad is gone, which is not "centred"
    source: str = ""  # which pad, keyboard or script
    device_age_ms: NotNegative = 0.0  # [ms] since the device itself last answered
    ttl_ms: Ttl = TTL_MS  # [ms] after stamp_ns this command must not move anything
    epoch: int = 0  # authority epoch; a command of another epoch is refused


RequestKind = Literal["arm", "disarm", "stop", "light", "goto", "follow", "mode", "lease"]

# Granted whoever asks: anybody may stop the drone, and a lease is how one gets an epoch.
FOR_ANYBODY: tuple[RequestKind, ...] = ("stop", "disarm", "lease")

# What the drone holds by itself; the sticks of what it does not hold are forces.
#   manual nothing, depth_hold depth, heading_hold heading, stabilised depth and heading,
#   station_keeping depth, heading and place (for vehicles that measure where they are)
Hold = Literal["manual", "depth_hold", "heading_hold", "stabilised", "station_keeping"]


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
    value: Stick | None = None  # light: brightness 0 … 1
    depth: Finite | None = None  # [m] goto: positive down
    heading: Finite | None = None  # [rad] goto: clockwise from north, shortest way
    north: Finite | None = None  # [m] goto, with east: straight there, NED
    east: Finite | None = None  # [m] goto
    course: Course | None = None  # follow
    hold: Hold | None = None  # mode
    epoch: int = 0  # authority epoch; of another one only FOR_ANYBODY is granted


class StopDistance(msgspec.Struct, frozen=True):
    """From the moment a stop is asked for to standstill, of the reference."""

    depth: Finite  # [m] positive down
    heading: Finite  # [rad] positive clockwise
    seconds: NotNegative  # [s]


class PilotAnswer(Answer, frozen=True, kw_only=True):
    """The drone's word on a request."""

    reason: str = ""  # why not, in words for the pilot
    stop: StopDistance | None = None  # stop: how far the drone still goes
    epoch: int | None = None  # lease: the authority epoch that commands have to carry from now on
    cause_ns: Stamp | None = None  # [ns] stamp of the request
