"""Every stamp of a message is moved, wherever in it, and nothing else is touched."""

from typing import Any

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import inspect

from messages import topics
from messages.link import Clock, LinkStatus
from messages.message import Message
from messages.topic import AnyTopic
from messages.units import DURATION, STAMP, DurationNs, Stamp
from services.runtime.node.stamps import mover

SHIFTS = st.integers(-(10**15), 10**15)
SIMPLE: dict[type, st.SearchStrategy[Any]] = {
    inspect.BytesType: st.binary(max_size=8),
    inspect.NoneType: st.none(),
    inspect.BoolType: st.booleans(),
    inspect.StrType: st.text(max_size=3),
}


class Part(msgspec.Struct, frozen=True):
    """Stamps at all places where one could stand."""

    at: Stamp
    took: DurationNs = 7
    count: int = 3


class Deep(Message, frozen=True, kw_only=True):
    maybe_ns: Stamp | None = None
    part: Part = Part(1)
    maybe: Part | None = None
    several: tuple[Part, ...] = ()
    listed: list[Stamp] = msgspec.field(default_factory=list[int])
    pair: tuple[Stamp, DurationNs, float] = (5, 6, 0.5)
    named: dict[str, Part] = msgspec.field(default_factory=dict[str, Part])
    lasted_ns: DurationNs = 9
    text: str = ""


def values(kind: inspect.Type) -> st.SearchStrategy[Any]:
    """Any value of a type, as plain data."""
    match kind:
        case inspect.Metadata():
            return values(kind.type)
        case inspect.FloatType():
            return st.floats(kind.ge, kind.le)
        case inspect.IntType():
            return st.integers(kind.ge, kind.le)
        case inspect.LiteralType():
            return st.sampled_from(kind.values)
        case inspect.UnionType():
            return st.one_of([values(each) for each in kind.types])
        case inspect.TupleType():
            return st.tuples(*map(values, kind.item_types)).map(list)
        case inspect.VarTupleType() | inspect.ListType():
            least, most = kind.min_length or 0, min(kind.max_length or 3, 3)
            return st.lists(values(kind.item_type), min_size=least, max_size=most)
        case inspect.DictType():
            return st.dictionaries(st.text(max_size=3), values(kind.value_type), max_size=2)
        case inspect.StructType():
            return st.fixed_dictionaries(
                {f.encode_name: values(f.type) for f in kind.fields if f.required},
                optional={f.encode_name: values(f.type) for f in kind.fields if not f.required},
            )
        case _:
            return SIMPLE[type(kind)]


def expected(kind: inspect.Type, data: Any, ahead: int) -> Any:
    """Plain data with the stamps moved, found by walking down type and data together."""
    match kind:
        case inspect.Metadata():
            return data - ahead if kind.extra == STAMP else expected(kind.type, data, ahead)
        case inspect.UnionType():
            (inner,) = [each for each in kind.types if not isinstance(each, inspect.NoneType)]
            return None if data is None else expected(inner, data, ahead)
        case inspect.TupleType():
            return [expected(k, v, ahead) for k, v in zip(kind.item_types, data, strict=True)]
        case inspect.VarTupleType() | inspect.ListType():
            return [expected(kind.item_type, value, ahead) for value in data]
        case inspect.DictType():
            return {key: expected(kind.value_type, value, ahead) for key, value in data.items()}
        case inspect.StructType():
            kinds = {field.encode_name: field.type for field in kind.fields}
            return {name: expected(kinds[name], value, ahead) for name, value in data.items()}
        case _:
            return data


def plain(message: Message) -> Any:
    return msgspec.json.decode(msgspec.json.encode(message))


def kinds() -> list[type[Message]]:
    return [*dict.fromkeys(topic.message for topic in topics.ALL), Deep]


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.__name__)
@given(st.data(), SHIFTS)
@settings(max_examples=20, deadline=None)
def test_every_stamp_is_moved_and_nothing_else(
    kind: type[Message], data: st.DataObject, ahead: int
) -> None:
    info = inspect.type_info(kind)
    sent = msgspec.convert(data.draw(values(info)), kind)
    before = plain(sent)
    mover(kind)(sent, ahead)
    assert plain(sent) == expected(info, before, ahead)
    mover(kind)(sent, -ahead)
    assert plain(sent) == before


def test_a_part_that_was_not_sent_is_moved_for_one_message_only() -> None:
    first = msgspec.convert({"stamp_ns": 0}, Deep)
    mover(Deep)(first, 10)
    assert first.part.at == -9
    assert first.lasted_ns == 9
    assert msgspec.convert({"stamp_ns": 0}, Deep).part.at == 1


def test_the_sounders_word_within_a_status_is_moved_and_its_offset_is_not() -> None:
    clock = Clock(
        stamp_ns=100, offset_ns=40, bound_ns=3, drift_ppm=None, rtt_ms=None, rtt_min_ms=None,
        answered_ms=None,
    )  # fmt: skip
    direction = {
        "delay_p50_ms": None, "delay_p99_ms": None, "forwarded": 0, "dropped": 0, "queued": 0,
    }  # fmt: skip
    status = msgspec.convert(
        {
            "stamp_ns": 200, "profile": "", "up": True, "down_link": direction,
            "up_link": direction, "rtt_ms": None, "clock": msgspec.to_builtins(clock),
        },
        LinkStatus,
    )  # fmt: skip
    mover(LinkStatus)(status, 40)
    assert status.stamp_ns == 160
    assert status.clock == msgspec.structs.replace(clock, stamp_ns=60)


def whole_numbers(kind: inspect.Type, name: str = "") -> list[tuple[str, inspect.Type]]:
    """Every whole number within a type, with the name of its field."""
    match kind:
        case inspect.IntType():
            return [(name, kind)]
        case inspect.Metadata():
            return [(name, kind)]
        case inspect.UnionType():
            return [found for each in kind.types for found in whole_numbers(each, name)]
        case inspect.TupleType():
            return [found for each in kind.item_types for found in whole_numbers(each, name)]
        case inspect.VarTupleType() | inspect.ListType():
            return whole_numbers(kind.item_type, name)
        case inspect.DictType():
            return whole_numbers(kind.value_type, name)
        case inspect.StructType():
            return [found for f in kind.fields for found in whole_numbers(f.type, f.name)]
        case _:
            return []


@pytest.mark.parametrize("topic", topics.ALL, ids=lambda topic: topic.key)
def test_nanoseconds_say_whether_they_are_a_moment_or_a_duration(topic: AnyTopic) -> None:
    numbers = whole_numbers(inspect.type_info(topic.message))
    assert ("stamp_ns", inspect.type_info(Stamp)) in numbers
    for name, kind in numbers:
        told = isinstance(kind, inspect.Metadata) and kind.extra in (STAMP, DURATION)
        assert told == name.endswith("_ns"), name
