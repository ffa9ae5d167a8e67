"""What a review needs of a recording, read once."""

from array import array
from pathlib import Path
from typing import NamedTuple

import numpy as np

from messages import topics
from messages.message import Message
from messages.sensors import ImuSample, PressureSample
from messages.state import VehicleState
from messages.vehicle import VehicleEstimate, VehicleStatus
from services.estimation.settings import Settings as EstimationSettings
from services.marine.vehicle import Vehicle
from services.reference.settings import Settings as ReferenceSettings
from services.vehicle.mounting import AtOrigin
from tools.log.armed_spans import ArmedSpan, ArmedSpans
from tools.recordings.columns import Array
from tools.recordings.progress import reading
from tools.replay.source import ReplaySource, open_source
from tools.report import RecordedDive, read_dive
from tools.review.track import Track, TrackRows

SENSORS = tuple(topic for topic in topics.ALL if topic.key.startswith("sensor/"))
OF_THE_VEHICLE = (topics.STATE.key, topics.ESTIMATE.key, topics.STATUS.key)
PAUSE = 3.0  # [-] a longer period, in usual ones, is a pause
WATER = 1000.0  # [kg/m³] for the pressure's lever arm, centimetres


class SensorColumns(NamedTuple):
    """The samples of a sensor whose stamps rise. Times in s since the recording began."""

    stamp: Array  # (n,) [s]
    arrival: Array  # (n,) [s] by the recorder's clock
    values: Array  # (n, k); of the IMU rate [rad/s] and force [m/s²], FRD; of pressure [Pa]
    not_newer: int  # samples left out: stamped no later than one before them

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
    dive: RecordedDive
    sensors: dict[str, SensorColumns]  # by key; those that have samples
    own: Track | None  # what was estimated in the dive; None: nothing
    settings: VehicleSettings
    begin_ns: int  # [ns] by the clock of the stamps, from which times count
    seconds: float  # [s] from the first message to the last
    armed: list[ArmedSpan] | None  # [s] since it began; None: the recording does not say


def read(path: Path, overrides: tuple[str, ...] = ()) -> Recorded:
    """
    Raises:
        LindyError: not a recording of Lindy, nothing in it, or wrong settings.
    """
    source = open_source(path)
    settings = settings_of(source, overrides)
    recording, first_last = source.recording, source.span
    begin_ns = source.origin_ns - source.utc_offset_ns
    own = TrackRows(begin_ns)
    rows = {topic.key: SensorRows(begin_ns) for topic in SENSORS}
    armed: ArmedSpans | None = None
    origin = AtOrigin(settings.vehicle.mounting, WATER, settings.vehicle.calibration)
    with reading("reading", recording.size) as recording.advance:
        for raw in recording.raw(lambda key: key in rows or key in OF_THE_VEHICLE):
            if (message := recording.decode(raw)) is None:
                continue
            if isinstance(message, VehicleStatus):
                armed = armed or ArmedSpans()
                armed.see(message, (raw.log_ns - source.origin_ns) / 1e9)
            if raw.key in rows:
                rows[raw.key].add(message, raw.log_ns - source.utc_offset_ns, origin)
            elif isinstance(message, VehicleState):
                own.add(message)
            elif isinstance(message, VehicleEstimate):
                own.add_estimate(message)
    with reading("reading its sticks", recording.size) as recording.advance:
        dive = read_dive(recording, apart=source.apart)
    return Recorded(
        source=source,
        dive=dive,
        sensors={key: each.columns() for key, each in rows.items() if each.count},
        own=own.track() if own.count else None,
        settings=settings,
        begin_ns=begin_ns,
        seconds=(first_last[1] - first_last[0]) / 1e9,
        armed=None if armed is None else armed.until((first_last[1] - source.origin_ns) / 1e9),
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


class SensorRows:
    """Collects the samples of one sensor."""

    def __init__(self, begin_ns: int) -> None:
        self._begin, self._newest = begin_ns, -1
        self._times, self._values = array("d"), array("d")
        self.count = self._not_newer = 0

    def add(self, message: Message, arrival_ns: int, origin: AtOrigin) -> None:
        if message.stamp_ns <= self._newest:
            self._not_newer += 1
            return
        self._newest = message.stamp_ns
        self.count += 1
        self._times.extend(
            ((message.stamp_ns - self._begin) / 1e9, (arrival_ns - self._begin) / 1e9)
        )
        self._values.extend(_numbers(message, origin))

    def columns(self) -> SensorColumns:
        times = np.asarray(self._times).reshape(-1, 2)
        values = np.asarray(self._values).reshape(len(times), -1)
        return SensorColumns(times[:, 0], times[:, 1], values, self._not_newer)


def _numbers(message: Message, origin: AtOrigin) -> tuple[float, ...]:
    match message:
        case ImuSample():
            sample = origin.imu(message)
            return *sample.angular_rate, *sample.specific_force
        case PressureSample():
            return (message.pressure,)
        case _:
            return ()
