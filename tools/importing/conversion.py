"""Rows of a log become messages, by a map: pure."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from math import asin, atan2, isfinite
from statistics import median
from typing import Any, NamedTuple, cast

from messages import topics
from messages.message import Message
from messages.pilot import FlightMode
from messages.topic import AnyTopic
from messages.units import Ns, Quaternion, Vec3
from messages.vehicle import VehicleStatus
from services.marine.attitude import to_world
from services.marine.mounting import ALONG, Rotation
from services.runtime.config.errors import LindyError
from tools.importing.board_offset import BoardOffset
from tools.importing.contradictions import (
    SensorsHeard,
    Series,
    WindowMeans,
    is_far,
    ratio,
    require_pressure,
    require_turns,
    require_upright,
)
from tools.importing.log_file import BlankError, LogRow, Wanted, getter
from tools.importing.map_file import STAMP_UNITS, WORLDS, FieldMap, TakenMessage
from tools.importing.oddities import GapWatch, Oddities
from tools.importing.quantities import (
    POSSIBLE,
    TARGETS,
    TYPICAL,
    UNITS,
    VECTOR,
    amount,
    better_units,
    is_possible,
)

LONGEST_WORD = 30  # letters of it that are shown where a number was expected
S = 1_000_000_000  # [ns]
JUDGED = 100  # samples after which the unit of a stream is judged
STEP_NS = S  # [ns] of the logger's clock backwards; less is the order in which it wrote
OTHER_CLOCK_NS = 10 * S  # [ns] between stamp and arrival: they are not by one clock
YEAR_2000_NS = 946_684_800 * S  # [ns] UTC; an earlier clock was never set
LONGEST_PAUSE_NS = 86_400 * S  # [ns] a longer one is a clock that was set in mid-log
MEASURED = ("sensor/imu", "sensor/magnetometer", "sensor/pressure", "sensor/dvl")
HEARD = ("sensor/imu", "sensor/pressure", "vehicle/estimate")  # before messages are made of them
PACE = 2.0  # times by which a board's clock may be off
LONGEST_SUM_S = 10.0  # [s] of current that is added up; longer is a pause
SOURCE = "imported"  # of a pilot's command

Values = tuple[float, ...]


class Imported(NamedTuple):
    """A message of ours, and when the logger wrote what it is from."""

    topic: AnyTopic
    message: Message
    arrival_ns: Ns  # [ns] UTC


class LoggerClock:
    """Arrivals as the recording has them: never backwards. Where the logger's clock steps back,
    everything after it is moved, so that time goes on."""

    def __init__(self, began_ns: Ns | None = None) -> None:
        """
        Args:
            began_ns: [ns] UTC of the first row; None: as the log says.
        """
        self.first_ns: Ns | None = None
        self.last_ns: Ns = 0
        self.shift_ns: Ns = 0  # what was added
        self.steps: list[tuple[float, float]] = []  # [s] when, and how far back
        self._began = began_ns

    def arrival(self, said: Ns) -> Ns:
        """[ns] UTC.

        Raises:
            LindyError: the clock was never set, or was set in mid-log.
        """
        if self.first_ns is None:
            if self._began is not None:
                self.shift_ns = self._began - said
            elif said < YEAR_2000_NS:
                raise LindyError(
                    f"its clock says {said / 1e9:.0f} s after 1 January 1970, so it was never set; "
                    f"write began = 2024-05-01T09:30:00Z (when it was, UTC) in the map"
                )
            self.first_ns = self.last_ns = said + self.shift_ns
        at = said + self.shift_ns
        if at < self.last_ns - STEP_NS:
            self.steps.append((self.elapsed_s, (self.last_ns - at) / 1e9))
            self.shift_ns += self.last_ns - at
            at = self.last_ns
        if at > self.last_ns + LONGEST_PAUSE_NS:
            raise LindyError(
                f"its clock jumps by {(at - self.last_ns) / 86_400e9:.0f} days after "
                f"{self.elapsed_s:.1f} s: it was set in mid-log, or these are two logs; "
                f"cut the log there"
            )
        self.last_ns = max(self.last_ns, at)
        return self.last_ns

    @property
    def elapsed_s(self) -> float:
        """[s] Since the first row."""
        return 0.0 if self.first_ns is None else (self.last_ns - self.first_ns) / 1e9


class Conversion:
    """One log. Give it every row of the sources in `taken`, in their order, twice: first all to
    `hear`, which `heard` ends, then all to `messages`, which `finish` ends."""

    def __init__(
        self,
        taken: Wanted,
        began_ns: Ns | None = None,
        take: Callable[[str], Callable[[Any], Any]] = getter,
        mounted: Rotation = ALONG,
    ) -> None:
        """
        Args:
            taken: by source, as `chosen`.
            began_ns: [ns] UTC of the first row; None: as the log says.
            take: the log's `getter`.
            mounted: the IMU's axes to the body's.
        """
        self.sensors = SensorsHeard(mounted)
        self.take = take
        self.oddities = Oddities()
        self.clock = LoggerClock(began_ns)
        self.counts: dict[str, int] = {}  # messages by key
        self._heard_clock = LoggerClock(began_ns)
        self._status = _StatusSum()
        self._streams = {
            source: [_Stream(source, each, self) for each in several]
            for source, several in taken.items()
        }

    def hear(self, row: LogRow) -> None:
        """
        Raises:
            LindyError: as `messages`.
        """
        arrival = self._heard_clock.arrival(row.arrival_ns)
        for stream in self._streams[row.source]:
            if stream.wants(row.fields):
                stream.hear(row.fields, arrival)

    def heard(self) -> None:
        """
        Raises:
            LindyError: the map's units or axes contradict what the log's sensors say of each other.
        """
        references = self.sensors.references()
        for several in self._streams.values():
            for stream in several:
                stream.heard(references)

    def messages(self, row: LogRow) -> list[Imported]:
        """What comes of a row; empty: nothing that can be used, which is counted.

        Raises:
            LindyError: the map does not fit: a field that is not there, a wrong unit or clock.
        """
        steps = len(self.clock.steps)
        arrival = self.clock.arrival(row.arrival_ns)
        for at_s, size in self.clock.steps[steps:]:
            what = "the logger's clock stepped back [s]; what follows was moved"
            self.oddities.tell("log", what, at_s, size)
        found: list[Imported] = []
        for stream in self._streams[row.source]:
            if stream.wants(row.fields):
                message = stream.message(row.fields, arrival, self._status)
                if message is not None:
                    key = stream.topic.key
                    self.counts[key] = self.counts.get(key, 0) + 1
                    found.append(Imported(stream.topic, message, arrival))
        return found

    def finish(self) -> None:
        """After the last row.

        Raises:
            LindyError: a short stream has a wrong unit, or nothing came of the log.
        """
        for several in self._streams.values():
            for stream in several:
                stream.finish()
        if not self.counts:
            odd = ", ".join(f"{o.stream}: {o.what} ({o.count})" for o in self.oddities.all())
            raise LindyError(f"no row of it could be used: {odd or 'the map takes none of them'}")


class _Stream:
    """One of our messages from one source."""

    def __init__(self, source: str, taken: TakenMessage, of: Conversion) -> None:
        self.taken, self.source = taken, source
        topic = topics.find(taken.as_)
        assert topic is not None, taken.as_
        self.topic = topic
        self.offset = BoardOffset()
        self._take = of.take
        self._oddities, self._clock, self._counts = of.oddities, of.clock, of.counts
        self._only = [(of.take(path), value) for path, value in taken.only.items()]
        self._stamp = of.take(taken.stamp) if taken.stamp else None
        known = TARGETS[taken.as_]
        self._fields = {
            name: _reader(field, known[name].quantity, taken.rotation, of.take, self._odd)
            for name, field in taken.fields.items()
        }
        self._judges = {
            name: _UnitJudge(taken, name, known[name].quantity)
            for name in taken.fields
            if known[name].quantity != "word"
        }
        self._sensors = of.sensors
        self._said: dict[str, WindowMeans] = {}  # an estimate's fields
        self._unbelieved: dict[str, str] = {}  # fields of an autopilot that cannot be, and why
        self._gaps = GapWatch()
        self._newest: Ns | None = None  # stamp
        self._before: dict[str, Values] = {}
        self._fresh_ns: Ns = 0  # stamp of the newest values that were other ones
        self._used_wh = 0.0
        self._used_at: Ns | None = None

    def wants(self, fields: Any) -> bool:
        try:
            return all(take(fields) == value for take, value in self._only)
        except (AttributeError, IndexError, TypeError):
            raise self._without(list(self.taken.only), fields) from None

    def stamp(self, fields: Any) -> Ns:
        """[ns] By the clock that the map says."""
        assert self._stamp is not None
        try:
            raw = self._stamp(fields)
            if self.taken.stamp_unit == "ros":
                # JSON by Foxglove's schemas has nsec.
                below = raw.nsec if hasattr(raw, "nsec") else raw.nanosec
                return int(raw.sec) * S + int(below)
            scale = STAMP_UNITS[self.taken.stamp_unit]
            return raw * scale if isinstance(raw, int) else round(float(raw) * scale)
        except (AttributeError, IndexError, TypeError, ValueError, OverflowError):
            raise self._without([self.taken.stamp], fields) from None

    # What it says before anything is made of it.

    def hear(self, fields: Any, arrival: Ns) -> None:
        if self.taken.clock == "board":
            self.offset.hear(self.stamp(fields), arrival)
        if self.topic.key in HEARD:
            self._compare(self._readable(fields), arrival)

    def _readable(self, fields: Any) -> dict[str, Values]:
        """Whatever is odd there is told when messages are made."""
        found: dict[str, Values] = {}
        for name, read in self._fields.items():
            with suppress(BlankError, AttributeError, IndexError, TypeError, ValueError):
                values = read(fields) if not self.taken.fields[name].curve else ()
                if values and all(map(isfinite, values)):
                    found[name] = values
        return found

    def _compare(self, found: dict[str, Values], arrival: Ns) -> None:
        if self.topic.key == topics.ESTIMATE.key:
            for name, values in found.items():
                self._said.setdefault(name, WindowMeans()).tell(arrival, values)
            if "attitude" in found:
                q = cast(Quaternion, found["attitude"])
                angles = _angles(q, self.taken.rotation, WORLDS[self.taken.world])
                self._sensors.own_angles(arrival, angles["roll"], angles["pitch"])
            elif {"roll", "pitch"} <= {*found}:
                self._sensors.own_angles(arrival, found["roll"][0], found["pitch"][0])
        elif self.topic.key == topics.PRESSURE.key and "pressure" in found:
            self._sensors.pressure(arrival, found["pressure"][0])
        elif {"specific_force", "angular_rate"} <= {*found}:
            force, rate = found["specific_force"], found["angular_rate"]
            self._sensors.imu(arrival, cast(Vec3, force), cast(Vec3, rate))

    def heard(self, references: Mapping[str, Series]) -> None:
        """
        Args:
            references: of an estimate's fields, from sensors.

        Raises:
            LindyError: the map's units or axes contradict what the log's sensors say of each other.
        """
        if self.taken.clock == "board":
            self._require_pace()
        if self.topic.key == topics.IMU.key:
            require_upright(self.taken, self._sensors)
            require_turns(self.taken, self._sensors)
        elif self.topic.key == topics.PRESSURE.key:
            require_pressure(self.taken, self._sensors)
            if (noise := self._sensors.pressure_noise()) is not None:
                self._odd("jumps from sample to sample [Pa]", noise)
        for name, said in self._said.items():
            times = ratio(said.series(), references[name]) if name in references else None
            if times is not None and is_far(times):
                self._leave_out(name, times)

    def _leave_out(self, name: str, times: float) -> None:
        """An estimate's field that contradicts the sensors, and angles that are in its unit."""
        fields, angles = self.taken.fields, ("roll", "pitch", "heading")
        unit = fields[name].unit
        words = f"{name} is {times:.2g} times what the sensors say in the map's {unit}, left out"
        alike = [other for other in angles if name in angles and other in fields]
        for other in [name, *(other for other in alike if fields[other].unit == unit)]:
            self._unbelieved.setdefault(other, words if other == name else f"{other}, as {words}")

    def _require_pace(self) -> None:
        pace, unit = self.offset.pace, self.taken.stamp_unit
        if pace is None or 1.0 / PACE < pace < PACE:
            return
        scale = STAMP_UNITS[unit]
        fitting = [
            f'stamp_unit = "{other}"'
            for other, of in STAMP_UNITS.items()
            if {unit, other}.isdisjoint({"ros", "date"}) and 1.0 / PACE < pace * of / scale < PACE
        ]
        remedy = " or ".join(fitting) or 'clock = "arrival"'
        raise LindyError(
            f"{self.taken.where}: its stamps ({self.taken.stamp}) go by {pace:.3g} s in a second "
            f"of the log; write {remedy} in the map"
        )

    def message(self, fields: Any, arrival: Ns, status: "_StatusSum") -> Message | None:
        stamp = self._stamp_ns(fields, arrival)
        if self.topic.key == topics.STATUS.key:
            found = self._words(fields)
            return None if found is None else status.message(found, stamp, self._next())
        values = self._values(fields)
        if values is None or not self._new(values, stamp):
            return None
        if self.topic.key == topics.BATTERY.key and "used_wh" not in values:
            values["used_wh"] = (self._sum(values, arrival),)
        if self.topic.key == topics.THRUSTERS.key:
            values.setdefault("armed", (status.armed,))
        return self._made(values, stamp)

    def finish(self) -> None:
        for judge in self._judges.values():
            if self.topic.key != topics.ESTIMATE.key:
                judge.judge()

    # Fields.

    def _words(self, fields: Any) -> dict[str, Any] | None:
        found: dict[str, Any] = {}
        for name, field in self.taken.fields.items():
            try:
                raw = self._take(field.from_[0])(fields)
                found[name] = _word(raw, field)
            except BlankError:
                continue
            except KeyError as unknown:
                self._odd(f"{name} {unknown.args[0]} is not in the map, left out")
                return None
            except (AttributeError, IndexError, TypeError, ValueError):
                raise self._without(field.from_, fields) from None
        return found or None

    def _values(self, fields: Any) -> dict[str, Values] | None:
        found: dict[str, Values] = {}
        known = TARGETS[self.topic.key]
        for name, read in self._fields.items():
            try:
                values = read(fields)
            except BlankError:
                if known[name].required:
                    self._odd("rows without it, of another sensor")
                    return None
                continue
            except (AttributeError, IndexError, TypeError, ValueError):
                raise self._without(self.taken.fields[name].from_, fields) from None
            possible = all(map(isfinite, values))
            if not possible:
                self._odd(f"{name} is not a number, left out")
            elif name in self._unbelieved or not self._may_be(name, values):
                why = self._unbelieved.get(name, f"{name} cannot be [SI], left out")
                self._odd(why, abs(amount(values)))
                possible = False
            if possible:
                found[name] = values
            elif known[name].required:
                return None
        return found or None

    def _may_be(self, name: str, values: Values) -> bool:
        """
        Raises:
            LindyError: a sensor's field cannot be in its unit.
        """
        try:
            return name not in self._judges or self._judges[name].may_be(values)
        except LindyError:
            if self.topic.key != topics.ESTIMATE.key:
                raise
        # An autopilot may be wrong, which is no reason to refuse what its sensors say.
        self._unbelieved[name] = f"{name} cannot be [SI], left out"
        return False

    def _new(self, values: dict[str, Values], stamp: Ns) -> bool:
        """Is it a measurement of its own, after the one before? What is odd is counted."""
        if self._newest is not None and stamp <= self._newest:
            self._odd("stamp not newer than the one before [s], left out", self._behind(stamp))
            return False
        same = values == self._before
        if same and self.topic.key in MEASURED:
            if stamp - self._fresh_ns < self.taken.repeats_s * S:
                self._odd("the same values again, left out")
                return False
            self._odd("the same values again")
        self._newest, self._fresh_ns, self._before = stamp, stamp, values
        if self.topic.hz and (pause := self._gaps.pause(stamp)) is not None:
            self._odd("gap [s]", pause)
        return True

    def _behind(self, stamp: Ns) -> float:
        return ((self._newest or stamp) - stamp) / 1e9

    def _sum(self, values: dict[str, Values], now: Ns) -> float:
        """[Wh] Used so far, where the log does not say."""
        if self._used_at is not None:
            seconds = min(LONGEST_SUM_S, (now - self._used_at) / 1e9)
            self._used_wh += max(0.0, values["voltage"][0] * values["current"][0]) * seconds / 3600
        self._used_at = now
        return self._used_wh

    def _made(self, values: dict[str, Values], stamp: Ns) -> Message:
        known = TARGETS[self.topic.key]
        given: dict[str, Any] = {
            name: found if known[name].size != 1 else found[0] for name, found in values.items()
        }
        if self.topic.key == topics.PILOT_COMMAND.key:
            most = max(abs(float(value)) for value in given.values())
            if most > 1.0:
                self._odd("a stick beyond its end [of full], cut to its end", most)
                given = {name: min(1.0, max(-1.0, value)) for name, value in given.items()}
            given["source"] = SOURCE
        elif "attitude" in given:
            q = given.pop("attitude")
            given |= _angles(q, self.taken.rotation, WORLDS[self.taken.world])
        elif self.topic.key == topics.THRUSTERS.key:
            given |= {"armed": bool(given["armed"]), "sensor_ns": None, "pilot_ns": None}
        elif self.topic.key == topics.ACTUATION.key:
            given |= {"actuated_ns": stamp, "sensor_ns": None, "pilot_ns": None}
            given |= {"stale": False, "power": 0.0}
        elif self.topic.key == topics.BATTERY.key and given["used_wh"] < 0.0:
            self._odd("used_wh is negative [Wh], taken for 0", given["used_wh"])
            given["used_wh"] = 0.0
        return self.topic.message(stamp_ns=stamp, seq=self._next(), **given)

    def _next(self) -> int:
        """Several sources may give one of our streams: they count together."""
        return self._counts.get(self.topic.key, 0)

    # Time.

    def _stamp_ns(self, fields: Any, arrival: Ns) -> Ns:
        if self.taken.clock == "arrival" or self._stamp is None:
            return arrival
        stamp = self.stamp(fields)
        if self.taken.clock == "board":
            return self.offset.logger_ns(stamp)
        stamp += self._clock.shift_ns
        if abs(stamp - arrival) > OTHER_CLOCK_NS:
            raise LindyError(
                f"{self.source}: {self.taken.stamp} says {_date(stamp)}, and the logger "
                f'{_date(arrival)}: they are not by one clock; write clock = "board" at '
                f'{self.taken.where} in the map, or "arrival" where the stamp is never set'
            )
        return stamp

    # Words.

    def _odd(self, what: str, size: float | None = None) -> None:
        self._oddities.tell(self.topic.key, what, self._clock.elapsed_s, size)

    def _without(self, paths: Sequence[str], fields: Any) -> LindyError:
        words: list[str] = []
        for path in paths:
            found: Any = None
            try:
                found = self._take(path)(fields)
                float(found)
            except ValueError:  # a word
                words.append(f"{path} is {str(found)[:LONGEST_WORD]!r}")
            except (BlankError, AttributeError, IndexError, TypeError):
                continue
        if words:
            return LindyError(
                f"{self.source}: {', '.join(words)}, which is no number; mend the log, or leave "
                f"it out of the map at {self.taken.where}"
            )
        named = ", ".join(paths)
        return LindyError(
            f"{self.source} has no number {named}, which the map names at {self.taken.where}; "
            f"write there the fields that it has"
        )


