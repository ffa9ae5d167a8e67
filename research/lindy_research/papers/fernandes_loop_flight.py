"""Minerva flown along the routes of Fernandes et al. 2015, 4.1 and 4.3, on virtual time.

Simulator, estimation, control and the route, each as a service of its own; the simulated hull is
not quite the one of the vehicle file. The dive to 80 m is left out: the drone calibrates at the
surface in still water, and goes on at depth as after a restart.
"""

import tempfile
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from lindy.api.dives import Registry, Stack, VirtualHost
from lindy.api.messages import (
    DvlSample,
    ThrusterCommand,
    Topic,
    Truth,
    VehicleState,
    Wrench,
    topics,
)
from lindy.api.references import plan
from lindy.api.service import Node
from lindy.api.vehicle import Vehicle
from lindy_research.papers import fernandes_loop_law
from lindy_research.papers.fernandes_loop_guide import Guide
from lindy_research.papers.fernandes_model import peak_limits
from lindy_research.papers.setups import MIN_RADIUS, SEA_TRIAL, paper_path, paper_route, table_3
from messages.topic import M
from services.reference.paths.path import Path
from services.reference.trajectory.minimum_jerk import MotionProfile
from services.runtime.bus.envelope import Envelope
from services.runtime.hosts.registry import Wire, wire_of
from services.simulator.core import Settings, at_the_surface
from tools.generators.route import Route, sequence, stretch

Floats = NDArray[np.float64]
LawName = Literal["paper", "lindy"]

DEPTH = 80.0  # [m] printed for 4.3
BEGIN = 50.0  # [s] of station keeping before the route, as in 4.3
KEPT = 20.0  # [s] of that which is kept, when the start has settled, and as much after the route
EVERY_NS = 100_000_000  # [ns] between two rows of what is kept
LONGEST_START = 60.0  # [s] until it is calibrated, or something is wrong
SEED = 0  # [-] as everywhere

# What the drone meets: not printed but for the rates of the sensors.
PLACE = (
    "simulator.current={north=0.08, east=-0.06, std=0.03, time_constant=120}",  # [m/s], [s]
    "simulator.usbl.rate=1",  # [1/s] "at most 1 Hz"
)
# 4.3 was a simulation, and says nothing of an umbilical. It decides: with that of the vehicle file,
# 98 N of drag at 0.4 m/s, the largest path error is 1.05 m with the paper's law, 0.33 m with ours.
UNTETHERED = ("simulator.tether.drag_coefficient=0",)
DRAG_MORE = 1.15  # [-] the hull's damping and added mass beside those of the file
ADDED_MORE = 1.1  # [-]


class Track(NamedTuple):
    """Rows of one kind of message. NED and body FRD, SI units."""

    t: Floats  # [s]
    place: Floats  # n × 3 [m]
    velocity: Floats  # n × 4: surge, sway, heave [m/s], yaw rate [rad/s]
    heading: Floats  # [rad] from north, accumulated


@dataclass(frozen=True, eq=False)
class LoopRun:
    """What is kept of a flight. Times count from arming."""

    begin: float  # [s] of the route
    end: float  # [s] of the route
    truth: Track
    wanted: Track  # at the times of the truth
    estimate: Track
    measured: tuple[Floats, Floats]  # DVL: time [s], n × 3 [m/s] body
    commanded: tuple[Floats, Floats]  # time [s], n × 4 [N, N m] surge, sway, heave, yaw
    thrust: Floats  # [N] n × 5 at the same times, in the order of the vehicle file

    @property
    def under_way(self) -> NDArray[np.bool_]:
        """Rows of the truth that are judged."""
        return (self.truth.t >= self.begin) & (self.truth.t <= self.end)

    @property
    def path_error(self) -> Floats:
        """[m] Distance in space from where it should be at that moment."""
        return np.linalg.norm(self.truth.place - self.wanted.place, axis=1)

    @property
    def depth_error(self) -> Floats:
        """[m] Positive: too deep."""
        return self.truth.place[:, 2] - self.wanted.place[:, 2]

    @property
    def heading_error(self) -> Floats:
        """[rad]"""
        off = self.truth.heading - self.wanted.heading
        return np.arctan2(np.sin(off), np.cos(off))

    def worst(self) -> tuple[float, float, float]:
        """Largest errors under way: path [m], depth [m], heading [rad]."""
        errors = self.path_error, self.depth_error, self.heading_error
        path, depth, heading = (float(np.max(np.abs(e[self.under_way]))) for e in errors)
        return path, depth, heading


