"""What every page is shown: the newest messages of the drone in a pilot's units. Unknown is left
out, never 0."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec

from messages.control import ThrusterCommand
from messages.link import Clock, LatencyBudget, LinkStatus
from messages.message import Estimate
from messages.pilot import PilotCommand
from messages.reference import Reference
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus

OLD_NS = 3_000_000_000  # [ns] an older state is not shown; one over 0.5 s is dim
OLD_UNDATED_NS = 1_000_000_000  # [ns] nor what comes without an age: reference, thrust, link
OLD_BATTERY_NS = 10_000_000_000  # [ns] it is said once a second
SILENT_NS = 1_500_000_000  # [ns] a status is repeated five times a second


class LastHeard(NamedTuple):
    """The newest message of each stream, however old."""

    status: VehicleStatus | None = None
    state: VehicleState | None = None
    reference: Reference | None = None
    thrusters: ThrusterCommand | None = None
    battery: BatterySample | None = None
    link: LinkStatus | None = None
    clock: Clock | None = None
    latency: LatencyBudget | None = None


class Outlook(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One picture of the drone. Angles in degrees, because people read them."""

    drone: str = ""  # its name
    armed: bool = False
    mode: str = ""
    hold: str = ""
    failsafe: str = "none"
    words: str = ""  # what the drone does by itself, and what ends it
    note: str = ""
    resumable: bool = False
    since_s: float | None = None  # [s] since the failsafe's condition began
    next_s: float | None = None  # [s] until its next reaction
    pilot: str = ""  # who has control of the drone
    light: float | None = None  # [-] 0 … 1
    silent_s: float | None = None  # [s] no status has arrived for so long: the above is old
    depth: float | None = None  # [m] positive down
    depth_wanted: float | None = None  # [m]
    depth_rate: float | None = None  # [m/s]
    heading: float | None = None  # [deg] 0 … 360
    heading_wanted: float | None = None  # [deg]
    roll: float | None = None  # [deg] + right side down
    pitch: float | None = None  # [deg] + nose up
    tilt: float | None = None  # [deg] camera, + upwards
    state_ms: float | None = None  # [ms] age of depth, heading, roll and pitch
    thrust: tuple[float, ...] = ()  # [-] share of each thruster's most, signed
    sticks: tuple[float, ...] = ()  # [-] surge, sway, heave, yaw as sent to the drone
    volts: float | None = None
    used_wh: float | None = None
    left: float | None = None  # [-] of the battery's capacity
    link_up: bool | None = None
    down_ms: float | None = None
    up_ms: float | None = None
    rtt_ms: float | None = None
    loss: float | None = None  # [-] the worse direction's
    stick_ms: float | None = None  # [ms] from the stick to the thruster
    alarm: str = ""
    change: str = ""  # of drone: what has become of the newest order to fly another one
    lines: tuple[tuple[str, str], ...] = ()  # (level, text), the newest last


def outlook(
    newest: LastHeard,
    command: PilotCommand | None,
    limits: Sequence[tuple[float, float]],
    lines: tuple[tuple[str, str], ...],
    drone: str,
    change: str,
    now: Ns,
) -> Outlook:
    """
    Args:
        drone: its name.
        change: what has become of the newest order to fly another one.
        command: the one that was sent last, if it still acts.
        limits: [N] least and most thrust of each thruster.
    """
    return Outlook(
        **_status(newest.status, now),
        **_motion(newest, now),
        **_vehicle(newest, limits, now),
        **_link(newest, now),
        sticks=() if command is None else (command.surge, command.sway, command.heave, command.yaw),
        lines=lines,
        drone=drone,
        change=change,
    )


def _status(status: VehicleStatus | None, now: Ns) -> dict[str, Any]:
    if status is None:
        return {}
    silence = now - status.stamp_ns
    return {
        "armed": status.armed,
        "mode": status.mode,
        "hold": status.hold,
        "failsafe": status.failsafe,
        "words": status.words,
        "note": status.note,
        "resumable": status.resumable,
        "since_s": None if status.since_ns is None else _short((now - status.since_ns) / 1e9),
        "next_s": None if status.next_ns is None else _short((status.next_ns - now) / 1e9),
        "pilot": status.pilot,
        "light": _short(status.light),
        "silent_s": _short(silence / 1e9) if silence > SILENT_NS else None,
    }


def _motion(newest: LastHeard, now: Ns) -> dict[str, Any]:
    state, reference = newest.state, newest.reference
    shown: dict[str, Any] = {}
    if state is not None and now - state.stamp_ns <= OLD_NS:
        shown = {
            "depth": _value(state.depth),
            "depth_rate": _value(state.depth_rate),
            "heading": _degrees(state.heading, turn=True),
            "roll": _degrees(state.roll),
            "pitch": _degrees(state.pitch),
            "state_ms": max(0.0, round((now - state.sensor_ns) / 1e6, 1)),
        }
    if reference is not None and now - reference.stamp_ns <= OLD_UNDATED_NS:
        shown |= {
            "depth_wanted": _short(reference.depth.position),
            "heading_wanted": round(math.degrees(reference.heading.position), 1) % 360.0,
            "tilt": round(math.degrees(reference.tilt.position), 1),
        }
    return shown


def _vehicle(newest: LastHeard, limits: Sequence[tuple[float, float]], now: Ns) -> dict[str, Any]:
    shown: dict[str, Any] = {}
    if (command := newest.thrusters) is not None and now - command.stamp_ns <= OLD_UNDATED_NS:
        shares = zip(command.thrust, limits, strict=False)
        shown["thrust"] = tuple(
            round(n / (most if n > 0.0 else -least), 2) for n, (least, most) in shares
        )
    battery = newest.battery
    if battery is not None and now - battery.stamp_ns <= OLD_BATTERY_NS:
        capacity = battery.capacity_wh
        left = None if not capacity else max(0.0, 1.0 - battery.used_wh / capacity)
        shown |= {
            "volts": round(battery.voltage, 2),
            "used_wh": round(battery.used_wh, 1),
            "left": None if left is None else _short(left),
        }
    return shown


def _link(newest: LastHeard, now: Ns) -> dict[str, Any]:
    shown: dict[str, Any] = {}
    if (link := newest.link) is not None and now - link.stamp_ns <= OLD_UNDATED_NS:
        losses = [d.loss for d in (link.down_link, link.up_link) if d.loss is not None]
        shown = {
            "link_up": link.up,
            "down_ms": _tenth(link.down_link.delay_p50_ms),
            "up_ms": _tenth(link.up_link.delay_p50_ms),
            "rtt_ms": _tenth(link.rtt_ms),
            "loss": _short(max(losses)) if losses else None,
        }
    if newest.clock is not None:
        shown["rtt_ms"] = _tenth(newest.clock.rtt_ms)
    if newest.latency is not None:
        shown |= {
            "stick_ms": _tenth(newest.latency.stick_to_thruster_ms),
            "alarm": newest.latency.alarm,
        }
    return shown


def _value(estimate: Estimate) -> float | None:
    return _short(estimate.value) if estimate.valid else None


def _degrees(estimate: Estimate, *, turn: bool = False) -> float | None:
    if not estimate.valid:
        return None
    degrees = round(math.degrees(estimate.value), 1)
    return degrees % 360.0 if turn else degrees  # rounded first: 359.96 is 0.0, not 360.0


def _short(number: float) -> float:
    return round(number, 3)


def _tenth(number: float | None) -> float | None:
    return None if number is None else round(number, 1)