class _UnitJudge:
    """Can the values of a field be in the unit that the map says?"""

    def __init__(self, taken: TakenMessage, name: str, quantity: str) -> None:
        self._taken, self._name, self._quantity = taken, name, quantity
        self._seen: list[float] | None = []  # [SI] None: judged
        self._late = quantity == "share"  # before a pad is connected, sticks say nonsense

    def may_be(self, values: Values) -> bool:
        """
        Raises:
            LindyError: the stream cannot be in that unit.
        """
        possible = is_possible(values, self._quantity)
        if self._seen is None:
            return possible
        if self._late and possible:
            self._seen = None
        elif len(self._seen) < JUDGED:
            self._seen.append(amount(values))
        elif not self._late:
            self.judge()
        return possible

    def judge(self) -> None:
        """
        Raises:
            LindyError: the stream cannot be in that unit.
        """
        seen, self._seen = self._seen, None
        if not seen:
            return
        least, most = TYPICAL[self._quantity]
        field, middle = self._taken.fields[self._name], median(seen)
        if least <= middle <= most or field.value is not None:
            return
        units = UNITS[self._quantity]
        said = f"{middle:g} {next(iter(units))}" if self._quantity != "share" else f"{middle:g}"
        raise LindyError(
            f"{self._taken.where}: {self._name} is {said} in the middle, which cannot be "
            f"({least:g} to {most:g}); {self._remedy(field, middle)}"
        )

    def _remedy(self, field: FieldMap, middle: float) -> str:
        if self._quantity == "share":
            return "write in the map zero and full, the log's numbers of a centred and a full stick"
        others = better_units(middle, field.unit, self._quantity)
        ways = [f'unit = "{other}"' for other in others if other != field.unit]
        if self._quantity == "pressure" and middle < POSSIBLE["pressure"][0]:
            gauge = -101325.0 / UNITS["pressure"][field.unit]
            ways.insert(0, f"zero = {gauge:g} where it counts from the surface")
        return f"write {' or '.join(ways)} in the map" if ways else "name another field in the map"


