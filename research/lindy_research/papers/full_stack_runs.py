"""The Pioneer through steps in depth and heading, flown by the whole chain with estimates, noise,
dead-bands and tether, once as it is and once without ramps (Andrén 2023, 6.2).

As in the thesis only the reference differs. Without ramps, the velocity reference jumps with the
stick, the position is its integral and there is no acceleration to feed forward: Lindy's reference
service with limits that let every transition end within a sample.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from lindy.api.dives import Stack
from lindy.api.messages import topics
from lindy.api.vehicle import Vehicle, total_wrench, wrench_per_newton
from lindy_research.dives import DT, Dive, Floats

AT_ONCE = ("heave.jerk", "heave.max_acceleration", "yaw.jerk", "yaw.max_acceleration",
           "horizontal.max_rate_change", "horizontal.max_rate")  # fmt: skip
# The jerk that a sample sees at the jump itself must not be fed forward either.
NAIVE = (
    *(f"reference.{limit}=1e6" for limit in AT_ONCE),
    "control.depth.acceleration_percent=0",
    "control.heading.acceleration_percent=0",
    "reference.standstill=0",  # which is no ramp, but is ours
)
SEEDS = (0, 1, 2)
SECONDS = 41.0  # [s]
SCRIPT = """t,surge,sway,heave,yaw
0,0,0,0,0
1,0,0,0.6,0
7,0,0,0,0
12,0,0,0.6,0
15,0,0,0,0
20,0,0,0,0.5
23,0,0,0,0
28,0.5,0,0,0
33,0.5,0,-0.6,0
36,0.5,0,0,0
41,0,0,0,0
"""  # down; a step in depth; a step in heading; ahead with a step in depth


class StickStep(NamedTuple):
    """[s] When the stick goes on, when it is released, and how long all else rests."""

    on: float
    off: float
    end: float
    near: float  # [m] or [deg] this close to where it comes to rest is there


DEPTH, HEADING = StickStep(12.0, 15.0, 20.0, 0.02), StickStep(20.0, 23.0, 28.0, 0.5)
AHEAD = (33.0, 41.0)  # [s] running ahead, and a step in depth on the way
AT_REST = (9.0, 12.0)  # [s]
RESTING = 1.5  # [s] at the end of a step it has come to rest


class AxisLog(NamedTuple):
    """One axis at 100 Hz since arming: [m] and [N], or [deg] and [N m]."""

    wanted: Floats  # reference
    wanted_rate: Floats
    estimate: Floats
    estimate_rate: Floats
    truth: Floats
    truth_rate: Floats
    asked: Floats  # force or moment that the controller asks for
    produced: Floats  # by the thrusters

    def between(self, begin: float, end: float) -> "AxisLog":
        """[s]"""
        return AxisLog(*[column[round(begin / DT) : round(end / DT)] for column in self])


class StepRun(NamedTuple):
    t: Floats  # [s] since arming
    depth: AxisLog
    heading: AxisLog
    pitch_rate: Floats  # [deg/s]


class StepScores(NamedTuple):
    """What a step costs and how well it is followed, by the truth: [m], [N] or [deg], [N m]."""

    error: float  # largest, apart from what is left at rest
    left: float  # at rest, by the estimate: what the controller knows of and leaves alone
    overshoot: float  # furthest beyond where it comes to rest
    settled: float  # [s] from the release until it stays near where it comes to rest
    peak: float  # largest force or moment asked for
    jerk: float  # per s², sum of squared changes of it per second, as in Table 6.1


@cache
def flown(seed: int = SEEDS[0], *, naive: bool) -> StepRun:
    """The same script, from the same seed."""
    dive = Dive(SCRIPT, seed=seed, overrides=NAIVE if naive else ()).until(SECONDS)
    rate = dive.column(topics.TRUTH, lambda m: m.angular_rate[1])
    return StepRun(dive.t, _depth(dive), _heading(dive), np.degrees(rate))


def scores(axis: AxisLog, step: StickStep) -> StepScores:
    whole, stop = axis.between(step.on, step.end), axis.between(step.off, step.end)
    rest = axis.between(step.end - RESTING, step.end)
    place = float(np.mean(rest.truth))
    error = whole.wanted - whole.truth - float(np.mean(rest.wanted - rest.truth))
    known = float(np.mean(rest.wanted - rest.estimate))
    away = np.flatnonzero(np.abs(stop.truth - place) > step.near)
    return StepScores(
        error=float(np.max(np.abs(error))),
        left=abs(known),
        overshoot=float(np.max(stop.truth)) - place,
        settled=DT * (float(away[-1]) + 1.0) if len(away) else 0.0,
        peak=float(np.max(np.abs(whole.asked))),
        jerk=float(np.sum((np.diff(whole.asked) / DT) ** 2)),
    )


def pitching(dive: StepRun) -> float:
    """[deg/s] rms pitch rate while it changes its depth under way."""
    begin, end = (round(t / DT) for t in AHEAD)
    return float(np.sqrt(np.mean(dive.pitch_rate[begin:end] ** 2)))


def idle(axis: AxisLog) -> float:
    """[%] Of the time at rest in which the thrusters produce nothing along the axis."""
    return 100.0 * float(np.mean(np.abs(axis.between(*AT_REST).produced) < 1e-3))


def _depth(dive: Dive) -> AxisLog:
    return AxisLog(
        wanted=dive.column(topics.REFERENCE, lambda m: m.depth.position),
        wanted_rate=dive.column(topics.REFERENCE, lambda m: m.depth.velocity),
        estimate=dive.column(topics.STATE, lambda m: m.depth.value),
        estimate_rate=dive.column(topics.STATE, lambda m: m.depth_rate.value),
        truth=dive.column(topics.TRUTH, lambda m: m.position[2]),
        truth_rate=dive.column(topics.TRUTH, lambda m: m.depth_rate),
        asked=dive.column(topics.WRENCH, lambda m: m.wanted[2]),
        produced=_produced(dive, 2),
    )


def _heading(dive: Dive) -> AxisLog:
    return AxisLog(
        wanted=np.degrees(dive.column(topics.REFERENCE, lambda m: m.heading.position)),
        wanted_rate=np.degrees(dive.column(topics.REFERENCE, lambda m: m.heading.velocity)),
        estimate=np.degrees(dive.column(topics.STATE, lambda m: m.heading.value)),
        estimate_rate=np.degrees(dive.column(topics.STATE, lambda m: m.yaw_rate.value)),
        truth=np.degrees(dive.column(topics.TRUTH, lambda m: m.heading)),
        truth_rate=np.degrees(dive.column(topics.TRUTH, lambda m: m.angular_rate[2])),
        asked=dive.column(topics.WRENCH, lambda m: m.wanted[5]),
        produced=_produced(dive, 5),
    )


def _produced(dive: Dive, axis: int) -> Floats:
    """[N] or [N m] What the thrusters add up to along an axis of the body."""
    columns = [wrench_per_newton(each) for each in Stack().section("vehicle", Vehicle).thruster]
    return dive.column(topics.ACTUATION, lambda m: total_wrench(columns, m.thrust)[axis])
