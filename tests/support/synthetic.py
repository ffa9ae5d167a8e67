"""What a synthetic drone and its pilot say: the rows of the topic table at their rates, with valid
messages of the usual length, and nobody who thinks. Pure.

To learn what a network carries without flying anything.
"""

from collections.abc import Iterator
from dataclasses import replace as row_of
from typing import Any, NamedTuple

from msgspec.structs import replace

from messages import events, topics
from messages.control import ThrusterCommand, Wrench
from messages.health import Health
from messages.identity import SideIdentity
from messages.link import (
    DOWN_STAGES,
    UP_STAGES,
    Clock,
    ClockPing,
    ClockPong,
    LatencyBudget,
    Shown,
    Stage,
)
from messages.message import Estimate, Message
from messages.pilot import PilotCommand
from messages.prediction import Miss, Prediction
from messages.reference import Motion, Reference
from messages.sensors import BatterySample, LeakSample, TemperatureSample
from messages.state import VehicleState
from messages.topic import AnyTopic, Side
from messages.units import Ns
from messages.vehicle import Actuation, VehicleStatus
from services.runtime.bus.spaces import namespace

TICK_HZ = 100.0  # [1/s] of the fastest rows
THRUSTERS = 8
SERVICES: dict[Side, tuple[str, ...]] = {
    "drone": (
        *("simulator", "estimation", "reference", "control", "recorder"),
        *("link_monitor_drone", "supervisor_drone"),
    ),
    "topside": ("gamepad", "link_monitor", "predictor", "recorder_topside", "supervisor_topside"),
}
# What a side asks for across the network, as recordings of real ones show. The rest is not sent.
ASKED: dict[Side, tuple[AnyTopic, ...]] = {
    "topside": (
        *(topics.STATE, topics.REFERENCE, topics.THRUSTERS, topics.ACTUATION, topics.STATUS),
        *(topics.BATTERY, topics.CLOCK_PONG, topics.PILOT_ANSWER),
        *(topics.IDENTITY, topics.HEALTH, topics.LOG),
    ),
    "drone": (
        *(topics.PILOT_COMMAND, topics.PILOT_REQUEST, topics.CLOCK_PING, topics.CLOCK),
        *(topics.IDENTITY, topics.HEALTH, topics.LOG),
    ),
}
SECOND_HZ = 1.0  # [1/s] rows that the table calls events, and that come every second

_AT, _SMALL = 1_700_000_000_000, 0.012345
_ESTIMATE = Estimate(1.2345678, _SMALL)
_MOTION = Motion(1.2345678, 0.1, 0.01, 0.001, 1.5)
_SIX = (10.5, 0.25, 8.75, 0.125, 0.5, 1.75)
_EVENTS = {
    events.SATURATED("depth"): 3,
    events.LOST(topics.PILOT_COMMAND.key): 1,
    events.STALE(topics.STATE.key): 2,
    events.LATE("state"): 4,
}
_COUNTS = {event.name: times for event, times in _EVENTS.items()}
_STAGES = tuple(Stage(name, 1.25, 3.5) for name in DOWN_STAGES)
_SCREEN = tuple(Stage(name, 1.25, 3.5) for name in UP_STAGES)


class SyntheticStream(NamedTuple):
    """One row of one drone."""

    topic: AnyTopic  # its key is whole: from the network's root
    hz: float  # [1/s]
    example: Message


def said_by(side: Side, name: str, *, messages: str = "") -> list[SyntheticStream]:
    """What this side of the drone of this name says, to whoever asks for it.

    Args:
        messages: hash of its messages.
    """
    rows = _drone(messages) if side == "drone" else _topside(messages)
    return [
        SyntheticStream(row_of(topic, key=f"{namespace(name)}/{topic.key}"), hz, example)
        for topic, hz, example in rows
    ]


def due(streams: list[SyntheticStream], tick: int, phase: int = 0) -> Iterator[int]:
    """Numbers of the streams that speak in this tick.

    Args:
        phase: [ticks] by which a drone is before the others: not all speak at once.
    """
    for number, stream in enumerate(streams):
        if (tick + phase + number) % round(TICK_HZ / stream.hz) == 0:
            yield number


def said(stream: SyntheticStream, seq: int, now: Ns) -> Message:
    """Its next message."""
    return replace(stream.example, seq=seq, stamp_ns=now)


Row = tuple[AnyTopic, float, Message]


