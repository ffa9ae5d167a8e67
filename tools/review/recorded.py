"""What a review needs of a recording, read once: sensors, and the motion that was estimated in the
dive. Times are in s since the recording began."""

from math import nan
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from messages.message import Message
from messages.sensors import DvlSample, ImuSample, MagnetometerSample, PressureSample
from messages.vehicle import VehicleEstimate, VehicleStatus
from services.estimation.settings import Settings as EstimationSettings
from services.marine.vehicle import Vehicle
from services.reference.settings import Settings as ReferenceSettings
from services.vehicle.mounting import AtOrigin
from tools.analysis.dive import RecordedDive, kept, read_dive
from tools.analysis.stops import counting
from tools.log.cut import ArmedSpan, ArmedSpans
from tools.recordings.columns import ARRIVAL, Array, Figures, StreamColumns, StreamFigures
from tools.recordings.progress import reading
from tools.replay.source import ReplaySource, open_source

PAUSE = 3.0  # [-] a longer period, in usual ones, is a pause
WATER = 1000.0  # [kg/m³] for the pressure's lever arm, centimetres
TOGETHER_S = 0.5  # [s] no value is taken from over a longer pause
UNKNOWN_STD = 0.5  # [rad] of a heading that is as good as not known
VALUES = ("p", "q", "r", "x", "y", "z", "pressure")  # of the IMU at the origin, and in Pa
REPEATED = "repeated"
ESTIMATES = (
    *("roll", "pitch", "heading", "depth", "depth_rate", "depth_acceleration", "yaw_rate"),
    *("surge_velocity", "sway_velocity"),
)  # in a state
STATE = StreamFigures(
    topics.STATE,
    ("sensor_ns", "stamp_ns", "phase", "depth_moved", "depth_corrected", "heading_navigation.std",
     *(f"{name}.{part}" for name in (*ESTIMATES, "heading_navigation")
       for part in ("value", "valid")), "heading.std"),
)  # fmt: skip


def _estimate(m: VehicleEstimate) -> Figures:
    return (None if m.angular_rate is None else m.angular_rate[2],)


ESTIMATE = StreamFigures(
    topics.ESTIMATE,
    ("stamp_ns", "roll", "pitch", "heading", "depth", "depth_rate"),
    ("yaw_rate",),
    _estimate,
)
FEWEST_TRUE = 3  # samples that have a rate


class Track(NamedTuple):
    """The motion that somebody estimated: arrays (n,) over time; NaN where it is not known."""

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
    corrected: Array  # [m] of the depth, sum: of where it came to rest, which is no motion

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


def at(track: Track, name: str, t: Array) -> Array:
    """A track's column at other times; NaN where it has no value near."""
    times, values = track.known(name)
    if not len(times):
        return np.full(len(t), nan)
    after = np.clip(np.searchsorted(times, t), 1, max(1, len(times) - 1))
    pause = times[np.minimum(after, len(times) - 1)] - times[after - 1]
    found = np.interp(t, times, values, left=nan, right=nan)
    return np.where(pause <= TOGETHER_S, found, nan)


def true_track(dive: RecordedDive) -> Track | None:
    """Depth and heading as the simulator knows them, and their rates. None: there was none."""
    truth = dive[topics.TRUTH]
    t, unknown = truth["stamp_ns"] / 1e9, np.full(truth.count, nan)
    if len(t) < FEWEST_TRUE:
        return None
    depth, heading = truth["heave"], np.unwrap(truth["yaw"])
    return Track(
        t=t, roll=unknown, pitch=unknown, heading=heading, depth=depth,
        depth_rate=np.gradient(depth, t), depth_acceleration=unknown,
        yaw_rate=np.gradient(heading, t), surge=unknown, sway=unknown, bearing=unknown,
        corrected=np.zeros(truth.count),
    )  # fmt: skip


def track(state: StreamColumns, estimate: StreamColumns | None = None) -> Track | None:
    """Of states of Lindy, and of what another autopilot estimated. None: nobody estimated.

    Args:
        state: as `STATE` has it.
        estimate: as `ESTIMATE` has it.
    """
    running = state.said("phase", "running")

    def known(name: str) -> Array:
        return np.where(running & (state[f"{name}.valid"] > 0.0), state[f"{name}.value"], nan)

    def bearing(name: str) -> Array:
        return np.where(state[f"{name}.std"] > UNKNOWN_STD, nan, known(name))

    rows = [state["sensor_ns"] / 1e9, *map(known, ESTIMATES)]
    rows += [kept(state["depth_corrected"]), bearing("heading"), bearing("heading_navigation")]
    has_compass = np.isfinite(state["heading_navigation.value"]).any()
    if estimate is not None:
        e, none = estimate, np.full(estimate.count, nan)
        theirs = [e["stamp_ns"] / 1e9, e["roll"], e["pitch"], e["heading"], e["depth"],
                  e["depth_rate"], none, e["yaw_rate"], none, none, np.zeros(e.count),
                  e["heading"], none]  # fmt: skip
        rows = [np.concatenate(pair) for pair in zip(rows, theirs, strict=True)]
    if not len(rows[0]):
        return None
    order = np.argsort(rows[0], kind="stable")
    *columns, corrected, gyroscopes, compass = (row[order] for row in rows)
    # Two zeros: the gyroscopes' heading is no stand-in where the compass is refused.
    found = Track(*[*columns, compass if has_compass else gyroscopes], corrected=corrected)
    for turning in (found.heading, found.bearing):  # some are in one turn
        there = np.isfinite(turning)
        turning[there] = np.unwrap(turning[there])
    return found


