"""The vehicle at one instant as a pilot sees it, from the newest messages, whatever their ages."""

import math
from typing import Any, NamedTuple

import msgspec
from msgspec import UNSET, UnsetType

from messages import topics
from messages.control import ThrusterCommand
from messages.events import UNMOVED
from messages.link import Clock, LatencyBudget, LinkStatus
from messages.message import Estimate, Notice
from messages.reference import Reference
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import Reaction, Returns, VehicleStatus
from services.vehicle_view import ages

# [ns] `control` arms and disarms with `reference`, within a step or two of it. Where its commands
# are disarmed for longer, it has obeyed a disarm that a hung `reference` has not heard.
OVERRULED_NS = 100_000_000
# What a failsafe makes the drone do once it is at rest, in a word or two.
DOES: dict[Reaction, str] = {
    "stop": "holding",
    "ascend": "rising",
    "surface": "staying at the surface",
}
STANDS = 1e-3  # [m/s, rad/s, N, N m] less of a reference stands still
NOT_OBEYED = "not obeyed"  # the reference is, whatever a failsafe makes it do


class Newest(NamedTuple):
    """The newest message of each stream, however old; None: none yet."""

    status: VehicleStatus | None = None
    state: VehicleState | None = None
    reference: Reference | None = None
    battery: BatterySample | None = None
    link: LinkStatus | None = None
    clock: Clock | None = None
    latency: LatencyBudget | None = None


def believed(status: VehicleStatus, thrusters: ThrusterCommand | None) -> VehicleStatus:
    """The status from `reference`, disarmed where `control` has disarmed the drone since."""
    if thrusters is None or thrusters.armed or not status.armed:
        return status
    overruled = thrusters.stamp_ns - status.stamp_ns > OVERRULED_NS
    return msgspec.structs.replace(status, armed=False) if overruled else status


