"""What a page shows of the past. Pure.

For its map: where the drone is, has been and began, as its state says. It is shown only: nothing
flies by it. Every place belongs to an origin. Where estimation begins anew at another one, home and
the track of the one before are not shown: they would lie.

And how long the dive has gone on, and how long the battery lasts.
"""

from collections import deque
from dataclasses import dataclass, field
from math import dist

import msgspec
from msgspec import UNSET
from msgspec.structs import replace

from messages.sensors import BatterySample
from messages.state import VehicleState
from messages.units import Ns
from messages.vehicle import VehicleStatus

Pair = tuple[float, float]

APART = 0.5  # [m] between two points of the track, at first
MOST = 1000  # points; with more of them they are twice as far apart
REMEMBERED_NS = 3_600_000_000_000  # [ns] of the track
JUMP = 2.0  # [m] further than the drone moves in a step, beyond its spread: the line is broken
MEASURED_ON, RECKONED_ON, BEGINS = 0, 1, 2  # how a point of the track follows the one before
SPAN_NS = 180_000_000_000  # [ns] of the past by which the battery's use is judged
LEAST_NS = 30_000_000_000  # [ns] of it, before anything is said
LONGEST_MIN = 600.0  # [min] more is not said: the drone hardly uses anything


class Position(msgspec.Struct, frozen=True, array_like=True):
    """Where the drone is."""

    north: float  # [m]
    east: float  # [m]
    std: float  # [m] the larger component's
    measured: bool  # False: reckoned from what was measured a while ago
    origin: int  # which north and east these are, as in VehicleState

    @property
    def place(self) -> Pair:
        return self.north, self.east


@dataclass(slots=True)
class Chart:
    begun: bool = False  # it was armed before this service was started: home is not known
    here: Position | None = None
    _home: Position | None = None
    _track: deque[tuple[Ns, Position, int]] = field(default_factory=deque[tuple[Ns, Position, int]])
    _apart: float = APART

    def step(self, state: VehicleState | None, now: Ns, *, armed: bool) -> None:
        """What is shown of the state now; None: nothing, and the drone is where it was last."""
        if state is not None:
            self.here = position(state)
        elif self.here is not None:
            self.here = replace(self.here, measured=False)
        here = self.here
        if armed and not self.begun and here is not None:
            self._home, self.begun = here, True
        if self.begun and here is not None:
            self._keep(here, now)

    def home(self) -> Pair | None:
        """[m] North and east of where it was first armed; None: not known by this origin."""
        home, here = self._home, self.here
        if home is None or here is None or home.origin != here.origin:
            return None
        return round(home.north, 2), round(home.east, 2)

    def place(self) -> Position | None:
        """As a page is shown it."""
        here = self.here
        if here is None:
            return None
        north, east, std = round(here.north, 2), round(here.east, 2), round(here.std, 2)
        return replace(here, north=north, east=east, std=std)

    def track(self) -> list[int]:
        """North and east [dm] and how it follows the one before, for each point of this origin."""
        flat = list[int]()
        for _, at, how in self._track:
            if self.here is not None and at.origin == self.here.origin:
                flat += [round(10 * at.north), round(10 * at.east), how]
        return flat

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
            points = list(track)
            track.clear()  # every other point is left out, but none that begins a line
            track.extend(p for k, p in enumerate(points) if k % 2 == 0 or p[2] == BEGINS)


def position(state: VehicleState) -> Position | None:
    """What the state knows of the drone's position."""
    north, east = state.north, state.east
    if north is None or east is None:
        return None
    origin = 0 if state.origin is UNSET else state.origin
    measured = north.valid and east.valid
    return Position(north.value, east.value, max(north.std, east.std), measured, origin)


def current(state: VehicleState | None) -> Pair | None:
    """[m/s] Of the water over the ground, north and east; None: not known."""
    if state is None or state.current_north is None or state.current_east is None:
        return None
    if not (state.current_north.valid and state.current_east.valid):
        return None
    return round(state.current_north.value, 2), round(state.current_east.value, 2)


@dataclass(slots=True)
class DiveTimer:
    """Since the drone was first seen armed."""

    began_ns: Ns | None = None

    def heard(self, status: VehicleStatus, now: Ns) -> None:
        if status.armed and self.began_ns is None:
            self.began_ns = now

    def seconds(self, now: Ns) -> float | None:
        """[s]"""
        return None if self.began_ns is None else round((now - self.began_ns) / 1e9)


@dataclass(slots=True)
class Endurance:
    """How long the battery lasts at the mean power of the last minutes."""

    _used: deque[tuple[Ns, float]] = field(default_factory=deque[tuple[Ns, float]])  # [ns], [Wh]

    def heard(self, battery: BatterySample | None) -> None:
        """The newest sample, as often as anybody likes."""
        used = self._used
        if battery is None or battery.used_wh is None:
            return
        if used and battery.stamp_ns == used[-1][0]:
            return
        if used and (battery.stamp_ns < used[-1][0] or battery.used_wh < used[-1][1]):
            used.clear()  # another battery, or another clock
        used.append((battery.stamp_ns, battery.used_wh))
        while used[0][0] < battery.stamp_ns - SPAN_NS:
            used.popleft()

    def minutes(self, battery: BatterySample | None) -> float | None:
        """[min] None: not known, because its capacity is not, or the past is too short."""
        if battery is None or battery.charge is None or battery.capacity_wh is None:
            return None
        (began_ns, before), (ends_ns, after) = self._used[0], self._used[-1]
        if ends_ns < began_ns + LEAST_NS or after <= before:
            return None
        left = max(0.0, battery.charge) * battery.capacity_wh  # [Wh]
        minutes = left * (ends_ns - began_ns) / 60e9 / (after - before)
        return round(minutes) if minutes <= LONGEST_MIN else None