def trial_route(way: LawName) -> Route:
    """50 m straight north (4.1)."""
    path, model = Path.through(((0.0, 0.0), (SEA_TRIAL.length, 0.0)), MIN_RADIUS), plan(SEA_TRIAL)
    if way == "paper":
        return Route(path, model)
    return Route(path, stretch(SEA_TRIAL.length, peak_limits(model), SEA_TRIAL.cruise))


def survey_route(way: LawName) -> Route:
    """The path of Table 4 with the speeds of Table 3 (4.3); ours with the greatest jerk and
    acceleration of the paper's, and turns whose yaw is C2."""
    if way == "paper":
        return paper_route()
    path = paper_path(smooth_yaw=True)
    parts: list[MotionProfile] = []
    for request in table_3(path):
        model = plan(request)
        moves = model.phases[0].duration + model.phases[3].duration > 0
        if moves:
            limits, v = peak_limits(model), (request.cruise, request.initial, request.final)
            parts.append(stretch(request.length, limits, *v))
        else:
            parts.append(model)
    return Route(path, sequence(parts))


def trial(way: LawName) -> LoopRun:
    """4.1, a sea trial: with an umbilical."""
    return flown(trial_route(way), way, trial_route("paper").duration + KEPT)


def survey(way: LawName) -> LoopRun:
    """4.3, a simulation: without one."""
    return flown(survey_route(way), way, survey_route("paper").duration + KEPT, UNTETHERED)


def flown(
    route: Route, way: LawName, seconds: float, place: tuple[str, ...] = (), begin: float = BEGIN
) -> LoopRun:
    """A flight along a route. The same arguments give the same flight.

    Args:
        seconds: [s] from the begin of the route to the end of the flight.
        place: more of what the drone meets, as assignments into the vehicle file.
        begin: [s] of station keeping before the route.

    Raises:
        RuntimeError: the drone is not ready to go.
    """
    guide = Guide(route, DEPTH, begin)
    notes, rows = LoopLog(guide), Registry.read()
    with tempfile.TemporaryDirectory() as folder:
        stack = Stack(vehicle="minerva", out=folder, seed=SEED, overrides=[*PLACE, *place])
        host = _at_depth(stack)
        host.add("reference", rows["reference"], stack, guide.wire)
        law: Wire = fernandes_loop_law.wire if way == "paper" else wire_of("control")
        host.add("control", rows["control"], stack, law)
        notes.listen(host)
        host.run(host.now + round(LONGEST_START * 1e9), done=lambda: guide.armed_ns is not None)
        if guide.armed_ns is None:
            raise RuntimeError(f"the drone does not know its place after {LONGEST_START:.0f} s")
        host.run(guide.armed_ns + round((begin + seconds) * 1e9))
    return notes.flight()


def _at_depth(stack: Stack) -> VirtualHost:
    """Simulator and estimator, calibrated, at rest at DEPTH."""
    host, rows = VirtualHost(), Registry.read()
    ready: list[int] = []

    def hear(state: VehicleState, now: int) -> None:
        if state.phase == "running" and not ready:
            ready.append(now)

    in_harbour = msgspec.structs.replace(stack, overrides=["simulator.current={}"])
    host.add("simulator", rows["simulator"], in_harbour)
    host.add("estimation", rows["estimation"], stack)
    host.node("ear", ["drone"]).each(topics.STATE, hear)
    host.run(round(LONGEST_START * 1e9), done=lambda: bool(ready))
    if not ready:
        raise RuntimeError(f"the drone is not calibrated after {LONGEST_START:.0f} s")
    host.run(host.now + 2_000_000_000)  # until it has written down what it has learnt
    for name in ("ear", "simulator", "estimation"):
        host.kill(name)
    real = msgspec.structs.replace(stack, overrides=[*stack.overrides, *_real_hull(stack)])
    host.add("simulator", rows["simulator"], real, _submerged)
    host.add("estimation", rows["estimation"], stack)
    return host


