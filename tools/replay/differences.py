"""Compares what was recorded with what today's code publishes, field by field, and says which
differences are none. Pure."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import isclose
from sys import float_info
from typing import Any, NamedTuple, cast

import msgspec

from messages.payload import UNDECODABLE
from services.runtime.config.errors import LindyError

LARGEST = int(float_info.max)  # beyond, an integer is compared as a word is
UNREADABLE = "what cannot be read"
MISSING = "no message"  # in the place of a field: the whole message is on one side only


class Tolerance(NamedTuple):
    """How far two numbers of a field may be apart: the larger of the two is allowed."""

    pattern: str  # TOPIC.FIELD with * for anything, such as state.depth.*
    absolute: float = 0.0  # unit of the field
    relative: float = 0.0  # [-] of the larger number

    def covers(self, path: str) -> bool:
        """Is it for this TOPIC.FIELD? Brackets are those of an index, such as `thrust[3]`."""
        return fnmatchcase(path, self.pattern.replace("[", "[[]"))

    def allows(self, a: float, b: float) -> bool:
        return isclose(a, b, rel_tol=self.relative, abs_tol=self.absolute)


EXACT = Tolerance("*")
ANY = float("inf")
# A recording of the real clock does not say when exactly a handler was called: the service is
# stepped at the stamps of its own recorded messages, but a timer rings at its nominal instant.
# What follows from the load of that computer is not compared at all.
REAL_TIME = (
    Tolerance("health/*", absolute=ANY),
    Tolerance("identity/*", absolute=ANY),  # version and commit are today's
    Tolerance("*.seq", absolute=ANY),
    Tolerance("*.epoch"),  # numbers of leases, large as they are
    Tolerance("*_ns", absolute=50e6),  # [ns] a timer rang, or a command came, just before or after
    Tolerance("*_age_ms", absolute=50.0),  # [ms]
    Tolerance("control/*", absolute=0.1, relative=0.01),  # [N, N m]
    Tolerance("state.*", absolute=3e-3, relative=3e-3),  # [m, rad, m/s …]
    Tolerance("reference.*", absolute=1e-3, relative=1e-3),  # [m, rad, m/s …]
)
# Share of a topic's messages in which a field of a real-time recording may differ all the same, and
# how many always may: two messages that arrived together may have been handled in another order.
RARELY, A_FEW = 0.01, 3
# Where the link damaged messages, the recorder heard that there were some, and not what they were.
DAMAGED = (
    Tolerance("health/*.counts.malformed:*", absolute=ANY),
    Tolerance("health/*.received", absolute=ANY),
    Tolerance("health/*.loop_hz", absolute=ANY),
    Tolerance("health/*.lateness_*", absolute=ANY),
)
# The same input is the same output; only the version is today's.
VIRTUAL = (Tolerance("identity/*.version", absolute=ANY),)


class Told(NamedTuple):
    """A message as it is compared."""

    key: str
    seq: int
    stamp_ns: int  # [ns] by the clock of the service
    data: bytes  # JSON
    sensor_ns: int | None = None  # [ns] the sensor sample behind it, where it names one


class Pair(NamedTuple):
    """A recorded message and today's; None: there is none on that side."""

    recorded: Told | None
    today: Told | None


@dataclass(slots=True)
class Difference:
    """One field of one topic that is not the same."""

    key: str
    field: str
    first_ns: int  # [ns] stamp of the first message in which it differs
    recorded: Any  # in that message
    today: Any
    count: int = 0  # messages
    worst: float = 0.0  # [unit of the field] largest distance of two numbers
    worst_ns: int = 0


def by_seq(
    recorded: Sequence[Told], today: Sequence[Told], begin_ns: int = 0, end_ns: int = 0
) -> Iterator[Pair]:
    """Pair the messages of one key by their sequence numbers, on virtual time. Then comes what is
    published today between two instants, and was not recorded."""
    then, now = ({told.seq: told for told in side} for side in (recorded, today))
    yield from (Pair(told, now.get(told.seq)) for told in recorded)
    for told in today:
        if begin_ns < told.stamp_ns < end_ns and told.seq not in then:
            yield Pair(None, told)


def by_cause(recorded: Sequence[Told], today: Sequence[Told], apart_ns: int) -> Iterator[Pair]:
    """Pair the messages of one key where a real clock decided when a timer rang: by the sensor
    sample behind them, else by their stamps, at most `apart_ns` apart. In order of their stamps."""
    samples = {told.sensor_ns: told for told in today if told.sensor_ns is not None}
    others = [told for told in today if told.sensor_ns is None]
    k = 0
    for told in recorded:
        if told.sensor_ns is not None:
            yield Pair(told, samples.get(told.sensor_ns))
            continue
        while k < len(others) and others[k].stamp_ns < told.stamp_ns - apart_ns:
            k += 1
        while k + 1 < len(others) and _distance(others[k + 1], told) <= _distance(others[k], told):
            k += 1
        if k < len(others) and _distance(others[k], told) <= apart_ns:
            yield Pair(told, others[k])
            k += 1
        else:
            yield Pair(told, None)


def _distance(a: Told, b: Told) -> int:
    return abs(a.stamp_ns - b.stamp_ns)


