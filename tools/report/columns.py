"""The streams that a report is made from, and which figures of each message: a dive of hours has
millions of messages, so each one is reduced to a few as it is read. Times are in ns of the
vehicle's clock, exact in a float64 for the first 104 days after the computer was started.
"""

from typing import get_args

import msgspec

from messages import topics
from messages.control import ThrusterCommand
from messages.link import DOWN_STAGES, UP_STAGES, Clock, LatencyBudget, Stage
from messages.pilot import FlightMode, PilotCommand, PilotRequest
from messages.reference import Reference
from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.vehicle import OWN_WAY, Actuation, Failsafe, Reaction, Truth, VehicleStatus
from messages.video import PICTURE_STAGES, PictureAge
from tools.recordings.columns import Figures, StreamFigures

FAILSAFES: tuple[Failsafe, ...] = get_args(Failsafe)  # a status has the place in these
REACTIONS: tuple[Reaction, ...] = get_args(Reaction)
FLIGHT_MODES: tuple[FlightMode, ...] = get_args(FlightMode)


def _command(m: PilotCommand) -> Figures:
    deflection = max(map(abs, (m.surge, m.sway, m.heave, m.yaw)))
    sticks = m.surge, m.sway, m.heave, m.yaw
    return m.stamp_ns, *sticks, deflection, m.pilot == "lost", m.epoch


def _request(m: PilotRequest) -> Figures:
    return m.stamp_ns, m.kind == "stop"


def _status(m: VehicleStatus) -> Figures:
    reaction = -1 if m.reaction is None else REACTIONS.index(m.reaction)
    own_way = m.activity in OWN_WAY
    flight_mode = FLIGHT_MODES.index(m.flight_mode)
    failsafe = FAILSAFES.index(m.failsafe)
    return m.stamp_ns, failsafe, reaction, m.since_ns, own_way, flight_mode, m.armed


def _state(m: VehicleState) -> Figures:
    moved = m.depth_moved or 0.0  # absent: no jump
    known = m.depth.valid, m.heading.valid
    felt = m.depth_acceleration.value, m.yaw_rate.value
    return m.sensor_ns, m.stamp_ns, m.depth.value, m.heading.value, moved, *known, *felt


def _reference(m: Reference) -> Figures:
    valid = m.stamp_ns if m.sensor_ns is None else m.sensor_ns
    depth, heading = msgspec.structs.astuple(m.depth), msgspec.structs.astuple(m.heading)
    return valid, m.stamp_ns, m.sensor_ns, m.pilot_ns, m.armed, m.epoch, *depth, *heading


def _thrusters(m: ThrusterCommand) -> Figures:
    ahead = astern = 0
    for k, thrust in enumerate(m.thrust):
        if thrust > 0.0:
            ahead |= 1 << k
        elif thrust < 0.0:
            astern |= 1 << k
    return m.stamp_ns, m.sensor_ns, len(m.thrust), ahead, astern


def _actuation(m: Actuation) -> Figures:
    squared = sum(thrust * thrust for thrust in m.thrust)
    return m.stamp_ns, m.actuated_ns, m.sensor_ns, m.pilot_ns, squared, m.power


def _truth(m: Truth) -> Figures:
    return m.stamp_ns, m.position[2], m.heading


def _latency(m: LatencyBudget) -> Figures:
    down = _medians(m.down, len(DOWN_STAGES))
    up = _medians(m.up, len(UP_STAGES))
    return m.stamp_ns, *down, *up, m.stick_to_thruster_ms, m.sensor_to_screen_ms


def _medians(stages: tuple[Stage, ...] | None, count: int) -> Figures:
    if stages is None or len(stages) != count:
        return (None,) * count
    return tuple(stage.p50_ms for stage in stages)


def _picture(m: PictureAge) -> Figures:
    stages = _medians(m.stages, len(PICTURE_STAGES))
    total = (None, None) if m.total is None else (m.total.p50_ms, m.total.p99_ms)
    return m.stamp_ns, *stages, *total, m.per_second


def _clock(m: Clock) -> Figures:
    return m.stamp_ns, m.offset_ns, m.bound_ns, m.drift_ppm


LATENCY = (
    "stamp",
    *(f"down {stage}" for stage in DOWN_STAGES),  # [ms]
    *(f"up {stage}" for stage in UP_STAGES),  # [ms]
    *("stick", "screen"),  # [ms]
)


PICTURE = ("stamp", *PICTURE_STAGES, "p50", "worst", "rate")  # [ns, ms …, 1/s, -]


def _battery(m: BatterySample) -> Figures:
    return m.stamp_ns, m.used_wh, m.capacity_wh


MOTION = ("position", "velocity", "acceleration", "jerk", "jerk limit")
REFERENCE = (
    *("valid", "stamp", "sensor", "pilot", "armed", "epoch"),
    *(f"heave {part}" for part in MOTION),  # [m, m/s, m/s², m/s³ ×2]
    *(f"yaw {part}" for part in MOTION),  # [rad, rad/s, rad/s², rad/s³ ×2]
)
STATUS = ("stamp", "failsafe", "reaction", "since", "own way", "flight mode", "armed")
COMMAND = ("stamp", "surge", "sway", "heave", "yaw", "deflection", "lost", "epoch")
STATE = (
    *("sensor", "stamp", "heave", "yaw"),  # [ns, ns, m, rad]
    *(
        "moved",
        "heave known",
        "yaw known",
        "heave acceleration",
        "yaw rate",
    ),  # [m, -, -, m/s², rad/s]
)
COMMANDED = ("stamp", "sensor", "count", "ahead", "astern")  # thrusters; bit k: thruster k turns so
WANTED = (
    StreamFigures(topics.PILOT_COMMAND, COMMAND, _command),
    StreamFigures(topics.PILOT_REQUEST, ("stamp", "stop"), _request),
    StreamFigures(topics.STATUS, STATUS, _status),
    StreamFigures(
        topics.STATE,
        STATE,
        _state,
        ("sensor_ns", "depth_moved", "depth", "depth_acceleration", "heading", "yaw_rate"),
    ),
    StreamFigures(
        topics.REFERENCE,
        REFERENCE,
        _reference,
        ("sensor_ns", "pilot_ns", "epoch", "armed", "depth", "heading"),
    ),
    StreamFigures(topics.THRUSTERS, COMMANDED, _thrusters),
    StreamFigures(
        topics.ACTUATION,
        ("stamp", "actuated", "sensor", "pilot", "thrust_squared", "power"),  # [ns ×4, N², W]
        _actuation,
    ),
    StreamFigures(topics.BATTERY, ("stamp", "used", "capacity"), _battery),  # [ns, Wh, Wh]
    StreamFigures(topics.LATENCY, LATENCY, _latency),
    StreamFigures(topics.PICTURE_AGE, PICTURE, _picture),
    StreamFigures(topics.CLOCK, ("stamp", "offset", "bound", "drift"), _clock),  # [ns ×3, ppm]
    StreamFigures(
        topics.TRUTH, ("stamp", "heave", "yaw"), _truth, ("position", "heading")
    ),  # [ns, m, rad]
)
FURTHER_WANTED = StreamFigures(topics.FURTHER_AGE, PICTURE, _picture)  # of every member
