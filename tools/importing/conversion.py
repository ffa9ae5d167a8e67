"""A log becomes messages, by a map: pure. It is read once, into columns; these are judged; then
messages are made of them in the order of the log."""

from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import merge
from math import isnan, nan
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from messages import topics
from messages.message import Message
from messages.pilot import FlightMode
from messages.topic import AnyTopic
from messages.units import Ns
from messages.vehicle import VehicleStatus
from services.marine.mounting import ALONG, Rotation
from services.runtime.config.errors import LindyError
from tools.importing.contradictions import Oddities, SensorsHeard, gaps, unbelieved
from tools.importing.log_file import CHUNK, LogRow, Wanted, getter
from tools.importing.map_file import QUANTITIES, TakenMessage, remedy
from tools.importing.streams import Floats, LoggerClock, LogStream, Take

JUDGED = 100  # samples by which the unit of a field is judged
MEASURED = ("sensor/imu", "sensor/magnetometer", "sensor/pressure", "sensor/dvl")
LONGEST_SUM_S = 10.0  # [s] of current that is added up; longer is a pause
SOURCE = "imported"  # of a pilot's command

Values = dict[str, tuple[float, ...]]  # [SI, FRD] by our field


class Imported(NamedTuple):
    """A message of ours, and when the logger wrote what it is from."""

    topic: AnyTopic
    message: Message
    arrival_ns: Ns  # [ns] UTC


class JudgedColumn(NamedTuple):
    """One of our fields."""

    name: str
    values: Floats  # (n, k) [SI, FRD]
    believed: NDArray[np.bool_]  # (n,) those that can be used


class LogSample(NamedTuple):
    """What a message is made of."""

    row: int  # number in the log
    stream: LogStream
    stamp_ns: Ns  # [ns] UTC
    arrival_ns: Ns  # [ns] UTC
    given: dict[str, Any]  # fields of the message


