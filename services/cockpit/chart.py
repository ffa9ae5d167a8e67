"""Where the drone is, has been and began, for the page's map. It is shown only: nothing flies by
it. Pure.

A measured position is that of the state. Where there is none, it is reckoned from the newest one,
or from where the drone was first armed, by heading, thrust and the drag of the vehicle file. Nobody
measures the water then, so the spread grows by a rule: a current of `CURRENT` that does not change,
and `SHARE` of the way through the water, each one standard deviation. Currents of up to 0.3 m/s
then stay within two of them.

Every place belongs to an origin. Where estimation begins anew at another one, home and the track of
the one before are not shown: they would lie.
"""

from collections import deque
from dataclasses import dataclass, field
from math import ceil, cos, dist, hypot, sin

import msgspec
from msgspec import UNSET

from messages.control import Wrench
from messages.state import VehicleState
from messages.units import Ns, Vec6
from services.marine.attitude import level_velocity
from services.marine.hydrodynamics import Translation
from services.marine.vehicle import Vehicle

Pair = tuple[float, float]

CURRENT = 0.15  # [m/s] 1σ of each component of an unknown current
WAKE_SHARE = 1.0  # [-] of the Munk moment, as the simulator and control take it
AT_REST: Vec6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # [N, N m] no thrust
SHARE = 0.2  # [-] 1σ of the way through the water: thrust, drag and heading are not known better
STEP_S = 0.04  # [s] longest of one step
LONGEST_S = 5.0  # [s] of missing motion is made up for
APART = 0.5  # [m] between two points of the track, at first
MOST = 1000  # points; with more of them they are twice as far apart
REMEMBERED_NS = 3_600_000_000_000  # [ns] of the track
JUMP = 2.0  # [m] further than the drone moves in a step, beyond its spread: the line is broken
RECKONED = -1  # origin where no position was ever measured
MEASURED_ON, RECKONED_ON, BEGINS = 0, 1, 2  # how a point of the track follows the one before


class ShownPlace(msgspec.Struct, frozen=True, array_like=True):
    """Of the drone."""

    north: float  # [m]
    east: float  # [m]
    std: float  # [m] of each component
    measured: bool  # False: reckoned


class Position(msgspec.Struct, frozen=True):
    north: float  # [m]
    east: float  # [m]
    std: float  # [m] the larger component's
    origin: int  # which north and east these are, as in VehicleState; RECKONED: the chart's own
    measured: bool

    @property
    def place(self) -> Pair:
        return self.north, self.east


@dataclass(slots=True)
class Reckoning:
    """The drone's motion through water that is taken to stand still."""

    hull: Translation
    velocity: Pair = (0.0, 0.0)  # [m/s] surge, sway
    moved: Pair = (0.0, 0.0)  # [m] north, east since it began
    way: float = 0.0  # [m]
    seconds: float = 0.0  # [s]

    def begin(self, velocity: Pair) -> None:
        """Anew, here and now, with this velocity [m/s] in surge and sway."""
        self.velocity, self.moved, self.way, self.seconds = velocity, (0.0, 0.0), 0.0, 0.0

    def step(self, thrust: Vec6, heading: float, yaw_rate: float, dt: float) -> None:
        """`dt` [s] on, with this thrust [N, N m], heading [rad] from north and yaw rate [rad/s]."""
        self.seconds += dt
        known = min(dt, LONGEST_S)
        count = max(1, ceil(known / STEP_S))
        h, (c, s) = known / count, (cos(heading), sin(heading))
        for _ in range(count):
            u, v = self.velocity
            a, b, _ = self.hull.acceleration((u, v, 0.0, 0.0, 0.0, yaw_rate), thrust)
            u, v = u + a * h, v + b * h
            self.velocity = u, v
            self.moved = self.moved[0] + (c * u - s * v) * h, self.moved[1] + (s * u + c * v) * h
            self.way += hypot(u, v) * h

    def std(self, began: float) -> float:
        """[m] Of each component, where it was `began` [m] when it began."""
        return hypot(began, CURRENT * self.seconds, SHARE * self.way)


