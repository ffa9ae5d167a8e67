"""What a router and a link need, as a function of the messages that pass. Pure.

Two straight lines, each fitted by least squares to half of the measured points and checked on the
other half:

    cores of a router = idle + per_hub * hubs joined + per_message * messages routed a second
    bytes on a link   = payload + per_message * messages

A message is routed once by every router on its way, however many bytes it has.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np

from lindy_research.scale.traffic import FleetTraffic

JOIN_S = 30.0  # [s] that joining may take


class ScalePoint(msgspec.Struct, frozen=True):
    """One measurement: so many synthetic drones and pilots on two routers."""

    drones: int
    speed: float  # times the table's rates
    messages_hz: float  # [1/s] that passed each router
    payload_hz: float  # [bytes/s] of them
    wire_hz: float | None  # [bytes/s] on the link between both routers; None: not measured
    cores: float  # mean of both routers
    p50_ms: float  # [ms] from a drone to its pilot
    p99_ms: float


class FleetJoin(msgspec.Struct, frozen=True):
    """One measurement: so many drones that join at once."""

    drones: int
    clients: bool  # they are Zenoh clients of the router; False: routers, as hubs are
    seconds: float | None  # until all were known at the other router; None: not in `JOIN_S`
    router_s: float  # [s] of processor time of both routers meanwhile
    idle_cores: float  # of both, afterwards, while nobody says anything


class ScaleModel(NamedTuple):
    """Fitted."""

    idle: float  # [cores] of a router
    per_message: float  # [core s] of a router for one message
    overhead: float  # [bytes] on the wire of a message, besides its payload

    def cores(self, traffic: FleetTraffic) -> float:
        """Of one router that all of this passes."""
        return self.idle + self.per_message * traffic.messages_hz

    def bits_hz(self, traffic: FleetTraffic) -> float:
        """[bit/s] On one link that all of this passes; without TCP's and IP's part."""
        return 8.0 * (traffic.payload_hz + self.overhead * traffic.messages_hz)


def fit(points: Sequence[ScalePoint]) -> ScaleModel:
    """By least squares, of relative errors: a small fleet counts as much as a large one.

    Args:
        points: two different loads at least.
    """
    hz = np.array([point.messages_hz for point in points])
    cores = np.array([point.cores for point in points])
    matrix = np.stack([np.ones_like(hz), hz], axis=1) / cores[:, None]
    (idle, per_message), *_ = np.linalg.lstsq(matrix, np.ones_like(hz), rcond=None)
    wired = [point for point in points if point.wire_hz is not None]
    overheads = [((p.wire_hz or 0.0) - p.payload_hz) / p.messages_hz for p in wired]
    overhead = float(np.mean(overheads)) if overheads else 0.0
    return ScaleModel(max(0.0, float(idle)), float(per_message), overhead)


def halves(points: Sequence[ScalePoint]) -> tuple[list[ScalePoint], list[ScalePoint]]:
    """To fit, and to check: every second one, by load."""
    by_load = sorted(points, key=lambda point: point.messages_hz)
    return by_load[::2], by_load[1::2]


class ScaleMiss(NamedTuple):
    """What the model says of a point that it was not fitted to."""

    point: ScalePoint
    cores: float
    wire_hz: float | None  # [bytes/s]

    @property
    def cores_off(self) -> float:
        """[-] Relative error."""
        return self.cores / self.point.cores - 1.0

    @property
    def wire_off(self) -> float | None:
        """[-] Relative error."""
        if self.wire_hz is None or not self.point.wire_hz:
            return None
        return self.wire_hz / self.point.wire_hz - 1.0


def check(model: ScaleModel, points: Sequence[ScalePoint]) -> list[ScaleMiss]:
    """The model beside what was measured."""
    return [
        ScaleMiss(
            point, model.cores(passing), model.bits_hz(passing) / 8.0 if point.wire_hz else None
        )
        for point in points
        for passing in [FleetTraffic(point.messages_hz, point.payload_hz)]
    ]


class FleetPlan(NamedTuple):
    """A fleet: drones at routers of their own site, pilots at those of a centre, and core routers
    between the two. Everybody is at the next router; the load is spread evenly."""

    drones: int
    per_site: int = 10  # drones at one router
    per_desk: int = 25  # pilots at one router
    watchers: int = 2  # who see all drones, as `lindy drones --watch` does
    most_cores: float = 0.5  # of a core router; more of them where it would need more

    @property
    def sites(self) -> int:
        return math.ceil(self.drones / self.per_site)

    @property
    def desks(self) -> int:
        return math.ceil(self.drones / self.per_desk)


class FleetLoad(NamedTuple):
    """What passes each part of a plan."""

    site: FleetTraffic  # a site's router, and up and down its link
    site_up: FleetTraffic  # of it what goes up
    core: FleetTraffic  # all core routers together
    desk: FleetTraffic  # a router of the centre
    watcher: FleetTraffic  # the link of one who watches


def load(plan: FleetPlan, up: FleetTraffic, down: FleetTraffic, watched: FleetTraffic) -> FleetLoad:
    """
    Args:
        up, down: of one drone that is flown.
        watched: of one drone, for one who watches.
    """
    # A router asks once for a row, however many behind it want it: who watches hears copies that
    # the core makes, and of a row that the pilot has, none comes twice up the link.
    copies = watched.times(plan.watchers)
    return FleetLoad(
        site=(up + down).times(plan.per_site),
        site_up=up.times(plan.per_site),
        core=(up + down + copies).times(plan.drones),
        desk=(up + down).times(plan.per_desk),
        watcher=watched.times(plan.drones),
    )


def core_routers(plan: FleetPlan, model: ScaleModel, passing: FleetTraffic) -> int:
    """How many core routers it takes."""
    room = (plan.most_cores - model.idle) / model.per_message
    return max(1, math.ceil(passing.messages_hz / room))