class _StatusSum:
    """Arming and mode come in different messages of a log: each tells what both are."""

    def __init__(self) -> None:
        self.armed = False
        self._mode: FlightMode = "manual"

    def message(self, found: dict[str, Any], stamp: Ns, seq: int) -> VehicleStatus:
        self.armed = bool(found.get("armed", self.armed))
        self._mode = cast(FlightMode, found.get("mode", self._mode))
        return VehicleStatus(
            stamp_ns=stamp,
            seq=seq,
            activity="piloted" if self.armed else "ready",
            armed=self.armed,
            flight_mode=self._mode,
            pilot=SOURCE if self.armed else "",
        )


def _word(raw: Any, field: FieldMap) -> str | bool:
    """
    Raises:
        KeyError: `values` does not have it.
    """
    if field.mask is not None:
        return int(raw) & field.mask != 0
    if not field.values:
        return bool(raw)
    return field.values[raw if isinstance(raw, str) else f"{float(raw):g}"]


def _reader(
    field: FieldMap,
    quantity: str,
    rotation: Rotation,
    take: Callable[[str], Callable[[Any], Any]],
    odd: Callable[[str, float], None],
) -> Callable[[Any], Values]:
    """What reads a field's numbers [SI, FRD] from the fields of a row. `odd` is told of numbers
    beyond the ends of a curve."""
    factor = UNITS[quantity].get(field.unit, 1.0)
    if field.value is not None:
        constant = (field.value * factor,)
        return lambda _: constant
    zero = field.zero
    if field.full is not None:
        factor = 1.0 / (field.full - zero)
    getters = [take(path) for path in field.from_]

    def scaled(fields: Any) -> Values:
        return tuple([(float(take(fields)) - zero) * factor for take in getters])

    if field.curve:
        curve = field.curve
        least, most = curve[0][0], curve[-1][0]

        def along(fields: Any) -> Values:
            found = [float(take(fields)) for take in getters]
            for x in found:
                if not least <= x <= most:
                    odd("a number beyond the ends of its curve, taken as at the end", x)
            return tuple([_along(curve, x) * factor for x in found])

        return along
    if len(getters) != VECTOR or rotation == ALONG:
        return scaled

    def turned(fields: Any) -> Values:
        x, y, z = scaled(fields)
        return _turned(rotation, (x, y, z))

    return turned