def require_fields(tolerances: Sequence[Tolerance], messages: Iterable[Told]) -> None:
    """
    Raises:
        LindyError: one of them is for no field of these messages.
    """
    for told in messages:
        if not tolerances:
            return
        with suppress(*UNDECODABLE):
            names = [f"{told.key}.{name}" for name, _ in fields(msgspec.json.decode(told.data))]
            tolerances = [each for each in tolerances if not any(map(each.covers, names))]
    if tolerances:
        raise LindyError(
            f"--tolerance {tolerances[0].pattern}: no message that is compared has such a field"
        )


class FieldComparison:
    """Collects differences.

    Attributes:
        compared: pairs of messages so far.
    """

    def __init__(self, tolerances: Sequence[Tolerance], *, common_only: bool = False) -> None:
        """
        Args:
            tolerances: the first whose pattern matches counts; where none does, exactly equal.
            common_only: fields that only one of the two has are not compared, because the
                recording was made with other messages.
        """
        self.compared = 0
        self._tolerances = tolerances
        self._common_only = common_only
        self._found: dict[tuple[str, str], Difference] = {}
        self._of_field: dict[tuple[str, str], Tolerance] = {}

    @property
    def differences(self) -> list[Difference]:
        """The earliest first."""
        return sorted(self._found.values(), key=lambda found: (found.first_ns, found.key))

    def compare(self, pair: Pair) -> None:
        self.compared += 1
        recorded, today = pair
        if recorded is None or today is None:
            there = cast(Told, recorded or today)
            one, other = ("a message", MISSING) if recorded else (MISSING, "a message")
            self._differs(there.key, "", there.stamp_ns, one, other)
        elif recorded.data != today.data:
            self._fields(recorded, today)

    def _fields(self, recorded: Told, today: Told) -> None:
        now = dict(fields(msgspec.json.decode(today.data)))
        try:
            then = dict(fields(msgspec.json.decode(recorded.data)))
        except UNDECODABLE:
            self._differs(recorded.key, "", recorded.stamp_ns, UNREADABLE, "a message")
            return
        names = then.keys() & now.keys() if self._common_only else then.keys() | now.keys()
        for name in sorted(names):
            a, b = then.get(name), now.get(name)
            if not self._same(recorded.key, name, a, b):
                self._differs(recorded.key, name, recorded.stamp_ns, a, b)

    def _same(self, key: str, name: str, a: Any, b: Any) -> bool:
        tolerance = self._tolerance(key, name)
        if tolerance.absolute == ANY:
            return True
        if a is None or b is None or not (_is_number(a) and _is_number(b)):
            return a == b
        return a == b or tolerance.allows(a, b)

    def _tolerance(self, key: str, name: str) -> Tolerance:
        known = self._of_field.get((key, name))
        if known is None:
            path = f"{key}.{name}"
            known = next((t for t in self._tolerances if t.covers(path)), EXACT)
            self._of_field[key, name] = known
        return known

    def _differs(self, key: str, name: str, stamp_ns: int, a: Any, b: Any) -> None:
        found = self._found.setdefault((key, name), Difference(key, name, stamp_ns, a, b))
        found.count += 1
        if _is_number(a) and _is_number(b) and abs(a - b) > found.worst:
            found.worst, found.worst_ns = abs(a - b), stamp_ns


def fields(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of a message with its path, such as `depth.value` or `thrust[3]`."""
    if isinstance(tree, Mapping):
        for name, value in cast(Mapping[str, Any], tree).items():
            yield from fields(value, f"{path}.{name}" if path else name)
    elif isinstance(tree, list):
        values = cast(list[Any], tree)
        yield f"{path}.length", len(values)
        for number, value in enumerate(values):
            yield from fields(value, f"{path}[{number}]")
    else:
        yield path, tree


def _is_number(value: Any) -> bool:
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= LARGEST
    return isinstance(value, float)


def in_words(found: Difference, begin_ns: int) -> str:
    """One line. Times count from `begin_ns`."""
    times = f"in {found.count} messages" if found.count > 1 else "in one message"
    field = f"{found.field}: " if found.field else ""
    line = f"{found.key}: {field}first at {(found.first_ns - begin_ns) / 1e9:.3f} s: "
    line += f"recorded {found.recorded}, now {found.today}"
    if not found.worst:
        return f"{line}; {times}"
    if _is_number(found.recorded) and _is_number(found.today):
        line += f", {abs(found.recorded - found.today):.3g} apart"
    worst_at = f"{(found.worst_ns - begin_ns) / 1e9:.3f} s"
    return f"{line}; {times}, worst {found.worst:.3g} at {worst_at}"


def parsed(texts: Sequence[str]) -> tuple[Tolerance, ...]:
    """`TOPIC.FIELD=NUMBER` as the user writes it; * for anything in the name, % behind a relative
    one.

    Raises:
        LindyError: not of that form, or not a number from 0.
    """
    found: list[Tolerance] = []
    for text in texts:
        pattern, _, number = text.rpartition("=")
        try:
            value = float(number.removesuffix("%"))
        except ValueError:
            value = -1.0
        if not pattern or not value >= 0.0:
            raise LindyError(
                f"--tolerance {text}: expected TOPIC.FIELD=NUMBER, such as state.depth.*=1e-6 or "
                f"control/wrench.*=1%"
            )
        is_share = number.endswith("%")
        found.append(
            Tolerance(pattern, relative=value / 100.0)
            if is_share
            else Tolerance(pattern, absolute=value)
        )
    return tuple(found)
