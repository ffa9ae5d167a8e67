"""What a step of the controller costs, allocation included, on messages as services send them."""

from collections.abc import Callable
from itertools import product
from math import pi, sin

from lindy.api.dives import Stack
from lindy.api.messages import Estimate, Motion, Reference, VehicleState
from lindy.api.vehicle import Vehicle
from lindy_research.bench.timing import race
from messages.events import Outbox
from messages.units import Ns
from services.control.core import Controller, Settings

VEHICLES = ("pioneer", "bluerov2_heavy")
MOST = 80.0  # [µs] a step may cost
STEP_NS = 10_000_000
STEPS = 100  # few, so that a turn is seldom interrupted
TURNS = 100
RATE = 2 * pi / (STEPS * STEP_NS / 1e9)  # [rad/s] once round in a turn, so that turns join
LAG = 0.05  # [s] by which the vehicle is behind
SIZES = {"depth": 0.01, "heading": 0.03, "north": 0.02, "east": 0.01}  # [m], [rad]
Inputs = list[tuple[Reference, VehicleState, Ns]]


def microseconds() -> dict[str, float]:
    """[µs] Of a step, by vehicle and by what is held."""
    ways = list(product(VEHICLES, (False, True)))
    best = race(*(_steps(name, place=place) for name, place in ways), repeats=TURNS)
    held = {False: "depth and heading", True: "north and east too"}
    return {
        f"{name}, {held[place]}": ns / 1e3 for (name, place), ns in zip(ways, best, strict=True)
    }


def controller(vehicle: str) -> Controller:
    """As its vehicle file says."""
    stack = Stack(vehicle=vehicle)
    return Controller(
        stack.section("control", Settings), stack.section("vehicle", Vehicle), Outbox()
    )


def moving_inputs(*, place: bool) -> Inputs:
    """A reference that moves on every axis, and a vehicle a little behind it."""
    return [_inputs(k * STEP_NS, place=place) for k in range(STEPS)]


def _inputs(now: Ns, *, place: bool) -> tuple[Reference, VehicleState, Ns]:
    t, begun = now / 1e9, now - STEP_NS // 5
    wanted, there = [
        {axis: _swing(size, RATE * moment + k) for k, (axis, size) in enumerate(SIZES.items())}
        for moment in (t, t - LAG)
    ]
    reference = Reference(
        stamp_ns=now, sensor_ns=begun, pilot_ns=begun, armed=True,
        depth=wanted["depth"], heading=wanted["heading"],
        surge_force=5.0 * sin(RATE * t), sway_force=4.0 * sin(RATE * t + 1.0),
        north=wanted["north"] if place else None, east=wanted["east"] if place else None,
    )  # fmt: skip

    def known(value: float) -> Estimate:
        return Estimate(value, 0.01)

    state = VehicleState(
        stamp_ns=begun, sensor_ns=begun, phase="running",
        depth=known(there["depth"].position), depth_rate=known(there["depth"].velocity),
        depth_acceleration=known(there["depth"].acceleration),
        attitude=(1.0, 0.0, 0.0, 0.0), roll=known(0.02), pitch=known(-0.03),
        heading=known(there["heading"].position), heading_navigation=None,
        yaw_rate=known(there["heading"].velocity),
        surge_velocity=known(there["north"].velocity) if place else None,
        sway_velocity=known(there["east"].velocity) if place else None,
        north=known(there["north"].position) if place else None,
        east=known(there["east"].position) if place else None,
    )  # fmt: skip
    return reference, state, now


def _swing(size: float, angle: float) -> Motion:
    """A sine and its derivatives."""
    swing = [size * RATE**k * sin(angle + k * pi / 2) for k in range(4)]
    return Motion(*swing)


def _steps(vehicle: str, *, place: bool) -> Callable[[], int]:
    steers, inputs = controller(vehicle), moving_inputs(place=place)

    def turn() -> int:
        for reference, state, now in inputs:
            steers.step(reference, state, now)
        steers.outbox.counts.clear()
        return STEPS

    return turn
