"""Hulls in the simulated sea, and simulators around them, as the tests of this room fly them."""

from typing import Any

from msgspec.structs import replace

from messages.control import ThrusterCommand
from messages.events import Outbox
from messages.units import Quaternion, Vec6
from services.marine.vehicle import Vehicle
from services.runtime.config.stack import Stack
from services.simulator.core import Simulator, WorldCheckpoint, at_the_surface
from services.simulator.settings import Settings
from services.simulator.vessel import Vessel

MS = 1_000_000  # [ns]
PIONEER = Stack().section("vehicle", Vehicle)
NEUTRAL = replace(PIONEER, net_buoyancy=0.0)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def deep(**changes: Any) -> Settings:
    """Nothing to bump into."""
    return Settings(floor_depth=1000.0, **changes)


def vessel(
    place: Settings | None = None,
    vehicle: Vehicle = NEUTRAL,
    *,
    at: tuple[float, float, float] = (0.0, 0.0, 50.0),
    q_NB: Quaternion = LEVEL,
    nu: Vec6 = REST,
    seed: int = 0,
) -> Vessel:
    """At rest over the ground, unless said otherwise."""
    still = [0.0] * len(vehicle.thruster)
    return Vessel(vehicle, place or deep(), (*at, *q_NB, *nu), still, seed)


def world(
    place: Settings | None = None,
    vehicle: Vehicle = PIONEER,
    *,
    depth: float = 5.0,
    q_NB: Quaternion = LEVEL,
    **changes: Any,
) -> WorldCheckpoint:
    """At rest so deep."""
    surface = at_the_surface(vehicle, place or Settings())
    return replace(surface, state=(0.0, 0.0, depth, *q_NB, *REST), **changes)


def simulator(
    place: Settings | None = None,
    vehicle: Vehicle = PIONEER,
    before: WorldCheckpoint | None = None,
    *,
    seed: int = 0,
    outbox: Outbox | None = None,
) -> Simulator:
    """At rest 5 m deep, unless it goes on with a world from before."""
    place = place or Settings()
    begun = before or world(place, vehicle)
    made = Simulator(vehicle, place, seed, begun, outbox or Outbox())
    made.advance(0)
    return made


def command(now: int, *thrust: float, ttl_ms: float = 200.0) -> ThrusterCommand:
    return ThrusterCommand(
        stamp_ns=now, sensor_ns=now - 1, pilot_ns=now - 2, thrust=thrust, ttl_ms=ttl_ms, armed=True
    )