class SensorColumns(NamedTuple):
    """The samples of a sensor whose stamps rise. Times in s since the recording began."""

    stamp: Array  # (n,) [s]
    arrival: Array  # (n,) [s] by the recorder's clock
    values: Array  # (n, k); of the IMU rate [rad/s] and force [m/s²], FRD; of pressure [Pa]
    not_newer: int = 0  # samples left out: stamped no later than one before them
    repeated: int = 0  # samples that say the same as the one before

    @property
    def per_second(self) -> float:
        """[1/s] Between pauses; 0: it cannot be told."""
        periods = np.diff(self.stamp)
        usual = periods[periods <= PAUSE * np.median(periods)] if len(periods) else periods
        return 1.0 / float(np.mean(usual)) if len(usual) else 0.0


class VehicleSettings(NamedTuple):
    """What the vehicle file says, with the dive's own overrides and those of the command line."""

    vehicle: Vehicle
    estimation: EstimationSettings
    reference: ReferenceSettings


class Recorded(NamedTuple):
    source: ReplaySource
    dive: RecordedDive  # with the sticks that count; its times are from the recording's beginning
    sensors: dict[str, SensorColumns]  # by key; those that have samples
    own: Track | None  # what was estimated in the dive; None: nothing
    settings: VehicleSettings
    begin_ns: int  # [ns] by the clock of the stamps, from which times count
    seconds: float  # [s] from the first message to the last
    armed: list[ArmedSpan] | None  # None: the recording does not say


def read(path: Path, overrides: tuple[str, ...] = ()) -> Recorded:
    """
    Raises:
        LindyError: not a recording of Lindy, nothing in it, or wrong settings.
    """
    source = open_source(path)
    settings = settings_of(source, overrides)
    recording, (first_ns, last_ns) = source.recording, source.span
    begin_ns = source.origin_ns - source.utc_offset_ns
    wanted = _sensors(AtOrigin(settings.vehicle.mounting, WATER, settings.vehicle.calibration))
    with reading("reading", recording.size) as recording.advance:
        dive = read_dive(
            recording,
            apart=source.apart,
            more=(STATE, ESTIMATE, *wanted),
            origin_ns=begin_ns,
            utc_offset_ns=source.utc_offset_ns,
        )
    armed = _armed(dive, (last_ns - source.origin_ns) / 1e9)
    samples = {each.topic.key: dive[each.topic] for each in wanted if dive[each.topic].count}
    return Recorded(
        source=source,
        dive=counting(dive, armed),
        sensors={key: _samples(columns) for key, columns in samples.items()},
        own=track(dive[topics.STATE], dive[topics.ESTIMATE]),
        settings=settings,
        begin_ns=begin_ns,
        seconds=(last_ns - first_ns) / 1e9,
        armed=armed,
    )


def settings_of(source: ReplaySource, overrides: tuple[str, ...]) -> VehicleSettings:
    """
    Raises:
        LindyError: the vehicle file is not in the recording, or a setting is wrong.
    """
    with source.stack() as stack:
        stack.overrides.extend(overrides)
        return VehicleSettings(
            stack.section("vehicle", Vehicle),
            stack.section("estimation", EstimationSettings),
            stack.section("reference", ReferenceSettings),
        )


def digits(value: float, count: int = 3) -> float:
    """So many of it."""
    return float(f"{value:.{count}g}") + 0.0  # no -0


def _sensors(origin: AtOrigin) -> list[StreamFigures]:
    """Every sensor's stamps and repeats, and the values of IMU and pressure."""
    names = {topics.IMU.key: VALUES[:6], topics.PRESSURE.key: VALUES[6:]}
    return [
        StreamFigures(topic, ("stamp_ns",), (REPEATED, *named), NewerSamples(origin, len(named)))
        for topic in topics.ALL
        if topic.key.startswith("sensor/")
        for named in [names.get(topic.key, ())]
    ]


class NewerSamples:
    """Of each sample that is newer than all before: does it measure the same again, as `lindy
    import` asks, and its values."""

    def __init__(self, origin: AtOrigin, count: int) -> None:
        self._origin, self._nothing = origin, (None,) * (1 + count)
        self._newest_ns, self._before = -1, object()

    def __call__(self, sample: Message) -> Figures:
        if sample.stamp_ns <= self._newest_ns:
            return self._nothing
        measured, values = object(), ()
        match sample:
            case ImuSample():
                at_origin = self._origin.imu(sample)
                measured = sample.angular_rate, sample.specific_force
                values = *at_origin.angular_rate, *at_origin.specific_force
            case PressureSample(pressure=pressure):
                measured, values = pressure, (pressure,)
            case MagnetometerSample(field=measured) | DvlSample(velocity=(_, _, _) as measured):
                pass
            case _:
                pass
        same, self._newest_ns, self._before = measured == self._before, sample.stamp_ns, measured
        return same, *values


def _samples(columns: StreamColumns) -> SensorColumns:
    newer = columns.rising()
    values = [newer[name] for name in VALUES if name in newer]
    return SensorColumns(
        stamp=newer["stamp_ns"] / 1e9,
        arrival=newer[ARRIVAL] / 1e9,
        values=np.column_stack(values) if values else np.zeros((newer.count, 0)),
        not_newer=columns.count - newer.count,
        repeated=int(np.nansum(newer[REPEATED])),
    )


def _armed(dive: RecordedDive, last: float) -> list[ArmedSpan] | None:
    """
    Args:
        last: [s] when the recording ends.
    """
    status, spans = dive[topics.STATUS], ArmedSpans()
    if not status.count:
        return None
    status = status.as_recorded()
    columns = (status[ARRIVAL], status["stamp_ns"], status["armed"])
    for arrival, stamp, armed in zip(*(column.tolist() for column in columns), strict=True):
        said = VehicleStatus(stamp_ns=round(stamp), activity="piloted", armed=armed > 0.0)
        spans.see(said, arrival / 1e9)
    return spans.until(last)