@dataclass(slots=True)
class Chart:
    vehicle: Vehicle
    begun: bool = False  # it was armed before this service was started: home is not known
    here: Position | None = None
    _home: Position | None = None
    _from: Position | None = None  # where the reckoning began
    _reckoning: Reckoning = field(init=False)
    _track: deque[tuple[Ns, Position, int]] = field(default_factory=deque[tuple[Ns, Position, int]])
    _apart: float = APART
    _at_ns: Ns | None = None
    _heading: float = 0.0  # [rad] from north, newest known

    def __post_init__(self) -> None:
        self._reckoning = Reckoning(Translation(self.vehicle, WAKE_SHARE))

    def step(
        self, state: VehicleState | None, wrench: Wrench | None, now: Ns, *, armed: bool
    ) -> None:
        """What is shown of the state and of control's forces now; None: nothing."""
        dt = 0.0 if self._at_ns is None else max(0.0, (now - self._at_ns) / 1e9)
        self._at_ns = now
        begins = armed and not self.begun
        if state is not None and (found := measured(state)) is not None:
            self._see(found, state)
        elif armed and self._from is None:
            self._from = Position(0.0, 0.0, 0.0, RECKONED, measured=False)
            self._reckoning.begin((0.0, 0.0))
        elif self._from is not None:
            self._reckon(state, wrench, dt)
        self.here = self._position()
        if begins and self.here is not None:
            self._home, self.begun = self.here, True
        if self.begun and self.here is not None:
            self._keep(self.here, now)

    def home(self) -> Pair | None:
        """[m] North and east of where it was first armed; None: not known by this origin."""
        home, here = self._home, self.here
        if home is None or here is None or home.origin != here.origin:
            return None
        return round(home.north, 2), round(home.east, 2)

    def place(self) -> ShownPlace | None:
        here = self.here
        if here is None:
            return None
        north, east, std = round(here.north, 2), round(here.east, 2), round(here.std, 2)
        return ShownPlace(north, east, std, here.measured)

    def track(self) -> list[int]:
        """North and east [dm] and how it follows the one before, for each point of this origin."""
        flat = list[int]()
        for _, at, how in self._track:
            if self.here is not None and at.origin == self.here.origin:
                flat += [round(10 * at.north), round(10 * at.east), how]
        return flat

    def _see(self, found: Position, state: VehicleState) -> None:
        self._from = found
        self._reckoning.begin(_through_water(state))

    def _reckon(self, state: VehicleState | None, wrench: Wrench | None, dt: float) -> None:
        thrust = AT_REST if wrench is None else wrench.achieved
        heading = None if state is None else from_north(state)
        if state is None or heading is None:  # it goes on as it did, more slowly
            self._reckoning.step(AT_REST, self._heading, 0.0, dt)
        else:
            self._heading = heading
            self._reckoning.step(_level(thrust, state), heading, state.yaw_rate.value, dt)

    def _position(self) -> Position | None:
        start, reckoning = self._from, self._reckoning
        if start is None or (start.measured and reckoning.seconds == 0.0):
            return start
        north, east = start.north + reckoning.moved[0], start.east + reckoning.moved[1]
        return Position(north, east, reckoning.std(start.std), start.origin, measured=False)

    def _keep(self, here: Position, now: Ns) -> None:
        """A new point of the track, once it is far enough from the newest one."""
        track = self._track
        while track and track[0][0] < now - REMEMBERED_NS:
            track.popleft()
        how = MEASURED_ON if here.measured else RECKONED_ON
        if track:
            last = track[-1][1]
            apart = dist(last.place, here.place)
            if last.origin != here.origin or apart > self._apart + JUMP + 3.0 * here.std:
                how = BEGINS
            elif apart < self._apart:
                return
        else:
            how = BEGINS
        track.append((now, here, how))
        if len(track) > MOST:
            self._apart *= 2.0
            self._thin()

    def _thin(self) -> None:
        """Every other point is left out, but none that begins a line."""
        points = list(self._track)
        self._track.clear()
        self._track.extend(p for k, p in enumerate(points) if k % 2 == 0 or p[2] == BEGINS)


def measured(state: VehicleState) -> Position | None:
    """What the state knows of the drone's position."""
    north, east = state.north, state.east
    if north is None or east is None or not (north.valid and east.valid):
        return None
    origin = 0 if state.origin is UNSET else state.origin
    std = max(north.std, east.std)
    return Position(north.value, east.value, std, origin, measured=True)


def from_north(state: VehicleState) -> float | None:
    """[rad] Heading clockwise from north, as far as it is known."""
    compass = state.heading_navigation
    if compass is not None and compass.valid:
        return compass.value
    return state.heading.value if state.heading.valid else None


def current(state: VehicleState | None) -> Pair | None:
    """[m/s] Of the water over the ground, north and east; None: not known."""
    if state is None or state.current_north is None or state.current_east is None:
        return None
    if not (state.current_north.valid and state.current_east.valid):
        return None
    return round(state.current_north.value, 2), round(state.current_east.value, 2)


def _level(thrust: Vec6, state: VehicleState) -> Vec6:
    """The thrust [N] ahead and to starboard in the level plane: weight and buoyancy have no part
    in that, at whatever roll and pitch they are held."""
    x, y, z, *_ = thrust
    roll, pitch = state.roll.value, state.pitch.value
    ahead = x * cos(pitch) + (y * sin(roll) + z * cos(roll)) * sin(pitch)
    return ahead, y * cos(roll) - z * sin(roll), 0.0, 0.0, 0.0, 0.0


def _through_water(state: VehicleState) -> Pair:
    """[m/s] Ahead and to starboard, level; at rest where they are not known."""
    level, heading = level_velocity(state), from_north(state)
    if level is None or heading is None:
        return 0.0, 0.0
    (north, east), c, s = current(state) or (0.0, 0.0), cos(heading), sin(heading)
    return level[0] - c * north - s * east, level[1] - c * east + s * north
