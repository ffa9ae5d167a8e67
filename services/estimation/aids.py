"""Velocity over the ground by a DVL, position by acoustic or satellite fixes, and the current.

A sample is compared with the state at its own time of validity: the filter's recent past is kept.
Without either there is no estimate. With a DVL alone, position counts from its first sample.
"""

from bisect import bisect_right
from collections import deque
from math import cos, sin
from typing import NamedTuple

from messages import events, topics
from messages.events import Event, Row
from messages.message import Estimate
from messages.sensors import DvlSample, UsblSample
from messages.units import Vec3
from services.estimation.filter import (
    CURRENT,
    DEVIATION,
    GYRO,
    NORTH,
    POSITION,
    SIZE,
    TILT,
    VELOCITY,
    YAW,
    ErrorStateFilter,
    Floats,
    Rotation,
    considered,
    to_body,
)
from services.estimation.quantity import Fusion, Quantity
from services.vehicle.mounting import cross

DVL, USBL = topics.DVL.key, topics.USBL.key
LEAST_DVL_STD, LEAST_USBL_STD = 0.001, 0.01  # [m/s], [m] no sensor is better
DVL_PATIENCE, USBL_PATIENCE = 4.0, 10.0  # [s] of outliers only; a school of fish takes seconds
OLDEST_NS = 4_000_000_000  # [ns] largest age of a sample
AHEAD_NS = 500_000_000  # [ns] a sample may be this much newer than the newest IMU sample
LOST_AFTER = 60.0  # [s] without either: prediction is useless
VALID_FOR = {DVL: 3.0, USBL: 15.0}  # [s] after the last accepted sample
FIRST_VELOCITY, FIRST_CURRENT = 1.0, 0.5  # [m/s] 1σ before any is measured
STILL_CURRENT = 1e-3  # [m/s] 1σ where no velocity over the ground is: it is that through the water
FAR = 100.0  # [m] 1σ of a position before its first fix
MOST_CURRENT_STD = 0.15  # [m/s] a current with a larger std is not published
# What is measured over the ground says nothing of heading or gyroscope: after a restart,
# when the heading is known to 4°, a current that the hull's model lacks turned it by 3°. A velocity
# along the body's axes says nothing of north.
KEPT = (YAW, GYRO, GYRO + 1, GYRO + 2)
BY_FIX = considered(*(state for state in range(SIZE) if state not in KEPT))
BY_DVL = considered(*(state for state in range(SIZE) if state not in (*KEPT, NORTH, DEVIATION)))


class Past(NamedTuple):
    """The filter at one instant."""

    stamp_ns: int
    position: tuple[float, float]  # [m] north, east
    velocity: Vec3  # [m/s] world axes
    R: Rotation
    shift: tuple[float, ...]  # `ErrorStateFilter.shift`

    def velocity_by(self, f: ErrorStateFilter) -> Vec3:
        """[m/s] Then, with what corrections have changed since."""
        (u, v, w), now, before = self.velocity, f.shift, self.shift
        return u + now[3] - before[3], v + now[4] - before[4], w + now[5] - before[5]


