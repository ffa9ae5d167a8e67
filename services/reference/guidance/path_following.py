"""Path following on board: a path that the drone can follow, and the motion along it.

With a measured position, north, east, depth and heading all come from the path. Without, this is
dead reckoning: heading and depth follow the path, and the distance along it is the integral of the
speed reference. A stop acts along the path.

The reference waits when the drone falls behind: it runs on a clock τ that can slow to a standstill.
The clock advances with dτ/dt = λ, 0 (wait) to 1 (run), a jerk-bounded minimum-jerk reference, so
the motion in real time is as smooth as the reference up to C²:

    p = p_r(τ)    v = v_r(τ) λ    a = a_r(τ) λ² + v_r(τ) dλ/dt

It replaces the waiting of Fernandes et al. 2015 (130), which holds the position while the velocity
reference continues.
"""

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import hypot

from messages.pilot import Course
from messages.state import VehicleState
from services.marine.attitude import wrapped
from services.marine.summation import plain_sum
from services.reference.guidance.station_keeping import GroundMotion, Pair
from services.reference.paths.path import Path, RoutePoint, point_on
from services.reference.trajectory.minimum_jerk import Limits, Ramp, Sample, pair, reader, solve

WAIT, RESUME = 1.0, 0.5  # [-] of the tolerances below
HEADING_TOLERANCE = 0.35  # [rad]
DEPTH_TOLERANCE = 0.3  # [m]
PLACE_TOLERANCE = 1.0  # [m]
SHOWN = 8  # way-points, of a path of a thousand: they are sent five times a second
WAITING = Limits(4.0, 2.0)  # of the clock's rate [1/s², 1/s]


@dataclass(slots=True)
class WaitingClock:
    """Waits while the vehicle is too far from its reference, resumes once it is close again. Time
    is the caller's, in seconds, and never decreases."""

    wait_above: float  # error above which the reference waits
    resume_below: float  # and, once it waits, below which it resumes
    limits: Limits  # of λ: d²λ/dt² [1/s²], dλ/dt [1/s]
    since: float = 0.0  # [s] real time at which the reference starts, running
    waiting: bool = field(default=False, init=False)
    _ramp: Ramp = field(init=False)

    def __post_init__(self) -> None:
        self._ramp = Ramp(self.limits, target=1.0, since=self.since)

    def watch(self, error: float, t: float) -> None:
        """Take in the vehicle's error from its reference at `t` [s]; for a vector, the norm."""
        size = abs(error)
        self.waiting = size >= self.resume_below if self.waiting else size > self.wait_above
        self._ramp.aim(0.0 if self.waiting else 1.0, t)

    def at(self, t: float) -> Sample:
        """τ [s], λ [-], dλ/dt [1/s] and d²λ/dt² [1/s²] at `t` [s] of real time."""
        return self._ramp.at(t)


def scaled_sample(reference: Sample, clock: Sample) -> Sample:
    """The reference at τ, in real time."""
    (position, v, a, j), (_, rate, change, bend) = reference, clock
    acceleration = a * (rate * rate) + v * change
    jerk = j * rate**3 + 3 * a * rate * change + v * bend
    return Sample(position, v * rate, acceleration, jerk)