class Conversion:
    """One log, read and judged."""

    def __init__(
        self,
        rows: Iterable[LogRow],
        taken: Wanted,
        began_ns: Ns | None = None,
        take: Take = getter,
        mounted: Rotation = ALONG,
        changed_ns: Ns = 0,
    ) -> None:
        """
        Args:
            rows: of the sources in `taken`, in the order of the log.
            taken: by source, as `chosen`.
            began_ns: [ns] UTC of the first row; None: as the log says.
            take: the log's `getter`.
            mounted: the IMU's axes to the body's.
            changed_ns: [ns] UTC of the last row, of a log whose clock was never set.

        Raises:
            LindyError: the map does not fit: a field that is not there, a wrong unit or clock, axes
                or units that contradict what the log's sensors say of each other.
        """
        self.oddities = Oddities()
        self.counts: dict[str, int] = {}  # messages by key
        by_source = {
            source: [LogStream(source, each, take) for each in several]
            for source, several in taken.items()
        }
        clock = LoggerClock(began_ns, changed_ns)
        for number, row in enumerate(rows):
            arrival = clock.arrival(row.arrival_ns)
            for stream in by_source[row.source]:
                stream.hear(number, row.fields, arrival, clock.shifts)
        for at_s, size in clock.set_at:
            way = "ahead" if size > 0.0 else "back"
            what = f"the logger's clock stepped {way} [s]; what follows was moved"
            self.oddities.tell("log", what, at_s, abs(size))
        self.seconds = clock.elapsed_s  # from the first row to the last
        self.remarks = clock.remarks
        self._streams = [stream for several in by_source.values() for stream in several]
        for stream in self._streams:
            stream.move(clock.moved_ns)
        self._first_ns = (clock.first_ns or 0) + clock.moved_ns
        with np.errstate(over="ignore", invalid="ignore"):  # of numbers that cannot be
            sensors = SensorsHeard(self._streams, mounted)
            contradicting = [unbelieved(stream, sensors) for stream in self._streams]
            if sensors.noise is not None:
                what = "jumps from sample to sample [Pa]"
                self.oddities.tell(topics.PRESSURE.key, what, 0.0, sensors.noise)
            self._judged = [
                [] if stream.topic.key == topics.STATUS.key else self._judge(stream, why)
                for stream, why in zip(self._streams, contradicting, strict=True)
            ]

    def messages(self) -> Iterator[Imported]:
        """In the order of the log.

        Raises:
            LindyError: at its end, nothing came of the log.
        """
        armed, mode = False, "manual"  # they come in different messages of a log
        samples = [
            self._statuses(stream)
            if stream.topic.key == topics.STATUS.key
            else self._samples(stream, columns)
            for stream, columns in zip(self._streams, self._judged, strict=True)
        ]
        for sample in merge(*samples, key=lambda sample: sample.row):
            topic, stamp, given = sample.stream.topic, sample.stamp_ns, sample.given
            seq = self.counts.get(topic.key, 0)  # several sources may give one of our streams
            if topic.key == topics.STATUS.key:
                armed, mode = bool(given.get("armed", armed)), given.get("mode", mode)
                message = VehicleStatus(
                    stamp_ns=stamp,
                    seq=seq,
                    activity="piloted" if armed else "ready",
                    armed=armed,
                    flight_mode=cast(FlightMode, mode),
                    pilot=SOURCE if armed else "",
                )
            else:
                if topic.key == topics.THRUSTERS.key:
                    given["armed"] = bool(given.get("armed", armed))
                message = topic.message(stamp_ns=stamp, seq=seq, **given)
            self.counts[topic.key] = seq + 1
            yield Imported(topic, message, sample.arrival_ns)
        if not self.counts:
            odd = ", ".join(f"{o.stream}: {o.what} ({o.count})" for o in self.oddities.all())
            if any(stream.taken.only and not stream.rows for stream in self._streams):
                odd = odd or "`only` in the map leaves out every row"
            raise LindyError(f"no row of it could be used: {odd or 'the map takes none of them'}")

    def _seconds(self, arrivals: Any) -> Floats:
        """[s] Since the log began."""
        return (np.asarray(arrivals, np.int64) - self._first_ns) / 1e9

    # What can be believed.

    def _judge(self, stream: LogStream, contradicting: Mapping[str, str]) -> list[JudgedColumn]:
        """What of each field can be used. The rest is counted.

        Raises:
            LindyError: a sensor's field cannot be in its unit.
        """
        at_s, found = self._seconds(stream.arrivals), list[JudgedColumn]()
        alive = np.full(len(at_s), True)  # rows that have all that is required so far

        def odd(what: str, rows: NDArray[np.bool_], sizes: Floats | None = None) -> None:
            many = () if sizes is None else sizes[rows]
            self.oddities.tell(stream.topic.key, what, at_s[rows], many)

        for name, field in stream.taken.fields.items():
            known, there = stream.known[name], stream.is_there(name)
            unit = next(iter(QUANTITIES[known.quantity].units))
            values = stream.column(name)
            if known.required:
                odd(f"rows without {name}, left out", alive & ~there)
            there = alive & there
            for column in stream.raw(name).T if field.curve else ():
                beyond = (column < field.curve[0][0]) | (column > field.curve[-1][0])
                what = "a number beyond the ends of its curve, taken as at the end"
                odd(what, there & beyond, column)
            finite = np.isfinite(values).all(axis=1)
            odd(f"{name} is not a number, left out", there & ~finite)
            amounts = _amounts(values)
            believed = there & finite
            if name in contradicting:
                odd(f"{contradicting[name]} [{unit}]", believed, abs(amounts))
                believed &= False
            elif known.quantity != "word":
                possible = believed & _possible(stream, name, values, believed)
                odd(f"{name} cannot be [{unit}], left out", believed & ~possible, abs(amounts))
                believed = possible
            if known.required:
                alive &= believed
            found.append(JudgedColumn(name, values, believed))
        return [column._replace(believed=column.believed & alive) for column in found]

    # In the order of the log.

    def _statuses(self, stream: LogStream) -> Iterator[LogSample]:
        times = zip(stream.rows, stream.stamps_ns(), stream.arrivals, stream.words, strict=True)
        for row, stamp, arrival, words in times:
            if isinstance(words, str):
                self.oddities.tell(stream.topic.key, words, self._seconds(arrival))
            elif words:
                yield LogSample(row, stream, stamp, arrival, dict(words))

    def _samples(self, stream: LogStream, columns: Sequence[JudgedColumn]) -> Iterator[LogSample]:
        """Measurements of their own, each after the one before. What is odd is counted."""
        key = stream.topic.key
        kept, arrivals = array("q"), array("q")  # [ns] of those that are given
        newest, before = -(2**63), Values()
        used_wh, used_ns = 0.0, 0

        def odd(what: str, size: float = nan) -> None:
            sizes = () if isnan(size) else size
            self.oddities.tell(key, what, self._seconds(arrival), sizes)

        every = _rows(columns) if columns else [Values()] * len(stream.rows)
        times = zip(stream.rows, stream.stamps_ns(), stream.arrivals, every, strict=True)
        for row, stamp, arrival, values in times:
            if not values:
                continue
            if stamp <= newest:
                behind = (newest - stamp) / 1e9
                odd("stamp not newer than the one before [s], left out", behind)
                continue
            if values == before and key in MEASURED:
                if stamp - newest < stream.taken.repeats_s * 1e9:
                    odd("the same values again, left out")
                    continue
                odd("the same values again")
            newest, before = stamp, values
            kept.append(stamp)
            arrivals.append(arrival)
            given = _message_fields(stream, values, stamp, odd)
            if key == topics.BATTERY.key and "used_wh" not in given:
                seconds = min(LONGEST_SUM_S, (arrival - (used_ns or arrival)) / 1e9)
                used_wh += max(0.0, given["voltage"] * given["current"]) * seconds / 3600
                used_ns, given["used_wh"] = arrival, used_wh
            yield LogSample(row, stream, stamp, arrival, given)
        if stream.topic.hz:
            places, pauses = gaps(kept)
            at_s = self._seconds(arrivals)[places]
            self.oddities.tell(key, "gap [s]", at_s, pauses)