class Aids:
    """Corrections by DVL and fixes."""

    def __init__(self) -> None:
        self.dvl_quantities = tuple(
            Quantity(name, "m/s", LEAST_DVL_STD, patience=DVL_PATIENCE)
            for name in ("dvl_surge", "dvl_sway")
        )
        self.usbl_quantities = tuple(
            Quantity(name, "m", LEAST_USBL_STD, patience=USBL_PATIENCE)
            for name in ("usbl_north", "usbl_east")
        )
        self._past = deque[Past]()
        self._begun_ns: int | None = None  # None: there is no estimate
        self._fixed = False  # a fix has set the origin of north and east
        self._heard = dict[str, int]()  # [ns] stamp of the last accepted sample

    def remember(self, f: ErrorStateFilter, stamp_ns: int) -> Event | None:
        """The filter is now at this time [ns]. Returns an event to tell."""
        past, (n, e, _), (u, v, w) = self._past, f.position, f.velocity
        past.append(Past(stamp_ns, (n, e), (u, v, w), f.rotation, f.shift))
        while stamp_ns - past[0].stamp_ns > OLDEST_NS:
            past.popleft()
        if self._begun_ns is None:
            return None
        newest_ns = max(self._begun_ns, *self._heard.values())
        return self.stop(f) if (stamp_ns - newest_ns) * 1e-9 > LOST_AFTER else None

    def stop(self, f: ErrorStateFilter) -> Event:
        """Discard the estimate."""
        self._begun_ns, self._fixed = None, False
        self._heard.clear()
        for k in range(2):
            f.forget(CURRENT + k, STILL_CURRENT)
        return events.LOST_POSITION()

    def dvl(self, f: ErrorStateFilter, sample: DvlSample) -> Event | None:
        """A validated sample, of the vehicle's origin. Returns an event to tell."""
        if (measured := sample.velocity) is None:
            return None
        then = self._then(sample.stamp_ns)
        if not isinstance(then, Past):
            return _refused(self.dvl_quantities, then(DVL), sample.stamp_ns)
        if DVL not in self._heard:
            for k in range(2):
                f.forget(VELOCITY + k, FIRST_VELOCITY)
                f.forget(CURRENT + k, FIRST_CURRENT)
        std = max(LEAST_DVL_STD, sample.std)
        found = Fusion.USED
        for k, quantity in enumerate(self.dvl_quantities):
            v = then.velocity_by(f)
            axis = then.R[0][k], then.R[1][k], then.R[2][k]
            a, b, c = cross(axis, v)  # Rᵀ (v × θ), row k
            h = (
                (VELOCITY, axis[0]), (VELOCITY + 1, axis[1]), (VELOCITY + 2, axis[2]),
                (TILT, a), (TILT + 1, b), (YAW, c),
            )  # fmt: skip
            off = measured[k] - (axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2])
            states = (VELOCITY, VELOCITY + 1)
            outcome = _fuse(f, quantity, h, measured[k], off, std, sample.stamp_ns, states, BY_DVL)
            found = max(found, outcome, key=lambda each: each.value)
        if found is not Fusion.OUTLIER and self._begun_ns is None:
            self._begin(f, sample.stamp_ns)
        return self._heard_of(DVL, "velocity", found, sample.stamp_ns)

    def usbl(self, f: ErrorStateFilter, sample: UsblSample) -> Event | None:
        """A validated fix, of the vehicle's origin. Returns an event to tell."""
        then = self._then(sample.stamp_ns)
        if not isinstance(then, Past):
            return _refused(self.usbl_quantities, then(USBL), sample.stamp_ns)
        if self._begun_ns is None:
            self._begin(f, sample.stamp_ns)
        std, measured = max(LEAST_USBL_STD, sample.std), (sample.north, sample.east)
        found = Fusion.USED
        if first := not self._fixed:
            for k in range(2):
                f.forget(POSITION + k, FAR)
        age = (self._past[-1].stamp_ns - sample.stamp_ns) * 1e-9
        c, s = cos(f.north), sin(f.north)
        for k, quantity in enumerate(self.usbl_quantities):
            value = then.position[k] + f.shift[k] - then.shift[k]
            along = ((c, -s), (s, c))[k]
            h = (
                (POSITION + k, 1.0), (VELOCITY, -age * along[0]), (VELOCITY + 1, -age * along[1]),
            )  # fmt: skip
            off = measured[k] - value
            if first:
                quantity.white, quantity.white_variance = std, std * std
                f.place(k, f.position[k] + off, std)
                quantity.forget()
                continue
            states = (POSITION + k,)
            outcome = _fuse(f, quantity, h, measured[k], off, std, sample.stamp_ns, states, BY_FIX)
            found = max(found, outcome, key=lambda each: each.value)
        self._fixed = True
        return self._heard_of(USBL, "position", found, sample.stamp_ns)

    def estimates(
        self, f: ErrorStateFilter, now: int, *, with_current: bool
    ) -> dict[str, Estimate]:
        """What is known at `now` [ns], by its name in `VehicleState`: valid while DVL or fixes are,
        for dead reckoning counts, with its growing std. `with_current`: thrust and drag have been
        compared with the accelerometer."""
        if self._begun_ns is None:
            return {}
        valid = any((now - at) * 1e-9 <= VALID_FOR[key] for key, at in self._heard.items())
        u, v, w = f.velocity
        surge, sway, _ = to_body(f.rotation, (u, v, w))
        speed_std = max(f.std(VELOCITY), f.std(VELOCITY + 1))
        found = {
            "surge_velocity": Estimate(surge, speed_std, valid),
            "sway_velocity": Estimate(sway, speed_std, valid),
            "north": Estimate(f.position[0], f.std(POSITION), valid),
            "east": Estimate(f.position[1], f.std(POSITION + 1), valid),
        }
        stds = f.std(CURRENT), f.std(CURRENT + 1)
        if with_current and max(stds) <= MOST_CURRENT_STD:
            (a, b), c, s = f.current, cos(f.north), sin(f.north)
            found["current_north"] = Estimate(c * a - s * b, stds[0], valid)
            found["current_east"] = Estimate(s * a + c * b, stds[1], valid)
        return found

    @property
    def origin(self) -> int | None:
        """Names the origin of north and east: 0 that of the fixes, else the moment [ms] when the
        position began, where the drone then was; None: no position."""
        if self._begun_ns is None:
            return None
        return 0 if self._fixed else self._begun_ns // 1_000_000

    def _begin(self, f: ErrorStateFilter, stamp_ns: int) -> None:
        self._begun_ns = stamp_ns
        for k in range(2):
            f.place(k, 0.0, LEAST_USBL_STD)

    def _then(self, stamp_ns: int) -> Past | Row:
        """The filter at the time of a sample; a row of events: there is none."""
        if not self._past:
            return events.UNREADY
        if stamp_ns - self._past[-1].stamp_ns > AHEAD_NS:
            return events.AHEAD
        after = bisect_right(self._past, stamp_ns, key=lambda past: past.stamp_ns)
        if after:
            return self._past[after - 1]
        young = self._past[-1].stamp_ns - self._past[0].stamp_ns < OLDEST_NS // 2
        return events.UNREADY if young else events.TOO_OLD

    def _heard_of(self, key: str, what: str, found: Fusion, stamp_ns: int) -> Event | None:
        if found is Fusion.OUTLIER:
            return events.OUTLIER(key)
        self._heard[key] = max(stamp_ns, self._heard.get(key, stamp_ns))
        return events.RESTARTED(what) if found is Fusion.PERSISTENT else None


def _refused(quantities: tuple[Quantity, ...], why: Event, stamp_ns: int) -> Event:
    for quantity in quantities:
        quantity.refuse(why, stamp_ns)
    return why


def _fuse(
    f: ErrorStateFilter,
    quantity: Quantity,
    h: tuple[tuple[int, float], ...],
    value: float,
    off: float,
    std: float,
    stamp_ns: int,
    states: tuple[int, ...],
    mask: Floats,
) -> Fusion:
    """A sample whose sensor states its own spread: the measured one makes it larger only."""
    quantity.white = std
    quantity.white_variance = max(quantity.white_variance, std * std)
    outcome = quantity.fuse(f, h, value, off, stamp_ns, mask)
    if outcome is Fusion.PERSISTENT:
        for state in states:
            f.forget(state, max(std, abs(off)))
        quantity.set_anew(f, h, off, stamp_ns, mask)
    return outcome
