"""The motion that somebody estimated, as columns over time."""

from array import array
from math import nan
from typing import NamedTuple

import numpy as np

from messages.message import Estimate
from messages.state import VehicleState
from messages.vehicle import VehicleEstimate
from tools.recordings.columns import Array

UNKNOWN_STD = 0.5  # [rad] of a heading that is as good as not known


class Track(NamedTuple):
    """Arrays (n,) over time; NaN where it is not known."""

    t: Array  # [s] since the recording began
    roll: Array  # [rad]
    pitch: Array  # [rad]
    heading: Array  # [rad] accumulates past ±π
    depth: Array  # [m] positive down
    depth_rate: Array  # [m/s]
    depth_acceleration: Array  # [m/s²]
    yaw_rate: Array  # [rad/s]
    surge: Array  # [m/s] velocity, body
    sway: Array  # [m/s]
    bearing: Array  # [rad] to compare: by the compass where there is one; accumulates past ±π

    @property
    def seconds_known(self) -> float:
        """[s] In which roll, pitch and depth are known."""
        known = np.isfinite(self.roll) & np.isfinite(self.pitch) & np.isfinite(self.depth)
        steps = np.minimum(np.diff(self.t, append=self.t[-1:]), 1.0)
        return float(np.sum(steps[known]))

    def known(self, name: str) -> tuple[Array, Array]:
        """Times and values of one of its columns, where it is known."""
        values: Array = getattr(self, name)
        there = np.isfinite(values)
        return self.t[there], values[there]


class TrackRows:
    """Collects states of Lindy, or what another autopilot estimated."""

    def __init__(self, begin_ns: int) -> None:
        self._begin = begin_ns
        self._rows = array("d")
        self.count = 0
        self.has_compass = False

    def add(self, state: VehicleState) -> None:
        self.count += 1
        s, running = state, state.phase == "running"
        self.has_compass |= s.heading_navigation is not None
        estimates = (
            *(s.roll, s.pitch, s.heading, s.depth, s.depth_rate, s.depth_acceleration, s.yaw_rate),
            *(s.surge_velocity, s.sway_velocity),
        )
        bearings = (_bearing(each) for each in (s.heading, s.heading_navigation))
        values = (*map(_known, estimates), *bearings) if running else (nan,) * (len(estimates) + 2)
        self._rows.extend(((s.sensor_ns - self._begin) / 1e9, *values))

    def add_estimate(self, estimate: VehicleEstimate) -> None:
        self.count += 1
        e = estimate
        yaw_rate = None if e.angular_rate is None else e.angular_rate[2]
        values = (e.roll, e.pitch, e.heading, e.depth, e.depth_rate, None, yaw_rate, None, None,
                  e.heading, None)  # fmt: skip
        self._rows.append((e.stamp_ns - self._begin) / 1e9)
        self._rows.extend(nan if value is None else value for value in values)

    def track(self) -> Track:
        rows = np.asarray(self._rows).reshape(-1, len(Track._fields) + 1)
        *columns, gyroscopes, compass = rows[np.argsort(rows[:, 0], kind="stable")].T
        # Two zeros: the gyroscopes' heading is no stand-in where the compass is refused.
        found = Track(*[*columns, compass if self.has_compass else gyroscopes])
        for turning in (found.heading, found.bearing):  # some are in one turn
            there = np.isfinite(turning)
            turning[there] = np.unwrap(turning[there])
        return found


def _known(estimate: Estimate | None) -> float:
    return estimate.value if estimate is not None and estimate.valid else nan


def _bearing(estimate: Estimate | None) -> float:
    return nan if estimate is None or estimate.std > UNKNOWN_STD else _known(estimate)
