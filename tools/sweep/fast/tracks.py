"""What is kept of many dives, and the figures of each: by the functions that judge a recording."""

from typing import Any, NamedTuple

import numpy as np

from messages import topics
from services.reference.settings import Settings
from tools.report.columns import (
    COMMAND,
    FAILSAFES,
    FLIGHT_MODES,
    REFERENCE,
    STATE,
    STATUS,
    WANTED,
    StreamColumns,
)
from tools.report.dive import RecordedDive
from tools.report.stops import StickStop, stops
from tools.report.tracking import error_rms, peak_jerk_ratio
from tools.sweep.fast.lanes import Lanes, Mask, to_euler, wrapped
from tools.sweep.fast.timeline import DiveTimes

EPOCH = 1.0


class FastEnergy(NamedTuple):
    thrust_squared_n2s: float  # [N² s]
    wh: float  # [Wh]


class FastFigures(NamedTuple):
    """Those of a `Report` that are known without messages."""

    seconds: float  # [s]
    stops: list[StickStop]
    depth_error_rms_m: float | None
    heading_error_rms_deg: float | None
    peak_jerk_ratio: float | None
    energy: FastEnergy


class Tracks:
    """One row for each state from the end of the calibration on."""

    lost: Mask  # lanes that are not to be believed

    def __init__(
        self,
        times: DiveTimes,
        period: int,
        now: int,
        limits: Settings,
        heading: float,
        hotel: Lanes,
    ) -> None:
        """
        Args:
            period: [ns] of the rows, and when the first sample was.
            now: [ns] of the first row.
            limits: of the reference.
            heading: [rad] of all dives so far.
            hotel: [W] drawn by each so far.
        """
        rows, count = (times.end_ns - now) // period + 1, len(hotel)
        self._times, self._row = times, 0
        self._jerks = limits.heave.jerk, limits.yaw.jerk
        self._true, self._wanted = np.empty((2, 2, rows, count))  # depth [m] and heading [rad]
        self._shared = np.empty((rows, 8))  # stamp [ns], armed; ν, a, jerk of depth and heading
        self._heading = np.full(count, heading)
        self._first_heading: Lanes | None = None  # [rad] estimated, at the first armed reference
        # Both integrals, and what they were of at the instant before.
        self._thrust_squared, self._energy = np.zeros((2, count))  # [N² s], [J]
        self._before = period, np.zeros(count), hotel

    def add(
        self, now: int, reference: Any, state: Any, truth: Any, drawn: Any, armed: bool
    ) -> None:
        """One instant [ns].

        Args:
            truth: depth [m] and attitude q_NB of the vehicles.
            drawn: thrust [N] (thrusters, lanes) and power [W].
        """
        row, self._row = self._row, self._row + 1
        (depth, attitude), (thrust, power) = truth, drawn
        self._heading = self._heading + wrapped(to_euler(attitude)[2] - self._heading)
        self._true[0, row], self._true[1, row] = depth, self._heading
        down, turn = reference.depth, reference.heading
        self._wanted[0, row], self._wanted[1, row] = down.position, turn.position
        self._shared[row] = now, armed, *down[1:], *turn[1:]
        if armed and self._first_heading is None:
            self._first_heading = state.heading
        # By the trapezium rule.
        squared = np.sum(thrust * thrust, axis=0)
        since, squared_before, power_before = self._before
        half = 0.5e-9 * (now - since)
        self._thrust_squared = self._thrust_squared + half * (squared + squared_before)
        self._energy = self._energy + half * (power + power_before)
        self._before = now, squared, power

    @property
    def sound(self) -> Mask:
        rows = slice(0, self._row)
        numbers = np.all(np.isfinite(self._true[:, rows] + self._wanted[:, rows]), axis=(0, 1))
        return numbers & np.isfinite(self._energy)

    def deepest(self, lane: int) -> float:
        """[m]"""
        return float(np.max(self._true[0, : self._row, lane]))

    def figures(self, lane: int) -> FastFigures:
        dive = self.dive(lane)
        heading = error_rms(dive, "yaw")
        return FastFigures(
            seconds=self._times.end_ns * 1e-9,
            stops=stops(dive),
            depth_error_rms_m=error_rms(dive, "heave"),
            heading_error_rms_deg=None if heading is None else float(np.degrees(heading)),
            peak_jerk_ratio=peak_jerk_ratio(dive),
            energy=FastEnergy(float(self._thrust_squared[lane]), float(self._energy[lane]) / 3600),
        )

    def dive(self, lane: int) -> RecordedDive:
        """As if it had been recorded, as far as the figures need it."""
        rows = self._row
        stamp, armed, *motions = self._shared[:rows].T
        reference = np.zeros((rows, len(REFERENCE)))
        columns = dict(zip(REFERENCE, reference.T, strict=True))
        for name in ("valid", "stamp", "sensor"):
            columns[name][:] = stamp
        columns["armed"][:], columns["epoch"][:] = armed, EPOCH
        for k, axis in enumerate(("heave", "yaw")):
            columns[f"{axis} position"][:] = self._wanted[k, :rows, lane]
            for n, part in enumerate(("velocity", "acceleration", "jerk")):
                columns[f"{axis} {part}"][:] = motions[3 * k + n]
            columns[f"{axis} jerk limit"][:] = self._jerks[k]
        known = self._first_heading
        yaw = 0.0 if known is None else float(known[lane])
        truth = np.stack([stamp, self._true[0, :rows, lane], self._true[1, :rows, lane]], axis=1)
        state = {"sensor": stamp[0], "stamp": stamp[0], "yaw": yaw, "heave known": 1.0,
                 "yaw known": 1.0}  # fmt: skip
        mode, failsafe = FLIGHT_MODES.index("stabilised"), FAILSAFES.index("none")
        status = {"stamp": stamp[0], "failsafe": failsafe, "reaction": -1, "flight mode": mode,
                  "armed": 1.0}  # fmt: skip
        streams = {wanted.topic.key: _empty(wanted.names) for wanted in WANTED}
        streams[topics.REFERENCE.key] = StreamColumns(REFERENCE, reference)
        streams[topics.TRUTH.key] = StreamColumns(("stamp", "heave", "yaw"), truth)
        streams[topics.STATE.key] = _one(STATE, state)
        streams[topics.STATUS.key] = _one(STATUS, status)
        streams[topics.PILOT_COMMAND.key] = self._commands()
        return RecordedDive({}, {}, streams)

    def _commands(self) -> StreamColumns:
        """The sticks where they change."""
        rows = list[list[float]]()
        for at, row in self._times.changes:
            s = row.sticks
            four = s.surge, s.sway, s.heave, s.yaw
            rows.append([at, *four, max(map(abs, four)), 0.0, EPOCH])
        return StreamColumns(COMMAND, np.array(rows, dtype=float))


def _empty(names: tuple[str, ...]) -> StreamColumns:
    return StreamColumns(names, np.zeros((0, len(names))))


def _one(names: tuple[str, ...], values: dict[str, float]) -> StreamColumns:
    return StreamColumns(names, np.array([[values.get(name, 0.0) for name in names]]))