def _rows(columns: Sequence[JudgedColumn]) -> Iterator[Values]:
    """Of each row; empty: it says nothing that can be used."""
    for begin in range(0, len(columns[0].values), CHUNK):
        part = slice(begin, begin + CHUNK)
        numbers = zip(*(column.values[part].tolist() for column in columns), strict=True)
        believed = zip(*(column.believed[part].tolist() for column in columns), strict=True)
        for several, usable in zip(numbers, believed, strict=True):
            each = zip(columns, several, usable, strict=True)
            yield {column.name: tuple(values) for column, values, is_so in each if is_so}


def _message_fields(
    stream: LogStream, values: Values, stamp: Ns, odd: Callable[[str, float], None]
) -> dict[str, Any]:
    given: dict[str, Any] = {
        name: numbers if stream.known[name].size != 1 else numbers[0]
        for name, numbers in values.items()
    }
    match stream.topic.key:
        case topics.PILOT_COMMAND.key:
            if (most := max(abs(stick) for (stick,) in values.values())) > 1.0:
                odd("a stick beyond its end [of full], cut to its end", most)
                given = {name: min(1.0, max(-1.0, value)) for name, value in given.items()}
            given["source"] = SOURCE
        case topics.ESTIMATE.key if "attitude" in given:
            angles = stream.angles(given.pop("attitude"))
            given |= zip(("roll", "pitch", "heading"), angles, strict=True)
        case topics.THRUSTERS.key:
            given |= {"sensor_ns": None, "pilot_ns": None}
        case topics.ACTUATION.key:
            given |= {"actuated_ns": stamp, "sensor_ns": None, "pilot_ns": None}
            given |= {"stale": False, "power": 0.0}
        case topics.BATTERY.key if given.get("used_wh", 0.0) < 0.0:
            odd("used_wh is negative [Wh], taken for 0", -given["used_wh"])
            given["used_wh"] = 0.0
        case _:
            pass
    return given


def _amounts(values: Floats) -> Floats:
    """(n,) [SI] What is compared with the limits: the length of a vector, else the value."""
    return values[:, 0] if values.shape[1] == 1 else np.sqrt(np.sum(values * values, axis=1))


def _possible(
    stream: LogStream, name: str, values: Floats, rows: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """(n,) Can it be? A vector by its length; each of several forces by itself.

    Raises:
        LindyError: a sensor's field cannot be in its unit.
    """
    quantity = stream.known[name].quantity
    least, most = QUANTITIES[quantity].possible
    sizes = values if quantity == "force" else _amounts(values)[:, None]
    possible: NDArray[np.bool_] = np.all((least <= sizes) & (sizes <= most), axis=1)
    heard = np.flatnonzero(rows)
    first = _amounts(values)[heard[:JUDGED]]
    if not len(first) or stream.taken.fields[name].value is not None:
        return possible
    low, high = QUANTITIES[quantity].typical
    middle = float(np.median(first))
    if low <= middle <= high:
        return possible
    if stream.topic.key == topics.ESTIMATE.key:
        # An autopilot may be wrong, which is no reason to refuse what its sensors say.
        possible[heard[JUDGED:]] = False
    elif quantity != "share" or not possible[heard].any():  # sticks without a pad say nonsense
        raise LindyError(_wrong_unit(stream.taken, name, quantity, middle))
    return possible


def _wrong_unit(taken: TakenMessage, name: str, quantity: str, middle: float) -> str:
    """
    Args:
        middle: [SI] by the map's unit.
    """
    field, units = taken.fields[name], QUANTITIES[quantity].units
    low, high = QUANTITIES[quantity].typical
    now = units.get(field.unit, 1.0)
    fitting = (
        unit
        for unit, factor in units.items()
        if unit != field.unit and low <= middle / now * factor <= high
    )
    ways = [remedy("unit", fitting, "")]
    if quantity == "pressure" and middle < QUANTITIES["pressure"].possible[0]:
        ways.insert(0, f"zero = {-101325.0 / now:g} where it counts from the surface")
    wanted = " or ".join(filter(None, ways))
    how = f"write {wanted} in the map" if wanted else "name another field in the map"
    if quantity == "share":
        how = "write in the map zero and full, the log's numbers of a centred and a full stick"
    unit = "" if quantity == "share" else f" {next(iter(units))}"
    return (
        f"{taken.where}: {name} is {middle:g}{unit} in the middle, which cannot be "
        f"({low:g} to {high:g}); {how}"
    )