@dataclass(slots=True)
class PathFollowing:
    """One path, begun with the drone pointing along it. Times `t` in seconds."""

    path: Path
    turns: float  # [rad] between the path's course and the accumulated heading
    has_depth: bool
    along: Callable[[float], Sample]  # [m] distance along the path at a time
    ends: Callable[[float], bool]  # is it over at a time?
    clock: WaitingClock
    corners: tuple[Pair, ...]  # [m] NED, of the way-points as given
    shift: Pair | None  # [m] NED, from the path as given to where it is run; None: dead reckoning
    _newest: tuple[float, RoutePoint] | None = None  # the last one that was asked for, and its time

    def point(self, t: float) -> RoutePoint:
        if self._newest is None or self._newest[0] != t:
            self._newest = t, point_on(self.path, self.along(t), t)
        return self._newest[1]

    def heading(self, t: float) -> Sample:
        here = self.point(t)
        return Sample(here.heading + self.turns, here.yaw_rate, here.yaw_acceleration, 0.0)

    def depth(self, t: float) -> Sample:
        here = self.point(t)
        return Sample(here.down, here.v_down, here.a_down, 0.0)

    def place(self, t: float) -> tuple[Sample, Sample]:
        """North and east; not in dead reckoning."""
        here, (north, east) = self.point(t), self.shift or (0.0, 0.0)
        return (
            Sample(here.north + north, here.v_north, here.a_north, 0.0),
            Sample(here.east + east, here.v_east, here.a_east, 0.0),
        )

    def ahead(self, t: float) -> tuple[Pair, ...]:
        """[m] NED, of the next way-points, as far as they are shown; none in dead reckoning."""
        if self.shift is None:
            return ()
        north, east = self.shift
        passed = bisect_right(self.path.passes, self.along(t).position)
        return tuple((n + north, e + east) for n, e in self.corners[passed : passed + SHOWN])

    def watch(self, state: VehicleState, ground: GroundMotion | None, t: float) -> None:
        """Wait while the drone is too far behind. Unknown errors are ignored."""
        errors = [abs(self.heading(t).position - state.heading.value) / HEADING_TOLERANCE]
        if self.has_depth:
            errors.append(abs(self.depth(t).position - state.depth.value) / DEPTH_TOLERANCE)
        if self.shift is not None and ground is not None:
            pairs = zip(self.place(t), ground.position, strict=True)
            errors.append(hypot(*(wanted.position - x for wanted, x in pairs)) / PLACE_TOLERANCE)
        self.clock.watch(max(errors), t)

    def stop(self, limits: Limits, t: float) -> "tuple[PathFollowing, float]":
        """The same path with a stop along it from `t` on, and the time [s] of standstill."""
        here = self.along(t)
        halt = solve(here.velocity, here.acceleration, 0.0, limits)
        at, end = reader(halt, 0.0), t + plain_sum(part.duration for part in halt)

        def along(now: float) -> Sample:
            moved, *rates = at(now - t)
            return Sample(here.position + moved, *rates)

        def ends(now: float) -> bool:
            return now >= end

        return replace(self, along=along, ends=ends, _newest=None), end


@dataclass(slots=True)
class PlannedPath:
    """A path that can be followed.

    Raises:
        ValueError: the way-points make no path; says why.
    """

    course: Course
    path: Path = field(init=False)

    def __post_init__(self) -> None:
        c = self.course
        # C2 in yaw: the drone's yaw reference then has a continuous acceleration.
        self.path = Path.through(c.waypoints, c.min_radius, c.kind)
        if not (c.cruise > 0 and c.acceleration > 0 and c.jerk > 0):
            raise ValueError("cruise, acceleration and jerk must be above 0")

    @property
    def first_depth(self) -> float | None:
        """[m] None: the path has no depths."""
        return self.path.at(0.0).down if len(self.course.waypoints[0]) == 3 else None

    def first_heading(self, heading: float, offset: float) -> float:
        """[rad] The path's first course, by the shortest turn from an accumulated heading; `offset`
        [rad]: north heading minus control heading."""
        return heading + wrapped(self.path.at(0.0).course - offset - heading)

    def begin(self, heading: float, place: Pair | None, t: float) -> PathFollowing:
        """Begin at `t` [s] with the drone pointing along `first_heading`, from `place` [m] if the
        position is measured."""
        c, start = self.course, self.path.at(0.0)
        profile = pair(self.path.length, Limits(c.jerk, c.acceleration), c.cruise)
        clock = WaitingClock(WAIT, RESUME, WAITING, since=t)

        def along(now: float) -> Sample:
            at = clock.at(now)
            return scaled_sample(profile.at(at.position), at)

        return PathFollowing(
            self.path,
            heading - start.course,
            self.first_depth is not None,
            along,
            lambda now: clock.at(now).position >= profile.duration,
            clock,
            tuple((north, east) for north, east, *_ in c.waypoints),
            None if place is None else (place[0] - start.north, place[1] - start.east),
        )