def _angles(
    q: tuple[float, float, float, float], body: Rotation, world: Rotation
) -> dict[str, float]:
    """Roll, pitch and heading [rad] of an attitude in the log's axes of body and world."""
    # The body's axes (FRD) in the world's (NED): R = world R(q) bodyᵀ, column by column.
    forward, starboard, down = (_turned(world, to_world(q, axis)) for axis in body)
    return {
        "roll": atan2(starboard[2], down[2]),
        "pitch": -asin(max(-1.0, min(1.0, forward[2]))),
        "heading": atan2(forward[1], forward[0]),
    }


def _turned(rotation: Rotation, v: Vec3) -> Vec3:
    x, y, z = (a * v[0] + b * v[1] + c * v[2] for a, b, c in rotation)
    return x, y, z


def _along(curve: Sequence[tuple[float, float]], x: float) -> float:
    """Between the points of a curve; beyond them as at the last."""
    if x <= curve[0][0]:
        return curve[0][1]
    for (x0, y0), (x1, y1) in pairwise(curve):
        if x <= x1:
            return y0 + (y1 - y0) * (x - x0) / (x1 - x0)
    return curve[-1][1]


def _date(utc_ns: Ns) -> str:
    try:
        date = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=utc_ns / 1e9)
        return f"{date:%Y-%m-%d %H:%M:%S}"
    except OverflowError:
        return f"{utc_ns / 1e9:g} s"