def _drone(messages: str) -> Iterator[Row]:
    thrust = tuple(float(n) + 0.5 for n in range(THRUSTERS))
    examples: dict[AnyTopic, Any] = {
        topics.STATE: _state(),
        topics.REFERENCE: Reference(
            stamp_ns=_AT, sensor_ns=_AT, pilot_ns=_AT, epoch=3, armed=True, armed_ns=_AT,
            depth=_MOTION, heading=_MOTION, surge_force=1.5, sway_force=2.5,
        ),
        topics.WRENCH: Wrench(
            stamp_ns=_AT, sensor_ns=_AT, wanted=_SIX, achieved=_SIX, depth_integral=1.5,
            heading_integral=0.5, saturated=False, disturbance=_SIX,
        ),
        topics.THRUSTERS: ThrusterCommand(
            stamp_ns=_AT, sensor_ns=_AT, pilot_ns=_AT, thrust=thrust, armed=True, armed_ns=_AT
        ),
        topics.ACTUATION: Actuation(
            stamp_ns=_AT, thrust=thrust, actuated_ns=_AT, sensor_ns=_AT, pilot_ns=_AT, stale=False,
            power=95.5,
        ),
        topics.STATUS: VehicleStatus(
            stamp_ns=_AT, activity="piloted", armed=True, pilot="ann", epoch=3,
            depth=2.5, heading=0.5,
        ),
        topics.BATTERY: BatterySample(
            stamp_ns=_AT, voltage=16.0, current=6.5, used_wh=12.5, capacity_wh=266.0
        ),
        topics.LEAK: LeakSample(stamp_ns=_AT, wet=False),
        topics.TEMPERATURE: TemperatureSample(stamp_ns=_AT, temperature=31.5),
        topics.CLOCK_PONG: ClockPong(stamp_ns=_AT, ping_ns=_AT, heard_ns=_AT, source=2**40),
    }  # fmt: skip
    for topic, example in examples.items():
        yield topic, topic.hz, example
    yield from _of_any_side("drone", messages)


def _topside(messages: str) -> Iterator[Row]:
    command = PilotCommand(
        stamp_ns=_AT, surge=0.25, sway=0.0, heave=0.5, yaw=0.125, source="ann", epoch=3
    )
    miss = Miss(_SMALL, _SMALL, _SMALL)
    examples: dict[AnyTopic, Any] = {
        topics.PILOT_COMMAND: command,
        topics.CLOCK_PING: ClockPing(stamp_ns=_AT, source=2**40),
        topics.CLOCK: Clock(
            stamp_ns=_AT, offset_ns=10**9, bound_ns=10**5, drift_ppm=1.5, rtt_ms=2.5,
            rtt_min_ms=1.5, answered_ms=20.0, source=2**40, epoch=3,
        ),
        topics.LATENCY: LatencyBudget(
            stamp_ns=_AT, down=_STAGES, up=_SCREEN, stick_to_thruster_ms=12.5,
            sensor_to_screen_ms=40.5, bound_ms=0.5,
        ),
        topics.PREDICTION: Prediction(
            stamp_ns=_AT, state_ns=_AT, ahead_ms=12.5, depth=1.5, heading=0.5, depth_rate=0.125,
            yaw_rate=0.25, forward=0.05, starboard=0.025, missed=miss, delayed=miss,
        ),
    }  # fmt: skip
    for topic, example in examples.items():
        yield topic, topic.hz, example
    yield topics.SHOWN.of("visualizer"), topics.SHOWN.hz, Shown(stamp_ns=_AT, sensor_ns=_AT)
    yield from _of_any_side("topside", messages)


def _of_any_side(side: Side, messages: str) -> Iterator[Row]:
    identity = SideIdentity(
        stamp_ns=_AT, side=side, instance=2**40, version="0.1.0", commit="0123456789ab",
        messages=messages, vehicle="pioneer", vehicle_hash="0123456789abcdef",
    )  # fmt: skip
    yield topics.IDENTITY.of(side), SECOND_HZ, identity
    for service in SERVICES[side]:
        health = Health(
            stamp_ns=_AT, service=service, loop_hz=200.0, lateness_p50_ms=0.25, lateness_p99_ms=1.5,
            cpu_percent=4.5, rss_mb=60.5, sent=10**5, received=10**5, counts=_COUNTS, side=side,
            pid=12345, instance=2**40,
        )  # fmt: skip
        yield topics.HEALTH.of(service), topics.HEALTH.hz, health


def _state() -> VehicleState:
    return VehicleState(
        stamp_ns=_AT, sensor_ns=_AT, phase="running", depth=_ESTIMATE, depth_rate=_ESTIMATE,
        depth_acceleration=_ESTIMATE, attitude=(0.5, 0.5, 0.5, 0.5), roll=_ESTIMATE,
        pitch=_ESTIMATE, heading=_ESTIMATE, heading_navigation=_ESTIMATE, yaw_rate=_ESTIMATE,
        surge_velocity=_ESTIMATE, sway_velocity=_ESTIMATE, pressure_age_ms=12.5,
    )  # fmt: skip