def _submerged(node: Node, stack: Stack) -> None:
    """The simulator, resumed at rest at DEPTH."""
    vehicle, settings = stack.section("vehicle", Vehicle), stack.section("simulator", Settings)
    start = at_the_surface(vehicle, settings)
    state = (0.0, 0.0, DEPTH, *start.state[3:])
    node.save_checkpoint(msgspec.structs.replace(start, state=state))
    wire_of("simulator")(node, stack)


def _real_hull(stack: Stack) -> list[str]:
    vehicle = stack.section("vehicle", Vehicle)
    linear = [DRAG_MORE * d for d in vehicle.linear_damping]
    quadratic = [DRAG_MORE * d for d in vehicle.quadratic_damping]
    added = [ADDED_MORE * m for m in vehicle.added_mass]
    return [
        f"vehicle.linear_damping={linear}",
        f"vehicle.quadratic_damping={quadratic}",
        f"vehicle.added_mass={added}",
    ]


@dataclass(slots=True)
class LoopLog:
    """What is heard during a flight, ten times a second."""

    guide: Guide
    truth: list[Truth] = field(default_factory=list[Truth])
    states: list[VehicleState] = field(default_factory=list[VehicleState])
    dvl: list[DvlSample] = field(default_factory=list[DvlSample])
    wrenches: list[Wrench] = field(default_factory=list[Wrench])
    commands: list[ThrusterCommand] = field(default_factory=list[ThrusterCommand])

    def listen(self, host: VirtualHost) -> None:
        """Hear it all. What is not kept is not decoded, which saves a quarter of the time."""
        port = host.side("drone")

        def keep(topic: Topic[M], rows: list[M], every_ns: int = EVERY_NS) -> None:
            decode = msgspec.msgpack.Decoder(topic.message).decode

            def hear(envelope: Envelope) -> None:
                early = self.guide.seconds(host.now) < self.guide.begin - KEPT
                if host.now % every_ns == 0 and not early:
                    rows.append(decode(envelope.payload))

            port.hear(topic.key, hear)

        keep(topics.TRUTH, self.truth)
        keep(topics.STATE, self.states)
        keep(topics.WRENCH, self.wrenches)
        keep(topics.THRUSTERS, self.commands)
        keep(topics.DVL, self.dvl, every_ns=1)

    def flight(self) -> LoopRun:
        guide = self.guide
        truth = _of_truth(self.truth, guide)
        wrenches = np.array([w.wanted for w in self.wrenches])
        return LoopRun(
            begin=guide.begin,
            end=guide.begin + guide.route.duration,
            truth=truth,
            wanted=_of_route(truth.t, guide),
            estimate=_of_states(self.states, guide),
            measured=(
                np.array([guide.seconds(m.stamp_ns) for m in self.dvl]),
                np.array([m.velocity for m in self.dvl]),
            ),
            commanded=(
                np.array([guide.seconds(w.stamp_ns) for w in self.wrenches]),
                wrenches[:, (0, 1, 2, 5)],
            ),
            thrust=np.array([c.thrust for c in self.commands]),
        )


def _of_truth(rows: list[Truth], guide: Guide) -> Track:
    return Track(
        np.array([guide.seconds(m.stamp_ns) for m in rows]),
        np.array([m.position for m in rows]),
        np.array([(*m.velocity, m.angular_rate[2]) for m in rows]),
        np.array([m.heading for m in rows]),
    )


def _of_states(rows: list[VehicleState], guide: Guide) -> Track:
    found = [
        (m.north.value, m.east.value, m.surge_velocity.value, m.sway_velocity.value)
        if m.north and m.east and m.surge_velocity and m.sway_velocity
        else (np.nan,) * 4
        for m in rows
    ]
    return Track(
        np.array([guide.seconds(m.sensor_ns) for m in rows]),
        np.array([(f[0], f[1], m.depth.value) for f, m in zip(found, rows, strict=True)]),
        np.array(
            [
                (f[2], f[3], m.depth_rate.value, m.yaw_rate.value)
                for f, m in zip(found, rows, strict=True)
            ]
        ),
        np.array([m.heading_navigation.value if m.heading_navigation else np.nan for m in rows]),
    )


def _of_route(t: Floats, guide: Guide) -> Track:
    points = [guide.route.at(float(x) - guide.begin) for x in t]
    return Track(
        t,
        np.array([(p.north, p.east, guide.depth) for p in points]),
        np.array([(p.surge_velocity, p.sway_velocity, 0.0, p.yaw_rate) for p in points]),
        np.array([p.heading for p in points]),
    )
