"""Manoeuvres: go to a position, or follow a path."""

from dataclasses import dataclass
from math import dist

from msgspec import UNSET

from messages.pilot import Course, StopDistance
from services.marine.attitude import wrapped
from services.reference.guidance.axes import Axes
from services.reference.guidance.ground_motion import Pair
from services.reference.guidance.path_following import PathFollowing, PlannedPath
from services.reference.trajectory.minimum_jerk import Sample
from services.reference.trajectory.position import go

AIMED = 0.01  # [rad] a path begins when the heading error is at most this
AT_DEPTH = 1e-6  # [m] and when the depth reference is this close to the path's depth
AT_GOAL = 0.05  # [m] a goal this close counts as reached


@dataclass(slots=True)
class Manoeuvre:
    """Moves the axes to a goal; at its end the axes continue without a step. Depth and heading must
    be held meanwhile. Times `t` in seconds."""

    axes: Axes
    going: bool = False  # to a depth, a heading or both
    planned: PlannedPath | None = None  # a path to follow, once the drone points along it
    following: PathFollowing | None = None
    measured: bool = False  # position along the path is measured, not dead-reckoned
    goal: Pair | None = None  # [m] north, east, at the end of a straight line

    @property
    def on_a_path(self) -> bool:
        return self.planned is not None or self.following is not None

    @property
    def busy(self) -> bool:
        return self.going or self.on_a_path

    def waypoints(self, t: float) -> tuple[Pair, ...]:
        """[m] North, east of the next ones of a path; none of a line to a goal."""
        following = self.following
        return () if following is None or self.goal is not None else following.ahead(t)

    def go(self, depth: float | None, heading: float | None, t: float) -> None:
        """Go to a depth [m] and a control heading [rad], accumulated."""
        s, axes = self.axes.settings, self.axes
        if depth is not None:
            axes.go_to_depth(depth, t)
        if heading is not None:
            go(axes.yaw, heading, s.yaw.limits, s.yaw.max_velocity, t)
        self.going = True

    def turn_to(self, heading: float, t: float) -> float:
        """[rad] Accumulated heading for one in (-π, π], by the shortest turn."""
        here = self.axes.yaw.at(t).position
        return here + wrapped(heading - here)

    def follow(
        self,
        planned: PlannedPath,
        t: float,
        *,
        measured: bool,
        offset: float,
        goal: Pair | None = None,
    ) -> None:
        """Turn to the path's first heading and depth, then follow it.

        Args:
            measured: hold the position until the path begins, and begin it there.
            offset: [rad] north heading minus control heading.
            goal: [m] the path is a line to here from wherever the drone comes to rest.
        """
        self.planned, self.measured, self.goal = planned, measured, goal
        self._line_up(planned, offset if measured else 0.0, t)

    def set_off(self, t: float) -> None:
        """Begin a planned path once heading, depth and position are settled."""
        planned, axes = self.planned, self.axes
        if planned is None:
            self.going = self.going and axes.settles() > t
            return
        if axes.settles() > t or (self.measured and not axes.place.held):
            return
        place, offset = None, 0.0
        if self.measured:
            north, east = axes.place.now
            place, offset = (north.position, east.position), axes.place.offset
        if self.goal is not None and place is not None:
            if dist(place, self.goal) < AT_GOAL:
                self._forget()
                return
            planned = self.planned = PlannedPath(Course(waypoints=(place, self.goal)))
        if not self._is_lined_up(planned, offset, t):
            self._line_up(planned, offset, t)
            return
        self.following = planned.begin(axes.yaw.at(t).position, place, t)
        self.planned, axes.place.held = None, False

    def go_blind(self) -> None:
        """Position measurement lost: continue by dead reckoning, except towards a goal."""
        self.measured = False
        if self.following is not None:
            self.following.shift = None
        elif self.goal is not None:
            self._forget()

    def come_to_rest(self, t: float) -> None:
        """End the manoeuvre at rest; on a path, the stop is along the path."""
        following = self.following
        if following is None and self.busy:
            self.axes.brake(t)
        self._forget()
        if following is not None:
            self.following, _ = following.stop(self.axes.settings.place.limits, t)

    def stop(self, t: float) -> StopDistance:
        """Emergency stop, along the path if there is one. Returns the stopping distance."""
        axes, following = self.axes, self.following
        axes.force.aim((0.0, 0.0), t, axes.settings.horizontal.stop)
        self._forget()
        if following is not None:
            here = following.point(t)
            self.following, end = following.stop(axes.settings.place.stop, t)
            there = self.following.point(end)
            ground = dist((here.north, here.east), (there.north, there.east))
            return StopDistance(
                there.down - here.down,
                there.heading - here.heading,
                end - t,
                ground if self.measured else UNSET,
            )
        axes.stop(t)
        return StopDistance(
            axes.heave.to_go(t),
            axes.yaw.to_go(t),
            axes.settles() - t,
            axes.place.to_go(axes.yaw.at) if axes.place.held else UNSET,
        )

    def end(self, t: float, *, hold_place: bool) -> None:
        """Hand the motion to the axes without a step. With `hold_place`, a measured path ends in
        station keeping; otherwise the speed is ramped out along the heading."""
        axes, following = self.axes, self.following
        if self.going or self.planned is not None:
            axes.brake(t)
        self._forget()
        if following is None:
            return
        here = following.point(t)
        heading, place = following.heading(here), following.place(here)
        axes.yaw.take(heading, t)
        if following.has_depth:
            axes.heave.take(following.depth(here), t)
        if hold_place and place is not None:
            axes.place.take(*place, t)
        else:
            along = following.along(t)
            axes.pace.take(Sample(0.0, along.velocity, along.acceleration, along.jerk), t)

    def _line_up(self, planned: PlannedPath, offset: float, t: float) -> None:
        """Go to the path's first heading and depth."""
        heading = planned.first_heading(self.axes.yaw.at(t).position, offset)
        self.go(planned.first_depth if planned.has_depth else None, heading, t)
        self.going = False

    def _is_lined_up(self, planned: PlannedPath, offset: float, t: float) -> bool:
        """False if the reference governor moved the reference, or the drone rests elsewhere."""
        depth, heading = self.axes.heave.at(t).position, self.axes.yaw.at(t).position
        if planned.has_depth and abs(planned.first_depth - depth) > AT_DEPTH:
            return False
        return abs(planned.first_heading(heading, offset) - heading) <= AIMED

    def _forget(self) -> None:
        self.going, self.planned, self.following, self.goal = False, None, None, None