class VehicleView(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """In the pilot's units, rounded as far as he reads them. Unknown is None, never 0."""

    activity: str = ""  # as in VehicleStatus; empty: not known
    doing: str = ""  # the same in words, or what a failsafe makes the drone do
    flight_mode: str = ""  # what the drone holds by itself
    armed: bool = False
    silent_s: float | None = None  # [s] no status for so long: all of it is the last known
    failsafe: str = "none"  # the condition that acts
    since_s: float | None = None  # [s] since that began
    next_s: float | None = None  # [s] until its next reaction
    resumable: bool = False
    returns: Returns | None = None  # what gives the sticks back; None: he has them, or not known
    acting: tuple[Notice, ...] = ()  # what makes it act by itself, and holds
    ended: tuple[str, ...] = ()  # the same, and does not hold any more: names of conditions
    notices: tuple[Notice, ...] = ()  # what he has to know, the gravest first
    pilot: str = ""  # who has control; empty: nobody
    light: float | None = None  # [-] 0 … 1
    outputs: dict[str, float] = {}  # [-] by name; of a gripper -1 … 1
    depth_m: float | None = None  # positive down
    depth_wanted_m: float | None = None
    depth_rate: float | None = None  # [m/s]
    heading_deg: float | None = None  # [0, 360)
    heading_wanted_deg: float | None = None
    roll_deg: float | None = None  # + right side down
    pitch_deg: float | None = None  # + nose up
    tilt_deg: float | None = None  # camera, + upwards
    age_ms: float | None = None  # [ms] of depth, heading, roll and pitch
    battery_v: float | None = None  # [V]
    used_wh: float | None = None  # [Wh] since power-on
    charge: float | None = None  # [-] left of the battery's capacity
    link_up: bool | None = None
    down_ms: float | None = None  # [ms] median delay to the drone
    up_ms: float | None = None  # [ms] median delay to the pilot
    rtt_ms: float | None = None
    lost_s: float | None = None  # [s] in all, in which nothing of the drone arrived
    stick_ms: float | None = None  # [ms] from the stick to the thruster
    screen_ms: float | None = None  # [ms] from the sensor to the screen
    alarms: tuple[Notice, ...] = ()  # what is wrong with the link
    altitude_m: float | None = None  # above the bottom
    altitude_wanted_m: float | None = None  # that is held

    @property
    def last_known(self) -> bool:
        return self.silent_s is not None

    @property
    def acts(self) -> bool:
        """Does a failsafe act? Then the sticks move nothing."""
        return self.failsafe != "none"

    @property
    def old(self) -> bool:
        """Depth, heading, roll and pitch are to be shown as old."""
        return self.age_ms is not None and self.age_ms > ages.STATE.grey_ns / 1e6


def vehicle_view(newest: Newest, now: Ns) -> VehicleView:
    """`now` [ns]."""
    battery = ages.shown(topics.BATTERY, newest.battery, now)
    at_rest = _at_rest(ages.shown(topics.REFERENCE, newest.reference, now))
    known = _status(newest.status, now, at_rest=at_rest)
    known |= _motion(newest, now)  # what the state says goes before
    return VehicleView(**known, **_battery(battery), **_link(newest, now))


def _status(status: VehicleStatus | None, now: Ns, *, at_rest: bool) -> dict[str, Any]:
    if status is None:
        return {}
    known: dict[str, Any] = {
        "activity": status.activity,
        "doing": _doing(status, at_rest=at_rest),
        "armed": status.armed,
        "failsafe": status.failsafe,
        "acting": tuple(each for each in status.acting if _name(each) in status.conditions),
        "ended": tuple(filter(lambda n: n not in status.conditions, map(_name, status.acting))),
        "pilot": status.pilot,
        "depth_m": _known(status.depth),
        "heading_deg": None if status.heading is UNSET else bearing(status.heading),
    }
    if ages.old(ages.STATUS, status.stamp_ns, now):
        silent_s = round((now - status.stamp_ns) / 1e9, 1)
        return known | {"silent_s": silent_s, "next_s": _seconds(now, status.next_ns)}
    return known | {
        "flight_mode": status.flight_mode,
        "light": round(status.light, 3),
        "outputs": {name: round(value, 3) for name, value in status.outputs.items()},
        "since_s": _seconds(status.since_ns, now),
        "next_s": _seconds(now, status.next_ns),
        "resumable": status.resumable,
        "returns": status.returns,
        "notices": status.notices,
        "altitude_m": _known(status.altitude),
        "altitude_wanted_m": _known(status.altitude_wanted),
    }


def _name(notice: Notice) -> str:
    """The name of its condition."""
    return notice.code.partition(":")[2]


def _doing(status: VehicleStatus, *, at_rest: bool) -> str:
    if status.reaction in DOES and not UNMOVED.isdisjoint(status.conditions):
        return NOT_OBEYED
    # It is stopping until the pilot has centred the sticks, long after it has come to rest.
    stops = status.activity == "stopping" and status.reaction == "stop" and not at_rest
    return status.activity if stops else DOES.get(status.reaction or "notice", status.activity)


def _at_rest(reference: Reference | None) -> bool:
    """Does the reference stand still?"""
    if reference is None:
        return False
    moves = (reference.depth, reference.heading, reference.surge, reference.north, reference.east)
    speeds = [each.velocity for each in moves if each is not None]
    pushes = (reference.surge_force, reference.sway_force, reference.heave_force)
    return all(abs(each or 0.0) < STANDS for each in (*speeds, *pushes, reference.yaw_moment))


def _motion(newest: Newest, now: Ns) -> dict[str, Any]:
    state = ages.shown(topics.STATE, newest.state, now)
    reference = ages.shown(topics.REFERENCE, newest.reference, now)
    found: dict[str, Any] = {}
    if newest.state is not None:  # rather unknown than from the status, which is older
        found |= {"depth_m": None, "heading_deg": None}
    if state is not None:
        found = {
            "depth_m": _value(state.depth),
            "depth_rate": _value(state.depth_rate),
            "heading_deg": bearing(state.heading.value) if state.heading.valid else None,
            "roll_deg": _degrees(state.roll),
            "pitch_deg": _degrees(state.pitch),
            "age_ms": max(0.0, round((now - state.sensor_ns) / 1e6, 1)),
        }
    if reference is not None:
        found |= {
            "depth_wanted_m": round(reference.depth.position, 3),
            "heading_wanted_deg": bearing(reference.heading.position),
            "tilt_deg": round(math.degrees(reference.tilt.position), 1),
        }
    return found


def _battery(battery: BatterySample | None) -> dict[str, Any]:
    if battery is None:
        return {}
    return {
        "battery_v": round(battery.voltage, 2),
        "used_wh": None if battery.used_wh is None else round(battery.used_wh, 1),
        "charge": None if battery.charge is None else round(max(0.0, battery.charge), 3),
    }


def _link(newest: Newest, now: Ns) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if (link := ages.shown(topics.LINK, newest.link, now)) is not None:
        found = {
            "link_up": link.up,
            "down_ms": _tenth(link.down_link.delay_p50_ms),
            "up_ms": _tenth(link.up_link.delay_p50_ms),
            "rtt_ms": _tenth(link.rtt_ms),
        }
    if (clock := ages.shown(topics.CLOCK, newest.clock, now)) is not None:
        found["rtt_ms"] = _tenth(clock.rtt_ms)
    if (latency := ages.shown(topics.LATENCY, newest.latency, now)) is not None:
        found |= {
            "stick_ms": _tenth(latency.stick_to_thruster_ms),
            "screen_ms": _tenth(latency.sensor_to_screen_ms),
            "lost_s": _tenth(latency.lost_s),
            "alarms": latency.alarms,
        }
    return found


def _known(value: float | UnsetType) -> float | None:
    return None if value is UNSET else round(value, 3)


def _value(estimate: Estimate) -> float | None:
    return round(estimate.value, 3) if estimate.valid else None


def _degrees(estimate: Estimate) -> float | None:
    return round(math.degrees(estimate.value), 1) if estimate.valid else None


def bearing(heading: float) -> float:
    """[deg] From a heading in radians that accumulates, as it is shown: 0.0 … 359.9."""
    return round(math.degrees(heading), 1) % 360.0  # rounded first: 359.96 is 0.0, not 360.0


def _seconds(since_ns: Ns | None, until_ns: Ns | None) -> float | None:
    """[s] From one instant to another."""
    if since_ns is None or until_ns is None:
        return None
    return round((until_ns - since_ns) / 1e9, 1)


def _tenth(number: float | None) -> float | None:
    return None if number is None else round(number, 1)
