"""What the simulator costs per step of 5 ms, beside a three-hundredth of real time."""

from collections.abc import Callable

import msgspec

from lindy.api.dives import Stack
from lindy.api.messages import ThrusterCommand
from lindy.api.vehicle import Vehicle
from lindy_research.bench.table import Figure
from lindy_research.bench.timing import race
from messages.events import Outbox
from services.simulator.core import Settings, Simulator, at_the_surface
from services.simulator.vessel import Vessel

STEP = 0.005  # [s]
STEP_NS = 5_000_000
STEPS = 40  # few, so that a turn is seldom interrupted
SPEEDUP = 300.0  # [-] the goal, times real time
DEEP = Settings(floor_depth=1000.0)
# 50 m deep, level, moving a little on every axis.
UNDER_WAY = (0.0, 0.0, 50.0, 1.0, 0.0, 0.0, 0.0, 0.3, 0.05, 0.1, 0.02, -0.03, 0.2)
Turn = Callable[[], int]


def figures() -> list[Figure]:
    pioneer, heavy = _vehicle("pioneer"), _vehicle("bluerov2_heavy")
    ours, alone, measured, eight = race(
        _vessel(pioneer), _simulator(pioneer, measured=False),
        _simulator(pioneer, measured=True), _vessel(heavy),
    )  # fmt: skip
    goal = STEP * 1e9 / SPEEDUP
    name, limit = "physics, four thrusters", f"1/{SPEEDUP:g} of real time"
    return [
        _figure(name, ours, limit, goal, 1.0),
        _figure("physics, eight thrusters", eight, limit, goal, 1.0),
        _figure("with commands at 100 Hz and battery", alone, limit, goal, 1.0),
        _figure("the same, and all its sensors and truth at 100 Hz", measured, limit, goal),
    ]


def _figure(
    name: str, ours: float, other: str, baseline: float, goal: float | None = None
) -> Figure:
    return Figure(
        section="simulator", name=f"{name}, 5 ms", unit="ns", ours=ours,
        baseline_name=other, baseline=baseline, goal=goal,
    )  # fmt: skip


def _vehicle(name: str) -> Vehicle:
    return Stack(vehicle=name).section("vehicle", Vehicle)


def _thrust(vehicle: Vehicle) -> list[float]:
    return [0.2 * thruster.max_thrust for thruster in vehicle.thruster]


def _vessel(vehicle: Vehicle) -> Turn:
    ship = Vessel(vehicle, DEEP, UNDER_WAY, [0.0] * len(vehicle.thruster))
    ship.propulsion.drive(_thrust(vehicle))

    def turn() -> int:
        for _ in range(STEPS):
            ship.advance(STEP)
        return STEPS

    return turn


def _simulator(vehicle: Vehicle, *, measured: bool) -> Turn:
    begin = msgspec.structs.replace(at_the_surface(vehicle, DEEP), state=UNDER_WAY)
    sim = Simulator(vehicle, DEEP, 0, begin, Outbox())
    thrust, now = tuple(_thrust(vehicle)), 0

    def turn() -> int:
        nonlocal now
        for _ in range(STEPS // 2):
            now += STEP_NS
            sim.advance(now)
            now += STEP_NS
            command = ThrusterCommand(
                stamp_ns=now, sensor_ns=now, pilot_ns=None, thrust=thrust, armed=True
            )
            sim.obey(command, now)
            if measured:
                sim.magnetometer()
                sim.imu()
                sim.actuation()
                sim.truth()
        return STEPS

    return turn
